"""Regulator and damping from table I2's pressure steps, each of them simulated.

I2 prints a damping B for every step: the dissertation fitted x = dX (1 - exp(-K t / B)) to each
contraction, and the falling exponential to each relaxation, as if the pressure stepped at once. The
regulator takes as long as the muscle, so B holds part of its lag. Here the step is simulated with
both - pressure first order, muscle B x' = F_ce(P(t)) - L - K x with I2's own K, standing still
until F_ce exceeds L - and the same exponential is fitted to the simulation. What the fit compares
is the printed B with the fitted one, as a ratio.
"""

from dataclasses import dataclass, fields

import numpy as np

from pma_gym.codegen.trace import as_numpy
from pma_gym.data.serres2008 import load_table
from pma_gym.effects.muscle.damping import symmetric_damping
from pma_gym.plant.model import Model
from pma_gym.units import SI_FACTORS

STEP_S = 0.005
DURATION_S = 2.0
_TIMES = np.arange(0.0, DURATION_S, STEP_S)
_TIME_CONSTANTS = np.exp(np.linspace(np.log(0.005), np.log(1.5), 60))


@dataclass(frozen=True)
class PressureSteps:
    """Rows of table I2, shape (rows,) each, in SI.

    Attributes:
        pressure: pressure stepped to and back from (Pa).
        load: held by the motor (N).
        force: contractile force F_ce at the pressure (N).
        stiffness: secant K (N/m).
        contracting: printed damping of the contraction (N s/m).
        relaxing: printed damping of the relaxation (N s/m).
    """

    pressure: np.ndarray
    load: np.ndarray
    force: np.ndarray
    stiffness: np.ndarray
    contracting: np.ndarray
    relaxing: np.ndarray

    def rows(self, chosen: np.ndarray) -> "PressureSteps":
        """The rows of a mask."""
        return PressureSteps(*(getattr(self, field.name)[chosen] for field in fields(self)))


def pressure_steps() -> PressureSteps:
    """Table I2."""
    table = load_table("I2")
    spring, damping = SI_FACTORS["N/mm"], SI_FACTORS["N s/mm"]
    return PressureSteps(
        pressure=table["pressure_kpa"] * SI_FACTORS["kPa"],
        load=table["load_n"],
        force=table["fce_n"],
        stiffness=table["spring_n_per_mm"] * spring,
        contracting=table["damping_contraction_ns_per_mm"] * damping,
        relaxing=table["damping_relaxation_ns_per_mm"] * damping,
    )


def apparent_damping(
    steps: PressureSteps, time_constant: float, damping: np.ndarray, filling: bool
) -> np.ndarray:
    """Damping that the dissertation's fit would find in a simulated step (N s/m), shape (rows,).

    Args:
        steps: rows of I2.
        time_constant: of the regulator (s).
        damping: of the muscle (N s/m), shape (rows,).
        filling: contraction (pressure stepped up), else relaxation.
    """
    share = _simulate(steps, time_constant, damping, filling)
    ideal = np.exp(-_TIMES[:, None] / _TIME_CONSTANTS[None, :])
    ideal = 1.0 - ideal if filling else ideal
    # Squared distance of every simulated step (rows) to every exponential (columns).
    cost = (share**2).sum(0)[:, None] - 2.0 * share.T @ ideal + (ideal**2).sum(0)[None, :]
    return _minimum(cost) * steps.stiffness


def _simulate(
    steps: PressureSteps, time_constant: float, damping: np.ndarray, filling: bool
) -> np.ndarray:
    """Contraction over its final value, shape (times, rows)."""
    fading = np.exp(-_TIMES / time_constant)[:, None]
    pressure = (1.0 - fading if filling else fading) * steps.pressure
    slope = 2.91e-3  # N/Pa, Serres 2008, 5.1.1: F_ce in I2 lies on this line.
    final = steps.force - steps.load
    equilibrium = final - slope * (steps.pressure - pressure)
    target = np.clip(equilibrium / final, 0.0, 1.0)
    keep = np.exp(-STEP_S * steps.stiffness / damping)
    share = np.empty_like(target)
    share[0] = 0.0 if filling else 1.0
    for row in range(1, len(_TIMES)):
        middle = 0.5 * (target[row] + target[row - 1])
        share[row] = middle + (share[row - 1] - middle) * keep
    return share


def _minimum(cost: np.ndarray) -> np.ndarray:
    """Time constant of least cost, by a parabola through the best and its neighbours."""
    best = np.clip(np.argmin(cost, axis=1), 1, cost.shape[1] - 2)
    rows = np.arange(cost.shape[0])
    before, at, after = (cost[rows, best + k] for k in (-1, 0, 1))
    spacing = np.log(_TIME_CONSTANTS[1] / _TIME_CONSTANTS[0])
    return np.exp(
        np.log(_TIME_CONSTANTS[best])
        + np.clip(0.5 * (before - after) / (before - 2.0 * at + after), -1.0, 1.0) * spacing
    )


def damping_of(model: Model, pressure: np.ndarray) -> np.ndarray:
    """Damping of a model's muscle (N s/m) at pressures (Pa), shape (n,)."""
    return as_numpy(symmetric_damping)(pressure, model.parameters["symmetric_damping"])


def step_residuals(model: Model, steps: PressureSteps, filling: bool) -> np.ndarray:
    """Logarithm of simulated over printed damping of I2's steps, shape (rows,).

    Args:
        model: a station's model with regulator_lag, regulator_asymmetry and symmetric_damping.
        steps: rows of I2.
        filling: contractions, else relaxations.
    """
    time_constant = model.parameters["regulator_lag"].time_constant
    if not filling:
        time_constant *= model.parameters["regulator_asymmetry"].vent_ratio
    damping = np.maximum(damping_of(model, steps.pressure), 1.0)
    printed = steps.contracting if filling else steps.relaxing
    return np.log(apparent_damping(steps, time_constant, damping, filling) / printed)
