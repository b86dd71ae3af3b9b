"""A second mass behind a coupling: absence, poles, momentum and energy of the two-mass system."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from pma_gym import Plant
from pma_gym.plant.forms.linear import linearize_at
from pma_gym.plant.statics import Condition
from tests.effects.test_contact_effects import INERTIA, joint, slide

SHARE, HERTZ, RATIO = 0.4, 8.0, 0.05
TABLE = {"share": SHARE, "frequency_hz": HERTZ, "damping": RATIO}
RIGS = {"slide": (slide, 2.0, 5.0, -0.01), "joint": (joint, INERTIA, 0.0, 1.0)}
"""Rig, its whole mass or inertia (kg, kg m^2), its command without force, and that per force."""


@pytest.mark.parametrize("rig", RIGS)
def test_a_share_of_none_leaves_every_bit_of_the_rates(rig):
    make, *_ = RIGS[rig]
    without, neutral = Plant(make()), Plant(make(second_mass={**TABLE, "share": 0.0}))
    values = np.random.default_rng(0).standard_normal(len(neutral.states))
    kept = [neutral.states.index(name) for name in without.states]
    rates = neutral.derivative(values, 5.3, 0.0, 0.0)[kept]
    np.testing.assert_array_equal(rates, without.derivative(values[kept], 5.3, 0.0, 0.0))


@pytest.mark.parametrize("rig", RIGS)
def test_resonance_and_antiresonance_are_those_of_two_masses(rig):
    """Of masses, stiffness and loss, not of the law's own parameters."""
    make, inertia, *_ = RIGS[rig]
    plant = Plant(make(second_mass=TABLE))
    system = linearize_at(plant, Condition(np.zeros(len(plant.states)), 0.0), (5.0, 0.0))
    first, second = (1.0 - SHARE) * inertia, SHARE * inertia
    stiffness = first * second / inertia * (2.0 * np.pi * HERTZ) ** 2
    loss = 2.0 * RATIO * np.sqrt(stiffness * first * second / inertia)
    masses = 1.0 / first + 1.0 / second
    swinging = np.roots([1.0, loss * masses, stiffness * masses])
    poles = sorted(system.poles(), key=abs)
    assert np.abs(poles[:2]).max() < 1e-4 * abs(swinging[0])
    np.testing.assert_allclose(sorted(poles[2:], key=np.imag), sorted(swinging, key=np.imag), 1e-6)
    still = 1j * np.sqrt(stiffness / second)
    moved = np.abs([system(still * k)[0, 0] * k**2 for k in (0.7, 1.0)])
    assert moved[1] < 0.3 * moved[0]


@pytest.mark.parametrize("rig", RIGS)
def test_the_work_of_the_drive_is_kinetic_and_elastic_energy_and_loss(rig):
    make, inertia, rest, slope = RIGS[rig]
    time = np.linspace(0.0, 1.0, 4001)
    force = inertia * 30.0 * np.sin(40.0 * time) * (time < 0.7)
    states, _ = Plant(make(second_mass=TABLE), 1e-9).run(time, rest + slope * force, 0.0 * time)
    _, speed, elastic, rate = states.T
    both, reduced = speed + SHARE * rate, SHARE * (1.0 - SHARE) * inertia
    stored = 0.5 * inertia * both**2 + 0.5 * reduced * (rate**2 + elastic**2)
    lost = 4.0 * np.pi * HERTZ * RATIO * reduced * rate**2
    gained = cumulative_trapezoid(force * speed - lost, time)
    assert stored[-1] > 0.1 * stored.max() and lost.max() > 0.0
    np.testing.assert_allclose(stored[1:], gained, atol=1e-4 * stored.max())
    given = cumulative_trapezoid(force, time)
    np.testing.assert_allclose(inertia * both[1:], given, atol=1e-5 * given.max())
