"""Accuracy and cost of the simulation: the integrator against scipy, and limits.

Three trials (`reference`) run on each model at three pressures, at a ladder of tolerances. Errors
are shares of each state's range in the trial; the price is counted in attempts at internal steps.
The limits hold for the demanding trial: a ramp of the motor with a controller's jitter, a sudden
drop by 30 %, a step of the pressure.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.accuracy.convergence import SIZES_S, orders
from benchmarks.accuracy.limits import (
    energy_drift,
    mass_effect,
    motor_inertia_effect,
    one_mass_error,
    rotor_inertia_effect,
)
from benchmarks.accuracy.reference import (
    CONTROL_PERIOD,
    TRIALS,
    Commands,
    demanding_commands,
    reference,
    shares,
    simulated,
)
from benchmarks.files import write_text
from pma_gym.plant.compiled_model import DEFAULT_TOLERANCE
from pma_gym.plant.condition import Condition
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.plant.simulation import Run, simulate_all
from pma_gym.terminal import SafeConsole

__all__ = [
    "CONTROL_PERIOD",
    "Commands",
    "Error",
    "demanding_commands",
    "error_ladder",
    "run_accuracy",
    "simulated",
]

EVALUATIONS = 3
"""Evaluations of the right-hand side in an attempt at an internal step: where the step begins, with
its Jacobian as one more, and at the stage."""

MODELS = ("serres2008", "station", "cascade")
PRESSURES = (200e3, 350e3, 550e3)
TOLERANCES = tuple(DEFAULT_TOLERANCE * factor for factor in (20 / 3, 10 / 3, 1.0, 1 / 3, 0.1))
STATE_LIMIT, POSITION_LIMIT = 1e-4, 1e-6
"""Largest errors at the default tolerance in the demanding trial, as shares of the range: any
state, and the positions."""

POSITIONS = ("contraction", "angle", "extension", "servo")


@dataclass(frozen=True)
class Error:
    """Error and computing time at a tolerance.

    Attributes:
        tolerance: largest error of an internal step, as a share of the states' scales.
        states: largest error of each state over all trials, as a share of its range.
        cost: time of a control step of 10 ms (s).
        attempts: attempts at internal steps in a control step of 10 ms.
    """

    tolerance: float
    states: dict[str, float]
    cost: float
    attempts: float

    @property
    def worst_state(self) -> str:
        """Name of the state with the largest error."""
        return max(self.states, key=lambda name: self.states[name])

    @property
    def position(self) -> float:
        """Largest error of a position."""
        return max(error for name, error in self.states.items() if name in POSITIONS)

    @property
    def met(self) -> bool:
        """Whether the error keeps both limits."""
        return self.states[self.worst_state] <= STATE_LIMIT and self.position <= POSITION_LIMIT

    @property
    def evaluations(self) -> float:
        """Right-hand sides in a control step of 10 ms."""
        return EVALUATIONS * self.attempts


def error_ladder(
    model: str | Model, tolerances: Sequence[float] = TOLERANCES, trial: str = "demanding"
) -> list[Error]:
    """Errors of a model over a trial at all pressures, one entry a tolerance."""
    plants = [Plant(model, tolerance) for tolerance in tolerances]
    worst = np.zeros((len(plants), len(plants[0].states)))
    costs, attempts = np.zeros((2, len(plants)))
    for pressure in PRESSURES:
        start = plants[0].settle(0.0, pressure)
        commands = TRIALS[trial](plants[0], pressure)
        truth = reference(plants[0], start, commands)
        steps = (len(commands.time) - 1) * len(PRESSURES)
        for row, plant in enumerate(plants):
            states, made, duration = _timed(plant, start, commands)
            worst[row] = np.maximum(worst[row], shares(states, truth))
            costs[row] += duration / steps
            attempts[row] += made / steps
    return [
        Error(tolerance, dict(zip(plants[0].states, map(float, row), strict=True)), *price)
        for tolerance, row, *price in zip(
            tolerances, worst, costs.tolist(), attempts.tolist(), strict=True
        )
    ]


def _timed(
    plant: Plant, start: Condition, commands: Commands, repeats: int = 5
) -> tuple[NDArray[np.float64], int, float]:
    """States, attempts, and the shortest of some times (s): what else runs only ever adds to it."""

    def once() -> tuple[Run, int, float]:
        columns = (commands.time, commands.motor, commands.regulator)
        run = Run(*columns, "zoh", plant.table, start.state, start.zero_contraction)
        begin = time.perf_counter()
        made = simulate_all(plant.program, [run])
        return run, made, time.perf_counter() - begin

    done = [once() for _ in range(repeats)]
    run, made, _ = done[0]
    return run.states, made, min(duration for *_, duration in done)


def run_accuracy(console: Console | None = None, out: Path | None = None) -> bool:
    """Print the error of every state over tolerance, the limits, and what inertia changes.

    Args:
        console: where to print; the terminal if not given.
        out: text file to write the same to, if given.
    Returns:
        Whether the default tolerance keeps both limits on every model.
    """
    console = console or SafeConsole()
    text = StringIO()
    places = (console, SafeConsole(file=text, width=120))
    kept = True
    for model in MODELS:
        ladders = {trial: error_ladder(model, TOLERANCES, trial) for trial in TRIALS}
        met = [error.met for error in ladders["demanding"] if error.tolerance == DEFAULT_TOLERANCE]
        kept = kept and all(met)
        for place in places:
            place.print(_ladder_table(model, ladders["demanding"]))
            place.print(_price_table(model, ladders))
    checks = _checks_table()
    for place in places:
        place.print(checks)
        place.print(f"Default tolerance {DEFAULT_TOLERANCE:g}: limits {_verdict(kept)}")
    if out:
        write_text(out, text.getvalue())
    return kept


def _table(title: str, ladder: list[Error], first: str) -> Table:
    table = Table(title=title)
    table.add_column(first)
    for error in ladder:
        style = "bold" if error.tolerance == DEFAULT_TOLERANCE else ""
        table.add_column(f"{error.tolerance:.2g}", justify="right", style=style)
    return table


def _ladder_table(model: str, ladder: list[Error]) -> Table:
    title = f"{model}, demanding: error as a share of the range, {len(PRESSURES)} trials"
    table = _table(title, ladder, "tolerance")
    for state in ladder[0].states:
        table.add_row(state, *(f"{error.states[state]:.1e}" for error in ladder))
    table.add_section()
    table.add_row("limits", *(_verdict(error.met) for error in ladder))
    return table


def _price_table(model: str, ladders: dict[str, list[Error]]) -> Table:
    """Worst errors beside what they cost, trial by trial."""
    title = f"{model}: error, and cost of a control step of 10 ms"
    table = _table(title, next(iter(ladders.values())), "tolerance")
    rows: dict[str, Callable[[Error], str]] = {
        "worst state": lambda error: f"{error.states[error.worst_state]:.1e}",
        "worst position": lambda error: f"{error.position:.1e}",
        "attempts": lambda error: f"{error.attempts:.1f}",
        "right-hand sides": lambda error: f"{error.evaluations:.0f}",
        "time (us)": lambda error: f"{error.cost * 1e6:.1f}",
    }
    for trial, ladder in ladders.items():
        for name, cell in rows.items():
            table.add_row(f"{trial}: {name}", *map(cell, ladder))
        table.add_section()
    return table


def _checks_table() -> Table:
    table = Table(title="Limits and inertia", show_header=False)
    for damping in (0.05, 2.9, 14.5):
        # The finest steps of little damping come near the reference's own error.
        orders_seen = orders(damping, np.array(SIZES_S[:3]))[1].min(axis=1)
        words = ", ".join(f"{order:.2f}" for order in orders_seen)
        label = f"order of convergence, damping {damping:g} N s/mm, {SIZES_S[0] * 1e3:g} ms halved"
        table.add_row(label, words)
    for stiffness in (1e4, 1e5, 1e6):
        error = f"{one_mass_error(stiffness) * 1e6:.2g} um"
        table.add_row(f"one-mass form, cable {stiffness:.0e} N/mm: contraction differs by", error)
    for tolerance in (DEFAULT_TOLERANCE, 1e-6):
        drift = f"{energy_drift(tolerance):.1e}"
        table.add_row(f"energy drift in 1 s, tolerance {tolerance:g}", drift)
    mass = f"{mass_effect():.2%} (under 1 % in figure 16)"
    table.add_row("moving mass 0.5 kg, free contraction at 400 kPa", mass)
    for inertia in (2e-3, 2e-5):
        change = f"{motor_inertia_effect(inertia):.2%}"
        table.add_row(f"cascade, motor inertia {inertia:g} kg m^2, damping ratio 0.7", change)
    for factor in (0.5, 2.0):
        change = f"{rotor_inertia_effect(factor):.2%}"
        table.add_row(f"station, rotor inertia times {factor:g}, load step at 400 kPa", change)
    return table


def _verdict(met: bool) -> str:
    return "met" if met else "missed"
