"""The whole station from tables I2 and I3: one call fits all that they tell."""

import math

import numpy as np

from benchmarks.identification import lines, statics
from benchmarks.identification.creep import CREEP, HELD, load_cycle_with_creep
from benchmarks.identification.measurements import StationLimits
from benchmarks.identification.transients import PressureSteps
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.parameter_rows import Note

TITLE = "The dissertation's station, identified from its tables I2 and I3"
CABLE_DAMPING_RATIO = 0.02
_REPLACED = ("contractile_force", "stiffness", "damping")
_ADDED: dict[str, dict[str, float]] = {
    "sarosi_force": {"resting_length_mm": 250.0},
    "pressure_curvature": {"resting_length_mm": 250.0},
    "symmetric_damping": {},
    "hysteresis": {},
    "regulator_asymmetry": {},
}


def template() -> Model:
    """serres2008 with the identified laws in place of the three-element model, not yet fitted."""
    base = load_model("serres2008")
    parameters = {n: v for n, v in base.parameters.items() if n not in _REPLACED}
    for effect, fixed in _ADDED.items():
        quantities = CATALOGUE[effect].names_in_files()
        values = {
            file_key: statics.PARAMETERS.get(f"{effect}.{file_key}", (0.0, 0.0))[0]
            for file_key in quantities
        }
        parameters[effect] = CATALOGUE[effect].parse(values | fixed)
    notes = {p: note for p, note in base.notes.items() if not p.startswith(_REPLACED)}
    fixed_note = Note("Serres 2008, section 2.1.2.1")
    for effect in ("sarosi_force", "pressure_curvature"):
        notes[f"{effect}.resting_length_mm"] = fixed_note
    return Model("station", TITLE, "station", parameters, notes)


def identify(
    data: StationLimits,
    steps: PressureSteps,
    start: dict[str, float] | None = None,
    creeps: bool = False,
) -> Model:
    """Fit everything that the tables tell of the station.

    Args:
        data: rows of I3.
        steps: rows of I2.
        start: values to start the static fit from.
        creeps: whether the model has a branch of creep (`creep`).
    Returns:
        The station's model.
    """
    values = lines.drive_line(data) | lines.regulator_line(data)
    values |= lines.pulley_parameters(lines.fit_pulley(data))
    model = template().replace(values)
    model = model.replace({"cable.damping_n_s_per_mm": cable_damping(model)})
    if not creeps:
        return statics.fit(model, data, steps, start)
    model = model.with_effects({"creep": {path.partition(".")[2]: v for path, v in HELD.items()}})
    return statics.fit(model, data, steps, start, CREEP, load_cycle_with_creep)


def cable_damping(model: Model) -> float:
    """Damping of the cable (N s/mm) at the assumed share of critical."""
    mass = model.parameters["slide"].mass
    rotor, cable = model.parameters["rotor"], model.parameters["cable"]
    turning = rotor.inertia / rotor.radius**2
    reduced = mass * turning / (mass + turning)
    return 2e-3 * CABLE_DAMPING_RATIO * math.sqrt(cable.stiffness * reduced)


def fitted_parameters(model: Model) -> dict[str, float]:
    """The values that the tables determine, by parameter, in file units."""
    creeps = CREEP if "creep" in model.parameters else {}
    names = [*statics.PARAMETERS, *creeps, *_LINES]
    return {name: _value(model, name) for name in names}


_LINES = (
    "drive.gain_n_per_v",
    "drive.offset_n",
    "regulator_line.gain_kpa_per_v",
    "regulator_line.offset_kpa",
    "rotor.radius_mm",
    "cable.stiffness_n_per_mm",
    "cable.slack_mm",
)


def _value(model: Model, path: str) -> float:
    effect, _, file_key = path.partition(".")
    value = model.values_in_files(effect)[file_key]
    assert isinstance(value, float)
    return value


def leave_out(
    data: StationLimits, steps: PressureSteps, pressure: float
) -> tuple[StationLimits, PressureSteps]:
    """The rows of all other pressures (Pa); I2's differ from their nominal by a little."""
    nominal = np.round(steps.pressure / 25e3) * 25e3
    return data.rows(data.pressure != pressure), steps.rows(nominal != pressure)
