"""The tuning script: its start, its margin, its file."""

import itertools
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.executors.executor import ProcessDied
from benchmarks.tuning import tune
from benchmarks.tuning.cost import UNSTABLE_COST, Cost, scaled_model
from benchmarks.tuning.loop_margins import Job, KeptRows, Loop, lambda_tuning
from benchmarks.tuning.tune import TuneError, gains_from, run_tune
from controllers.design.designs import GAINS_FILE, Gains, scheduled_gains
from pma_gym.plant.forms.linear import linearize
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant


@pytest.fixture
def job():
    return Job(load_model("station"), "displacement", "pid", 300.0, 0)


def test_start_is_lambda_tuning_of_the_linear_plant(job):
    proportional, integral, *_ = lambda_tuning(job)
    plant = Plant(job.model)
    zero = plant.settle(0.0, pressure=300e3).zero_contraction
    system = linearize(plant, 300e3, zero - 12.5e-3)["extension", "motor_voltage"]
    gain = float(np.real(system.dcgain()))
    assert integral == pytest.approx(1.0 / (gain * 2.5 * 0.01), rel=1e-3)
    # The muscle's own lag dominates: B / K, and more than nothing on top of it.
    assert proportional / integral == pytest.approx(0.05, abs=0.02)


def test_sensitivity_finds_the_edge_of_stability(job):
    loop = Loop(job)
    gains = gains_from(np.log(lambda_tuning(job)))
    assert 1.0 < loop.sensitivity(gains) < 2.0
    factors = np.geomspace(1.0, 20.0, 60)
    scaled = [
        loop.sensitivity(
            gains._replace(
                proportional=f * gains.proportional,
                integral=f * gains.integral,
                derivative=f * gains.derivative,
            )
        )
        for f in factors
    ]
    edge = next(i for i, value in enumerate(scaled) if np.isinf(value))
    # Largest near the edge, infinite beyond it; below 2 at least a factor of 2 is left.
    assert scaled[edge - 1] > 10.0
    assert all(np.isinf(scaled[edge:]))
    assert all(factors[edge] >= 2.0 * f for f, s in zip(factors, scaled, strict=True) if s <= 2.0)


def _shipped(name):
    """The jobs of every table of a model in the shipped file."""
    loops = tomllib.loads(GAINS_FILE.read_text())[name]
    jobs = tune.table_rows(load_model(name), 0, "*")
    tuned = [job for job in jobs if job.kind in loops.get(job.loop, {})]
    rows = sum(
        len(table["pressure_kpa"])
        for kinds in loops.values()
        for controllers in kinds.values()
        for table in controllers.values()
        if isinstance(table, dict)
    )
    assert len(tuned) == rows
    return tuned


@pytest.mark.parametrize("name", ["station", "cascade"])
def test_shipped_gains_keep_their_margin(name):
    loops = {}
    for job in _shipped(name):
        # Controllers of a row share its plant.
        row = (job.loop, job.task, job.pressure_kpa)
        if row not in loops:
            loops[row] = Loop(job)
        gains = scheduled_gains(job.controller, job.station)
        assert loops[row].sensitivity(gains) < 2.05, job


def test_shipped_gains_are_stable_on_stations_of_other_force_and_damping():
    """20 % more or less of either, in the loop with late commands, between tuned pressures too."""
    known, factors = load_model("station"), (0.8, 1.2)
    for task, pressure in (("displacement", 225.0), ("rotation", 400.0), ("isotonic", 225.0)):
        for force, damping in itertools.product(factors, factors):
            job = Job(scaled_model(known, force, damping), task, "pid", pressure, 0, 50.0, 0.02)
            loop, information = Loop(job), replace(job.station, model=known)
            for controller in tune.CONTROLLERS:
                sensitivity = loop.sensitivity(scheduled_gains(controller, information))
                assert sensitivity < 3.0, (controller, task, force, damping)


def test_delay_costs_sensitivity(job):
    gains = gains_from(np.log(lambda_tuning(job)))
    late = [Loop(replace(job, delay_s=delay)).sensitivity(gains) for delay in (0.0, 0.01, 0.02)]
    assert late[0] < late[1] < late[2]
    assert np.isinf(Loop(replace(job, delay_s=0.1)).sensitivity(gains))


def test_start_waits_for_late_commands(job):
    quick, late = (lambda_tuning(replace(job, delay_s=delay)) for delay in (0.0, 0.02))
    # lambda + delay: 2.5 periods, and twice the delay.
    assert late[1] == pytest.approx(quick[1] * 2.5 / 6.5)
    # Lead of the PID: 1 / (g k_i).
    assert late[4] == pytest.approx(0.065)


def test_regulator_s_loop_is_that_of_two_lags():
    job = Job(load_model("station"), "isotonic", "pid", 250.0, 0)
    assert (job.kind, job.loop) == ("contraction", "100hz")
    assert Job(job.model, "isotonic", "pid", 250.0, 0, 50.0, 0.02).loop == "50hz_delay20ms"
    proportional, integral, derivative, *_ = lambda_tuning(job)
    # Regulator and muscle: 0.059 s and 0.046 s.
    assert proportional / integral == pytest.approx(0.112, abs=0.02)
    assert derivative / integral == pytest.approx(0.059 * 0.046, rel=0.3)


def test_cost_punishes_unstable_and_brittle_gains(job):
    cost = Cost(job)
    good = gains_from(np.log(lambda_tuning(job)))
    assert cost(good) == cost(good)
    assert cost(Gains(5000.0, 1e5, 0.0, 0.005)) == UNSTABLE_COST


def test_same_seed_same_bytes_and_other_models_stay(tmp_path, monkeypatch):
    monkeypatch.setattr(tune, "PRESSURES_KPA", {"displacement": (300,)})
    monkeypatch.setattr(tune, "LOOPS", ((100.0, 0.0),))
    monkeypatch.setattr(tune, "EVALUATIONS", 6)
    monkeypatch.setattr(tune, "CONTROLLERS", ("pid",))
    paths = [tmp_path / "one.toml", tmp_path / "two.toml"]
    for path in paths:
        run_tune(path, seed=3, model="cascade", jobs=1)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    run_tune(paths[1], seed=3, model="station", jobs=1)
    one, two = (tomllib.loads(path.read_text()) for path in paths)
    assert two["cascade"] == one["cascade"]
    assert set(two) == {"schema", "cascade", "station"}
    table = two["station"]["100hz"]["displacement"]
    assert table["pid"]["pressure_kpa"] == [300]
    assert "seed 3;" in table["provenance"]
    assert not [p for p in tmp_path.iterdir() if p not in paths]


def test_only_the_tables_asked_for_are_tuned_and_others_stay(tmp_path, monkeypatch):
    monkeypatch.setattr(tune, "PRESSURES_KPA", {"displacement": (300,), "isotonic": (200,)})
    monkeypatch.setattr(tune, "CONTROLLERS", ("pid",))
    made = []

    def tuned(row):
        made.append(f"{row.loop}/{row.kind}")
        return Gains(1.0, 2.0, 3.0, 0.005), float(len(made))

    monkeypatch.setattr(tune, "tuned", tuned)
    out = tmp_path / "gains.toml"
    assert run_tune(out, jobs=1, only="*/displacement")
    assert run_tune(out, jobs=1, only="50hz*/*")
    assert sorted(made) == [
        "100hz/displacement",
        "50hz_delay20ms/contraction",
        "50hz_delay20ms/displacement",
        "50hz_delay20ms/displacement",
    ]
    station = tomllib.loads(out.read_text())["station"]
    assert set(station["100hz"]) == {"displacement"}
    assert set(station["50hz_delay20ms"]) == {"displacement", "contraction"}
    # A cascade has nothing to hold a load with.
    with pytest.raises(ValueError, match=r"got '\*/contraction'; tables: 100hz/displacement, 50hz"):
        run_tune(out, model="cascade", only="*/contraction")


def test_broken_file_of_gains_is_refused_before_the_work(tmp_path):
    path = tmp_path / "gains.toml"
    path.write_text("schema = 3\nstation = 1\n")
    with pytest.raises(ValueError, match=r"gains.toml is no file of gains.*delete it"):
        run_tune(path)
    path.write_text("schema = 7\n")
    with pytest.raises(ValueError, match=r"must have schema 3, got 7.*delete it"):
        run_tune(path)
    assert path.read_text() == "schema = 7\n"


def test_finished_rows_survive_an_interrupt_and_are_not_tuned_again(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(tune, "PRESSURES_KPA", {"displacement": (300, 400)})
    monkeypatch.setattr(tune, "LOOPS", ((100.0, 0.0),))
    monkeypatch.setattr(tune, "CONTROLLERS", ("pid",))
    made, interrupted = [], True

    def tuned(row):
        if interrupted and made:
            raise KeyboardInterrupt
        made.append(row.pressure_kpa)
        return Gains(row.pressure_kpa / 3.0, 2.0, 3.0, 0.005), 0.1

    monkeypatch.setattr(tune, "tuned", tuned)
    out = tmp_path / "gains.toml"
    assert not run_tune(out, model="cascade", jobs=1)
    assert "1 of 2 rows are tuned and kept in" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["gains.partial.json"]
    interrupted = False
    # Another seed takes none of them.
    other = KeptRows(out, {"seed": 1})
    assert not other.rows
    assert run_tune(out, model="cascade", jobs=1)
    assert made == [300, 400]
    assert "1 of 2 rows are taken from" in capsys.readouterr().out
    resumed = out.read_bytes()
    assert run_tune(tmp_path / "whole.toml", model="cascade", jobs=1)
    assert (tmp_path / "whole.toml").read_bytes() == resumed
    assert {path.name for path in tmp_path.iterdir()} == {"gains.toml", "whole.toml"}


def test_a_row_whose_process_dies_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(tune, "PRESSURES_KPA", {"displacement": (300,)})
    monkeypatch.setattr(tune, "CONTROLLERS", ("pid",))
    monkeypatch.setattr(
        tune, "run_all", lambda works, jobs, on_done: on_done(0, ProcessDied(-9, again=True))
    )
    with pytest.raises(
        TuneError, match=r"row 100hz/displacement/pid/300: its process died.*kept in"
    ):
        run_tune(tmp_path / "gains.toml", model="cascade")
