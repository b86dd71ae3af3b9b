"""PID with gains scheduled on pressure, alone and on top of the improved feed-forward.

PID on top of the improved feed-forward.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from controllers.design.designs import Gains, scheduled_gains
from controllers.models.voltage import VOLTAGE_LIMIT, nominal_offset
from controllers.registry import Reference
from pma_gym.codegen.elementary import clip
from pma_gym.codegen.generic import where
from pma_gym.envs import Measurement, StationInfo

if TYPE_CHECKING:
    import control
from typing import Protocol

from controllers.serres_feedforward import ImprovedFeedforward


class PID:
    """Proportional, integral and filtered derivative action on the measured position.

        v = offset + feed-forward + k_p e + I + D
        u = min(max(v, 0), 10 V)
        D:  tau_f D' + D = k_d e'                         backward Euler
        I:  I' = k_i e, or 0 where that would lead further beyond a limit   forward Euler

    e is the reference `lead` seconds ahead less the measured position, both of the time that the
    reading was taken at; `offset` the voltage at which the nominal drive just begins to pull, or at
    which the regulator holds the pressure, so that the first step has no bump.

    Anti-windup is conditional integration: at a limit the integral waits until the error turns.
    Back-calculation would lift it at 0 V whenever the drive cuts off a proportional action.

    On a ramp that needs the voltage to rise by V' the error e settles at V' / k_i. A lead of
    1 / (g k_i), g the plant's static gain, makes the position lag by nothing there. It uses that
    the reference is known ahead, and allows lower gains, which pass on less noise.

    The derivative is of the error: on a ramp that of the measurement alone would push against
    the motion all the time, which the integral would have to make good.

    Gains come from `controllers/design/gains.toml`, where `benchmarks/tuning/tune.py` wrote them:
    of the nearest loop (control rate and delay) and the kind of task, linear in pressure between
    the pressures that it tuned at and constant beyond, and varying with the reference
    (`Gains.scaled`). They are those under the model's name, else, for a model of one's own, those
    of the shipped model of its plant (`station`, `cascade`).

    Args:
        gains: gains to use instead of the scheduled ones, in SI of the task.

    Source:
        K. J. Astrom and T. Hagglund 2006, "Advanced PID Control", sections 3.3 and 3.5.
    """

    name = "pid"

    def __init__(self, gains: Gains | None = None) -> None:
        self._fixed_gains = gains
        self.gains = gains or Gains(0.0, 0.0, 0.0, 0.0)
        self._reference: Reference = lambda time: 0.0

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Select the gains for this model, task and pressure, and clear the controller's state.

        Raises:
            ValueError: nothing was tuned for this task, with how to do so.
        """
        self._reference = reference
        self._position, self._period = station.position, station.period
        self._span = station.task.schedule.span
        self.gains = self._fixed_gains or scheduled_gains(self.name, station)
        self._ahead = self.gains.lead - station.observation_delay
        self._offset = nominal_offset(station)
        self._integral = self._derivative = 0.0
        self._last_error: float | None = None

    def act(self, measurement: Measurement, time: float) -> float:
        """Voltage (V) of the task's actuator to hold for the next control period."""
        period, reference = self._period, self._reference(time + self._ahead)
        gains = self.gains.scaled(reference / self._span)
        error = reference - self._position(measurement)
        change = 0.0 if self._last_error is None else error - self._last_error
        base = self._offset + self.feedforward(time)
        memories = self._integral, self._derivative
        voltage, memories = pid_law(gains, (error, change), base, memories, period)
        self._integral, self._derivative = memories
        self._last_error = error
        return voltage

    def feedforward(self, time: float) -> float:
        """Voltage added to that of the feedback (V); none here."""
        return 0.0

    def linear(self, station: StationInfo, position: float) -> "control.StateSpace":
        """The feedback near a position (m or rad), without limits: volts by error."""
        import control

        gains = self._fixed_gains or scheduled_gains(self.name, station)
        law = linear_law(gains.scaled(position / station.task.schedule.span), station.period)
        return control.StateSpace(*law, station.period)


def pid_law(
    gains: Gains,
    errors: tuple[Any, Any],
    base: float,
    memories: tuple[Any, Any],
    period: float,
) -> tuple[Any, tuple[Any, Any]]:
    """Voltage (V) of one control step, of numbers or traced values, and the memories after it.

    Args:
        gains: in force.
        errors: of the position (m or rad), and its change since the step before.
        base: offset and feed-forward (V).
        memories: I and D (V).
        period: control period (s).
    """
    (error, change), (integral, derivative) = errors, memories
    derivative = (gains.filter * derivative + gains.derivative * change) / (gains.filter + period)
    unclipped = base + (gains.proportional * error + integral + derivative)
    voltage = clip(unclipped, 0.0, VOLTAGE_LIMIT)
    grows = (voltage == unclipped) | ((unclipped > voltage) ^ (error > 0.0))
    integral = integral + where(grows, gains.integral * period * error, 0.0)
    return voltage, (integral, derivative)


def linear_law(
    gains: Gains, period: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A, B, C, D of the PID between the limits: voltage (V) by error (m or rad).

        C(z) = k_p + k_i T / (z - 1) + k_d (z - 1) / ((tau_f + T) z - tau_f)

    Args:
        gains: in force at the place, see `Gains.scaled`.
        period: control period T (s).
    """
    total = gains.filter + period
    share, slope = gains.filter / total, gains.derivative / total
    a, c = np.diag([1.0, share]), np.ones((1, 2))
    b = np.array([[gains.integral * period], [(share - 1.0) * slope]])
    return a, b, c, np.array([[gains.proportional + slope]])


class OpenLoop(Protocol):
    """What gives a voltage by time alone, such as `ImprovedFeedforward`."""

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Prepare for a trial."""

    def voltage(self, time: float) -> float:
        """Motor voltage (V) at a time (s)."""
        ...


class FeedforwardPID(PID):
    """`ImprovedFeedforward` plus a PID on what error remains; gains of their own.

    The integral need not carry the motion itself, only what the nominal model does not know. The
    anti-windup sees the whole voltage.

    Args:
        gains: as `PID`.
        open_loop: another feed-forward to add.
    """

    name = "feedforward_pid"

    def __init__(self, gains: Gains | None = None, open_loop: OpenLoop | None = None) -> None:
        super().__init__(gains)
        self._open_loop = open_loop or ImprovedFeedforward()

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """As `PID.reset`, and compute the feed-forward, which holds the drive's offset itself."""
        super().reset(reference, station)
        self._open_loop.reset(reference, station)
        self._offset, self._delay = 0.0, station.action_delay

    def feedforward(self, time: float) -> float:
        """Voltage of the feed-forward (V) that is due when a command of now is in force."""
        return self._open_loop.voltage(time + self._delay)
