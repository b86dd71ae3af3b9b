"""Two effects of a free rig that is far from its model, whose chi-square is rugged, are named."""

import math

import numpy as np
import pytest

from benchmarks.hidden_effects.rigs import laws
from benchmarks.hidden_effects.rigs.rig import Rig
from benchmarks.hidden_effects.rigs.simulators import stick_slip
from benchmarks.hidden_effects.rigs.simulators.drive import Transmission
from pma_gym.data.trial import Trial
from pma_gym.discovery.workflow import diagnose
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model

RATE, SECONDS, STEP = 100.0, 4.0, 2e-6
AXIS = Rig("slide", 3.0, 20.0, 0.0, 0.0, 0.0, 0.015, 1.5, RATE)
HIDDEN = (laws.CoulombFriction(8.0), laws.DirectionalDamping(12.0))


def given():
    tables = {
        "two_way_drive": {"gain_n_per_v": 100.0, "middle_v": 5.0},
        "slide": {"mass_kg": 3.0},
        "symmetric_damping": {"intercept_n_s_per_mm": 0.02, "slope_n_s_per_mm_per_kpa": 0.0},
        "start": {"contraction_mm": 0.0, "velocity_mm_per_s": 0.0},
        "lvdt": {"bandwidth_hz": 1000.0, "noise_mm": 1e3 * STEP},
    }
    return Model("axis", "An axis", "slide", {n: CATALOGUE[n].parse(t) for n, t in tables.items()})


def controlled(seed):
    """A trial of the axis in a loop; a force of the simulator contracts."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(SECONDS * RATE)) / RATE
    phases = rng.uniform(0.0, 2.0 * math.pi, 3)
    tones = zip((0.7, 1.1, 1.6), phases, strict=True)
    wanted = 0.01 * sum(np.sin(2.0 * math.pi * hertz * time + p) - np.sin(p) for hertz, p in tones)
    last = [0.0]

    def force(row, q):
        slope, last[0] = (q - last[0]) * RATE, q
        return 3000.0 * (wanted[row] - q) - 60.0 * slope

    motion = stick_slip.simulate(AXIS, HIDDEN, Transmission(), force, len(time))
    read = STEP * np.round(motion.q / STEP)
    return Trial(time, {"load_command": -motion.command}, {"contraction": read})


@pytest.mark.campaign
def test_friction_and_damping_by_direction_are_found_together():
    diagnosis = diagnose([controlled(1)], given(), propose=False)
    named = {each.name: each for each in diagnosis.effects}
    assert set(named) == {"coulomb_friction", "directional_damping"}, diagnosis.sentence
    dynamic = named["coulomb_friction"].parameters["dynamic_n"].value
    assert dynamic == pytest.approx(8.0, rel=0.05)
    difference = named["directional_damping"].parameters["difference_n_s_per_mm"].value
    assert abs(difference) == pytest.approx(0.012, rel=0.1)
