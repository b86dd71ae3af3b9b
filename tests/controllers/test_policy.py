"""A policy drives the station that it was trained for, and says why it drives no other.

The policies that ship: whole, with their cards, and as good as is asked of them.
"""

import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from controllers import PPOPolicy
from controllers.models.voltage import nominal_offset
from controllers.policies.policy_file import load_policy_file
from controllers.policy import Policy, shipped_policies
from pma_gym.envs import ENVIRONMENTS, PMAEnv
from tests.controllers.conftest import trial

pytest.importorskip("safetensors")

from controllers.policies.adapter import ActionMapping, PolicyAdapter
from controllers.policies.network import Network
from controllers.policies.observation_spec import ObservationSpec
from controllers.policies.policy_file import PolicyError, save_policy_file
from controllers.policy import ShippedPolicy
from controllers.registry import Controller
from tests.controllers.policies.test_network import drawn_policy

KINDS = [
    (ObservationSpec("environment", 2, 3), ActionMapping("direct", 5.0)),
    (ObservationSpec("tracking", 6, 6), ActionMapping("increment", 0.5)),
    (ObservationSpec("tracking", 1, 0), ActionMapping("residual", 1.0, "pid")),
]


@pytest.fixture
def written(station, tmp_path):
    """Path of a policy trained for a station, its parts as asked for."""

    def write(*, of=None, name="displacement-100hz-ppo", **parts):
        return save_policy_file(drawn_policy(of or station(), name, **parts), tmp_path / name)

    return write


@pytest.mark.parametrize(("view", "form"), KINDS)
def test_it_is_the_pilot_and_the_network(view, form, written, station, reading):
    path = written(view=view, form=form, scaled=True)
    policy = Policy(path)
    assert isinstance(policy, Controller) and policy.name == "displacement-100hz-ppo"
    pilot, network = PolicyAdapter(view, form), Network(policy.file.weights)
    for _ in range(2):
        # The second trial is as the first: a reset forgets.
        policy.reset(lambda time: 0.005 * time, station())
        pilot.reset(lambda time: 0.005 * time, station())
        for step in range(20):
            said = reading(extension=1e-4 * step, rotation=1e-3 * step, time=0.01 * step)
            action = network(pilot.update(said, 0.01 * step))[0]
            assert policy.act(said, 0.01 * step) == pilot.volts(float(action))


def test_it_drives_the_environment_as_its_own_actions_do(written, drive):
    """What an agent does that was trained on the environment, action by action."""
    path = written(view=ObservationSpec("environment", 2, 3), form=ActionMapping("direct", 5.0))
    policy, network = Policy(path), Network(Policy(path).file.weights)
    _, volts = drive(policy, "displacement", 300, seed=4, preview=2, history=3)
    env = PMAEnv("displacement", model="station", pressure_kpa=300.0, preview=2, history=3)
    observation, _ = env.reset(seed=4)
    over = False
    while not over:
        observation, _, _, over, _ = env.step(network(observation).astype(np.float32))
    np.testing.assert_allclose(volts, env.voltages, atol=1e-5)


def test_every_difference_is_named(written, station):
    policy = Policy(written())
    other = replace(station("rotation", period=0.02), action_delay=0.02, observation_delay=0.04)
    with pytest.raises(PolicyError) as caught:
        policy.reset(lambda time: 0.0, other)
    message = str(caught.value)
    for part in (
        "policy displacement-100hz-ppo was not trained for this station",
        "the task's kind is rotation, trained for displacement",
        "the control rate is 50 Hz, trained for 100 Hz",
        "the action delay is 0.02 s, trained for 0 s",
        "the observation delay is 0.04 s, trained for 0 s",
        "entry 4 of the observation is reference now (1.0 = 90 deg), trained for reference now "
        "(1.0 = 25 mm)",
        "more entries differ. Give the environment what it was trained for",
    ):
        assert part in message


def test_anywhere_skips_rate_and_delay_but_not_what_it_sees(written, station):
    policy = Policy(written(), anywhere=True)
    policy.reset(lambda time: 0.0, replace(station(period=0.02), action_delay=0.02))
    with pytest.raises(PolicyError, match="kind is rotation.*entry 4 of the observation") as caught:
        policy.reset(lambda time: 0.0, station("rotation", period=0.02))
    assert "Hz" not in str(caught.value).split("Give")[0]


def test_a_view_that_has_other_rows_now_is_refused(station, tmp_path):
    """The file says what the entries were; code that changed since cannot misread them."""
    policy = drawn_policy(station())
    rows = (("measured torque", "1 Nm"), *policy.observation[1:])
    path = save_policy_file(replace(policy, observation=rows), tmp_path / "older")
    message = "entry 0 of the observation is measured extension (1.0 = 25 mm), trained for measured"
    with pytest.raises(PolicyError, match=re.escape(message)):
        Policy(path, anywhere=True).reset(lambda time: 0.0, station())
    longer = drawn_policy(station(), view=ObservationSpec("environment", 4, 3))
    path = save_policy_file(
        replace(longer, view=ObservationSpec("environment", 2, 3)), tmp_path / "longer"
    )
    with pytest.raises(PolicyError, match="the observation has 12 entries, trained for 14"):
        Policy(path, anywhere=True).reset(lambda time: 0.0, station())


def test_unseen_references_of_its_kind_are_followed(written, drive):
    _, volts = drive(Policy(written()), "displacement_sine", 300, preview=2, history=3)
    assert len(volts) == 1001


def test_the_shipped_policy_is_the_one_for_the_task_and_loop(written, station, reading, tmp_path):
    slow = replace(station(period=0.02), action_delay=0.02)
    paths = [written(), written(of=slow, name="displacement-50hz_delay20ms-ppo", seed=3)]
    assert shipped_policies(tmp_path) == sorted(paths)
    shipped = ShippedPolicy("ppo", tmp_path)
    assert isinstance(shipped, Controller) and shipped.name == "ppo"
    for where, path in zip((station(), slow, station()), (*paths, paths[0]), strict=True):
        alone = Policy(path)
        for controller in (shipped, alone):
            controller.reset(lambda time: 0.005 * time, where)
        said = reading(extension=1e-3)
        assert shipped.act(said, 0.0) == alone.act(said, 0.0)


def test_a_loop_that_nothing_is_shipped_for_is_refused(written, station, tmp_path):
    written()
    message = (
        "no policy displacement-50hz-ppo is shipped (kind of task, loop, algorithm), of ppo "
        "only displacement-100hz-ppo; take a task, control rate and delay of these"
    )
    shipped = ShippedPolicy("ppo", tmp_path)
    shipped.reset(lambda time: 0.0, station())
    with pytest.raises(PolicyError, match=re.escape(message)):
        shipped.reset(lambda time: 0.0, station(period=0.02))
    with pytest.raises(RuntimeError, match="has no trial: call reset"):
        shipped.act(None, 0.0)
    with pytest.raises(PolicyError, match="only none at all"):
        ShippedPolicy("ppo", tmp_path / "nowhere").reset(lambda time: 0.0, station())


def test_torch_is_not_needed():
    code = (
        "import sys, controllers.policy; "
        "assert not {'torch', 'stable_baselines3', 'safetensors'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


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
