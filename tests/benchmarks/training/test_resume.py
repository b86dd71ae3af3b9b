"""A training that was interrupted goes on, keeps its best weights, or says why not."""

import base64
import errno
import io
import json
import os
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

from benchmarks.training import run
from benchmarks.training.run import CheckpointError, Order, train


def interrupted(order, out, after):
    """Train until so many control steps, then Ctrl-C."""

    def stop(steps, point):
        if steps >= after and point is not None:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(order, out, stop)


def trained(order, out):
    return train(order, out, lambda steps, point: None)


def weights(model):
    return {name: tensor.clone() for name, tensor in model.policy.state_dict().items()}


def same(one, other):
    assert one.keys() == other.keys()
    return all(torch.equal(one[name], other[name]) for name in one)


@pytest.fixture(scope="module")
def kept():
    return {}


@pytest.fixture
def whole(kept, preset, tmp_path, tmp_path_factory):
    """A folder with a copy of a finished training, and what it came to."""
    if not kept:
        folder = tmp_path_factory.mktemp("whole")
        kept["whole"] = folder, trained(Order(preset(), seed=3), folder)
    folder, done = kept["whole"]
    return shutil.copytree(folder, tmp_path / "whole"), done


@pytest.mark.parametrize("algorithm", ["ppo", "sac", "td3", "tqc"])
def test_an_interrupted_training_goes_on_from_its_checkpoint(algorithm, preset, tmp_path):
    order = Order(preset(algorithm), seed=3)
    interrupted(order, tmp_path, 256)
    before = (tmp_path / "checkpoint.zip").read_bytes()
    resumed = []
    done = train(order, tmp_path, lambda steps, point: resumed.append(steps))
    assert min(resumed) >= 256 and done.model.num_timesteps >= 512
    steps = [point.steps for point in done.curve]
    assert steps == sorted(set(steps)) and steps[0] == 0 and min(resumed) in steps
    assert done.best.mean == min(point.mean for point in done.curve)
    if algorithm != "ppo":
        # What it replays is from the second half alone, and fills before it learns again.
        assert done.model.replay_buffer.pos * 4 == done.model.num_timesteps - min(resumed)
        assert done.model.learning_starts == 64 + min(resumed)
    assert (tmp_path / "checkpoint.zip").read_bytes() != before


def test_a_finished_training_run_again_trains_nothing(whole, preset, monkeypatch):
    folder, done = whole
    monkeypatch.setattr(run, "validate", lambda *_: pytest.fail("there is nothing to train"))
    again = trained(Order(preset(), seed=3), folder)
    assert same(weights(done.model), weights(again.model)) and done.best == again.best


def test_the_weights_are_those_of_the_best_validation(preset, tmp_path, monkeypatch):
    errors, seen = iter([3.0, 1.0, *[2.0] * 20]), []

    def validate(model, envs, task, wall_s):
        seen.append(weights(model))
        return run.Point(model.num_timesteps, wall_s, 0.0, 0, 0.0, next(errors))

    monkeypatch.setattr(run, "validate", validate)
    done = trained(Order(preset(), seed=3), tmp_path)
    assert same(weights(done.model), seen[1]) and not same(seen[1], seen[-1])
    assert done.best == done.curve[1]


def test_the_same_seed_gives_the_same_policy_in_any_process_and_another_one_another(
    whole, preset, tmp_path
):
    _, done = whole
    there = tmp_path / "there"
    order = cloudpickle.dumps(Order(preset(), seed=3))
    # Another hash seed: no order of a set may matter.
    subprocess.run(
        [sys.executable, "-c", PROCESS, str(there)],
        input=order,
        check=True,
        env=os.environ | {"PYTHONHASHSEED": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert same(weights(done.model), weights(trained(Order(preset(), seed=3), there).model))
    other = trained(Order(preset(), seed=4), tmp_path / "other")
    assert not same(weights(done.model), weights(other.model))


PROCESS = """
import pathlib, pickle, sys
from benchmarks.training import policy_batch, run
policy_batch.VALIDATION = 1
run.train(pickle.load(sys.stdin.buffer), pathlib.Path(sys.argv[1]), lambda steps, point: None)
"""


# -- refused ---------------------------------------------------------------------------------------


def test_another_order_in_the_folder_is_refused(whole, preset):
    with pytest.raises(CheckpointError, match=r"another training: seed was 3, is 4; give another"):
        trained(Order(preset(), seed=4), whole[0])
    with pytest.raises(CheckpointError, match=r"n_timesteps was 512, is 1024"):
        trained(Order(preset(n_timesteps=1024), seed=3), whole[0])


class Runs:
    def __reduce__(self):
        return exec, ("raise SystemExit('it ran')",)


def rewritten(content, name, change):
    """A zip with another content of one file."""
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(made, "w") as new:
        for each in old.namelist():
            new.writestr(each, change(old.read(each)) if each == name else old.read(each))
    return made.getvalue()


def pickled(_):
    made = io.BytesIO()
    torch.save({"weight": Runs()}, made)
    return made.getvalue()


DAMAGE = {
    "cut": lambda content: content[: len(content) // 2],
    "empty": lambda content: b"",
    "pickled tensors": lambda content: rewritten(content, "policy.pth", pickled),
    "other data": lambda content: rewritten(content, "data", lambda _: b"[1, 2]"),
    "no curve": lambda content: rewritten(content, "data", lambda d: d.replace(b"curve", b"x")),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_checkpoint_is_named(damage, whole, preset):
    path = whole[0] / "checkpoint.zip"
    path.write_bytes(DAMAGE[damage](path.read_bytes()))
    with pytest.raises(CheckpointError, match=r"checkpoint.zip is damaged .*; delete it to train"):
        trained(Order(preset(), seed=3), whole[0])


def test_nothing_in_a_checkpoint_executes(whole, preset):
    folder, done = whole
    path = folder / "checkpoint.zip"
    code = base64.b64encode(cloudpickle.dumps(Runs())).decode()
    words = {"policy_class": {":type:": "", ":serialized:": code}}
    content = rewritten(
        path.read_bytes(), "data", lambda data: json.dumps(json.loads(data) | words).encode()
    )
    path.write_bytes(content)
    assert same(weights(done.model), weights(trained(Order(preset(), seed=3), folder).model))


def test_a_full_disk_leaves_the_last_checkpoint(preset, monkeypatch, tmp_path):
    order = Order(preset(), seed=3)
    interrupted(order, tmp_path, 256)
    before = (tmp_path / "checkpoint.zip").read_bytes()

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(run, "replace_files", full)
    with pytest.raises(CheckpointError, match=r"No space left.*before it stays; make room"):
        trained(order, tmp_path)
    assert (tmp_path / "checkpoint.zip").read_bytes() == before
    assert not list(tmp_path.glob(".*partial"))
