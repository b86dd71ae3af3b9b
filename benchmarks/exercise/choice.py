"""Choice of configurations to show and search: given values, common sizes for the rest."""

from dataclasses import dataclass
from itertools import product

from pma_gym.numerals import parse_numbers
from pma_gym.plant.exercise_device.device import RADIUS, Device, MusclesError, muscles, own_device
from pma_gym.plant.model import Model

SEARCHED = {"muscles": range(1, 7), "diameter": (10, 20, 40), "length": (150, 200, 250, 300, 400)}
"""Numbers, diameters and lengths (mm) among which the smallest is sought: the diameters are those
that Festo has (Serres 2008, 1.2.1.4), the others our choice."""

SHOWN = {"muscles": (1, 2, 3), "diameter": (10, 20, 40), "length": (250,)}
"""The same for the tables and the picture, where nothing else is asked for."""


class ChoiceError(ValueError):
    """Options that cannot be used; says which, the rule and the fix."""


@dataclass(frozen=True)
class Choice:
    """The options as given: numbers by commas, or empty.

    Attributes:
        muscles: how many.
        diameter: of each (mm).
        length: of each (mm).
        radius: of the pulley (mm).
    """

    muscles: str = ""
    diameter: str = ""
    length: str = ""
    radius: str = ""

    def shown(self, model: Model) -> list[Device]:
        """The configurations of tables and picture, smallest first.

        Raises:
            ChoiceError: no number, or one out of bounds.
        """
        return self._devices(model, SHOWN)

    def searched(self, model: Model) -> list[Device]:
        """The configurations that a prescription chooses from; errors as `shown`."""
        return self._devices(model, SEARCHED)

    def _devices(self, model: Model, common: dict) -> list[Device]:
        own = RADIUS.from_si(own_device(model).radius)
        defaults = {**common, "radius": (own,)}
        options = [
            numbers(name, getattr(self, name)) or default for name, default in defaults.items()
        ]
        try:
            return sorted({_device(*each) for each in product(*options)})
        except MusclesError as error:
            raise ChoiceError(f"--{error}") from None


def _device(number: float, diameter: float, length: float, radius: float) -> Device:
    try:
        RADIUS.check("radius", radius)
    except ValueError as error:
        raise ChoiceError(f"--{error}") from None
    return Device(muscles(number, diameter, length), RADIUS.to_si(radius))  # type: ignore[arg-type]


def numbers(option: str, text: str) -> list[float]:
    """The numbers of an option; none if it is empty.

    Args:
        option: its name, for messages.
        text: as given.
    Raises:
        ChoiceError: something in it is no number.
    """
    values = parse_numbers(text)
    if values is None:
        raise ChoiceError(
            f"--{option} must be a number, or several by commas, got {text!r}; for example "
            f"--{option} {'1,2' if option == 'muscles' else '20,40'}"
        )
    return values
