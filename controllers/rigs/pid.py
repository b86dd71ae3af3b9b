"""PID on any rig's lever, alone and on top of the feed-forward."""

from collections.abc import Sequence

from controllers.rigs.feedforward import Feedforward
from controllers.rigs.nominal_rig import NominalRig
from controllers.rigs.rig_controller import Lever, RigController, RigMeasurement
from pma_gym.envs import RigInfo

FILTER_PERIODS = 2.0
"""Time constant of the derivative's filter, in control periods."""


class RigPID(RigController):
    """Proportional, integral and filtered derivative action on the task's signal.

        s = k_p e + I + D       lever of -1 to 1, e in shares of the task's range

    The integral waits where the lever is at an end and it would lead further.

    Source:
        K. J. Astrom and T. Hagglund 2006, "Advanced PID Control", sections 3.3 and 3.5.
    """

    name = "pid"
    settings = {"proportional": 2.0, "integral": 2.0, "derivative": 0.1}

    def reset(self, info: RigInfo) -> None:
        """Clear the state."""
        self._schedule, self._period = info.task.schedule, info.period
        self._late = info.observation_delay
        self.lever = self._lever(info)
        self._integral = self._derivative = 0.0
        self._before: float | None = None

    def _lever(self, info: RigInfo) -> Lever:
        return Lever(info, NominalRig(info))

    def feedforward(self, time: float) -> float:
        """Lever without feedback; at rest here."""
        return 0.0

    def act(self, measurement: RigMeasurement) -> Sequence[float]:
        """Commands (SI)."""
        schedule, period, gains = self._schedule, self._period, self.chosen
        target = schedule.at(measurement.time - self._late)
        error = (target - measurement.values[schedule.quantity]) / schedule.span
        change = 0.0 if self._before is None else error - self._before
        filter_s = FILTER_PERIODS * period
        self._derivative += (gains["derivative"] * change - period * self._derivative) / (
            filter_s + period
        )
        action = gains["proportional"] * error + self._integral + self._derivative
        whole = self.feedforward(measurement.time) + action
        share = min(max(whole, -1.0), 1.0)
        if share == whole or (whole > share) != (error > 0.0):
            self._integral += gains["integral"] * period * error
        self._before = error
        return self.lever.commands(share).tolist()


class FeedforwardPID(RigPID):
    """`Feedforward`, and a PID on what remains."""

    name = "feedforward_pid"

    def _lever(self, info: RigInfo) -> Lever:
        self._open_loop = Feedforward({})
        self._open_loop.reset(info)
        return self._open_loop.plan.lever

    def feedforward(self, time: float) -> float:
        """Lever of the plan."""
        return self._open_loop.share(time)
