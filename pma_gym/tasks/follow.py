"""Feasibility of a reference for a station's actuator, by the nominal balance of forces."""

import numpy as np
from numpy.typing import NDArray

from pma_gym.metrics import SAMPLE_RATE_HZ
from pma_gym.plant.memory_start import begun_at
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant
from pma_gym.tasks.task import Task
from pma_gym.units import SI_FACTORS

JUMP_SHARE = 0.05
"""Share of the range beyond which the way from one sample at 384 Hz to the next is a jump: the
fastest motion that is meant to be followed goes 0.2 % of the range in that time."""

ROUNDING_N, ROUNDING_V = 1.0, 0.02
"""What may be missed without a word (N, V)."""

_HALVINGS = 40


def infeasibility_reason(task: Task, model: str | Model, pressure: float) -> str | None:
    """Explain why a station's actuator cannot follow a task; None if it can.

    A jump of the reference; a voltage of less than 0 or more than 10 V; or, where the motor moves,
    a cable that would have to push, on the way back. The muscle's force and damping count; inertia,
    lags, delays, memories (hysteresis, dry friction) and the cable's slack do not. So None is no
    promise: what is left even to a controller that knows all is the achievable bound. Nothing is
    looked for in an exercise, where the operator moves; environments refuse a prescription that
    the device cannot give.

    Args:
        task: the task.
        model: the nominal model of a station.
        pressure: gauge pressure that the trial begins at (Pa).
    Raises:
        ValueError: a cascade, which has no balance of forces.

    Example:
        >>> from pma_gym.tasks import UNSEEN
        >>> infeasibility_reason(UNSEEN["displacement_speeds"], "station", 300e3) is None
        True
        >>> infeasibility_reason(UNSEEN["displacement_steps"], "station", 300e3)
        'the reference jumps by ... mm at 0.5 s'
    """
    nominal = load_model(model)
    if not nominal.rig.balances_loads:
        raise ValueError(
            f"model must be of a station, whose forces balance, got {nominal.name}, a "
            f"{nominal.plant}"
        )
    reason = _jump(task)
    if reason is not None or task.exercise:
        return reason
    # The zero too without memories: one that begins on a branch would move it by some N.
    balance = _Balance(task, Plant(begun_at(nominal, 0.0)), pressure)
    return balance.of_motor() if task.actuator == "motor" else balance.of_regulator()


def _times(task: Task) -> NDArray[np.float64]:
    return np.arange(round(task.schedule.duration * SAMPLE_RATE_HZ) + 1) / SAMPLE_RATE_HZ


def _jump(task: Task) -> str | None:
    schedule = task.schedule
    distances = np.abs(np.diff(schedule.reference(_times(task))))
    far = distances > JUMP_SHARE * schedule.span
    if not np.any(far):
        return None
    at = int(np.argmax(far))
    size = distances[at] / SI_FACTORS[schedule.unit]
    return f"the reference jumps by {size:.3g} {schedule.unit} at {(at + 1) / SAMPLE_RATE_HZ:.4g} s"


class _Balance:
    """The balance of forces along a reference, a row every 1/384 s."""

    def __init__(self, task: Task, plant: Plant, pressure: float) -> None:
        self.plant, self.pressure, self.load = plant, pressure, task.load
        self.rotates = task.schedule.followed.is_angle
        self.parameters = plant.model.parameters
        self.wanted = task.schedule.reference(_times(task))

    def of_motor(self) -> str | None:
        """What the motor lacks."""
        rotor, cable, drive = (self.parameters[n] for n in ("rotor", "cable", "drive"))
        rest = self.plant.settle(0.0, pressure=self.pressure).zero_contraction
        wound = rotor.radius * self.wanted if self.rotates else self.wanted
        pull = self._force(rest - wound, self._held)
        # The cable gives way by a few hundredths of the extension: four rounds are plenty.
        for _ in range(4 if self.rotates else 0):
            given = cable.slack + np.maximum(pull, 0.0) / cable.stiffness
            pull = self._force(rest - np.maximum(wound - given, 0.0), self._held)
        if np.any(pull < -ROUNDING_N):
            return f"the cable would have to push {_when(pull < -ROUNDING_N)}"
        return _beyond("motor", (pull - drive.offset) / drive.gain)

    def of_regulator(self) -> str | None:
        """What the regulator lacks."""
        drive, line = self.parameters["drive"], self.parameters["regulator_line"]
        motor = (self.load - drive.offset) / drive.gain
        rest = self.plant.settle(motor, pressure=self.pressure)
        x = rest.state[self.plant.states.index("contraction")] + self.wanted
        low = np.zeros(len(x))
        high = np.full(len(x), 2.0 * (10.0 * line.gain + line.offset))
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            weak = self._force(x, middle) < self.load
            low, high = np.where(weak, middle, low), np.where(weak, high, middle)
        return _beyond("regulator", (0.5 * (low + high) - line.offset) / line.gain)

    @property
    def _held(self) -> NDArray[np.float64]:
        return np.full(len(self.wanted), self.pressure)

    def _force(self, x: NDArray[np.float64], pressure: NDArray[np.float64]) -> NDArray[np.float64]:
        """Force of the muscle as it moves along contractions (N), without memories."""
        plant, states = self.plant, np.zeros((len(x), len(self.plant.states)))
        rate = np.gradient(x, 1.0 / SAMPLE_RATE_HZ)
        for name, values in {"contraction": x, "velocity": rate, "pressure": pressure}.items():
            states[:, plant.states.index(name)] = values
        # With the zero at the contraction itself the cable is slack.
        inputs, out = np.stack([0.0 * x, 0.0 * x, x], axis=1), np.empty_like(states)
        addresses = (a.ctypes.data for a in (states, inputs, plant.vector))
        plant.program.derivative(len(out), *addresses, 0, out.ctypes.data)
        return self.parameters["slide"].mass * out[:, plant.states.index("velocity")]


def _beyond(what: str, volts: NDArray[np.float64]) -> str | None:
    for wrong, bound in (
        (volts > 10.0 + ROUNDING_V, "more than 10 V"),
        (volts < -ROUNDING_V, "less than 0 V"),
    ):
        if np.any(wrong):
            return f"the {what} would need {bound} {_when(wrong)}"
    return None


def _when(wrong: NDArray[np.bool_]) -> str:
    first, share = int(np.argmax(wrong)) / SAMPLE_RATE_HZ, 100.0 * float(np.mean(wrong))
    return f"in {share:.2g} % of the trial, first at {first:.3g} s"
