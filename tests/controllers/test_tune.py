"""The tuning script: its start, its margin, its file."""

import json

import numpy as np
import pytest

from benchmarks import tune
from benchmarks.tune import TuneError, gains_from, run_tune
from benchmarks.tuning.cost import UNSTABLE_COST, Cost
from benchmarks.tuning.job import Job
from benchmarks.tuning.kept import KeptRows
from benchmarks.tuning.loop import Loop, lambda_tuning
from benchmarks.worker import ProcessDied
from controllers.gains import GAINS_FILE, Gains, scheduled_gains
from pma_gym.plant.linear import linearize
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


def test_shipped_gains_keep_their_margin():
    document = json.loads(GAINS_FILE.read_text())
    for name, tasks in document["models"].items():
        for task, controllers in tasks.items():
            for controller, table in controllers.items():
                for pressure in table["pressure_kpa"]:
                    job = Job(load_model(name), task, controller, pressure, 0)
                    loop = Loop(job)
                    gains = scheduled_gains(controller, _station(job))
                    assert loop.sensitivity(gains) < 2.05, job


def _station(job):
    from pma_gym.envs import Station
    from pma_gym.tasks import TASKS

    return Station(job.model, TASKS[job.task], job.pressure_kpa * 1e3, 0.01)


def test_cost_punishes_unstable_and_brittle_gains(job):
    cost = Cost(job)
    good = gains_from(np.log(lambda_tuning(job)))
    assert cost(good) == cost(good)
    assert cost(Gains(5000.0, 1e5, 0.0, 0.005)) == UNSTABLE_COST


def test_same_seed_same_bytes_and_other_models_stay(tmp_path, monkeypatch):
    monkeypatch.setattr(tune, "PRESSURES_KPA", {"displacement": (300,)})
    monkeypatch.setattr(tune, "EVALUATIONS", 6)
    monkeypatch.setattr(tune, "CONTROLLERS", ("pid",))
    paths = [tmp_path / "one.json", tmp_path / "two.json"]
    for path in paths:
        run_tune(path, seed=3, model="cascade", jobs=1)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    run_tune(paths[1], seed=3, model="station", jobs=1)
    one, two = (json.loads(path.read_text()) for path in paths)
    assert two["models"]["cascade"] == one["models"]["cascade"]
    assert set(two["models"]) == set(two["provenance"]) == {"cascade", "station"}
    row = two["models"]["station"]["displacement"]["pid"]
    assert row["pressure_kpa"] == [300]
    assert two["provenance"]["station"]["seed"] == 3
    assert not [p for p in tmp_path.iterdir() if p not in paths]


def test_broken_file_of_gains_is_refused_before_the_work(tmp_path):
    path = tmp_path / "gains.json"
    path.write_text("[]")
    with pytest.raises(ValueError, match=r"gains.json is no file of gains.*delete it"):
        run_tune(path)
    path.write_text('{"schema": 7}')
    with pytest.raises(ValueError, match=r"must have schema 1; delete it"):
        run_tune(path)
    assert path.read_text() == '{"schema": 7}'


def test_finished_rows_survive_an_interrupt_and_are_not_tuned_again(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(tune, "PRESSURES_KPA", {"displacement": (300, 400)})
    monkeypatch.setattr(tune, "CONTROLLERS", ("pid",))
    made, interrupted = [], True

    def tuned(row):
        if interrupted and made:
            raise KeyboardInterrupt
        made.append(row.pressure_kpa)
        return Gains(row.pressure_kpa / 3.0, 2.0, 3.0, 0.005), 0.1

    monkeypatch.setattr(tune, "tuned", tuned)
    out = tmp_path / "gains.json"
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
    assert run_tune(tmp_path / "whole.json", model="cascade", jobs=1)
    assert (tmp_path / "whole.json").read_bytes() == resumed
    assert {path.name for path in tmp_path.iterdir()} == {"gains.json", "whole.json"}


def test_a_row_whose_process_dies_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(tune, "PRESSURES_KPA", {"displacement": (300,)})
    monkeypatch.setattr(tune, "CONTROLLERS", ("pid",))
    monkeypatch.setattr(
        tune, "run_all", lambda works, jobs, on_done: on_done(0, ProcessDied(-9, again=True))
    )
    with pytest.raises(TuneError, match=r"row displacement/pid/300: its process died.*kept in"):
        run_tune(tmp_path / "gains.json", model="cascade")
