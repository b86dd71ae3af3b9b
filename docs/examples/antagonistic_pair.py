"""Two sealed muscles against each other, moved by a motor: a mechanistic model of a measured rig.

The log (https://github.com/jonreal/pneu-sim, branch pre-TOM-2026, `data/data.mat`, Apache-2.0; 50
rows a second, each the mean of five) has the force of a motor on a pulley of 6.875 mm, the position
and both pressures; no valve opens. The model has 10 free parameters and one input, the force: they
are fitted to the first 18 s, and the last 10 s are predicted. Beside it stand regressions on the
force, and the measured cycle before.
"""

import csv
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from pma_gym import Plant
from pma_gym.data.trial import Trial
from pma_gym.effects import CATALOGUE
from pma_gym.effects.effect import ANTAGONIST
from pma_gym.plant.model import Model

RAW = Path(__file__).parent / "antagonistic_pair" / "pair.csv"
RADIUS_MM, FITTED_S, PERIOD_S = 6.875, 18.0, 9.93
BRAID = {"resting_length_mm": 150, "resting_diameter_mm": 10, "turns": 2.7, "thickness_mm": 1}
"""Assumed: the fit takes up what is wrong with it in force, elasticity and exponent of the gas."""

MUSCLE = {
    "pulley": {"radius_mm": RADIUS_MM, "contraction_at_zero_mm": 15},
    "chou_hannaford_force": {**BRAID, "scale": 1},
    "symmetric_damping": {"intercept_n_s_per_mm": 0.5, "slope_n_s_per_mm_per_kpa": 0},
    "air_chamber": {
        **BRAID, "exponent": 1.3, "dead_volume_cm3": 2, "pressure_at_start_kpa": 366.5,
    },
    "leak": {"conductance_l_per_min_per_bar": 2e-5},
}  # fmt: skip
ARM = {
    "torque_drive": {"gain": 1},
    "inertia": {"inertia_kg_m2": 1e-4},
    "joint_spring": {"stiffness_n_m_per_rad": 7.5, "rest_deg": 0},
    "joint_friction": {
        "static_n_m": 0.3, "dynamic_n_m": 0.3, "stribeck_speed_deg_per_s": 5, "presliding_deg": 0.1,
    },
    "joint_range": {"lowest_deg": -60, "highest_deg": 60, "pressure_kpa": 600, "arrival": 0.8},
}  # fmt: skip
SECOND = {f"{ANTAGONIST}{name}": values for name, values in MUSCLE.items()}
TABLES = {**MUSCLE, **SECOND, **ARM}
FREE = (
    "joint_friction.static_n_m",
    "joint_friction.presliding_deg",
    "joint_spring.stiffness_n_m_per_rad",
    "joint_range.arrival",
    "leak.conductance_l_per_min_per_bar",
    *(
        f"{muscle}{name}"
        for muscle in ("", ANTAGONIST)
        for name in (
            "air_chamber.exponent",
            "air_chamber.pressure_at_start_kpa",
        )
    ),
)
"""Free parameters, beside the zero of the position (mm)."""

TIED = {
    f"{ANTAGONIST}leak.conductance_l_per_min_per_bar": "leak.conductance_l_per_min_per_bar",
    "joint_friction.dynamic_n_m": "joint_friction.static_n_m",
}
MODEL = Model(
    "antagonistic_pair",
    "Two sealed muscles on a pulley that a motor turns",
    "muscle_pair",
    {name: CATALOGUE[name].parse(values) for name, values in TABLES.items()},
)


def predicted(model: Model, time: np.ndarray, force: np.ndarray, zero_mm: float) -> np.ndarray:
    """Position (mm) and pressures (kPa) under a force (N), shape (rows, 3)."""
    trial = Trial(time, {"torque_command": 1e-3 * RADIUS_MM * force})
    truth = Plant(model).simulate(trial, noise=False).truth
    position = zero_mm + RADIUS_MM * truth["angle"]
    return np.stack(
        [position, 1e-3 * truth["pressure"], 1e-3 * truth["antagonist_pressure"]], axis=1
    )


def explained(measured: np.ndarray, guess: np.ndarray) -> np.ndarray:
    """R2 of each column.

    >>> explained(np.array([[0.0], [1.0], [2.0]]), np.ones((3, 1))).tolist()
    [0.0]
    """
    squares = ((measured - guess) ** 2).sum(axis=0)
    return 1.0 - squares / ((measured - measured.mean(axis=0)) ** 2).sum(axis=0)


def print_row(name: str, figures: np.ndarray) -> None:
    """Print what a model explains of position and pressures."""
    print(f"{name:42s}" + "".join(f"{figure:9.3f}" for figure in figures))


with RAW.open() as log:
    rows = [[float(value) for value in row.values()] for row in csv.DictReader(log)]
time, force, *columns = np.array(rows).T
measured, fitted = np.stack(columns, axis=1), time < FITTED_S
start = np.array([TABLES[path.split(".")[0]][path.split(".")[1]] for path in FREE])


def changed(shares: np.ndarray) -> tuple[Model, float]:
    """The model at free parameters in shares of their first values, and the position's zero."""
    values = dict(zip(FREE, (shares[:-1] * start).tolist(), strict=True))
    return MODEL.replace(values | {path: values[own] for path, own in TIED.items()}), shares[-1]


def residuals(shares: np.ndarray) -> np.ndarray:
    """What the fitted rows miss, in standard deviations of each column."""
    model, zero = changed(shares)
    miss = predicted(model, time[fitted], force[fitted], zero) - measured[fitted]
    return (miss / measured[fitted].std(axis=0)).ravel()


first = np.append(np.ones(len(FREE)), 0.2)
ends = np.append(np.full(len(FREE), 0.2), -2.0), np.append(np.full(len(FREE), 5.0), 2.0)
best = least_squares(residuals, first, bounds=ends, diff_step=3e-3, max_nfev=40).x
model, zero = changed(best)
guess = predicted(model, time, force, zero)

ones, direction = np.ones_like(force), np.sign(np.gradient(force, time))
line = np.stack([ones, force], axis=1)
curves = np.stack([ones, force, force**2], axis=1)
six = np.hstack([curves, direction[:, None] * curves])
held = ~fitted
print(f"R2 on the last {time[-1] - FITTED_S:.0f} s            position, pressure 1, pressure 2")
for name, inputs in (
    ("a line in the force", line),
    ("its squares and direction, 6 coefficients", six),
):
    weights = np.linalg.lstsq(inputs[fitted], measured[fitted], rcond=None)[0]
    print_row(name, explained(measured[held], inputs[held] @ weights))
before = [np.interp(time[held] - PERIOD_S, time, column) for column in measured.T]
print_row("the measured cycle before", explained(measured[held], np.stack(before, axis=1)))
figures = explained(measured[held], guess[held])
print_row(f"this model, {len(best)} parameters", figures)
assert figures.min() >= 0.98
for path, value in zip(FREE, best * np.append(start, 1.0), strict=False):
    print(f"{path:48s} {value:.4g}")
friction = model.parameters["joint_friction"].static / (1e-3 * RADIUS_MM)
print(f"dry friction at the muscles {friction:.0f} N, zero of the position {zero:.2f} mm")
