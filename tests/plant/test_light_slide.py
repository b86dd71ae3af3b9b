"""A slide of a millimetre is simulated as exactly as it is read."""

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant

TABLES = {
    "two_way_drive": {"gain_n_per_v": 1.0, "middle_v": 5.0},
    "slide": {"mass_kg": 1.84},
    "symmetric_damping": {"intercept_n_s_per_mm": 0.044, "slope_n_s_per_mm_per_kpa": 0.0},
    "start": {"contraction_mm": 0.0, "velocity_mm_per_s": 0.0},
}
TIGHT = 1e-10


@pytest.mark.parametrize("share", [10.0, 25.0, 50.0])
def test_friction_by_load_leads_a_light_slide_by_less_than_its_encoder_reads(share):
    """Beside the integrator at a tolerance a million times as tight; 0.05 um over 8 s."""
    friction = {"drive_share_percent": share, "carried_share_percent": 0, "presliding_um": 0.005}
    tables = {**TABLES, "load_dependent_friction": friction}
    effects = {name: CATALOGUE[name].parse(table) for name, table in tables.items()}
    model = Model("light", "", "slide", effects)
    time = np.arange(0.0, 8.0, 1e-3)
    tones = [(0.2, 1.5, 0.0), (0.3, 2.4, 1.0), (0.2, 3.9, 2.0)]
    load = sum(size * np.sin(2.0 * np.pi * f * time + p) for size, f, p in tones)
    trial = Trial(time, {"load_command": load})
    usual, exact = (
        plant.simulate(trial, noise=False).truth["contraction"]
        for plant in (Plant(model), Plant(model, TIGHT))
    )
    assert np.ptp(exact) > 1e-3
    assert np.sqrt(np.mean((usual - exact) ** 2)) < 5e-8
