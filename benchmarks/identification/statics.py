"""Static force, hysteresis, damping and the regulator's paces from tables I3 and I2, in one fit.

Load cycle of I3: settled at P with no load; load ramped to L in 5 s, held 5 s, ramped back in 5 s.
At 10 s everything viscous has died out; at 15 s the muscle still contracts at the ramp's speed.
With F(P, x) the static force, H and d force and distance of the hysteresis, z0 its memory where
the trial begins (1: filled and contracted), B the damping:

    no load        F(P, x0) - H z0 = 0
    at 10 s        F(P, x1) - H z1 = L,     z1 = (1 + z0) exp(-(x0 - x1) / d) - 1
    at 15 s        F(P, x2) - H z2 = B v,   v = (L / 5 s) / (-dF/dx at x2)
                   z2 = 1 - (1 - z1) exp(-(x2 - x1) / d)

extension is x0 - x1, return is x2 - x1. All follow from the Bouc-Wen law along monotonic paths;
a test holds them against the simulated load cycle. Damping and the
regulator's paces also make I2's transients (`transients`); neither table fixes them alone.

The measurements that identify the station: tables I1, I2 and I3, in SI.
"""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from benchmarks.identification.transients import PressureSteps, damping_of, step_residuals
from pma_gym.data.calibration import PRESSURE_TRANSDUCER
from pma_gym.data.serres2008 import load_table
from pma_gym.plant.model import Model
from pma_gym.plant.statics import contraction_at, muscle_force
from pma_gym.units import SI_FACTORS

_MM, _KPA, _DEG = SI_FACTORS["mm"], SI_FACTORS["kPa"], SI_FACTORS["deg"]


@dataclass(frozen=True)
class StationLimits:
    """Rows of table I3, shape (rows,) each; NaN where a figure is lost.

    Attributes:
        pressure: intended pressure (Pa).
        read_pressure: the "actual" pressure as printed (Pa).
        motor_voltage: commanded (V).
        regulator_voltage: commanded (V).
        load: measured at 10 s (N).
        no_load: contraction before the load (m).
        extension: at 10 s (m).
        returned: come back by 15 s (m).
        rotation: at 10 s (rad).
        returned_rotation: come back by 15 s (rad).
    """

    pressure: np.ndarray
    read_pressure: np.ndarray
    motor_voltage: np.ndarray
    regulator_voltage: np.ndarray
    load: np.ndarray
    no_load: np.ndarray
    extension: np.ndarray
    returned: np.ndarray
    rotation: np.ndarray
    returned_rotation: np.ndarray

    def rows(self, chosen: np.ndarray) -> "StationLimits":
        """The rows of a mask."""
        return StationLimits(*(getattr(self, field.name)[chosen] for field in fields(self)))

    @property
    def pressures(self) -> np.ndarray:
        """Distinct pressures (Pa), rising."""
        return np.unique(self.pressure)


def station_limits() -> StationLimits:
    """Table I3, misprints corrected."""
    table = load_table("I3")
    return StationLimits(
        pressure=table["pressure_nominal_kpa"] * _KPA,
        read_pressure=table["pressure_kpa"] * _KPA,
        motor_voltage=table["motor_voltage_v"],
        regulator_voltage=table["regulator_voltage_v"],
        load=table["load_n"],
        no_load=table["no_load_contraction_mm"] * _MM,
        extension=table["extension_mm"] * _MM,
        returned=table["return_mm"] * _MM,
        rotation=table["rotation_deg"] * _DEG,
        returned_rotation=table["return_rotation_deg"] * _DEG,
    )


def static_loading() -> tuple[np.ndarray, np.ndarray]:
    """Table I1: pressures (Pa) and the loads (N) held at zero contraction, shape (rows,) each."""
    table = load_table("I1")
    return table["pressure_kpa"] * _KPA, table["load_n"]


VOLTS_PER_PRINTED_KPA = 0.01
"""The "actual" pressures of I2 and I3 are transducer volts times 100, never decoded by table 1:
as printed they are 1.016 times the commanded pressure plus 3.4 kPa, decoded 0.996 times plus
0.7."""


def decoded_pressure(printed: np.ndarray) -> np.ndarray:
    """Pressure (Pa) behind "actual" pressures as printed (Pa), through table 1's calibration."""
    return PRESSURE_TRANSDUCER.from_volts(printed * 1e-3 * VOLTS_PER_PRINTED_KPA)


def drive_line(data: StationLimits) -> dict[str, float]:
    """Gain and offset of the drive: measured load on commanded voltage."""
    gain, offset = np.polyfit(data.motor_voltage, data.load, 1)
    return {"drive.gain_n_per_v": float(gain), "drive.offset_n": float(offset)}


def regulator_line(data: StationLimits) -> dict[str, float]:
    """Gain and offset of the regulator: decoded pressure on commanded voltage."""
    known = np.isfinite(data.read_pressure)
    decoded = decoded_pressure(data.read_pressure[known])
    gain, offset = np.polyfit(data.regulator_voltage[known], decoded / 1e3, 1)
    return {
        "regulator_line.gain_kpa_per_v": float(gain),
        "regulator_line.offset_kpa": float(offset),
    }


class Pulley(NamedTuple):
    """Parameters of rotation: radius (m), cable stiffness (N/m), slack (m)."""

    radius: float
    stiffness: float
    slack: float

    def rotation(self, extension: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Rotation (rad) that winds in slack, cable stretch and extension (m) under a load (N)."""
        return (extension + load / self.stiffness + self.slack) / self.radius

    def returned(self, returned: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Rotation (rad) given back: the slack stays wound in, the drive cannot unwind."""
        return (returned + load / self.stiffness) / self.radius


def fit_pulley(data: StationLimits) -> Pulley:
    """Radius, cable stiffness and slack, linear in their reciprocals, from I3's rotations.

    r theta = dL + L / k + slack     going out
    r theta = dL + L / k             coming back
    """
    out, back = np.isfinite(data.rotation), np.isfinite(data.returned_rotation)
    out &= np.isfinite(data.extension)
    back &= np.isfinite(data.returned)
    ones, zeros = np.ones(out.sum()), np.zeros(back.sum())
    columns = np.stack(
        [
            np.concatenate([data.extension[out], data.returned[back]]),
            np.concatenate([data.load[out], data.load[back]]),
            np.concatenate([ones, zeros]),
        ],
        axis=1,
    )
    angles = np.concatenate([data.rotation[out], data.returned_rotation[back]])
    per_extension, per_load, start = np.linalg.lstsq(columns, angles, rcond=None)[0]
    return Pulley(
        radius=float(1.0 / per_extension),
        stiffness=float(per_extension / per_load),
        slack=float(start / per_extension),
    )


def pulley_parameters(pulley: Pulley) -> dict[str, float]:
    """A pulley's numbers as model parameters in file units."""
    return {
        "rotor.radius_mm": pulley.radius * 1e3,
        "cable.stiffness_n_per_mm": pulley.stiffness / 1e3,
        "cable.slack_mm": pulley.slack * 1e3,
    }


RAMP_S = 5.0
PARAMETERS: dict[str, tuple[float, float]] = {
    "sarosi_force.toe_slope_n_per_bar": (-30.0, 10.0),
    "sarosi_force.toe_force_n": (280.0, 30.0),
    "sarosi_force.steepness_per_percent": (0.40, 0.05),
    "sarosi_force.softening_n_per_bar_per_percent": (8.0, 1.0),
    "sarosi_force.slope_n_per_bar": (350.0, 20.0),
    "sarosi_force.offset_n": (-290.0, 30.0),
    "pressure_curvature.passive_n_per_percent": (10.0, 2.0),
    "pressure_curvature.softening_n_per_bar2_per_percent": (-0.2, 0.1),
    "pressure_curvature.offset_n_per_bar2": (-12.0, 3.0),
    "hysteresis.force_n": (15.0, 3.0),
    "hysteresis.distance_mm": (2.0, 1.0),
    "hysteresis.memory_at_start": (0.5, 0.1),
    "symmetric_damping.intercept_n_s_per_mm": (0.8, 0.3),
    "symmetric_damping.slope_n_s_per_mm_per_kpa": (0.001, 0.001),
    "regulator_lag.time_constant_s": (0.06, 0.01),
    "regulator_asymmetry.vent_ratio": (0.6, 0.1),
}
"""Fitted parameters: where the fit starts, and the scale of a step."""

LOOP_WEIGHT = 1.5
"""Weight of extension less return: its scatter, 0.45 mm, is smaller than an extension's."""

STEP_WEIGHT = 4.0
"""Weight of a logarithmic residual of I2 (scatter 0.22) against a millimetre of I3."""


class LoadCycleReadings(NamedTuple):
    """Readings of I3's load cycle, arrays of shape (n,) in m: x0, x0 - x1 and x2 - x1."""

    no_load: np.ndarray
    extension: np.ndarray
    returned: np.ndarray


def load_cycle(model: Model, pressure: np.ndarray, load: np.ndarray) -> LoadCycleReadings:
    """Predict I3's load cycle by a model.

    Args:
        model: a station's model with hysteresis and damping.
        pressure: gauge pressures (Pa), shape (n,).
        load: loads at 10 s (N), shape (n,).
    """
    force = muscle_force(model)
    hysteresis = model.parameters["hysteresis"]
    damping = damping_of(model, pressure)
    memory = hysteresis.memory_at_start
    x0 = contraction_at(force, pressure, np.full_like(load, hysteresis.force * memory))

    def stretched(x: np.ndarray) -> np.ndarray:
        # Nothing turns back before x0: the search asks beyond it, where the state would run away.
        return (1.0 + memory) * np.exp(-np.maximum(x0 - x, 0.0) / hysteresis.distance) - 1.0

    def loaded(p: np.ndarray, x: np.ndarray) -> np.ndarray:
        return force(p, x) - hysteresis.force * stretched(x)

    x1 = contraction_at(loaded, pressure, load)
    turned = stretched(x1)

    def unloaded(p: np.ndarray, x: np.ndarray) -> np.ndarray:
        step = 1e-5
        stiffness = (force(p, x - step) - force(p, x + step)) / (2.0 * step)
        speed = load / RAMP_S / np.maximum(stiffness, 1e3)
        state = 1.0 - (1.0 - turned) * np.exp(-np.maximum(x - x1, 0.0) / hysteresis.distance)
        return force(p, x) - hysteresis.force * state - damping * speed

    x2 = contraction_at(unloaded, pressure, np.zeros_like(load))
    return LoadCycleReadings(x0, x0 - x1, x2 - x1)


def residuals(model: Model, data: StationLimits) -> dict[str, np.ndarray]:
    """Predicted less measured: no_load, extension, returned (mm), each of shape (rows,)."""
    predicted = load_cycle(model, data.pressure, data.load)
    return {
        "no_load": (predicted.no_load - data.no_load) * 1e3,
        "extension": (predicted.extension - data.extension) * 1e3,
        "returned": (predicted.returned - data.returned) * 1e3,
    }


def weighted(model: Model, data: StationLimits, steps: PressureSteps) -> np.ndarray:
    """Return the weighted residuals of a fit: of I3 (mm) and of I2, where measured."""
    parts = residuals(model, data)
    loop = parts["extension"] - parts["returned"]
    all_parts = (
        parts["no_load"],
        parts["extension"],
        LOOP_WEIGHT * loop,
        STEP_WEIGHT * step_residuals(model, steps, filling=True),
        STEP_WEIGHT * step_residuals(model, steps, filling=False),
    )
    return np.concatenate([part[np.isfinite(part)] for part in all_parts])


def fit(
    model: Model,
    data: StationLimits,
    steps: PressureSteps,
    start: dict[str, float] | None = None,
) -> Model:
    """The model with static force, hysteresis, damping and the regulator's paces fitted.

    Args:
        model: where everything else comes from.
        data: rows of I3.
        steps: rows of I2.
        start: values to start from, by parameter; `PARAMETERS` has the default.
    """
    names = list(PARAMETERS)
    begin = np.array([(start or {}).get(n, PARAMETERS[n][0]) for n in names])
    scale = np.array([PARAMETERS[n][1] for n in names])
    lower, upper = _bounds(model, names)

    def cost(values: np.ndarray) -> np.ndarray:
        tried = model.replace(dict(zip(names, values.tolist(), strict=True)))
        return weighted(tried, data, steps)

    solution = least_squares(
        cost,
        begin,
        x_scale=scale,
        bounds=(lower, upper),
        loss="soft_l1",
        f_scale=2.0,
        diff_step=1e-5,
        # A flat valley: at 1e-10 a fit ends 1e-4 of a value apart from processor to processor.
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
        max_nfev=200,
    )
    return model.replace(dict(zip(names, solution.x.tolist(), strict=True)))


def _bounds(model: Model, names: list[str]) -> tuple[list[float], list[float]]:
    quantities = []
    for path in names:
        effect, _, file_key = path.partition(".")
        stem = model.effects[effect].names_in_files()[file_key]
        quantities.append(model.effects[effect].quantities[stem])
    return [q.lower for q in quantities], [q.upper for q in quantities]
