"""A march in plain Python that any method's steps can be put into."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from benchmarks.accuracy.reference import Commands, switches
from benchmarks.methods import Stepper
from pma_gym.codegen.derivative import derivatives
from pma_gym.codegen.graph import FIXED, HELD, Value
from pma_gym.codegen.substitute import substitute
from pma_gym.codegen.text import python_text
from pma_gym.codegen.trace import live_inputs, operation_counts
from pma_gym.integrator.equations import COMMANDS, ZERO, State
from pma_gym.integrator.events import BEYOND
from pma_gym.integrator.step_attempt import GROW, LEAST_S, SAFETY, SHRINK
from pma_gym.plant.condition import Condition
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import FIRST_S, parameter_names
from pma_gym.plant.rigs.station import POSITIONS, TIGHTENING_M, TURNING_M

_WEIGHTS = {"divide": 8, "square_root": 8}
"""Cost of these operations in additions."""


class Prototype:
    """The station, its memory of the way, its kinks, and a choice of step sizes.

    Args:
        plant: the station.
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        eq = plant.program.equations
        values, rates = [s.value for s in eq.states], [s.rate for s in eq.states]
        slopes = derivatives(rates, values)
        entries = [(i, j, s) for i, row in enumerate(slopes) for j, s in enumerate(row)]
        self._full = [(i, j) for i, j, slope in entries if slope is not None]
        present = [slope for *_, slope in entries if slope is not None]
        self._rates, self._slopes = _Function(rates), _Function(present)
        self._operations = operations(rates), operations([*rates, *present])
        self._paths = _Function([path.after for path in eq.paths])
        names = ["tolerance", *parameter_names(plant.model)]
        self._fixed = dict(zip(names, map(float, plant.vector), strict=True))
        self._states = [s.name for s in eq.states]
        self._scales = np.array([_scale(state) for state in eq.states])
        self._velocity = self._states.index("velocity")

    def run(
        self, stepper: Stepper, setting: float, start: Condition, commands: Commands
    ) -> tuple[NDArray[np.float64], float]:
        """States at every command, and attempts at steps in a control step.

        Args:
            stepper: the method.
            setting: tolerance; the size of steps (s) for a method without an estimate.
            start: where the trial begins.
            commands: what the plant is told.
        """
        state, size, attempts = start.state.copy(), FIRST_S, 0
        out = [state.copy()]
        spans = zip(np.diff(commands.time), commands.motor, commands.regulator, strict=False)
        for duration, *given in spans:
            known = self._fixed | dict(zip(COMMANDS, map(float, given), strict=True))
            known[ZERO] = start.zero_contraction
            state, size, made = self._span(stepper, setting, known, state, size, float(duration))
            attempts += made
            out.append(state.copy())
        return np.array(out), attempts / (len(commands.time) - 1)

    def operations(self, stepper: Stepper) -> int:
        """Operations of one attempt, at least, in additions."""
        plain, both = self._operations
        more = both - plain if stepper.evaluations > stepper.stages else 0
        return stepper.stages * plain + more + stepper.overhead(len(self._states))

    def _span(
        self,
        stepper: Stepper,
        setting: float,
        known: dict[str, float],
        state: NDArray,
        size: float,
        left: float,
    ) -> tuple[NDArray, float, int]:
        """A control step: the state after it, the size of the next step, and attempts made."""
        count, attempts, fixed = len(self._states), 0, stepper.exponent == 0
        size = setting if fixed else min(size, FIRST_S)
        while left > 1e-12:
            length = left if left <= size else size
            if size < left < 2.0 * size and not fixed:
                length = 0.5 * left
            rates, jacobian = self._functions(known, state)
            first = state[:count]
            # Too long a step of an explicit method ends in infinities.
            with np.errstate(all="ignore"):
                new, error = stepper.step(first, rates, jacobian, length)
            attempts += 1
            factor, exact = self._judged(error, setting, stepper.exponent)
            share = self._kink(known[ZERO], first, rates(first), new, length) if exact else None
            if (exact and share is None) or length <= LEAST_S:
                state[count:] = self._paths(known, self._states, new)
                state[:count] = new
                left -= length
                cut = length < size and length * factor < size
                size = setting if fixed else size if cut else length * factor
            else:
                size = length * (factor if share is None else share)
        return state, size, attempts

    def _judged(self, error: NDArray | None, tolerance: float, exponent: int) -> tuple[float, bool]:
        """How much longer the next step may be, and whether this one is good enough."""
        if error is None:
            return 1.0, True
        with np.errstate(all="ignore"):
            square = float(np.sum((error / (self._scales * tolerance)) ** 2))
        if not np.isfinite(square):
            return SHRINK, False
        factor = SAFETY * max(square, 1e-30) ** (-0.5 / exponent)
        return min(max(factor, SHRINK), GROW), square <= 1.0

    def _functions(
        self, known: dict[str, float], state: NDArray
    ) -> tuple[Callable[[NDArray], NDArray], Callable[[NDArray], NDArray]]:
        """Rates and their Jacobian for a step that begins here."""
        count = len(self._states)
        known["origin"] = float(state[0])
        known |= dict(zip(self.plant.states[count:], map(float, state[count:]), strict=True))
        known["direction"] = 1.0
        speed = float(state[self._velocity])
        if speed == 0.0:
            speed = float(self._rates(known, self._states, state[:count])[self._velocity])
        known["direction"] = -1.0 if speed < 0.0 else 1.0

        def rates(moved: NDArray) -> NDArray:
            return np.array(self._rates(known, self._states, moved))

        def jacobian(moved: NDArray) -> NDArray:
            matrix = np.zeros((count, count))
            for place, slope in zip(
                self._full, self._slopes(known, self._states, moved), strict=True
            ):
                matrix[place] = slope
            return matrix

        return rates, jacobian

    def _kink(
        self, zero: float, old: NDArray, moving: NDArray, new: NDArray, length: float
    ) -> float | None:
        """Share of the step after which it passes a kink that it may not miss."""
        found = None
        limits = (TURNING_M, TIGHTENING_M)
        for factors, limit in zip(switches(self.plant, zero), limits, strict=True):
            own = factors[: len(old)]
            start, end = (float(own @ values + factors[-1]) for values in (old, new))
            speed = float(own @ moving)
            sign = 1.0 if start > 0.0 else -1.0 if start < 0.0 or speed < 0.0 else 1.0
            start, slope, end = sign * start, sign * speed * length, sign * end
            over = end * end * (0.5 * length if limit == TURNING_M else 1.0)
            if end < 0.0 and over > limit * (start - end):
                bend = end - start - slope
                root = max(slope * slope - 4.0 * bend * start, 0.0) ** 0.5
                share = 2.0 * start / (root - slope) if root != slope else 0.0
                found = BEYOND * share if share > 0.05 else 0.05
        return found


class _Function:
    """Traced values as a function of named numbers."""

    def __init__(self, outputs: list[Value]) -> None:
        inputs = live_inputs(outputs)
        self._names = [value.data for value in inputs]
        module: dict[str, Callable[..., tuple]] = {}
        exec(python_text(outputs, inputs, "function"), module)
        self._call = module["function"]

    def __call__(self, known: dict[str, float], names: list[str], values: NDArray) -> tuple:
        both = known | dict(zip(names, values.tolist(), strict=True))
        return self._call(*(both[name] for name in self._names))


def _scale(state: State) -> float:
    """What an error of a state is counted against."""
    return np.inf if state.scale is None else state.scale * POSITIONS.get(state.name, 1.0)


def operations(values: list[Value]) -> int:
    """Operations of values, in additions; what is fixed for a model's life is computed once."""
    total, once = operation_counts(values), operation_counts(values, FIXED)
    return sum(_WEIGHTS.get(name, 1) * (total[name] - once[name]) for name in total)


def slow_share(plant: Plant) -> float:
    """Share of a right-hand side's arithmetic that the muscle's force takes."""
    eq = plant.program.equations
    rates = [state.rate for state in eq.states]
    given = eq.graph.input("given_force", HELD)
    less = substitute(rates, {eq["muscle_force"].id: given})
    return 1.0 - operations(less) / operations(rates)
