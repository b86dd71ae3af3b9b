"""Interface of hidden effects; each method does nothing unless an effect overrides it."""

from dataclasses import dataclass

from benchmarks.hidden_effects.physics.rig import Array, Numbers


@dataclass
class Moment:
    """The rig in the middle of a step, one number a lane (SI).

    Attributes:
        step: size of the step (s).
        rig: true parameters.
        resting: contraction with no load at the first pressure.
        order: how many trials were made before this one.
        contraction: of the muscle.
        velocity: its rate at the beginning of the step.
        angle: of the pulley.
        spin: its rate at the beginning of the step.
        pressure: in the muscle.
        asked: pressure asked for.
        tension: of the cable, one step ago.
        load: that the drive gives.
    """

    step: float
    rig: Numbers
    resting: Array
    order: Array
    contraction: Array
    velocity: Array
    angle: Array
    spin: Array
    pressure: Array
    asked: Array
    tension: Array
    load: Array


class Hidden:
    """An effect at work in all lanes at once; where its size is 0 it changes nothing.

    Attributes:
        static: whether `force` has no memory and holds at rest too.
    """

    static = False

    def begin(self, moment: Moment) -> None:
        """Set memories for a rig at rest."""

    def motor_delay(self) -> Array | float:
        """Time (s) by which the motor's command is late."""
        return 0.0

    def regulator_delay(self) -> Array | float:
        """Time (s) by which the regulator's command is late."""
        return 0.0

    def loads(self, loads: Array, step: float) -> Array:
        """Loads (N) of a drive that asks for these, shape (steps, lanes)."""
        return loads

    def pressures(self, asked: Array, step: float) -> Array:
        """Pressures (Pa) asked for of the valve, shape (steps, lanes)."""
        return asked

    def flow(self, rate: Array, moment: Moment) -> Array:
        """Rate of the pressure (Pa/s) that the regulator brings about."""
        return rate

    def chamber(self, moment: Moment) -> Array | float:
        """Rate of the pressure (Pa/s) beside that."""
        return 0.0

    def damping(self, moment: Moment) -> Array | float:
        """Factor on the damping."""
        return 1.0

    def force(self, moment: Moment) -> Array | float:
        """Force (N) on the slide, positive where it shortens the muscle."""
        return 0.0

    def pull(self, moment: Moment) -> Array | float:
        """Load (N) at the pulley beside the drive's."""
        return 0.0

    def slack(self) -> Array | float:
        """Cable (m) to wind in before it pulls."""
        return 0.0

    def bandwidths(self, bandwidths: Array) -> Array:
        """Bandwidths (Hz) of the sensors, shape (4, lanes)."""
        return bandwidths

    def sensed(self, signals: list[Array], step: float) -> list[Array]:
        """What the sensors stand on, four of shape (steps, lanes) (SI)."""
        return signals

    def shown(self, readings: Array) -> Array:
        """Readings as a sensor shows them, noise and all, shape (lanes, rows, 4) (SI)."""
        return readings
