"""What other methods of integration would cost at equal error: right-hand sides a control step.

The station is told the trials of `reference`. The plant's own method and Rosenbrock methods run
compiled, in the plant's own march; the others are prototypes in Python with the same memory of the
way travelled, ends of steps at the same switches, and the same choice of size from the error.
Counted are evaluations of the right-hand side in a control step of 10 ms, a Jacobian as one more,
and operations: an exponential method takes few evaluations and much arithmetic between them.

Multirate methods evaluate the muscle's force, which changes slowly, more seldom than the cable and
the slide. The least that one can cost is bounded: Dormand-Prince's evaluations, which follow cable
and slide, without any of the muscle's arithmetic. Operations of the prototypes leave out the choice
of size and the search for kinks, which those of Rosenbrock methods contain.
"""

import csv
from dataclasses import dataclass
from functools import cached_property, partial
from io import StringIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.accuracy.job import POSITION_LIMIT, POSITIONS, STATE_LIMIT
from benchmarks.accuracy.reference import TRIALS, Commands, reference, shares
from benchmarks.files import write_text
from benchmarks.methods import DORMAND_PRINCE, EXPRB43, GRK4T, RK4, RODAS4, ROS4L, Stepper
from benchmarks.prototype import Prototype, operations, slow_share
from benchmarks.rosenbrock import VELDHUIZEN, Method
from benchmarks.rosenbrock import step as rosenbrock_step
from benchmarks.speed.rows import EVALUATIONS
from pma_gym.codegen.rebinding import rebind
from pma_gym.integrator.exponential_rosenbrock import step
from pma_gym.integrator.integration import Layout
from pma_gym.integrator.step_attempt import attempt
from pma_gym.integrator.system import System
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.condition import Condition
from pma_gym.plant.model import PLANTS, Model, load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import Program, table
from pma_gym.plant.simulation import Run, simulate_all
from pma_gym.terminal import SafeConsole

MODEL, PRESSURE, CONTROL_STEPS = "station", 350e3, 60
TOLERANCES = (3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5)
SIZES_S = (1e-3, 5e-4, 2.5e-4, 1.25e-4, 6.25e-5)
COMPILED: dict[str, tuple[Method | None, int]] = {
    "exponential, quotients": (None, EVALUATIONS),
    "van Veldhuizen": (VELDHUIZEN, 4),
    "GRK4T": (GRK4T, 4),
    "ROS4 (L-stable)": (ROS4L, 4),
    "Rodas4": (RODAS4, 7),
}
"""Methods and the right-hand sides of an attempt, the Jacobian counted as one more; None is the
plant's own."""

PROTOTYPES: dict[str, tuple[Stepper, tuple[float, ...]]] = {
    "classical RK4, fixed steps": (RK4, SIZES_S),
    "Dormand-Prince 5(4)": (DORMAND_PRINCE, (1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6)),
    "exponential exprb43": (EXPRB43, TOLERANCES),
}
MULTIRATE = "multirate, at least"


@dataclass(frozen=True)
class Point:
    """A point of an error-cost curve.

    Attributes:
        trial: name of the trial.
        method: name of the method.
        setting: tolerance, or size of a fixed step (s).
        evaluations: right-hand sides in a control step of 10 ms.
        operations: operations in it, in additions; a division counts as eight.
        state: largest error of a state, as a share of its range.
        position: largest error of a position.
    """

    trial: str
    method: str
    setting: float
    evaluations: float
    operations: float
    state: float
    position: float

    @property
    def error(self) -> float:
        """Error in units of the limits: 1 keeps both, and one of them just so."""
        return max(self.state / STATE_LIMIT, self.position / POSITION_LIMIT)


class MethodProgram(Program):
    """A plant's compiled functions with its own method or a Rosenbrock method.

    Args:
        model: the model.
        method: the Rosenbrock method; None for the plant's own.
        name: its name.
    """

    def __init__(self, model: Model, method: Method | None, name: str) -> None:
        self.method, self.name = method, name
        super().__init__(model)

    def key(self) -> list[str]:
        """The same, and the method."""
        return ["integrators", self.name, *super().key()]

    @cached_property
    def ramped(self) -> System:
        """The system with this method's step."""
        plant = PLANTS[self.model.plant]
        equations = PlantEquations(self.model.effects, self.model.parameters, ramped=True)
        plant.write_equations(equations)
        equations.finish()
        made_by = step if self.method is None else partial(rosenbrock_step, method=self.method)
        own = rebind(attempt, {"step": made_by})
        made = own(equations, plant.POSITIONS)
        return System(equations, made, Layout.of(made))

    @property
    def operations(self) -> int:
        """Operations of one attempt, in additions."""
        return operations(self.ramped.layout.outputs)


def curves(steps: int = CONTROL_STEPS) -> list[Point]:
    """Error and cost of every method in every trial.

    Args:
        steps: control steps of a trial.
    """
    plant = Plant(MODEL)
    start = plant.settle(0.0, PRESSURE)
    programs = {
        name: MethodProgram(load_model(MODEL), method, name)
        for name, (method, _) in COMPILED.items()
    }
    prototype = Prototype(plant)
    fast = 1.0 - slow_share(plant)
    points = []
    for trial, make in TRIALS.items():
        commands = _first(make(plant, PRESSURE), steps)
        truth = reference(plant, start, commands)

        def point(
            method: str,
            setting: float,
            states: NDArray,
            costs: tuple[float, float],
            trial: str = trial,
            truth: NDArray = truth,
        ) -> Point:
            away = dict(zip(plant.states, shares(states, truth).tolist(), strict=True))
            position = max(away[name] for name in POSITIONS if name in away)
            return Point(trial, method, setting, *costs, max(away.values()), position)

        for name, (_, each) in COMPILED.items():
            for tolerance in TOLERANCES:
                states, made = _compiled(programs[name], tolerance, start, commands)
                price = programs[name].operations
                points.append(point(name, tolerance, states, (each * made, price * made)))
        for name, (stepper, settings) in PROTOTYPES.items():
            price = prototype.operations(stepper)
            for setting in settings:
                states, made = prototype.run(stepper, setting, start, commands)
                costs = stepper.evaluations * made, price * made
                points.append(point(name, setting, states, costs))
                if stepper is DORMAND_PRINCE:
                    less = fast * costs[0], fast * costs[1]
                    points.append(point(MULTIRATE, setting, states, less))
    return points


def _first(commands: Commands, steps: int) -> Commands:
    rows = slice(0, steps + 1)
    return Commands(commands.time[rows], commands.motor[rows], commands.regulator[rows])


def _compiled(
    program: Program, tolerance: float, start: Condition, commands: Commands
) -> tuple[NDArray, float]:
    """States at the commands, and attempts at steps in a control step."""
    numbers = np.concatenate([[tolerance], program.model.vector()])
    columns = (commands.time, commands.motor, commands.regulator)
    own = table(program, numbers)
    run = Run(*columns, False, own, start.state, start.zero_contraction)
    made = simulate_all(program, [run])
    return run.states, made / (len(commands.time) - 1)


def at_equal_error(
    points: list[Point], cost: str = "evaluations", error: float = 1.0
) -> float | None:
    """What a curve costs where it keeps an error, between its points.

    Args:
        points: of one method in one trial.
        cost: "evaluations" or "operations" of a control step.
        error: in units of the limits.
    Returns:
        None where the curve does not reach the error.
    """
    curve = sorted((getattr(point, cost), point.error) for point in points)
    for (less, above), (more, below) in zip(curve[:-1], curve[1:], strict=True):
        if below <= error < above:
            share = np.log(above / error) / np.log(above / below)
            return float(less * (more / less) ** share)
    return curve[0][0] if curve and curve[0][1] <= error else None


def run_integrators(
    console: Console | None = None, out: Path | None = None, steps: int = CONTROL_STEPS
) -> list[Point]:
    """Print the error-cost curves and what each method costs at equal error.

    Args:
        console: where to print; the terminal if not given.
        out: CSV file of the curves, if given.
        steps: control steps of a trial.
    """
    console = console or SafeConsole()
    points = curves(steps)
    for trial in TRIALS:
        console.print(_curve_table(trial, [point for point in points if point.trial == trial]))
    console.print(_equal_table(points))
    if out:
        write_text(out, _csv(points))
    return points


def _methods(points: list[Point]) -> list[str]:
    return list(dict.fromkeys(point.method for point in points))


def _curve_table(trial: str, points: list[Point]) -> Table:
    title = f"{trial}: right-hand sides per 10 ms; below, error in units of the limits"
    page = Table(title=title)
    page.add_column("method", no_wrap=True)
    for _ in range(max(len(TOLERANCES), len(SIZES_S))):
        page.add_column("", justify="right")
    for method in _methods(points):
        own = [point for point in points if point.method == method]
        page.add_row(method, *(f"{point.evaluations:.0f}\n{_short(point.error)}" for point in own))
    return page


def _short(error: float) -> str:
    if error >= 1e3:
        return "unstable"
    return f"{error:.0f}" if error >= 10.0 else f"{error:.2g}" if error >= 0.1 else f"{error:.1g}"


def _equal_table(points: list[Point]) -> Table:
    title = (
        "Right-hand sides (thousand operations) per 10 ms\n"
        f"where state {STATE_LIMIT:g} and position {POSITION_LIMIT:g} of the range are kept"
    )
    page = Table(title=title)
    page.add_column("method", no_wrap=True)
    for trial in TRIALS:
        page.add_column(trial, justify="right")
    for method in _methods(points):
        page.add_row(method, *(_at_limits(points, method, trial) for trial in TRIALS))
    return page


def _at_limits(points: list[Point], method: str, trial: str) -> str:
    own = [point for point in points if (point.method, point.trial) == (method, trial)]
    found = [at_equal_error(own, cost) for cost in ("evaluations", "operations")]
    evaluations, work = found
    if evaluations is None or work is None:
        return "not reached"
    return f"{evaluations:.0f} ({work / 1e3:.0f})"


_COLUMNS = ("trial", "method", "setting", "evaluations", "operations", "state", "position")


def _csv(points: list[Point]) -> str:
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    for point in points:
        values = (getattr(point, name) for name in _COLUMNS)
        writer.writerow([v if isinstance(v, str) else f"{v:.6g}" for v in values])
    return text.getvalue()
