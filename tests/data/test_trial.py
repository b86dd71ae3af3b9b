"""

Two trials beside each other: the figures of their difference, and what is drawn of it.
"""

import copy
import dataclasses
import pickle
import sys
import warnings

import numpy as np
import pytest
from matplotlib import pyplot
from numpy.testing import assert_allclose, assert_array_equal

from pma_gym import Plant, compare
from pma_gym.data.trial import Trial, TrialError
from pma_gym.data.trial_columns import SampleError

TIME = np.array([0.0, 0.5, 1.0])
VOLTS = {"motor_voltage": [0.0, 1.0, 2.0]}


def trial(**changes):
    given = {"time": TIME, "commands": VOLTS, "measurements": {"contraction": [0.05, 0.04, 0.06]}}
    return Trial(**(given | changes))


def test_arrays_are_copies_that_nobody_can_change():
    time = TIME.copy()
    made = trial(time=time)
    time[0] = -1.0
    assert made.time[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        made.commands["motor_voltage"][0] = 3.0
    with pytest.raises(TypeError):
        made.commands["motor_voltage"] = TIME
    with pytest.raises(dataclasses.FrozenInstanceError):
        made.time = TIME


def test_extension_counts_from_the_first_contraction():
    made = trial()
    assert made.zero_contraction == 0.05
    assert_allclose(made.extension, [0.0, 0.01, -0.01])
    assert made.duration == 1.0
    assert len(made) == 3


def test_rotation_is_the_measured_one():
    assert_array_equal(
        trial(measurements={"rotation": [0.0, np.nan, 2.0]}).rotation, [0, np.nan, 2]
    )


@pytest.mark.parametrize(
    "duplicate", [copy.deepcopy, lambda made: pickle.loads(pickle.dumps(made))]
)
def test_a_trial_travels_between_processes(duplicate):
    made = duplicate(trial(truth={"extension": TIME}, provenance={"seed": 7}))
    assert_array_equal(made.extension, trial().extension)
    assert_array_equal(made.truth["extension"], TIME)
    assert dict(made.provenance) == {"seed": "7"}
    assert not made.time.flags.writeable


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"time": []}, r"time must have shape \(n,\) with n at least 1, got \(0,\)"),
        ({"time": [[0, 1, 2]]}, r"time must have shape \(n,\) .*, got \(1, 3\)"),
        ({"time": ["a", "b", "c"]}, "time must be an array of numbers"),
        (
            {"time": [0.0, 1.0, 1.0]},
            "time_s must increase strictly, sample 2 has 1.0 s after 1.0 s; two rows have one",
        ),
        ({"time": [0.0, np.nan, 1.0]}, "time_s must be a finite number .*, sample 1 has none"),
        ({"time": [0.0, 1.0, np.inf]}, "time_s must be a finite number .*, sample 2 has inf"),
        (
            {"time": [0.0, 1.0, 1e9]},
            r"time_s must span 86400 s .*, from sample 0 to sample 2 it is 1e\+09 s; write seconds",
        ),
        ({"time": [0.0, 1e-9, 3e-9]}, "samples must lie 1e-06 s or more apart .* 1.5e-09 s on av"),
        ({"commands": {}}, "needs at least one command, motor_voltage_v or .*pressure_command_kpa"),
        (
            {"commands": {"motor_volts": TIME}},
            r"commands are .*, got 'motor_volts' \(did you mean 'motor_voltage'\?\)",
        ),
        ({"commands": {"motor_voltage": [1.0]}}, "as long as time, 3 samples, got 1"),
        (
            {"commands": {"motor_voltage": [0.0, 10.5, 11.0]}},
            "motor_voltage_v must lie in 0-10 V, sample 1 has 10.5; give what reached the drive",
        ),
        (
            {"commands": {"regulator_voltage": [-0.1, 1.0, 1.0]}},
            "regulator_voltage_v must lie in 0-10 V, sample 0 has -0.1",
        ),
        (
            {"measurements": {"load": [0.0, np.inf, 0.0]}},
            r"load_n must be finite, sample 1 has inf; leave empty \(NaN\) what was not measured",
        ),
        ({"measurements": {"extension": TIME}}, "measurements are contraction, .*'extension'"),
        ({"truth": {"haste": TIME}}, "truth are .*'haste'"),
        ({"truth": {"extension": [0, np.inf, 0]}}, "extension must be finite, sample 1 has inf"),
    ],
)
def test_a_trial_refuses(changes, message):
    with pytest.raises(TrialError, match=message):
        trial(**changes)


def test_two_samples_may_lie_close_for_a_jump():
    assert len(trial(time=[0.0, 1.0, 1.0 + 1e-9])) == 3
    assert len(trial(time=[0.0, 1e-6, 2e-6])) == 3


def test_the_error_of_a_sample_travels_between_processes():
    error = pickle.loads(pickle.dumps(SampleError("load is 3 in {place}", 7)))
    assert (str(error), error.sample) == ("load is 3 in sample 7", 7)
    assert error.at("row 9 of a.csv") == "load is 3 in row 9 of a.csv"


def test_extension_needs_a_contraction_at_the_start():
    for message, act in (
        (
            "has no contraction_mm; it has load_n",
            lambda: trial(measurements={"load": TIME}).extension,
        ),
        (
            "contraction_mm is empty at the first sample",
            lambda: trial(measurements={"contraction": [np.nan, 0.1, 0.1]}).extension,
        ),
        ("has no rotation_deg; it has no measurements", lambda: trial(measurements={}).rotation),
    ):
        with pytest.raises(TrialError, match=message):
            act()


def test_a_frame_has_a_row_a_sample_and_units_in_its_names(monkeypatch):
    pandas = pytest.importorskip("pandas")
    trial = Trial(
        time=[0.0, 0.5],
        commands={"motor_voltage": [1.0, 2.0]},
        measurements={"contraction": [0.0253, np.nan]},
        truth={"load": [10.0, 20.0], "extension": [0.0, 1e-3]},
    )
    expected = {
        "time_s": [0.0, 0.5],
        "motor_voltage_v": [1.0, 2.0],
        "contraction_mm": [25.3, np.nan],
        "true_load_n": [10.0, 20.0],
        "true_extension_mm": [0.0, 1.0],
    }
    pandas.testing.assert_frame_equal(trial.to_frame(), pandas.DataFrame(expected))
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"^to_frame needs pandas.*: pip install pandas$"):
        trial.to_frame()


EVEN = np.linspace(0.0, 2.0, 201)
COMMANDS = {"motor_voltage": 1.5 * EVEN, "pressure_command": np.full(EVEN.size, 3e5)}


def of(time=EVEN, **measurements):
    commands = {name: np.interp(time, EVEN, values) for name, values in COMMANDS.items()}
    return Trial(time, commands, measurements, provenance={"rig": "2 <b>"})


@pytest.fixture(scope="module")
def simulated():
    return Plant("serres2008").simulate(of(), noise=False)


def test_a_constant_offset_is_the_rmse_in_the_unit_of_the_file():
    both = compare(of(contraction=0.01 * EVEN), of(contraction=0.01 * EVEN + 0.002))
    assert both.rmse == {"contraction_mm": pytest.approx(2.0)}
    assert both.samples == {"contraction_mm": EVEN.size}
    assert str(both) == "contraction_mm: RMSE 2 mm"


def test_other_times_are_interpolated_and_gaps_are_left_out():
    coarse = np.linspace(0.5, 1.5, 11)
    values = 0.3 * coarse
    values[5] = np.nan
    both = compare(of(rotation=0.3 * EVEN), of(coarse, rotation=values))
    assert both.rmse["rotation_deg"] == pytest.approx(0.0, abs=1e-9)
    assert both.samples["rotation_deg"] == 101


def test_a_simulation_has_true_values_where_nothing_was_measured(simulated):
    truth = Trial(EVEN, COMMANDS, truth=simulated.truth)
    # The sensor's lag is all that lies between them.
    assert 0.0 < compare(simulated, truth).rmse["contraction_mm"] < 0.05
    assert compare(truth, truth).rmse["contraction_mm"] == 0.0


def test_nothing_in_common_ends_in_one_message(simulated):
    with pytest.raises(TrialError, match="nothing to compare; simulate the one without"):
        compare(simulated, of())
    with pytest.raises(TrialError, match="names must differ"):
        compare(simulated, simulated, ("a", "a"))


def test_a_plot_has_a_panel_a_column_in_the_units_of_files(simulated):
    figure = simulated.plot()
    lines = {axes.get_ylabel(): axes.get_lines()[0] for axes in figure.axes}
    labels = [" ".join(label.split()) for label in lines]
    assert labels[:3] == ["motor voltage (V)", "pressure command (kPa)", "contraction (mm)"]
    drawn = lines["contraction\n(mm)"].get_ydata()
    np.testing.assert_allclose(drawn, 1e3 * simulated.measurements["contraction"])


def test_a_comparison_draws_both_with_their_distance(simulated):
    other = Plant("station").simulate(of(), noise=False)
    both = compare(simulated, other, ("dissertation", "station"))
    panel = next(a for a in both.plot().axes if a.get_ylabel() == "contraction\n(mm)")
    assert len(panel.get_lines()) == 2
    assert panel.get_title(loc="right") == f"RMSE {both.rmse['contraction_mm']:.3g} mm"
    (legend,) = both.plot().legends
    assert [text.get_text() for text in legend.get_texts()] == ["dissertation", "station"]


def test_plots_stay_out_of_the_list_of_open_figures(simulated):
    simulated.plot()
    assert pyplot.get_fignums() == []


def test_without_a_screen_show_says_what_to_do(simulated):
    assert pyplot.get_backend().lower() == "agg"
    with pytest.warns(UserWarning, match="opens no window; write the figure with savefig"):
        simulated.plot().show()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulated.plot().show(warn=False)


def test_with_a_screen_show_opens_a_window_of_this_figure(simulated, monkeypatch):
    shown = []
    monkeypatch.setattr(pyplot, "get_backend", lambda: "qtagg")
    monkeypatch.setattr(pyplot, "show", lambda: shown.append(pyplot.gcf()))
    figure = simulated.plot()
    figure.show()
    pyplot.close("all")
    assert shown == [figure]
