"""Controllers of the benchmark, each a short file; `CONTROLLERS` lists them by name."""

from collections.abc import Callable

from controllers.adrc import ADRC
from controllers.controller import Controller, Reference
from controllers.exercise.exercise_mpc import ExerciseMPC
from controllers.exercise.moment_pid import MomentPID
from controllers.exercise.scheduled_pressure import ConstantPressure, ScheduledPressure
from controllers.exercise.speed_pid import SpeedPID
from controllers.ilc import ILC
from controllers.improved_feedforward import ImprovedFeedforward, SerresFeedforward, SerresReplay
from controllers.lqg import LQG
from controllers.mpc import PreviewMPC
from controllers.oracle import Oracle
from controllers.pid import PID, FeedforwardPID
from controllers.policy import Policy, PPOPolicy, ShippedPolicy
from controllers.policy_with_ilc import PractisedPolicy
from controllers.sliding_mode import SlidingMode

CONTROLLERS: dict[str, Callable[[], Controller]] = {
    "serres_replay": SerresReplay,
    "serres_feedforward": SerresFeedforward,
    "improved_feedforward": ImprovedFeedforward,
    "pid": PID,
    "feedforward_pid": FeedforwardPID,
    "lqg": LQG,
    "adrc": ADRC,
    "sliding_mode": SlidingMode,
    "mpc": PreviewMPC,
    "ilc": ILC,
    "ppo": PPOPolicy,
    "ppo_ilc": PractisedPolicy,
    "oracle": Oracle,
    "constant_pressure": ConstantPressure,
    "scheduled_pressure": ScheduledPressure,
    "speed_pid": SpeedPID,
    "moment_pid": MomentPID,
    "exercise_mpc": ExerciseMPC,
}
"""Controllers by name: what makes a new one. A controller listed here is scored."""

__all__ = [
    "ADRC",
    "CONTROLLERS",
    "ILC",
    "LQG",
    "PID",
    "ConstantPressure",
    "Controller",
    "FeedforwardPID",
    "ImprovedFeedforward",
    "MomentPID",
    "Oracle",
    "PPOPolicy",
    "Policy",
    "PractisedPolicy",
    "PreviewMPC",
    "Reference",
    "ScheduledPressure",
    "SerresFeedforward",
    "SerresReplay",
    "ShippedPolicy",
    "SlidingMode",
    "SpeedPID",
]
