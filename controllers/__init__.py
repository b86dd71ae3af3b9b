"""Controllers of the benchmark, one a file; `CONTROLLERS` lists them by name."""

from controllers.adrc import ADRC
from controllers.exercise.exercise_mpc import ExerciseMPC
from controllers.exercise.moment_pid import ConstantPressure, MomentPID, ScheduledPressure
from controllers.exercise.speed_pid import SpeedPID
from controllers.ilc import ILC
from controllers.lqg import LQG
from controllers.mpc import PreviewMPC
from controllers.oracle import Oracle
from controllers.pid import PID, FeedforwardPID
from controllers.policy import Policy, PPOPolicy, ShippedPolicy
from controllers.policy_with_ilc import PolicyWithILC
from controllers.registry import CONTROLLERS, Controller, Reference
from controllers.serres_feedforward import ImprovedFeedforward, SerresFeedforward, SerresReplay
from controllers.sliding_mode import SlidingMode

__all__ = [
    "ADRC",
    "CONTROLLERS",
    "ILC",
    "LQG",
    "PID",
    "ConstantPressure",
    "Controller",
    "ExerciseMPC",
    "FeedforwardPID",
    "ImprovedFeedforward",
    "MomentPID",
    "Oracle",
    "PPOPolicy",
    "Policy",
    "PolicyWithILC",
    "PreviewMPC",
    "Reference",
    "ScheduledPressure",
    "SerresFeedforward",
    "SerresReplay",
    "ShippedPolicy",
    "SlidingMode",
    "SpeedPID",
]
