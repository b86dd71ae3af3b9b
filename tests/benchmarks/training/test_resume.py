"""A training that was interrupted goes on to what it would have come to, or says why not."""

import base64
import errno
import hashlib
import io
import json
import os
import resource
import shutil
import subprocess
import sys
import zipfile

import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("sb3_contrib")
pytest.importorskip("safetensors")

import cloudpickle
import torch
from stable_baselines3.common.save_util import load_from_zip_file

from benchmarks.training import checkpoint, run
from benchmarks.training.averaging import WeightAverage
from benchmarks.training.checkpoint import CheckpointError, save_checkpoint
from benchmarks.training.learner import learner
from benchmarks.training.run import Order, train


@pytest.fixture(autouse=True)
def short_legs(monkeypatch):
    """Legs of two episodes and two validations: what is tested is where they meet."""
    monkeypatch.setattr(run, "EPISODES", 2)
    monkeypatch.setattr(run, "EVALUATIONS", 2)


class Killed(BaseException):
    """Stands for a kill: nothing catches it."""


def killed_after(legs, monkeypatch, order, out):
    """Train until so many checkpoints are saved."""

    def saved(folder, number, *given):
        save_checkpoint(folder, number, *given)
        if number == legs:
            raise Killed

    with monkeypatch.context() as patched:
        patched.setattr(run, "save_checkpoint", saved)
        with pytest.raises(Killed):
            trained(order, out)


def trained(order, out):
    """Train."""
    return train(order, out, lambda steps, point: None)


def weights(model):
    return {name: tensor.clone() for name, tensor in model.policy.state_dict().items()}


def flat(content):
    """All numbers of parameters, optimisers' states and variables."""
    if torch.is_tensor(content):
        return content.reshape(-1).double()
    if isinstance(content, dict):
        content = [content[key] for key in sorted(content, key=str)]
    parts = [flat(one) for one in content] if isinstance(content, list | tuple) else []
    return torch.cat(parts) if parts else torch.zeros(0, dtype=torch.float64)


def same(one, other):
    assert one.keys() == other.keys()
    return all(torch.equal(one[name], other[name]) for name in one)


@pytest.fixture(scope="module")
def kept():
    """Trainings that several tests begin from."""
    return {}


@pytest.fixture
def whole(kept, preset, tmp_path, tmp_path_factory):
    """A folder with a copy of a finished training, its weights and its final score."""
    if "whole" not in kept:
        folder = tmp_path_factory.mktemp("whole")
        done = trained(Order(preset(), seed=3), folder)
        kept["whole"] = folder, weights(done.model), done.final
    folder, tensors, final = kept["whole"]
    return shutil.copytree(folder, tmp_path / "whole"), tensors, final


@pytest.fixture
def killed(kept, preset, monkeypatch, tmp_path, tmp_path_factory):
    """A folder with a copy of a training that was killed after its first leg."""
    if "killed" not in kept:
        kept["killed"] = tmp_path_factory.mktemp("killed")
        killed_after(1, monkeypatch, Order(preset(), seed=3), kept["killed"])
    return shutil.copytree(kept["killed"], tmp_path / "killed")


@pytest.mark.parametrize("algorithm", ["ppo", "sac", "td3", "tqc"])
def test_a_killed_training_comes_to_the_same_policy(algorithm, preset, monkeypatch, tmp_path):
    order = Order(preset(algorithm), seed=3)
    whole = trained(order, tmp_path / "whole")
    assert whole.course.legs == 2
    killed_after(1, monkeypatch, order, tmp_path / "killed")
    resumed = trained(order, tmp_path / "killed")
    assert same(weights(whole.model), weights(resumed.model))
    assert whole.final == resumed.final
    assert [p._replace(wall_s=0.0) for p in whole.course.curve] == [
        p._replace(wall_s=0.0) for p in resumed.course.curve
    ]
    ours, theirs = (
        load_from_zip_file(tmp_path / name / "checkpoints/000002/model.zip", load_data=False)
        for name in ("whole", "killed")
    )
    assert torch.equal(flat(ours), flat(theirs))


def test_a_finished_training_run_again_trains_nothing(whole, preset, monkeypatch):
    folder, tensors, final = whole

    def leg(*_):
        raise AssertionError("there is nothing to train")

    monkeypatch.setattr(run, "_leg", leg)
    again = trained(Order(preset(), seed=3), folder)
    assert same(tensors, weights(again.model)) and final == again.final


def test_the_same_seed_gives_the_same_policy_and_another_one_another(preset, tmp_path):
    one, other, third = (
        weights(trained(Order(preset(steps=480), seed), tmp_path / name).model)
        for name, seed in (("a", 3), ("b", 3), ("c", 4))
    )
    assert same(one, other) and not same(one, third)


PROCESS = """
import hashlib, sys, pathlib
from benchmarks.training import environments, run
from benchmarks.training.configuration.preset import Preset
from controllers.policies.adapter import ActionMapping
from controllers.policies.observation_spec import ObservationSpec
environments.VALIDATION = 1
preset = Preset("small", "ppo", "pma_gym/IsokineticDisplacement-v0", ObservationSpec("tracking", 2,
2),
    ActionMapping("increment", 0.5), "", {"control_rate_hz": 10.0, "pressure_kpa": 300.0}, 4, 480,
    0.5, {"n_steps": 32, "batch_size": 32, "n_epochs": 2, "learning_rate": "lin_0.003"},
    {"net_arch": [16]})
run.EPISODES = run.EVALUATIONS = 2
trained = run.train(run.Order(preset, 3), pathlib.Path(sys.argv[1]), lambda steps, point: None)
sums = hashlib.sha256()
for tensor in trained.model.policy.state_dict().values():
    sums.update(tensor.numpy().tobytes())
print(sums.hexdigest())
"""


def test_another_process_gives_the_same_policy(preset, tmp_path):
    # Another hash seed: no order of a set may matter.
    process = subprocess.run(
        [sys.executable, "-c", PROCESS, str(tmp_path / "there")],
        stdout=subprocess.PIPE,
        check=True,
        text=True,
        env=os.environ | {"PYTHONHASHSEED": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    sums = hashlib.sha256()
    for tensor in weights(trained(Order(preset(steps=480), 3), tmp_path / "here").model).values():
        sums.update(tensor.numpy().tobytes())
    assert process.stdout.strip() == sums.hexdigest()


# -- refused ---------------------------------------------------------------------------------------


def test_another_order_in_the_folder_is_refused(killed, preset):
    with pytest.raises(CheckpointError, match=r"another training: seed was 3, is 4; give another"):
        trained(Order(preset(), seed=4), killed)
    with pytest.raises(CheckpointError, match=r"steps was 960, is 1920"):
        trained(Order(preset(steps=1920), seed=3), killed)


def executes(content):
    """A zip with pickled data of Stable-Baselines3's kind, which runs code when it is loaded."""
    pickled = base64.b64encode(cloudpickle.dumps(Runs())).decode()
    data = json.dumps({"policy_class": {":type:": "", ":serialized:": pickled}})
    made = io.BytesIO(content)
    with zipfile.ZipFile(made, "a") as archive:
        archive.writestr("data", data)
    return made.getvalue()


class Runs:
    def __reduce__(self):
        return exec, ("raise SystemExit('it ran')",)


DAMAGE = {
    "cut tensors": ("model.zip", lambda content: content[: len(content) // 2]),
    "no tensors": ("model.zip", lambda content: b""),
    "pickled tensors": ("model.zip", lambda content: pickled_weights()),
    "cut words": ("state.json", lambda content: content[: len(content) // 2]),
    "other words": ("state.json", lambda content: b"[1, 2]"),
    "no course": ("state.json", lambda content: content.replace(b'"curve"', b'"curved"')),
}


def pickled_weights():
    weights, made = io.BytesIO(), io.BytesIO()
    torch.save({"weight": Runs()}, weights)
    with zipfile.ZipFile(made, "w") as archive:
        archive.writestr("policy.pth", weights.getvalue())
    return made.getvalue()


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_checkpoint_is_named_and_the_one_before_serves(damage, whole, preset, capsys):
    folder, tensors, _ = whole
    name, harm = DAMAGE[damage]
    last = folder / "checkpoints" / "000002"
    (last / name).write_bytes(harm((last / name).read_bytes()))
    (folder / "checkpoints" / "000002 of monday").mkdir()
    assert same(tensors, weights(trained(Order(preset(), seed=3), folder).model))
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("warning: ")]
    assert len(said) == 1 and "000002 is damaged" in said[0]


def test_nothing_in_a_checkpoint_executes(whole, preset):
    folder, tensors, _ = whole
    path = folder / "checkpoints" / "000002" / "model.zip"
    path.write_bytes(executes(path.read_bytes()))
    assert same(tensors, weights(trained(Order(preset(), seed=3), folder).model))


# -- a full disk -----------------------------------------------------------------------------------


def _full(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("what", ["save_to_zip_file", "json"])
def test_a_full_disk_leaves_the_last_checkpoint(what, whole, killed, preset, monkeypatch):
    order = Order(preset(), seed=3)
    with monkeypatch.context() as patched:
        if what == "json":
            patched.setattr("pathlib.Path.write_text", _full)
        else:
            patched.setattr(checkpoint, what, _full)
        with pytest.raises(CheckpointError, match=r"No space left.*before it stay; make room"):
            trained(order, killed)
    assert [p.name for p in (killed / "checkpoints").iterdir()] == ["000001"]
    assert same(whole[1], weights(trained(order, killed).model))


def test_a_file_that_may_not_grow_is_told(preset, tmp_path):
    small = preset()
    envs = run.training_environments(small)
    model = learner(small, envs, 0)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(CheckpointError, match=r"checkpoint 1 cannot be saved "):
            save_checkpoint(tmp_path, 1, model, WeightAverage(0.1, 960), {})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        envs.close()
    assert not list(tmp_path.iterdir())
