"""Forces of imposed motions: loops, plateaus, play, and both simulators against each other."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hidden_effects.rigs import laws
from benchmarks.hidden_effects.rigs.drawing import OFFERS
from benchmarks.hidden_effects.rigs.imposed_campaign import draw_tested
from benchmarks.hidden_effects.rigs.rig import ImposedRig, Reference, draw_imposed
from benchmarks.hidden_effects.rigs.sensing import Noise
from benchmarks.hidden_effects.rigs.simulators import imposed_force, mujoco_force
from pma_gym import Plant, load_model
from pma_gym.data.datasets.dataset import read_dataset

RIG = ImposedRig("imposed", 2.0, 30.0, 400.0, 5e-4, (1e5,), 0.05, 0.5, 500.0)
OMEGA = 2.0 * math.pi * 0.5
TIME = np.arange(5000) / 500.0
SINE = Reference(
    0.05 * np.sin(OMEGA * TIME),
    0.05 * OMEGA * np.cos(OMEGA * TIME),
    -0.05 * OMEGA**2 * np.sin(OMEGA * TIME),
)


@pytest.fixture(params=["own", "MuJoCo"])
def simulate(request):
    if request.param == "own":
        return imposed_force.simulate
    pytest.importorskip("mujoco")
    return mujoco_force.simulate


def test_a_force_moves_mass_damper_and_spring_against_the_pressure(simulate):
    force = simulate(RIG, (), SINE, 3e5)
    wanted = 2.0 * SINE.a + 30.0 * SINE.v + 400.0 * SINE.q + 5e-4 * 3e5
    assert force == pytest.approx(wanted, abs=1e-6)


def test_a_loop_takes_four_times_friction_and_amplitude_and_what_is_viscous(simulate):
    force = simulate(RIG, (laws.CoulombFriction(6.0),), SINE, 1e5)
    period = slice(1000, 2001)
    work = np.trapezoid(force[period], SINE.q[period])
    wanted = 4.0 * 6.0 * 0.05 + math.pi * 30.0 * OMEGA * 0.05**2
    assert work == pytest.approx(wanted, rel=3e-3)


def test_friction_grows_with_pressure(simulate):
    effect = (laws.PressureFriction(4.0, 1.5e-6),)
    fast = (SINE.v > 0.05) & (TIME > 0.2)
    for pressure in (1e5, 7e5):
        added = simulate(RIG, effect, SINE, pressure) - simulate(RIG, (), SINE, pressure)
        assert added[fast] == pytest.approx(4.0 * (1.0 + 1.5e-6 * pressure), abs=1e-6)


DRAWN = (
    lambda force, rig: laws.HardeningSpring(force / rig.travel**3),
    lambda force, rig: laws.QuadraticDrag(force / rig.peak_speed**2),
    lambda force, rig: laws.DirectionalDamping(force / rig.peak_speed),
    lambda force, rig: laws.Cogging(force, 0.3 * rig.travel, 1.0),
    lambda force, rig: laws.CoulombFriction(force, 0.4, 0.05 * rig.peak_speed),
)


@pytest.mark.parametrize("law", DRAWN)
def test_both_simulators_agree(law):
    pytest.importorskip("mujoco")
    effect = law(5.0, RIG)
    own, other = (m.simulate(RIG, (effect,), SINE, 1e5) for m in (imposed_force, mujoco_force))
    changed = own - imposed_force.simulate(RIG, (), SINE, 1e5)
    # Where it turns, one has a presliding, the other a step.
    fast = (np.abs(SINE.v) > 0.1 * RIG.peak_speed) & (TIME > 0.2)
    assert np.std(changed) > 1.0
    assert np.abs(own - other)[fast].max() < 0.03 * np.abs(changed).max()


def test_a_dwelling_machine_keeps_the_force_that_it_came_with(simulate):
    q = 0.02 * np.clip((TIME - 1.0) / 2.0, 0.0, 1.0)
    v = np.gradient(q) * 500.0
    moved = Reference(q, v, np.zeros(5000))
    force = simulate(RIG, (laws.CoulombFriction(6.0),), moved, 0.0)
    assert force[100] == pytest.approx(0.0, abs=1e-9)
    assert force[4000] == pytest.approx(400.0 * 0.02 + 6.0, abs=1e-3)


def test_a_hardening_spring_is_a_cube(simulate):
    added = simulate(RIG, (laws.HardeningSpring(1e6),), SINE, 0.0) - simulate(RIG, (), SINE, 0.0)
    assert added == pytest.approx(1e6 * SINE.q**3, abs=1e-3 * 1e6 * 0.05**3)


# One that turns with the motion and one that keeps its energy; the others run with the campaigns.
MEASURED = (
    "coulomb_friction",
    "hardening_spring",
    *(
        pytest.param(name, marks=pytest.mark.campaign)
        for name in (
            "pressure_dependent_friction",
            "quadratic_drag",
            "directional_damping",
            "cogging",
        )
    ),
)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.campaign)])
@pytest.mark.parametrize("name", MEASURED)
def test_what_a_testing_machine_can_show_is_hidden_at_any_size(name, seed):
    rng = np.random.default_rng(seed)
    campaign = draw_tested(rng, "imposed", "own", (3, seed))
    offer = OFFERS[name]
    if not offer.fits(campaign.rig):
        assert name == "pressure_dependent_friction" and not campaign.rig.area
        return
    most = offer.draw(rng, campaign.rig)
    small, large = campaign.ratio(most.scaled(0.01)), campaign.ratio(most.scaled(0.02))
    assert large == pytest.approx(2.0 * small, rel=0.02)
    assert campaign.ratio(most.scaled(0.0)) < 1e-9


def test_files_have_the_load_cell_s_noise_and_step():
    campaign = draw_tested(np.random.default_rng(1), "imposed", "own", (3, 1))
    campaign = replace(
        campaign, cell=replace(campaign.cell, noise=Noise(campaign.cell.noise.white))
    )
    read = campaign.tables(())[0]["force_n"][0]
    exact = campaign.force((), 0)
    assert float(np.std(read - exact)) == pytest.approx(campaign.cell.rms, rel=0.1)
    counts = read / campaign.cell.step
    assert counts == pytest.approx(np.round(counts), abs=1e-6)


def test_machines_are_of_all_sizes():
    rigs = [draw_imposed(np.random.default_rng(seed), 4) for seed in range(200)]
    assert max(rig.travel for rig in rigs) > 100 * min(rig.travel for rig in rigs)
    assert (
        {bool(rig.area) for rig in rigs} == {bool(rig.stiffness) for rig in rigs} == {True, False}
    )
    assert all(len(rig.pressures) == 4 for rig in rigs)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", [0, 2, 5])
def test_with_its_true_numbers_a_lab_s_model_leaves_the_sensor_s_noise(seed, tmp_path):
    """Two programs that know nothing of each other give the same force."""
    campaign = draw_tested(np.random.default_rng(seed), "imposed", "own", (3, seed))
    quiet = replace(campaign.cell, noise=Noise(campaign.cell.noise.white))
    campaign = replace(campaign, believed=campaign.rig, cell=quiet, motions=campaign.motions[:2])
    for name, text in campaign.texts(()).items():
        (tmp_path / name).write_text(text, "utf-8")
    plant = Plant(load_model(str(tmp_path / "model.toml")))
    for named in read_dataset(tmp_path).trials:
        made = plant.simulate(replace(named.trial, measurements={}))
        left = named.trial.measurements["force"] - made.measurements["force"]
        assert np.std(left) == pytest.approx(quiet.rms, rel=0.1)
