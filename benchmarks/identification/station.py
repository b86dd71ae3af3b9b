"""The whole station from tables I2 and I3: one call fits all that they tell."""

import math
from dataclasses import dataclass

import numpy as np

from benchmarks.identification import statics
from benchmarks.identification.statics import StationLimits, static_loading
from benchmarks.identification.transients import PressureSteps, step_residuals
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.parameter_rows import Note
from pma_gym.plant.statics import contraction_at, muscle_force

TARGETS = {"extension_mm": 0.8, "rotation_deg": 3.0, "no_load_mm": 1.0}


@dataclass(frozen=True)
class LeftOut:
    """Errors at a pressure that the fit has not seen, predicted less measured.

    Attributes:
        pressure: the pressure (Pa).
        extension: from measured load and predicted x0 (mm), shape (rows,).
        rotation: from predicted extension and measured load (deg), shape (rows,).
        no_load: mean contraction at no load (mm).
    """

    pressure: float
    extension: np.ndarray
    rotation: np.ndarray
    no_load: float


def left_out(model: Model, data: StationLimits) -> LeftOut:
    """Errors of a model at rows of one pressure."""
    predicted = statics.load_cycle(model, data.pressure, data.load)
    rotor, cable = model.parameters["rotor"], model.parameters["cable"]
    pulley = statics.Pulley(rotor.radius, cable.stiffness, cable.slack)
    rotation = pulley.rotation(predicted.extension, data.load) - data.rotation
    return LeftOut(
        pressure=float(data.pressure[0]),
        extension=(predicted.extension - data.extension) * 1e3,
        rotation=np.rad2deg(rotation[np.isfinite(rotation)]),
        no_load=float(np.mean(predicted.no_load - data.no_load)) * 1e3,
    )


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def figures(folds: list[LeftOut]) -> dict[str, float]:
    """The three figures that are judged, over all left-out pressures, beside `TARGETS`."""
    return {
        "extension_mm": rms(np.concatenate([fold.extension for fold in folds])),
        "rotation_deg": rms(np.concatenate([fold.rotation for fold in folds])),
        "no_load_mm": max(abs(fold.no_load) for fold in folds),
    }


def unexplained(model: Model, data: StationLimits, steps: PressureSteps) -> list[str]:
    """Describe the residuals of the model in I1, I2 and I3, with figures."""
    parts = statics.residuals(model, data)
    lines_ = [_trend_over_repeats(data), _scatter_at_rest(parts["no_load"], data)]
    loop = parts["extension"] - parts["returned"]
    lines_.append(
        f"extension less return scatters by {rms(loop[np.isfinite(loop)]):.2f} mm around the "
        "hysteresis; creep during the 5 s hold would look the same"
    )
    lines_ += [_damping_by_load(model, steps), _zero_of_steps(model, steps), _static_loading(model)]
    return lines_


def _trend_over_repeats(data: StationLimits) -> str:
    lowest = data.rows(data.pressure == data.pressures[0])
    means = [1e3 * float(np.mean(lowest.no_load[k::3])) for k in range(3)]
    return (
        f"warm-up: at {data.pressures[0] / 1e3:.0f} kPa the no-load contraction falls over the "
        f"repeats, {means[0]:.1f}, {means[1]:.1f}, {means[2]:.1f} mm; the model has one value"
    )


def _scatter_at_rest(no_load: np.ndarray, data: StationLimits) -> str:
    low = no_load[data.pressure <= 300e3]
    return (
        f"no-load contraction scatters by {np.std(low):.2f} mm up to 300 kPa and "
        f"{np.std(no_load[data.pressure > 300e3]):.2f} mm above, from row to row at one command"
    )


def _damping_by_load(model: Model, steps: PressureSteps) -> str:
    error = step_residuals(model, steps, filling=True)
    share = steps.load / steps.force
    middle = (share > 0.3) & (share < 0.6)
    ratio = np.exp(np.mean(error[~middle]) - np.mean(error[middle]))
    return (
        f"load-dependent damping: contracting at 30-60 % of F_ce, I2's steps are {ratio:.2f} times "
        "as slow as at other loads, more than the model has"
    )


def _zero_of_steps(model: Model, steps: PressureSteps) -> str:
    measured = (steps.force - steps.load) / steps.stiffness
    predicted = contraction_at(muscle_force(model), steps.pressure, steps.load)
    slope, offset = np.polyfit(steps.load, (predicted - measured) * 1e3, 1)
    return (
        f"I2's contractions lie {offset:+.1f} mm {slope * 100:+.2f} mm per 100 N of load from the "
        "model's: I2 counts from the loaded, deflated length"
    )


def _static_loading(model: Model) -> str:
    pressure, load = static_loading()
    force = muscle_force(model)(pressure, np.zeros_like(pressure))
    inside = pressure >= 150e3
    error, measured = (force - load)[inside], float(np.mean(load[inside]))
    predicted = contraction_at(muscle_force(model), pressure[inside], load[inside])
    return (
        f"I1 (load held at the resting length, above 150 kPa): predicted {rms(error):.0f} N off, "
        f"mean {np.mean(error):+.0f} N of {measured:.0f} N: the model has that load "
        f"{-1e3 * np.mean(predicted):.1f} mm beyond its resting length, another zero"
    )


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
    data: StationLimits, steps: PressureSteps, start: dict[str, float] | None = None
) -> Model:
    """Fit everything that the tables tell of the station.

    Args:
        data: rows of I3.
        steps: rows of I2.
        start: values to start the static fit from.
    Returns:
        The station's model.
    """
    values = statics.drive_line(data) | statics.regulator_line(data)
    values |= statics.pulley_parameters(statics.fit_pulley(data))
    model = template().replace(values)
    model = model.replace({"cable.damping_n_s_per_mm": cable_damping(model)})
    return statics.fit(model, data, steps, start)


def cable_damping(model: Model) -> float:
    """Damping of the cable (N s/mm) at the assumed share of critical."""
    mass = model.parameters["slide"].mass
    rotor, cable = model.parameters["rotor"], model.parameters["cable"]
    turning = rotor.inertia / rotor.radius**2
    reduced = mass * turning / (mass + turning)
    return 2e-3 * CABLE_DAMPING_RATIO * math.sqrt(cable.stiffness * reduced)


def fitted_parameters(model: Model) -> dict[str, float]:
    """The values that the tables determine, by parameter, in file units."""
    return {name: _value(model, name) for name in [*statics.PARAMETERS, *_LINES]}


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
