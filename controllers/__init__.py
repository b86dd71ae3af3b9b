"""Controllers of the benchmark, each a short file; `CONTROLLERS` lists them by name."""

from collections.abc import Callable

from controllers.controller import Controller, Reference
from controllers.feedforward import ImprovedFeedforward, SerresFeedforward, SerresReplay
from controllers.pid import PID, FeedforwardPID

CONTROLLERS: dict[str, Callable[[], Controller]] = {
    "serres_replay": SerresReplay,
    "serres_feedforward": SerresFeedforward,
    "improved_feedforward": ImprovedFeedforward,
    "pid": PID,
    "feedforward_pid": FeedforwardPID,
}
"""Controllers by name: what makes a new one. A controller listed here is scored."""

__all__ = [
    "CONTROLLERS",
    "PID",
    "Controller",
    "FeedforwardPID",
    "ImprovedFeedforward",
    "Reference",
    "SerresFeedforward",
    "SerresReplay",
]
