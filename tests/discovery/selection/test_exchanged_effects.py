"""What is added first may stand for something else until the second effect is there."""

from types import SimpleNamespace

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import free_parameters
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.prepared_trials import prepared
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.selection.candidate_fits import carries_the_rest
from pma_gym.discovery.selection.exchanged_effects import exchanged
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model

NOISE = np.radians(0.02)


def wheel(**tables):
    """A torque on a damped joint with an encoder."""
    given = {
        "torque_drive": {"gain": 1.0},
        "joint_damping": {"coefficient_n_m_s": 2.0},
        **tables,
        "inertia": {"inertia_kg_m2": 1.4},
        "joint_start": {"angle_deg": 0.0, "spin_deg_per_s": 0.0},
        "encoder": {"bandwidth_hz": 2000.0, "noise_deg": float(np.degrees(NOISE))},
    }
    return Model("arm", "An arm", "joint", {n: CATALOGUE[n].parse(t) for n, t in given.items()})


@pytest.fixture(scope="module")
def problem():
    rig = wheel(
        joint_hardening_spring={"cubic_n_m_per_rad3": 8.0},
        joint_directional_damping={"difference_n_m_s": 1.0},
    )
    time, trials = np.arange(0.0, 4.0, 0.01), []
    for seed, hertz in enumerate((0.7, 1.1)):
        torque = 25.0 * np.sin(2.0 * np.pi * hertz * time)
        read = Plant(rig).simulate(Trial(time, {"torque_command": torque}), seed=seed)
        trials.append(Trial(time, read.commands, {"angle": read.measurements["angle"]}))
    model = wheel()
    named, _ = prepared([NamedTrial(f"{k}", each) for k, each in enumerate(trials)], model)
    pieces = [each.trial for each in named]
    return FitProblem(pieces, model, free_parameters(model), (white_noise(NOISE),) * 2)


def test_a_spring_gives_way_to_the_hardening_spring_that_it_stood_for(problem):
    known = {each.name: each for each in candidate_effects(problem.given, None, problem.trials)}
    spring, hard, damping = (
        known[name]
        for name in ("joint_spring", "joint_hardening_spring", "joint_directional_damping")
    )
    fits = {
        each.name: problem.fit(problem.given, (each,), {each.name: each.probes[0]})
        for each in (spring, hard)
    }
    chosen = (spring, damping)
    starts = {each.name: each.probes[0] for each in chosen}
    fit = problem.fit(problem.given, chosen, starts)
    assert problem.left(fit) > 1.2
    alone = problem.fit(problem.given)
    beside = list(known.values())
    after, best = exchanged(problem, fit, chosen, [(alone, fits), (alone, {})], beside, [0])
    assert [each.name for each in after] == ["joint_hardening_spring", "joint_directional_damping"]
    assert problem.left(best) < 1.1
    cubic, _ = best.estimate("joint_hardening_spring.cubic_n_m_per_rad3")
    assert cubic == pytest.approx(8.0, rel=0.05)
    # What explains most already stays.
    again, same = exchanged(problem, best, after, [(alone, fits), (alone, {})], beside, [0])
    assert again == after and same is best


@pytest.mark.parametrize(
    ("left", "gain", "carries"),
    [(5.0, 2000.0, True), (5.0, 1500.0, False), (1.2, 40.0, True), (1.04, 8.0, False)],
)
def test_a_second_effect_counts_that_carries_nearly_all_of_much(left, gain, carries):
    before = SimpleNamespace(chi_square=100 * left**2)
    problem = SimpleNamespace(count=100, left=lambda fit: (fit.chi_square / 100) ** 0.5)
    assert carries_the_rest(problem, before, gain) is carries
