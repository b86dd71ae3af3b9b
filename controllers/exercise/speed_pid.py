"""PID on the joint's speed, for an exercise of one speed."""

from typing import NamedTuple

from controllers.exercise.resistance import Arrival, JointSpeed, Resistance, exercise_of, volts_of
from controllers.registry import Reference
from pma_gym.envs import Measurement, StationInfo


class SpeedGains(NamedTuple):
    """Gains in SI, as moments at the joint; tuned on operators of seeds from 1000000 on.

    Attributes:
        speed: moment let go for each rad/s that the joint is too slow, k_w (N m s/rad).
        angle: for each rad that it is behind, k_a (N m/rad).
        sum: growth of the moment for each rad that it is behind, k_s (N m/(rad s)).
        filter: time constant of the speed's filter (s).
        lead: how far ahead of its time the reference is followed (s): regulator and leg are late.
    """

    speed: float = 10.0
    angle: float = 60.0
    sum: float = 20.0
    filter: float = 0.015
    lead: float = 0.11


class SpeedPID:
    """Lowers the pressure where the joint is too slow, raises it where it is too fast.

        M = k_w (w_ref - w) + k_a (theta_ref - theta) + S,   S' = k_s (theta_ref - theta)
        P = P_0 - M / h

    P_0 is the trial's first pressure, h the change of the nominal device's moment by the pressure
    where pressure and angle are (`Resistance`): the loop's gain is then the same everywhere. The
    integral of the speed's error is the angle's error, so in the angle this is a PID whose
    derivative is the speed. An acceleration, the derivative of the speed, made it worse.

    The speed comes from the extension, which is finer than the angle, through a filter of the first
    order; the angle from the potentiometer, for the cable stretches.

    The sum waits while the pressure does not come to what was commanded (`Arrival`): the regulator
    gives no more, or the environment's safety layer lets no more through. Else it would grow all
    the time that a slow operator needs to catch up: without it errors are 16, 47 and 6 %
    larger by phase (48 operators of seeds from 7000000 on, nominal station).

    Args:
        gains: its gains.

    Source:
        Our own; gains were found by random search and rounded.
    """

    name = "speed_pid"
    kinds = ("isokinetic",)

    def __init__(self, gains: SpeedGains | None = None) -> None:
        self.gains = gains or SpeedGains()

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Begin at rest, at the trial's first pressure.

        Raises:
            ValueError: the task does not prescribe the speed.
        """
        exercise_of(self.name, station, prescribed=False)
        self._reference, self._volts = reference, volts_of(station)
        self._period, self._first = station.period, station.pressure
        self._ahead = self.gains.lead - station.observation_delay
        self._device, self._arrival = Resistance(station), Arrival(station)
        self._speed = JointSpeed(station, self.gains.filter)
        self._sum = 0.0

    def act(self, measurement: Measurement, time: float) -> float:
        """Regulator voltage (V)."""
        gains, due = self.gains, time + self._ahead
        target = self._reference(due)
        slow = (self._reference(due + self._period) - target) / self._period
        slow -= self._speed.update(measurement)
        behind = target - measurement.rotation
        moment = gains.speed * slow + gains.angle * behind + self._sum
        local = self._device.at(measurement.pressure, measurement.rotation)
        pressure = self._first - moment / local.influence
        if not self._arrival.is_saturated(measurement.pressure, -behind):
            self._sum += gains.sum * self._period * behind
        self._arrival.command(pressure)
        return self._volts(pressure)
