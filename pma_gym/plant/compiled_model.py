"""A model's compiled equations of motion: rates and outputs of given states."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pma_gym.effects import Effect
from pma_gym.effects.effect import Parameters
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.program import program, table, vector

DEFAULT_TOLERANCE = 2.3e-4
"""Default of the largest error of an internal step, relative to the states' scales.
`tests/integrator` holds the resulting error against scipy at rtol 1e-11 to limits."""


class CompiledModel:
    """A model's equations of motion, compiled.

    Args:
        model: a Model, the name of a shipped one, or the path of a TOML file.
        tolerance: largest error of an internal step, relative to the scales of the states; the
            positions of a station are held to 0.1 % of it.

    Attributes:
        model: the Model.
        tolerance: the tolerance.
        program: the compiled functions of all models of this structure.
        vector: tolerance and parameters, as the compiled functions read them.
        table: the model's constants, as the compiled functions read them.
        states: names of the states, in the order of the state vector.
        signals: the measured signals of the rig, in the order of outputs.
        outputs: names of the true outputs; of a station contraction (m), rotation (rad), load (N),
            pressure (Pa).
    """

    def __init__(
        self, model: str | Path | Model = "serres2008", tolerance: float = DEFAULT_TOLERANCE
    ) -> None:
        """Compile the model's equations, or load them from the cache.

        Raises:
            ModelError: an unknown or invalid model.
            ValueError: an invalid tolerance.
        """
        check_tolerance(tolerance)
        self.model = load_model(model)
        self.tolerance = tolerance
        self.program = program(self.model)
        self.states = list(self.program.states)
        self.vector = vector(self.model, tolerance)
        self.table = table(self.program, self.vector)
        self.signals, self.outputs = self.model.rig.signals, self.model.rig.outputs
        lags = [f"lag_{signal.sensor}" for signal in self.signals]
        self.sensor_columns = [self.states.index(lag) if lag in self.states else -1 for lag in lags]

    def __reduce__(self) -> "tuple[type[CompiledModel], tuple[Model, float]]":
        """Copy and pickle by construction, because compiled functions belong to one process."""
        return type(self), (self.model, self.tolerance)

    @property
    def effects(self) -> Mapping[str, Effect]:
        """The model's effects by name."""
        return self.model.effects

    @property
    def parameters(self) -> Mapping[str, Parameters]:
        """The effects' parameters (SI) by name."""
        return self.model.parameters

    def _repr_html_(self) -> str:
        """Table of the model and the plant's states for notebooks."""
        states = f"<p>States: {', '.join(self.states)}</p>"
        return self.model._repr_html_() + states

    def regulator_voltage(self, pressure: float) -> float:
        """Regulator voltage (V) for a steady pressure (Pa).

        Raises:
            ValueError: if the regulator would need less than 0 or more than 10 V.
        """
        return regulator_voltage(self.model, pressure)

    def derivative(
        self,
        state: np.ndarray,
        motor_voltage: float | np.ndarray,
        regulator_voltage: float | np.ndarray,
        zero_contraction: float,
    ) -> np.ndarray:
        """Time derivative of the state vector (SI per s), or of many, shape (rows, states)."""
        state = np.ascontiguousarray(state, float)
        inputs, out = np.empty((*state.shape[:-1], 3)), np.empty_like(state)
        columns = motor_voltage, regulator_voltage, zero_contraction
        for i, values in enumerate(columns):
            inputs[..., i] = values
        addresses = (a.ctypes.data for a in (state, inputs, self.vector))
        self.program.derivative(out.size // len(self.states), *addresses, 0, out.ctypes.data)
        return out

    def observe(self, states: np.ndarray, zero_contraction: float) -> dict[str, np.ndarray]:
        """True outputs of states.

        Args:
            states: shape (rows, states).
            zero_contraction: contraction x0, the zero of extension (m).
        Returns:
            Measured quantities and those relative to the trial's start (SI), shape (rows,) each:
            for a station contraction, rotation, load, pressure and extension.
        """
        states = np.ascontiguousarray(states, float)
        out = np.empty((states.shape[0], len(self.outputs)))
        addresses = (a.ctypes.data for a in (self.vector, out))
        self.program.observe(len(states), states.ctypes.data, zero_contraction, *addresses)
        truth = {name: out[:, i] for i, name in enumerate(self.outputs)}
        counted = {
            each.reading: zero_contraction - truth[each.name]
            for each in self.signals
            if each.reading
        }
        return truth | counted


def regulator_voltage(model: Model, pressure: float) -> float:
    """Regulator voltage (V) of a model for a steady pressure (Pa).

    Raises:
        ValueError: the rig has no regulator, or the regulator would need less than 0 or more than
            10 V.
    """
    line = model.parameters.get("regulator_line")
    if line is None:
        raise ValueError(
            f"model {model.name} is of a {model.plant} without a regulator, so that no pressure "
            f"can be set, got {pressure / 1e3:g} kPa; leave the pressure out"
        )
    voltage = (pressure - line.offset) / line.gain
    if not 0.0 <= voltage <= 10.0:
        low, high = max(0.0, line.offset), 10.0 * line.gain + line.offset
        raise ValueError(
            f"pressure must lie in {low / 1e3:g} to {high / 1e3:g} kPa, what the regulator "
            f"reaches with 0-10 V; got {pressure / 1e3:g} kPa; give another pressure, or a model "
            "whose regulator reaches it"
        )
    return voltage


def check_tolerance(tolerance: object) -> None:
    """Reject an invalid tolerance of the integrator.

    Raises:
        ValueError: the tolerance is not a number, or is too small or too large.
    """
    # `not`: NaN is out of every range, as is true or false.
    if not (isinstance(tolerance, int | float | np.floating) and 1e-10 <= tolerance <= 0.1):
        raise ValueError(
            f"tolerance must be a share in 1e-10 to 0.1 of the states' scales, got "
            f"{tolerance!r}; the default is {DEFAULT_TOLERANCE:g}"
        )
