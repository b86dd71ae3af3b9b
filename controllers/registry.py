"""The controllers by name: one row for each, and a row is all that a new one needs here.

What a controller has: `reset` with the reference and the station, `act` for each voltage.
"""

from collections import UserDict
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from pma_gym.envs import Measurement, StationInfo

if TYPE_CHECKING:
    import control


Reference = Callable[[float], float]
"""Reference by time: extension (m) or rotation (rad) at a time since the trial began (s)."""


@runtime_checkable
class Controller(Protocol):
    """Anything with a name, `reset` and `act`.

    A controller may keep what it needs between calls; `reset` makes it new. It never sees the
    plant, only what the station's sensors say. One that can do some kinds of task only
    (`controllers.design.designs.kind_of`) may have them as an attribute `kinds`; one that runs a
    shipped policy has its algorithm's name as an attribute `algorithm`, so that a comparison's
    journal knows that its scores depend on that policy's files.
    """

    name: str

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Prepare for a trial.

        Args:
            reference: what to follow, known ahead.
            station: nominal model, task, pressure, control period.
        """

    def act(self, measurement: Measurement, time: float) -> float:
        """Voltage of the task's actuator (V, 0-10) to hold for the next control period.

        Args:
            measurement: what the sensors say (SI).
            time: time since the trial began (s).
        """
        ...


@runtime_checkable
class LinearController(Controller, Protocol):
    """A controller whose feedback is linear between the voltage's limits.

    `linear` says what it does near a place of the stroke, so that the margins of its loop can be
    computed. Terms that do not depend on the measurement (feed-forward, filters on the reference)
    are left out: they move no margin.
    """

    def linear(self, station: StationInfo, position: float) -> "control.StateSpace":
        """The feedback near a position: voltage (V) by error (m or rad).

        In discrete time, one input, one output, sampled at `station.period`, such that the loop of
        plant and controller is closed by negative feedback: for a controller that reads the
        measured position y, the voltage's response to -y. Delays of the station belong to the
        plant, unless the controller itself waits. Needs no `reset`.

        Args:
            station: the station as the controller knows it.
            position: where on the stroke (m or rad).
        """
        ...


ENTRY_POINTS = {
    "serres_replay": "controllers.serres_feedforward:SerresReplay",
    "serres_feedforward": "controllers.serres_feedforward:SerresFeedforward",
    "improved_feedforward": "controllers.serres_feedforward:ImprovedFeedforward",
    "pid": "controllers.pid:PID",
    "feedforward_pid": "controllers.pid:FeedforwardPID",
    "lqg": "controllers.lqg:LQG",
    "adrc": "controllers.adrc:ADRC",
    "sliding_mode": "controllers.sliding_mode:SlidingMode",
    "mpc": "controllers.mpc:PreviewMPC",
    "ilc": "controllers.ilc:ILC",
    "ppo": "controllers.policy:PPOPolicy",
    "ppo_ilc": "controllers.policy_with_ilc:PolicyWithILC",
    "oracle": "controllers.oracle:Oracle",
    "constant_pressure": "controllers.exercise.moment_pid:ConstantPressure",
    "scheduled_pressure": "controllers.exercise.moment_pid:ScheduledPressure",
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
