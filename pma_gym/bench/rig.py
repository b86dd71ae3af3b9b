"""What the loop needs of a rig."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol


class RigError(ValueError):
    """The rig, its line or a command breaks a rule; the loop ends and the rig is made safe."""


class Sample(NamedTuple):
    """What a rig measured at one instant.

    Attributes:
        time: of the measurement, by the rig's clock (s).
        commands: in force then, in the units of their columns, in the rig's order.
        values: measurements, in the units of their columns, in the rig's order.
        command_time: when the last command came into force, by the rig's clock (s).
    """

    time: float
    commands: Sequence[float]
    values: Sequence[float]
    command_time: float


class Rig(Protocol):
    """A rig: arm, measure, command, make safe."""

    def arm(self) -> None:
        """Leave the safe state; commands stay as they are until the first one.

        Raises:
            RigError: no answer in time, or the rig refuses.
        """
        ...

    def read(self) -> Sample:
        """Measure now.

        Raises:
            RigError: no answer in time, or the rig is in its safe state.
        """
        ...

    def write(self, command: Sequence[float]) -> None:
        """Command values, in the units and order of the columns, until the next ones."""

    def safe(self) -> None:
        """Bring the rig into its safe state; never raises, for the rig's watchdog does it too."""
