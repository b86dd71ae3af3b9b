"""Two trials beside each other: the figures of their difference, and what is drawn of it."""

import warnings

import numpy as np
import pytest
from matplotlib import pyplot

from pma_gym import Plant, Trial, compare
from pma_gym.data.trial import TrialError

TIME = np.linspace(0.0, 2.0, 201)
COMMANDS = {"motor_voltage": 1.5 * TIME, "pressure_command": np.full(TIME.size, 3e5)}


def trial(time=TIME, **measurements):
    commands = {name: np.interp(time, TIME, values) for name, values in COMMANDS.items()}
    return Trial(time, commands, measurements, provenance={"rig": "2 <b>"})


@pytest.fixture(scope="module")
def simulated():
    return Plant("serres2008").simulate(trial(), noise=False)


def test_a_constant_offset_is_the_rmse_in_the_unit_of_the_file():
    both = compare(trial(contraction=0.01 * TIME), trial(contraction=0.01 * TIME + 0.002))
    assert both.rmse == {"contraction_mm": pytest.approx(2.0)}
    assert both.samples == {"contraction_mm": TIME.size}
    assert str(both) == "contraction_mm: RMSE 2 mm"


def test_other_times_are_interpolated_and_gaps_are_left_out():
    coarse = np.linspace(0.5, 1.5, 11)
    values = 0.3 * coarse
    values[5] = np.nan
    both = compare(trial(rotation=0.3 * TIME), trial(coarse, rotation=values))
    assert both.rmse["rotation_deg"] == pytest.approx(0.0, abs=1e-9)
    assert both.samples["rotation_deg"] == 101


def test_a_simulation_has_true_values_where_nothing_was_measured(simulated):
    truth = Trial(TIME, COMMANDS, truth=simulated.truth)
    # The sensor's lag is all that lies between them.
    assert 0.0 < compare(simulated, truth).rmse["contraction_mm"] < 0.05
    assert compare(truth, truth).rmse["contraction_mm"] == 0.0


def test_nothing_in_common_ends_in_one_message(simulated):
    with pytest.raises(TrialError, match="nothing to compare; simulate the one without"):
        compare(simulated, trial())
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
    other = Plant("station").simulate(trial(), noise=False)
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
