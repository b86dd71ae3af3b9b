"""The dissertation's feed-forward with each of its faults on its own switch.

Printed controller. Every 0.2 s, x = y + y' / A by Tustin's recursion turned around, then the motor
voltage at which table 18's quadratic gives the displacement x; samples joined linearly. Here

    V(t) = map^-1( y_c(t) + tau y'_c(t) + c(t) + h(t) )

in which every fault is a term of its own, so that any set of them can be taken away:

- rounding: map = station's own static curve + misfit + rounding; rounding is the quadratic that
  was used less the unrounded least-squares fit to table I3;
- chatter: c joins, linearly, what the recursion gives at its samples beyond y + y' / A;
- timing: y_c, y'_c are taken every 0.2 s, from rest at t = 0, and the voltages joined linearly;
  else in the middle of every control period;
- static misfit: the unrounded fit less the station's own static curve;
- hysteresis, dry friction: h = 0; else h has H / K, with H the force of hysteresis (of friction)
  along the ideal motion;
- lag: tau = 1 / A of the profile; else B / K, the station's own where it stands;
- pulley: in rotation y = R theta with R = 28.65 mm; else the station's own radius;
- slack: y_c = y; else the cable's slack is taken off in rotation, and in displacement the first
  40 ms push the rotor through it;
- stretch: y_c = y; else T / k_c, by which the cable is longer, is taken off in rotation.

K is the slope of the station's static force, B its damping. What the sum of all mends still misses
is inertia, and what is not linear in these terms; `controllers.ImprovedFeedforward` has that too.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from benchmarks.budget.statics import GRID_V, Statics, fitted_quadratic
from controllers.models.inverse import TAKE_UP_S
from controllers.models.muscle import Muscle
from controllers.models.nominal_motion import nominal_motion
from controllers.serres_feedforward import PROFILE_RADIUS
from pma_gym.envs import StationInfo
from pma_gym.integrator.equations import Interpolation
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.studies.tustin import cascade_transfer, inverse_recursion, tustin_recursion
from pma_gym.studies.voltage_profile import MOTOR_RATE, SAMPLE_TIME, profile_model
from pma_gym.tasks import EVERY_TASK

Array = np.ndarray

CAUSES = (
    "rounding",
    "chatter",
    "timing",
    "static misfit",
    "hysteresis",
    "dry friction",
    "lag",
    "pulley",
    "slack",
    "stretch",
)
"""Faults in the order in which they are taken away."""

OF_ROTATION = ("pulley", "stretch")
"""Faults of how far the pulley is taken to wind in, which displacement has none of."""

NODE_S = 2e-3
"""Step along the ideal motion (s) in which memories are followed."""

ABSENT = {
    "hysteresis": {"hysteresis.force_n": 0.0},
    "dry friction": {"coulomb_friction.static_n": 0.0, "coulomb_friction.dynamic_n": 0.0},
    "slack": {"cable.slack_mm": 0.0},
}
"""Changes of a model that leave something of it out."""


def causes_of(task: str) -> tuple[str, ...]:
    """The faults that a task can have."""
    return tuple(
        cause
        for cause in CAUSES
        if EVERY_TASK[task].schedule.followed.is_angle or cause not in OF_ROTATION
    )


def without(model: Model, *parts: str) -> Model:
    """The model without some of `ABSENT`, as far as it has them."""
    changes = {path: value for part in parts for path, value in ABSENT[part].items()}
    known = {path: v for path, v in changes.items() if path.partition(".")[0] in model.parameters}
    return model.replace(known)


@dataclass(frozen=True)
class Motion:
    """Prescribed motion of the muscle's end at given times; arrays of one shape.

    Attributes:
        extension: y (m).
        speed: y' just before (m/s).
    """

    extension: Array
    speed: Array


class OpenLoop:
    """The feed-forward of one trial, with any of its faults.

    Args:
        plant: the station.
        station: task, pressure and control period.
    """

    def __init__(self, plant: Plant, station: StationInfo) -> None:
        self.plant, self.station = plant, station
        self.rotation = station.task.schedule.followed.is_angle
        self.profile = profile_model(station.pressure / 1e3)
        parameters = plant.model.parameters
        self.cable, self.drive, self.rotor = (parameters[n] for n in ("cable", "drive", "rotor"))
        self.statics = Statics(plant, station.pressure)
        self.smooth = Plant(without(plant.model, "hysteresis", "dry friction"))

    def voltages(
        self, faults: frozenset[str], interpolation: Interpolation = "foh", compensated: bool = True
    ) -> Array:
        """Motor voltage of every control period with these faults (V), shape (steps,).

        Args:
            faults: some of `CAUSES`.
            interpolation: how samples become voltages where `timing` is a fault: joined (`foh`), or
                each held until the next (`zoh`).
            compensated: whether any lag is made up for; else tau = 0.
        """
        steps = self.station.task.steps(1.0 / self.station.period)
        middle = self.station.period * (np.arange(steps) + 0.5)
        if "timing" in faults:
            volts = self._interpolated(
                self._mapped(self._samples, faults, compensated), middle, interpolation
            )
        else:
            volts = self._mapped(middle, faults, compensated)
        if "slack" not in faults and not self.rotation:
            push = 2 * max(1, round(TAKE_UP_S / self.station.period))
            volts[:push] = self.improved[:push]
        return np.clip(volts, 0.0, 10.0)

    @cached_property
    def improved(self) -> Array:
        """Voltages of `ImprovedFeedforward` (V), shape (steps,)."""
        schedule = self.station.task.schedule
        motion = nominal_motion(lambda time: float(schedule.reference(time)), self.station)
        return np.clip(motion.volts, 0.0, 10.0)

    @property
    def _samples(self) -> Array:
        """Times of the dissertation's samples (s)."""
        return SAMPLE_TIME * np.arange(round(self.station.task.schedule.duration / SAMPLE_TIME) + 1)

    def _interpolated(self, samples: Array, times: Array, interpolation: Interpolation) -> Array:
        if interpolation == "foh":
            return np.interp(times, self._samples, samples)
        return samples[np.searchsorted(self._samples, times + 1e-9, side="right") - 1]

    def _mapped(self, times: Array, faults: frozenset[str], compensated: bool) -> Array:
        """Voltages at times, as continuous time or as samples of it (V)."""
        motion = self._motion(times, faults)
        wanted = motion.extension
        if compensated:
            wanted = wanted + self._lag(motion.extension, faults) * motion.speed
        if "chatter" in faults:
            chatter = self._radius(faults) * self._chatter
            wanted = wanted + np.interp(times, self._samples, chatter)
        for name, (nodes, force) in self._memories.items():
            if name not in faults:
                held = np.interp(times, nodes, force)
                wanted = wanted + held / self.statics.stiffness(motion.extension)
        volts = self.statics.voltage(wanted, self._map(faults))
        # The recursion begins at rest, and no displacement takes no voltage.
        return np.where(wanted == 0.0, 0.0, volts)

    def _lag(self, extension: Array, faults: frozenset[str]) -> Array:
        """Time constant that is made up for (s), shape of extension."""
        if "lag" in faults:
            return np.full(len(extension), 1.0 / self.profile.muscle_rate)
        return self._damping / self.statics.stiffness(extension)

    @cached_property
    def _damping(self) -> float:
        """Damping coefficient of muscle and rotor as seen at the slide (N s/m)."""
        muscle = Muscle(self.smooth, self.smooth.settle(0.0, pressure=self.station.pressure))
        speed, middle = 5e-3, 0.5 * float(self.statics.extension[-1])
        difference = muscle.tension(middle, speed) - muscle.tension(middle, -speed)
        return difference / (2.0 * speed) + self.rotor.damping / self.rotor.radius**2

    def _radius(self, faults: frozenset[str]) -> float:
        """From rotation to extension (m/rad), or 1."""
        if not self.rotation:
            return 1.0
        return PROFILE_RADIUS if "pulley" in faults else self.rotor.radius

    def _motion(self, times: Array, faults: frozenset[str]) -> Motion:
        """What is wanted; at t = 0 still at rest."""
        radius, before = self._radius(faults), 1e-6
        reference = self.station.task.schedule.reference
        extension = radius * reference(times)
        speed = (extension - radius * reference(times - before)) / before
        if self.rotation:
            extension, speed = self._pulled(extension, speed, faults)
        return Motion(extension, speed)

    def _pulled(self, wound: Array, speed: Array, faults: frozenset[str]) -> tuple[Array, Array]:
        """Extension and speed (m, m/s) of a muscle whose cable is wound in so far."""
        slack = 0.0 if "slack" in faults else self.cable.slack
        compliance = 0.0 if "stretch" in faults else 1.0 / self.cable.stiffness
        reached = self.statics.extension
        # The static curve stands still below the voltage that begins to pull.
        moves = np.append(np.diff(reached) > 0.0, True)
        cable = reached + self.statics.load * compliance + slack
        extension = np.interp(wound, cable[moves], reached[moves])
        share = 1.0 / (1.0 + self.statics.stiffness(extension) * compliance)
        return extension, np.where(wound >= slack, share, 0.0) * speed

    @cached_property
    def _chatter(self) -> Array:
        """What the recursion's inverse adds to y + y' / A at its samples (m), for a radius of 1."""
        wanted, rate = self.station.task.schedule.reference(self._samples), self.profile.muscle_rate
        transfer = cascade_transfer(rate, MOTOR_RATE)
        given = inverse_recursion(wanted, tustin_recursion(transfer, SAMPLE_TIME))
        return given - wanted - np.diff(wanted, prepend=0.0) / SAMPLE_TIME / rate

    @cached_property
    def _fit(self) -> Array:
        """Extension (m) by the unrounded fit at `GRID_V`."""
        return fitted_quadratic(self.station.pressure / 1e3).displacement(GRID_V)

    def _map(self, faults: frozenset[str]) -> Array:
        """Extension (m) that the feed-forward expects at `GRID_V`."""
        expected = self.statics.extension.copy()
        if "static misfit" in faults:
            expected += self._fit - self.statics.extension
        if "rounding" in faults:
            expected += self.profile.quadratic.displacement(GRID_V) - self._fit
        return expected

    @cached_property
    def _memories(self) -> dict[str, tuple[Array, Array]]:
        """Times (s), and forces of hysteresis and dry friction there on the ideal motion (N)."""
        nodes = NODE_S * np.arange(round(self.station.task.duration / NODE_S) + 1)
        motion = self._motion(nodes, frozenset())
        frictionless = Plant(without(self.plant.model, "dry friction"))
        plants = (self.plant, frictionless, self.smooth)
        muscles = [Muscle(p, p.settle(0.0, pressure=self.station.pressure)) for p in plants]
        tension = np.zeros((len(muscles), len(nodes)))
        for k, way in enumerate(zip(motion.extension.tolist(), motion.speed.tolist(), strict=True)):
            for muscle, row in zip(muscles, tension, strict=True):
                muscle.remember(*way, NODE_S)
                row[k] = muscle.tension(*way)
        # The smooth muscle begins where it is without hysteresis, the statics where it is with.
        bare = Statics(self.smooth, self.station.pressure)
        tension[-1] += self.statics.force(motion.extension) - bare.force(motion.extension)
        friction, hysteresis = -np.diff(tension, axis=0)
        return {"hysteresis": (nodes, hysteresis), "dry friction": (nodes, friction)}
