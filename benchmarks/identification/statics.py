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
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from benchmarks.identification.measurements import StationLimits
from benchmarks.identification.transients import PressureSteps, damping_of, step_residuals
from pma_gym.plant.model import Model
from pma_gym.plant.statics import contraction_at, muscle_force

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
    begun = hysteresis.memory_at_start
    x0 = contraction_at(force, pressure, np.full_like(load, hysteresis.force * begun))

    def stretched(x: np.ndarray) -> np.ndarray:
        # Nothing turns back before x0: the search asks beyond it, where the state would run away.
        return (1.0 + begun) * np.exp(-np.maximum(x0 - x, 0.0) / hysteresis.distance) - 1.0

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


Predict = Callable[[Model, np.ndarray, np.ndarray], LoadCycleReadings]
"""What predicts I3's load cycle from model, pressures (Pa) and loads (N)."""


def residuals(
    model: Model, data: StationLimits, predict: Predict = load_cycle
) -> dict[str, np.ndarray]:
    """Predicted less measured: no_load, extension, returned (mm), each of shape (rows,)."""
    predicted = predict(model, data.pressure, data.load)
    return {
        "no_load": (predicted.no_load - data.no_load) * 1e3,
        "extension": (predicted.extension - data.extension) * 1e3,
        "returned": (predicted.returned - data.returned) * 1e3,
    }


def weighted(
    model: Model, data: StationLimits, steps: PressureSteps, predict: Predict = load_cycle
) -> np.ndarray:
    """Return the weighted residuals of a fit: of I3 (mm) and of I2, where measured."""
    parts = residuals(model, data, predict)
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
    more: Mapping[str, tuple[float, float]] | None = None,
    predict: Predict = load_cycle,
) -> Model:
    """The model with static force, hysteresis, damping and the regulator's paces fitted.

    Args:
        model: where everything else comes from.
        data: rows of I3.
        steps: rows of I2.
        start: values to start from, by parameter; `PARAMETERS` has the default.
        more: parameters that are fitted beside `PARAMETERS`, as these.
        predict: predicts I3's load cycle.
    """
    fitted = {**PARAMETERS, **(more or {})}
    names = list(fitted)
    begin = np.array([(start or {}).get(n, fitted[n][0]) for n in names])
    scale = np.array([fitted[n][1] for n in names])
    lower, upper = _bounds(model, names)

    def cost(values: np.ndarray) -> np.ndarray:
        tried = model.replace(dict(zip(names, values.tolist(), strict=True)))
        return weighted(tried, data, steps, predict)

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
