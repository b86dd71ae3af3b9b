"""What data could tell, by the generator's own ruler."""

import numpy as np
import pytest

from benchmarks.hidden_effects.evaluation.verdicts import compare, no_answer
from benchmarks.hidden_effects.generation.cases import SCALED_TOGETHER, draw_case
from benchmarks.hidden_effects.generation.effect_size import (
    KNOWN,
    UNTOLD,
    Behind,
    Experiment,
    odds_of_parameters,
)
from benchmarks.hidden_effects.generation.excitation import draw_trial
from benchmarks.hidden_effects.physics.rig import NOMINAL, noise_levels
from benchmarks.hidden_effects.physics.simulation import Commands
from tests.benchmarks.hidden_effects.cheap_diagnosis import document


def test_what_parameters_absorb_is_not_told():
    numbers = {"radius": 1.0, "mass": 2.0}
    g = np.random.default_rng(1)
    base, *shapes = 100.0 * g.standard_normal((4, 2, 40, 4))
    few = Commands(np.zeros((2, 40)), np.zeros((2, 40)), np.arange(2.0))
    behind = Behind(
        Experiment(few, np.ones((2, 40), bool), np.ones(4)),
        numbers,
        base,
        [base + 0.005 * shapes[0], base + 0.01 * shapes[1]],
    )
    small, large = (behind.log_odds(base + size * KNOWN * shapes[0]) for size in (1.0, 5.0))
    # Half the square of how many standard deviations the radius must be off.
    assert small == pytest.approx(0.5, rel=0.02) and large == pytest.approx(12.5, rel=0.02)
    assert behind.log_odds(base + shapes[2]) > 100.0


def off(**factors):
    """Log odds of parameters that are off by factors, in one trial of moving load and pressure."""
    motor, regulator = draw_trial(np.random.default_rng(3), "both", 2.0, False, False)
    commands = Commands(motor[None], regulator[None], np.zeros(1))
    experiment = Experiment(commands, np.ones(motor[None].shape, bool), noise_levels(np.ones(4)))
    rig = {name: value * factors.get(name, 1.0) for name, value in NOMINAL.items()}
    return odds_of_parameters(experiment, rig, factors, SCALED_TOGETHER)


def test_a_light_slide_is_not_told_beside_a_rotor_and_a_radius_is():
    truth = off(radius=1.1, mass=1.2)
    assert truth["mass"] < UNTOLD and truth["radius"] > 1000.0


def test_cases_tell_of_their_parameters_whether_data_do():
    case = draw_case(5, 2, "parameters", trials=2, seconds=2.0)
    off = {names[0] for names in SCALED_TOGETHER if names[0] in case.truth["base_factors"]}
    assert off and set(case.truth["log_odds"]) == off
    assert draw_case(5, 2, "nothing", trials=2, seconds=2.0).truth["log_odds"] == {}
    truth = case.truth | {"log_odds": {"radius": UNTOLD + 0.1}}
    outcome = compare(truth, document("agrees"))
    untold = compare(truth | {"log_odds": {"radius": UNTOLD}}, document("agrees"))
    assert outcome.parameters_tellable and not untold.parameters_tellable
    # What raises counts against the diagnosis, not for it.
    failed = compare(truth, no_answer("ValueError"))
    assert failed.parameters_tellable and not failed.parameters
