"""What a controller is: told the reference and the station, then asked for volts."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from pma_gym.envs import Reading, Station

Reference = Callable[[float], float]
"""Reference by time: extension (m) or rotation (rad) at a time since the trial began (s)."""


@runtime_checkable
class Controller(Protocol):
    """Anything with a name, `reset` and `act`.

    A controller may keep what it needs between calls; `reset` makes it new. It never sees the
    plant, only what the station's sensors say.
    """

    name: str

    def reset(self, reference: Reference, station: Station) -> None:
        """Prepare for a trial.

        Args:
            reference: what to follow, known ahead.
            station: nominal model, task, pressure, control period.
        """

    def act(self, observation: Reading, time: float) -> float:
        """Motor voltage (V, 0-10) to hold for the next control period.

        Args:
            observation: what the sensors say (SI).
            time: time since the trial began (s).
        """
        ...
