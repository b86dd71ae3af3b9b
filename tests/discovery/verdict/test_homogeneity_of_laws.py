"""Terms of one law have one size: friction that grows almost in proportion to the pressure."""

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import free_parameters
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.verdict.homogeneity_test import homogeneity_test
from pma_gym.discovery.verdict.unknown import MOST_SPREAD
from pma_gym.plant import sensors
from tests.plant.test_imposed import imposed

KPA = (100.0, 300.0, 700.0)
SENSOR = {"bandwidth_hz": 1000.0, "noise_n": 0.1}
GIVEN = imposed(force_sensor=SENSOR)
TIME = np.arange(0.0, 4.0, 0.02)


def scatter(friction, *names):
    """Scatter of the size by trial, of effects fitted to friction (N) that differs by pressure."""
    trials = []
    for seed, (force, kpa) in enumerate(zip(friction, KPA, strict=True)):
        hidden = {"contact_friction": {"force_n": force, "presliding_um": 100.0}}
        commands = {
            "contraction_command": 0.01 * (1.0 - np.cos(np.pi * TIME)),
            "pressure_command": np.full(TIME.size, 1e3 * kpa),
        }
        rig = Plant(imposed(force_sensor=SENSOR, **hidden))
        full = rig.simulate(Trial(TIME, commands), seed=seed)
        trials.append(Trial(TIME, full.commands, {"force": full.measurements["force"]}))
    problem = FitProblem(
        trials, GIVEN, free_parameters(GIVEN), tuple(map(white_noise, sensors.deviations(GIVEN)))
    )
    known = {each.name: each for each in candidate_effects(GIVEN, None, trials)}
    chosen = tuple(known[name] for name in names)
    fit = problem.fit(GIVEN, chosen, {each.name: each.probes[0] for each in chosen})
    assert fit is not None
    return homogeneity_test(problem, fit, chosen, 0)["trial"]


BOTH = ("contact_friction", "pressure_friction")


def test_a_growth_that_saturates_is_a_small_error_of_the_friction():
    assert scatter((3.9, 5.4, 7.2), *BOTH) < 0.5 * MOST_SPREAD


def test_a_law_that_misses_how_friction_changes_has_no_one_size():
    falls_and_rises = scatter((7.0, 3.0, 7.0), *BOTH)
    assert falls_and_rises > 2.0 * MOST_SPREAD
    assert scatter((3.9, 5.4, 7.2), "contact_friction") == pytest.approx(0.25, abs=0.08)
