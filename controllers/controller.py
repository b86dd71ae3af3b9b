"""What a controller has: `reset` with the reference and the station, `act` for each voltage."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol, runtime_checkable

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
