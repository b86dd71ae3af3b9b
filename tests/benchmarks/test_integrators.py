"""Methods of integration, compared at equal error."""

import csv
import io

import numpy as np
import pytest
from rich.console import Console

from benchmarks import integrators
from benchmarks.accuracy.reference import TRIALS, demanding_commands, reference, shares
from benchmarks.integrators import Point, at_equal_error
from benchmarks.methods import DORMAND_PRINCE, EXPRB43, RK4
from benchmarks.prototype import Prototype, slow_share
from pma_gym.plant.plant import Plant


def test_the_report_has_every_method_in_every_trial(tmp_path):
    out, shown = tmp_path / "curves.csv", io.StringIO()
    points = integrators.run_integrators(Console(file=shown, width=120), out, steps=3)
    with out.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(points)
    methods = {point.method for point in points}
    assert methods == {
        *integrators.COMPILED,
        *integrators.PROTOTYPES,
        integrators.MULTIRATE,
    }
    assert {row["trial"] for row in rows} == set(TRIALS)
    for row, point in zip(rows, points, strict=True):
        assert float(row["evaluations"]) == pytest.approx(point.evaluations, rel=1e-5)
    for method in methods:
        assert shown.getvalue().count(method) >= len(TRIALS) + 1


def points(*pairs):
    return [Point("t", "m", 0.0, cost, 10.0 * cost, 1e-4 * error, 0.0) for cost, error in pairs]


def test_equal_error_lies_between_points():
    assert at_equal_error(points((10, 4.0), (20, 0.25))) == pytest.approx(200**0.5)
    assert at_equal_error(points((10, 4.0), (20, 0.25)), "operations") == pytest.approx(20000**0.5)
    assert at_equal_error(points((10, 0.5), (20, 0.25))) == 10.0
    assert at_equal_error(points((10, 50.0), (20, 2.5))) is None


@pytest.mark.parametrize(
    ("stepper", "setting"), [(RK4, 1e-4), (DORMAND_PRINCE, 1e-5), (EXPRB43, 1e-4)]
)
def test_every_prototype_finds_the_reference(stepper, setting):
    plant = Plant("station")
    start = plant.settle(0.0, 350e3)
    commands = demanding_commands(plant, 350e3, steps=5)
    states, attempts = Prototype(plant).run(stepper, setting, start, commands)
    truth = reference(plant, start, commands)
    away = dict(zip(plant.states, shares(states, truth), strict=True))
    assert away["contraction"] < 1e-5
    assert away["velocity"] < 1e-4
    assert attempts > 3


@pytest.mark.parametrize(("stepper", "order"), [(RK4, 4), (DORMAND_PRINCE, 5), (EXPRB43, 4)])
def test_the_prototypes_have_their_orders(stepper, order):
    def rates(state):
        return np.array([state[0] * (1.0 - state[1]), state[1] * (state[0] - 1.0)])

    def jacobian(state):
        return np.array([[1.0 - state[1], -state[0]], [state[1], state[0] - 1.0]])

    ends = []
    for count in (8, 16, 32, 64, 512):
        state = np.array([2.0, 1.5])
        for _ in range(count):
            state, _ = stepper.step(state, rates, jacobian, 2.0 / count)
        ends.append(state)
    errors = [np.abs(end - ends[-1]).max() for end in ends[:-1]]
    assert np.log2(errors[-2] / errors[-1]) == pytest.approx(order, abs=0.4)


def test_the_muscle_takes_a_part_of_the_arithmetic():
    assert 0.1 < slow_share(Plant("station")) < 0.6
