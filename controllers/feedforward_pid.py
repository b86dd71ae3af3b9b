"""PID on top of the improved feed-forward."""

from typing import Protocol

from controllers.design.designs import Gains
from controllers.improved_feedforward import ImprovedFeedforward
from controllers.pid import PID
from controllers.registry import Reference
from pma_gym.envs import StationInfo


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
