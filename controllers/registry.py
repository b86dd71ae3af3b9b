"""The controllers by name: one row for each, and a row is all that a new one needs here."""

from collections import UserDict
from collections.abc import Callable
from importlib import import_module
from typing import Any

from controllers.controller import Controller

ENTRY_POINTS = {
    "serres_replay": "controllers.serres_replay:SerresReplay",
    "serres_feedforward": "controllers.serres_feedforward:SerresFeedforward",
    "improved_feedforward": "controllers.improved_feedforward:ImprovedFeedforward",
    "pid": "controllers.pid:PID",
    "feedforward_pid": "controllers.feedforward_pid:FeedforwardPID",
    "lqg": "controllers.lqg:LQG",
    "adrc": "controllers.adrc:ADRC",
    "sliding_mode": "controllers.sliding_mode:SlidingMode",
    "mpc": "controllers.mpc:PreviewMPC",
    "ilc": "controllers.ilc:ILC",
    "ppo": "controllers.policy:PPOPolicy",
    "ppo_ilc": "controllers.policy_with_ilc:PolicyWithILC",
    "oracle": "controllers.oracle:Oracle",
    "constant_pressure": "controllers.exercise.constant_pressure:ConstantPressure",
    "scheduled_pressure": "controllers.exercise.scheduled_pressure:ScheduledPressure",
    "speed_pid": "controllers.exercise.speed_pid:SpeedPID",
    "moment_pid": "controllers.exercise.moment_pid:MomentPID",
    "exercise_mpc": "controllers.exercise.exercise_mpc:ExerciseMPC",
}
"""Name, and `module:class` of what makes a new controller, in the order of tables and reports."""


class ControllerRegistry(UserDict[str, Callable[[], Controller]]):
    """Mapping of a name to what makes a new controller of it.

    Rows name a class, as Gymnasium's entry points do. The class is imported when it is first asked
    for, so a policy's file can name the controller that its action is added to without an import
    cycle.

    >>> CONTROLLERS["pid"]().name
    'pid'
    """

    data: dict[str, Any]

    def __getitem__(self, name: str) -> Callable[[], Controller]:
        """The class of a name.

        Raises:
            KeyError: no controller of that name.
        """
        entry = self.data[name]
        if isinstance(entry, str):
            module, _, attribute = entry.partition(":")
            entry = self.data[name] = getattr(import_module(module), attribute)
        return entry


CONTROLLERS = ControllerRegistry(ENTRY_POINTS)  # type: ignore[arg-type] - rows become classes
"""Controllers by name: what makes a new one."""
