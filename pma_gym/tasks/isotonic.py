"""Isotonic tasks: the regulator contracts the muscle against a constant load that the motor holds.

An episode begins settled at its pressure and under its load; what is asked for is how far the
muscle shortens from there. The motor's voltage is what the nominal drive needs for the load, and
stays.

Feasibility of a reference for a station's actuator, by the nominal balance of forces.
"""

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.motions import triangle
from pma_gym.data.trial_schedule import Phase, TrialSchedule
from pma_gym.metrics import SAMPLE_RATE_HZ
from pma_gym.plant.memory_start import begun_at
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant
from pma_gym.tasks.task import Task
from pma_gym.units import SI_FACTORS

_MM, _KPA = SI_FACTORS["mm"], SI_FACTORS["kPa"]

LOWEST_PRESSURE, HIGHEST_PRESSURE = 150 * _KPA, 575 * _KPA
"""Pressures of the station's trials (Pa): table I3."""


def isotonic(
    load: float = 200.0,
    stroke: float = 12.5 * _MM,
    part: float = 2.5,
    start_pressures: tuple[float, float] = (150 * _KPA, 350 * _KPA),
    name: str = "isotonic",
) -> Task:
    """Contract against a load at one speed, stay there, return at that speed: phases I, II, III.

    The speed of the default is that of the dissertation's displacement, 5 mm/s. Its stroke, load
    and pressures are our choice within the station's reach: by table I3 (command of 225 N, 205 N
    measured) the muscle under such a load is contracted by 39.2 mm at 350 kPa and by 55.9 mm at
    575 kPa, so that 12.5 mm are left wherever a trial begins.

    Args:
        load: constant load (N).
        stroke: how far (m).
        part: how long each phase is (s).
        start_pressures: range of the pressures that episodes begin at (Pa).
        name: name of the task.
    """
    slope = stroke / part
    phases = (
        Phase("I", 0.0, part, initial=0.0, slope=slope),
        Phase("II", part, part, initial=stroke, slope=0.0),
        Phase("III", 2.0 * part, part, initial=stroke, slope=-slope),
    )
    schedule = TrialSchedule(name, "contraction", "mm", stroke, phases)
    return _task(schedule, load, start_pressures)


def pressure_triangle(
    name: str, load: float, pressure: float, stroke: float, period: float, periods: int = 3
) -> Task:
    """Contract and return at one speed, again and again: a phase is a period.

    Args:
        name: name of the task.
        load: constant load (N).
        pressure: pressure that it begins at (Pa).
        stroke: how far (m).
        period: time there and back (s).
        periods: how often; 1 to 9.
    """
    motion = triangle(stroke, period, periods)
    phases = tuple(
        Phase(numeral, k * period, period, 0.0, 0.0, motion)
        for k, numeral in zip(range(periods), _NUMERALS, strict=False)
    )
    schedule = TrialSchedule(name, "contraction", "mm", stroke, phases)
    return _task(schedule, load, (pressure, pressure))


_NUMERALS = ("I", "II", "III", "IV", "V", "VI", "VII", "VIII", "IX")


def _task(schedule: TrialSchedule, load: float, starts: tuple[float, float]) -> Task:
    pressures = LOWEST_PRESSURE, HIGHEST_PRESSURE
    return Task(schedule.name, schedule, *pressures, "regulator", load, starts)


ISOTONIC: dict[str, Task] = {
    task.name: task
    for task in (
        isotonic(),
        pressure_triangle("triangle_low", 150.0, 150 * _KPA, 11.4 * _MM, 4.0),
        pressure_triangle("triangle_high", 400.0, 450 * _KPA, 5.5 * _MM, 10.0),
    )
}
"""Isotonic tasks by name. The triangles are the dissertation's validation trials (Serres 2008,
section 4.1.5, figures 28 and 29: pressure goes up and down between 150 and 250 kPa against 150 N in
4 s, and between 450 and 550 kPa against 400 N in 10 s, three times each), turned into something to
follow: a triangle of the contraction that they had. That is 1.94 mm / 17 % = 11.4 mm and
1.38 mm / 25 % = 5.5 mm, by the printed RMSE and its share of the total contraction (section 5.1.5).
"""

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
        self.target = task.schedule.reference(_times(task))

    def of_motor(self) -> str | None:
        """What the motor lacks."""
        rotor, cable, drive = (self.parameters[n] for n in ("rotor", "cable", "drive"))
        rest = self.plant.settle(0.0, pressure=self.pressure).zero_contraction
        wound = rotor.radius * self.target if self.rotates else self.target
        pull = self._force(rest - wound, self._pressures)
        # The cable gives way by a few hundredths of the extension: four rounds are plenty.
        for _ in range(4 if self.rotates else 0):
            stretch = cable.slack + np.maximum(pull, 0.0) / cable.stiffness
            pull = self._force(rest - np.maximum(wound - stretch, 0.0), self._pressures)
        if np.any(pull < -ROUNDING_N):
            return f"the cable would have to push {_when(pull < -ROUNDING_N)}"
        return _beyond("motor", (pull - drive.offset) / drive.gain)

    def of_regulator(self) -> str | None:
        """What the regulator lacks."""
        drive, line = self.parameters["drive"], self.parameters["regulator_line"]
        motor = (self.load - drive.offset) / drive.gain
        rest = self.plant.settle(motor, pressure=self.pressure)
        x = rest.state[self.plant.states.index("contraction")] + self.target
        low = np.zeros(len(x))
        high = np.full(len(x), 2.0 * (10.0 * line.gain + line.offset))
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            weak = self._force(x, middle) < self.load
            low, high = np.where(weak, middle, low), np.where(weak, high, middle)
        return _beyond("regulator", (0.5 * (low + high) - line.offset) / line.gain)

    @property
    def _pressures(self) -> NDArray[np.float64]:
        return np.full(len(self.target), self.pressure)

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
