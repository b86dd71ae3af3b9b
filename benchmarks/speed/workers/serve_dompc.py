"""do-mpc's simulator on the station, its laws as CasADi expressions of the same text."""

# pyright: reportMissingImports=false
import operator
import warnings
from collections.abc import Callable
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from benchmarks.speed.loops import EPISODE, Prepared
from benchmarks.speed.workers.same_plant import PERIOD, PRESSURE, plant, prepared
from pma_gym.codegen.trace import order
from pma_gym.plant.program import parameter_names

PACKAGES = ("do_mpc", "casadi", "numpy")

TOLERANCE = 1e-6
"""Relative tolerance of CVODES; the absolute one is a thousandth of it."""

_OPERATIONS: dict[str, Callable] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "negative": operator.neg,
    "absolute": casadi.fabs,
    "square_root": casadi.sqrt,
    "floor": casadi.floor,
    "less": operator.lt,
    "less_equal": operator.le,
    "equal": operator.eq,
    "not_equal": operator.ne,
    "and": casadi.logic_and,
    "or": casadi.logic_or,
    "not": casadi.logic_not,
    "select": casadi.if_else,
}
"""What traced arithmetic is for CasADi."""


def rates(states: dict[str, casadi.SX], motor: casadi.SX) -> list[casadi.SX]:
    """The rate of every state of the station, for CasADi's symbols of state and voltage (V)."""
    station = plant()
    numbers = zip(parameter_names(station.model), station.model.vector().tolist(), strict=True)
    given: dict[str, Any] = {**dict(numbers), **states, "motor_voltage": motor}
    given["regulator_voltage"] = station.regulator_voltage(PRESSURE)
    given["zero_contraction"] = station.settle(0.0, PRESSURE).zero_contraction
    wanted = station.program.rates()
    expressions: dict[int, Any] = {}
    for value in order(wanted):
        if value.operands:
            parts = [expressions[part.id] for part in value.operands]
            expressions[value.id] = _OPERATIONS[value.operation](*parts)
        else:
            expressions[value.id] = value.data if value.is_constant else given[value.data]
    return [expressions[value.id] for value in wanted]


def simulator() -> Prepared:
    """The simulator with CVODES, its integrator for ordinary differential equations."""
    with warnings.catch_warnings():
        # Of features that are not installed, and not used.
        warnings.simplefilter("ignore")
        import do_mpc
    model = do_mpc.model.Model("continuous", "SX")
    states = {name: model.set_variable("_x", name) for name in plant().states}
    motor = model.set_variable("_u", "motor_voltage")
    for name, rate in zip(states, rates(states, motor), strict=True):
        model.set_rhs(name, rate)
    model.setup()
    made = do_mpc.simulator.Simulator(model)
    made.set_param(
        t_step=PERIOD, integration_tool="cvodes", reltol=TOLERANCE, abstol=1e-3 * TOLERANCE
    )
    made.setup()
    command, last, steps = np.zeros((1, 1)), np.empty(0), 0

    def integrate(state: NDArray[np.float64], motor: float) -> NDArray[np.float64]:
        nonlocal last, steps
        if state is not last:
            made.x0 = state
        if steps % EPISODE == 0:
            # What it records of every step is copied whole in every step.
            made.reset_history()
        command[0, 0], steps = motor, steps + 1
        made.make_step(command)
        last = _state(made)
        return last

    return prepared(integrate, 10, lambda: float("nan"))


def _state(made: Any) -> NDArray[np.float64]:  # noqa: ANN401 - a Simulator
    return np.asarray(made.x0.cat).ravel()


ROWS = {"simulator": simulator}
