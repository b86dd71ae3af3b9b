"""The policies that ship: whole, with their cards, and as good as is asked of them."""

import numpy as np
import pytest

from controllers import Policy, PPOPolicy
from controllers.models.voltage import nominal_offset
from controllers.policies.policy_file import load_policy_file
from controllers.policy import shipped_policies
from pma_gym.envs import ENVIRONMENTS, PMAEnv
from tests.controllers.conftest import trial


@pytest.mark.parametrize("path", shipped_policies(), ids=lambda path: path.stem)
def test_each_loads_and_has_a_card_that_says_how_to_make_it_again(path):
    policy = load_policy_file(path)
    training = policy.training
    card = path.with_suffix(".md").read_text(encoding="utf-8")
    assert policy.name == path.stem and policy.name.endswith(f"-{training['algorithm']}")
    assert f"--preset {training['preset']} --seed {training['seed']}`" in card
    assert training["code"] in card and "+" not in training["code"]


LATE = {"control_rate_hz": 50.0, "action_delay_s": 0.02}


@pytest.mark.parametrize(
    ("task", "options", "scores", "most"),
    [
        *(("displacement", {"pressure_kpa": p}, ["rmse_mm"], 0.10) for p in (200.0, 550.0)),
        *(
            ("rotation", {"pressure_kpa": p}, ["rmse_I_deg", "rmse_II_deg"], 0.5)
            for p in (300.0, 500.0)
        ),
        ("displacement", {"pressure_kpa": 300.0} | LATE, ["rmse_mm"], 0.4),
        (
            "rotation",
            {"pressure_kpa": 400.0, "disturbances": "regulator_and_hand_push"} | LATE,
            ["rmse_deg"],
            2.0,
        ),
    ],
)
def test_references_are_followed_in_the_late_loop_too(task, options, scores, most):
    info = trial(PPOPolicy(), PMAEnv(task, **options), seed=7)
    assert max(info[score] for score in scores) <= most


@pytest.mark.parametrize("path", shipped_policies(), ids=lambda path: path.stem)
def test_each_drives_the_task_that_it_was_trained_for(path):
    policy = Policy(path)
    kwargs = dict(policy.file.environment["kwargs"])
    task = kwargs.pop("task", None) or ENVIRONMENTS[policy.file.environment["id"]]
    kwargs |= {"pressure_kpa": 400.0}
    trial(policy, PMAEnv(task, **kwargs), seed=7)


class Constant:
    """The regulator voltage that holds the pressure that a trial begins at."""

    def reset(self, reference, station):
        self.volts = nominal_offset(station)

    def act(self, observation, time):
        return self.volts


def test_operators_are_held_to_the_pace_in_every_phase():
    """Over eight operators the errors are half of those at constant pressure, or less."""
    env = PMAEnv("isokinetic_exercise", pressure_kpa=400.0)

    def pooled(controller):
        rows = [
            [trial(controller, env, seed)[f"rmse_{phase}_deg"] for phase in ("I", "II", "III")]
            for seed in range(8)
        ]
        return np.sqrt(np.mean(np.square(rows), axis=0))

    assert np.all(pooled(PPOPolicy()) <= 0.5 * pooled(Constant()))
