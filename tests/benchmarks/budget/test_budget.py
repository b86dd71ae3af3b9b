"""The error budget: begins at the printed controller, ends at the improved one, adds up."""

import csv
import itertools
import re
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from benchmarks.budget import job
from benchmarks.budget.causes import OpenLoop, causes_of, without
from benchmarks.budget.drawn_stations import CONTROLLERS, contest, drawn_stations
from benchmarks.budget.statics import GRID_V, Statics, fitted_quadratic
from benchmarks.budget.tables import alone_rows, share_rows, waterfall_rows
from benchmarks.budget.trial import Budget, trial_budget
from benchmarks.runner.rollout import make_environment, rollout
from controllers import SerresFeedforward
from pma_gym.effects.muscle.hysteresis import hysteresis_force
from pma_gym.envs import Measurement, StationInfo
from pma_gym.metrics import rmse
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.studies.position_voltage import printed_quadratics
from pma_gym.tasks import TASKS

AT_REST = Measurement(0.0, 0.0, 0.0, 0.0, 300e3)


@pytest.fixture(scope="module")
def plant():
    return Plant("station")


@pytest.fixture(scope="module")
def budgets():
    return {task: trial_budget(task, 300.0) for task in TASKS}


def open_loop(plant, task, pressure_kpa=300.0):
    return OpenLoop(plant, StationInfo(plant.model, TASKS[task], 1e3 * pressure_kpa, 0.01))


# -- the controller --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("task", "pressure"), [("displacement", 150.0), ("displacement", 250.0), ("rotation", 575.0)]
)
def test_with_all_faults_it_is_the_dissertations(plant, task, pressure):
    own = open_loop(plant, task, pressure)
    printed = SerresFeedforward()
    printed.reset(TASKS[task].schedule.at, own.station)
    volts = [printed.act(AT_REST, 0.01 * k) for k in range(TASKS[task].steps(100.0))]
    assert own.voltages(frozenset(causes_of(task))) == pytest.approx(volts, abs=1e-5)


def test_chatter_is_what_alternates(plant):
    own, faults = open_loop(plant, "displacement"), frozenset(causes_of("displacement"))
    samples = np.arange(100, 500, 20)
    bends = np.diff(own.voltages(faults)[samples], 2)
    assert np.all(np.sign(bends[1:]) == -np.sign(bends[:-1])) and np.abs(bends).min() > 0.1
    assert np.abs(np.diff(own.voltages(faults - {"chatter"})[samples], 2)).max() < 0.02


def test_without_timing_the_first_voltage_passes_the_dead_zone_at_once(plant):
    own, faults = open_loop(plant, "displacement"), frozenset(causes_of("displacement"))
    dead_zone = min(np.roots(printed_quadratics()[300]))
    assert own.voltages(faults)[0] < 0.1 * dead_zone
    assert own.voltages(faults - {"timing", "chatter"})[0] > dead_zone


def test_the_memory_of_the_ideal_motion_saturates_at_the_hysteresis(plant):
    own, parameters = open_loop(plant, "displacement"), plant.model.parameters["hysteresis"]
    nodes, force = own._memories["hysteresis"]
    # Bouc-Wen on one way out, from the branch of filling: z - z0 = (1 + z0) (exp(-way / d) - 1).
    way, whole = 5e-3 * nodes, 1.0 + parameters.memory_at_start
    expected = hysteresis_force(whole * np.expm1(-way / parameters.distance), parameters)
    moving = (nodes > 0.01) & (nodes < 5.0)
    assert force[moving] == pytest.approx(expected[moving], abs=0.02 * parameters.force)
    assert force[2400] == pytest.approx(whole * parameters.force, rel=1e-3)


def test_what_is_left_out_of_a_station_is_neutral():
    model = load_model("station")
    bare = without(model, "hysteresis", "dry friction", "slack")
    assert bare.parameters["hysteresis"].force == 0.0
    assert bare.parameters["coulomb_friction"].static == 0.0
    assert bare.parameters["cable"].slack == 0.0
    assert bare.parameters["drive"] == model.parameters["drive"]
    assert "hysteresis" not in without(load_model("cascade"), "hysteresis").parameters


# -- statics ---------------------------------------------------------------------------------------


def test_the_unrounded_fit_rounds_to_table_18():
    for pressure, printed in printed_quadratics().items():
        fit = fitted_quadratic(pressure)
        assert fit.square == pytest.approx(printed.square, abs=5.1e-5)
        assert fit.linear == pytest.approx(printed.linear, abs=5.1e-5)
        assert fit.constant == pytest.approx(printed.constant, abs=5.1e-5)


def test_the_stations_curve_is_where_it_settles(plant):
    statics = Statics(plant, 300e3)
    for volts in (1.0, 4.0):
        rest = plant.settle(volts, pressure=300e3)
        truth = plant.observe(rest.state[None, :], rest.zero_contraction)
        at = int(np.searchsorted(GRID_V, volts))
        assert statics.extension[at] == pytest.approx(truth["extension"][0], abs=1e-6)
        assert statics.voltage(statics.extension[at : at + 1], statics.extension) == volts
    # A spring's slope: the load over the extension of a small change.
    slope = np.gradient(statics.load[999:1002], statics.extension[999:1002])[1]
    assert statics.stiffness(statics.extension[1000:1001])[0] == pytest.approx(slope, rel=1e-3)


# -- the budget ------------------------------------------------------------------------------------


def test_it_begins_with_the_replay_on_the_station(budgets):
    environment = make_environment("displacement", "station", 300.0, noise=False)
    replayed = rollout(environment, SerresFeedforward(), seed=0)
    position = replayed.trial.truth["extension"]
    error = position - TASKS["displacement"].ideals(len(position))
    assert budgets["displacement"].printed["all"] == pytest.approx(1e3 * rmse(error), rel=1e-3)


@pytest.mark.parametrize(("task", "near"), [("displacement", 0.02), ("rotation", 0.4)])
def test_it_ends_near_the_improved_feedforward(budgets, task, near):
    budget = budgets[task]
    for phase in budget.phases:
        fall = budget.waterfall(phase)
        assert fall[0] == budget.printed[phase] and len(fall) == len(budget.causes) + 1
        assert abs(fall[-1] - budget.improved[phase]) < near
        assert budget.improved[phase] < 0.02 * budget.printed[phase]
        assert budget.measured[phase] > 0.5


@pytest.mark.parametrize("task", TASKS)
def test_shares_add_up(budgets, task):
    budget = budgets[task]
    for phase in budget.phases:
        total = sum(budget.share(cause, phase) for cause in budget.causes)
        left = budget.waterfall(phase)[-1]
        assert total == pytest.approx(budget.printed[phase] ** 2 - left**2, rel=1e-9)


def test_shares_of_causes_that_do_not_interact_are_their_own():
    own = {"a": 4.0, "b": 1.0, "c": 2.25}
    sets = [frozenset(s) for n in range(4) for s in itertools.combinations(own, n)]
    by_faults = {s: {"displacement": np.sqrt(sum(own[c] for c in s))} for s in sets}
    budget = Budget("displacement", 300.0, tuple(own), by_faults, {}, {}, {})
    for cause, square in own.items():
        assert budget.share(cause, "displacement") == pytest.approx(square)
    assert budget.alone("a", "displacement") == pytest.approx(np.sqrt(3.25))


def test_improved_is_better_on_the_nominal_station_and_on_most_others():
    drawn = drawn_stations()
    for task, pressure in (("displacement", 200.0), ("rotation", 450.0)):
        outcome = contest(task, pressure, drawn)
        serres, improved = (outcome.drawn[name] for name in CONTROLLERS)
        assert outcome.nominal[CONTROLLERS[1]] < 0.02 * outcome.nominal[CONTROLLERS[0]]
        assert np.median(improved) < np.median(serres)
        assert outcome.better > len(drawn) / 2


def test_command_writes_tables_and_pictures(tmp_path, monkeypatch):
    monkeypatch.setattr(job, "pressures", lambda task: [300])
    with (tmp_path / "terminal.txt").open("w") as terminal:
        budgets = job.run_budget(tmp_path / "out", Console(file=terminal, width=100))
    said = (tmp_path / "terminal.txt").read_text()
    assert "less static misfit" in said and "without pulley" in said
    with (tmp_path / "out" / "budget.csv").open() as file:
        rows = list(csv.DictReader(file))
    (row,) = (
        r for r in rows if r["task"] == "rotation" and r["name"] == "lag" and r["phase"] == "I"
    )
    assert float(row["rmse_alone"]) == pytest.approx(
        budgets["rotation"][0].alone("lag", "I"), rel=1e-4
    )
    assert {r["phase"] for r in rows if r["task"] == "rotation"} == {"I", "II", "III", "all"}
    with (tmp_path / "out" / "drawn.csv").open() as file:
        assert len(list(csv.DictReader(file))) == 4
    assert "| printed voltages | " in (tmp_path / "out" / "budget.md").read_text()
    for task in TASKS:
        assert (tmp_path / "out" / f"{task}.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize(
    ("words", "make"),
    [("as causes", waterfall_rows), ("one thing alone", alone_rows), ("share of", share_rows)],
)
def test_the_documentation_has_the_commands_figures(budgets, task, words, make):
    docs = Path(__file__).parents[3] / "docs"
    pages = (docs / "error-budget.md", docs / "notebook" / "error-budget.md")
    page = "".join(each.read_text(encoding="utf-8") for each in pages)
    (table,) = (
        [[cell.strip() for cell in line.strip("|\n").split("|")] for line in lines.splitlines()]
        for title, lines in re.findall(r"\*\*(.+?)\*\*\n\n((?:\|.*\n)+)", page)
        if title.startswith(task.capitalize()) and words in title
    )
    column, rows = table[0].index("300"), make([budgets[task]], budgets[task].phases[-1])
    assert [row[0] for row in table if row[0] != "---"] == [row[0] for row in rows]
    printed = [float(row[column]) for row in table[2:]]
    # Another machine may round the last digit otherwise.
    assert printed == pytest.approx([float(row[1]) for row in rows[1:]], abs=0.011, rel=0.01)
