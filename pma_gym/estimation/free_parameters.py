"""Parameters of a model that a fit may change."""

from collections.abc import Sequence
from dataclasses import dataclass

from pma_gym.plant import sensors
from pma_gym.plant.model import Model, ModelError
from pma_gym.plant.program import parameter_names
from pma_gym.units import Quantity


@dataclass(frozen=True)
class FreeParameter:
    """A free parameter of a fit.

    Attributes:
        path: `effect.parameter_unit`, as in `Model.paths`.
        name: `effect.parameter`, without a unit.
        place: its index in the vector of the compiled functions.
        quantity: its unit and bounds.
    """

    path: str
    name: str
    place: int
    quantity: Quantity


def free_parameters(model: Model, paths: Sequence[str]) -> list[FreeParameter]:
    """Look up the free parameters of a model by their paths.

    Raises:
        ModelError: a path that the model does not have, a row of numbers or a sensor's noise.
    """
    names, parameters = parameter_names(model), []
    # Its message names the nearest that there is.
    model.replace({path: 0.0 for path in paths if path not in set(model.paths())})
    for path in paths:
        effect, _, file_key = path.partition(".")
        law = model.effects[effect]
        stem = law.names_in_files()[file_key]
        if stem in law.rows or (effect in sensors.SENSORS and stem == "noise"):
            raise ModelError(
                f"{path} cannot be fitted: it is "
                + ("a row of numbers" if stem in law.rows else "what residuals are counted in")
            )
        name = f"{effect}.{stem}"
        place = 1 + names.index(name)
        parameters.append(FreeParameter(path, name, place, law.quantities[stem]))
    return parameters
