"""Stations with an effect more, at values that are typical for it, or usual."""

from functools import cache

import pytest

from pma_gym.effects import CATALOGUE
from pma_gym.plant.compiled_model import DEFAULT_TOLERANCE
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant

BRAID = {"resting_length_mm": 250.0, "resting_diameter_mm": 20.0, "turns": 2.085}
FORCE = {"force_slope_n_per_kpa": 2.91, "force_intercept_n": 44.6}
TYPICAL = {
    "passive_stretch": {"factor": 1.0, "resting_length_mm": 250.0},
    "load_dependent_damping": {"linear": 12.0, "quadratic": -12.0, **FORCE},
    "creep": {"stiffness_n_per_mm": 1.0, "time_constant_s": 2.0},
    "slow_creep": {"stiffness_n_per_mm": 1.0, "time_constant_s": 40.0},
    "drive_dead_zone": {"width_n": 20.0},
    "drive_saturation": {"limit_n": 150.0},
    "drive_lag": {"share": 1.0, "time_constant_ms": 10.0},
    "torque_ripple": {"amplitude_percent": 1.0, "periods": 24.0, "phase_deg": 30.0},
    "current_imbalance": {"amplitude_percent": 2.5, "periods": 6.0, "phase_deg": 30.0},
    "regulator_rate_limit": {"limit_kpa_per_s": 100.0},
    "filling": {"exponent": 1.4, **BRAID},
    "lvdt_error": {"gain_percent": 1.0, "offset_mm": 0.5},
    "load_cell_error": {"gain_percent": 2.0, "offset_n": 5.0},
    "pressure_transducer_error": {"gain_percent": 1.6, "offset_kpa": 3.4},
    "potentiometer_error": {"gain_percent": -1.0, "offset_deg": 1.0},
}


@cache
def _plant(name, values, tolerance):
    base = load_model("station")
    effect = CATALOGUE[name]
    typical = effect.parse(TYPICAL[name]) if name in TYPICAL else effect.usual
    given = effect.neutral if values is None else effect.changed(typical, dict(values))
    parameters = {**base.parameters, name: given}
    return Plant(Model(f"station with {name}", "", "station", parameters), tolerance)


@pytest.fixture(scope="session")
def station():
    """The identified station as it is."""
    return Plant("station")


@pytest.fixture(scope="session")
def station_with():
    """The identified station with an effect at typical or given values, or neutral."""

    def make(name, tolerance=DEFAULT_TOLERANCE, neutral=False, **values):
        return _plant(name, None if neutral else tuple(sorted(values.items())), tolerance)

    return make
