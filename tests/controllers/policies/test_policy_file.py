"""A policy file comes back as it was written; one that was tampered with says how.

What a file of weights announces is held against what it has, before memory is taken.
"""

import hashlib
import json
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("safetensors")

from safetensors.numpy import load, save

from controllers.policies.adapter import ActionMapping
from controllers.policies.document import SHAPE
from controllers.policies.network import Network
from controllers.policies.observation_spec import ObservationSpec
from controllers.policies.policy_file import (
    PolicyError,
    load_policy_file,
    policy_pair,
    save_policy_file,
)
from controllers.policies.tensors import weights_of
from tests.controllers.policies.test_network import drawn_policy, drawn_weights


@pytest.fixture
def policy(station):
    return drawn_policy(station())


@pytest.fixture
def pair(policy, tmp_path):
    """Words and weights on the disk."""
    save_policy_file(policy, tmp_path / "mine")
    return policy_pair(tmp_path / "mine")


def rewrite(pair, change, tensors=None):
    """Change the words, and the weights with a digest that is right."""
    words, weights = pair
    document = json.loads(words.read_text())
    if tensors is not None:
        weights.write_bytes(save(tensors))
        document["sha256"] = hashlib.sha256(weights.read_bytes()).hexdigest()
    change(document)
    words.write_text(json.dumps(document))


@pytest.mark.parametrize("scaled", [False, True])
@pytest.mark.parametrize(
    ("view", "form"),
    [
        (ObservationSpec("environment", 2, 3), ActionMapping("direct", 5.0)),
        (ObservationSpec("tracking", 6, 6), ActionMapping("increment", 0.5)),
        (ObservationSpec("tracking", 1, 0), ActionMapping("residual", 1.0, "pid")),
    ],
)
def test_what_is_written_comes_back(view, form, scaled, station, tmp_path):
    policy = drawn_policy(station(), view=view, form=form, scaled=scaled)
    words = save_policy_file(policy, tmp_path / "displacement-62.5hz-ppo")
    assert words == tmp_path / "displacement-62.5hz-ppo.json"
    for name in (words, words.with_suffix(".safetensors"), tmp_path / "displacement-62.5hz-ppo"):
        back = load_policy_file(name)
        same = ("name", "title", "task", "environment", "view", "form", "observation", "training")
        assert all(getattr(back, field) == getattr(policy, field) for field in same)
        observation = np.random.default_rng(1).normal(size=len(policy.observation))
        again, wanted = Network(back.weights)(observation), Network(policy.weights)(observation)
        assert again.tobytes() == wanted.tobytes()


def test_the_same_policy_is_the_same_bytes(policy, pair, tmp_path):
    save_policy_file(policy, tmp_path / "again")
    for one, other in zip(pair, policy_pair(tmp_path / "again"), strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_weights_may_lie_in_memory_in_any_order(policy, tmp_path):
    first, *rest = policy.weights.layers
    turned = first._replace(weight=np.asfortranarray(first.weight))
    policy = replace(policy, weights=policy.weights._replace(layers=(turned, *rest)))
    back = load_policy_file(save_policy_file(policy, tmp_path / "turned"))
    assert np.array_equal(back.weights.layers[0].weight, first.weight)


# -- the two files ---------------------------------------------------------------------------------


@pytest.mark.parametrize("which", [0, 1])
def test_a_missing_file_is_named(pair, which):
    pair[which].unlink()
    message = f"there is no file {pair[which]}; a policy is two files in one folder"
    with pytest.raises(PolicyError, match=re.escape(message)):
        load_policy_file(pair[0])


@pytest.mark.parametrize(("which", "most"), [(0, 4), (1, 64)])
def test_a_file_too_large_is_refused_unread(pair, which, most):
    with pair[which].open("r+b") as file:
        file.truncate((most << 20) + 1)
    message = f"{pair[which].name} must have at most {most} MiB, it has {most}.0"
    with pytest.raises(PolicyError, match=re.escape(message)):
        load_policy_file(pair[0])


@pytest.mark.parametrize("cut", [0, 7, -1])
def test_weights_that_were_cut_off_are_refused(pair, cut):
    _, weights = pair
    weights.write_bytes(weights.read_bytes()[:cut])
    with pytest.raises(PolicyError, match="one of the two files was cut off, changed or mixed up"):
        load_policy_file(weights)
    # With a digest that is right the format itself shows it.
    rewrite(
        pair, lambda words: words.update(sha256=hashlib.sha256(weights.read_bytes()).hexdigest())
    )
    with pytest.raises(PolicyError, match="the weights beside it are no safetensors"):
        load_policy_file(weights)


def test_every_byte_counts(pair):
    _, weights = pair
    whole = weights.read_bytes()
    for place in np.linspace(0, len(whole) - 1, 23).astype(int).tolist():
        weights.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        with pytest.raises(PolicyError, match="not the ones it was written with"):
            load_policy_file(weights)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[" * 100000,
        '{"a": NaN}',
        "\xff",
        '{"a": ' + "9" * 5000 + "}",
        "[1]",
        "null",
        '"x"',
    ],
)
def test_words_that_are_no_json_are_refused(pair, text):
    words, _ = pair
    words.write_bytes(text.encode("latin-1"))
    with pytest.raises(
        PolicyError, match=f"{re.escape(str(words))}: it (is no JSON|must be a table)"
    ):
        load_policy_file(words)


def test_a_failing_disk_leaves_the_old_pair_whole(policy, pair, monkeypatch):
    before = [path.read_bytes() for path in pair]
    other = replace(policy, weights=drawn_weights((len(policy.observation), 64, 64, 1), seed=5))
    write = Path.write_bytes

    for failing in pair:

        def full(path, content, failing=failing):
            if failing.name in path.name:
                write(path, content[:10])
                raise OSError(28, "No space left on device")
            return write(path, content)

        monkeypatch.setattr(Path, "write_bytes", full)
        with pytest.raises(OSError, match="No space left"):
            save_policy_file(other, pair[0])
        monkeypatch.undo()
        assert [path.read_bytes() for path in pair] == before
        assert sorted(pair[0].parent.iterdir()) == sorted(pair)


def test_a_machine_that_stops_between_the_files_leaves_no_pair_that_loads_wrongly(
    policy, pair, monkeypatch
):
    other = replace(policy, weights=drawn_weights((len(policy.observation), 64, 64, 1), seed=5))
    rename = os.replace

    def stops(source, target):
        if target.suffix == ".json":
            raise KeyboardInterrupt
        rename(source, target)

    monkeypatch.setattr(os, "replace", stops)
    with pytest.raises(KeyboardInterrupt):
        save_policy_file(other, pair[0])
    monkeypatch.undo()
    with pytest.raises(PolicyError, match="not the ones it was written with"):
        load_policy_file(pair[0])


# -- words -----------------------------------------------------------------------------------------


def test_every_key_must_be_there_and_no_other(pair):
    whole = pair[0].read_text()
    for section in ("", "network", "environment", "training"):
        for key in SHAPE[section] if section else SHAPE:
            pair[0].write_text(whole)
            rewrite(pair, lambda words, s=section, k=key: (words[s] if s else words).pop(k))
            message = f"{key} is missing; it must be"
            with pytest.raises(PolicyError, match=message):
                load_policy_file(pair[0])
        pair[0].write_text(whole)
        rewrite(pair, lambda words, s=section: (words[s] if s else words).update(cmd="rm"))
        with pytest.raises(
            PolicyError, match=f"the key 'cmd' of {section or 'the file'} must be among"
        ):
            load_policy_file(pair[0])


def _set(*path_and_value):
    *path, last, value = path_and_value

    def change(words):
        for key in path:
            words = words[key]
        words[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_set("schema", 2), "schema must be 1, the one that is known here, got 2"),
        (_set("schema", True), "schema must be a whole number, got True"),
        (_set("name", ""), "name must be a text, got ''"),
        (
            _set("task", "isotonic"),
            "task must be one of displacement, .*contraction, isokinetic, moment, got",
        ),
        (_set("network", []), r"network must be a table, got \[\]"),
        (_set("network", "layers", [12, 1]), "tensors: layers.0.bias must be of the shape"),
        (
            _set("network", "layers", [12, 64, 2]),
            "must be 1: a policy has one action",
        ),
        (
            _set("network", "layers", [10**12, 1]),
            "entry 1 must be a whole number in 1 to 65536",
        ),
        (
            _set("network", "layers", [True, 1]),
            "entry 1 must be a whole number in 1 to 65536",
        ),
        (_set("network", "activation", "gelu"), "network.activation must be one of tanh, relu"),
        (_set("network", "output", ["clip"]), r"network.output must be a text, got \['clip'\]"),
        (_set("network", "scaling", {"epsilon": 0, "clip": 1}), "a positive epsilon and clip"),
        (
            _set("network", "scaling", {"epsilon": 1e-8, "clip": 10.0}),
            "tensors: scaling.mean must be of the shape .* got None",
        ),
        (_set("tensors", "more", [1]), "tensors: more must be without a place in network.layers"),
        (_set("sha256", "0" * 63), "sha256 must be 64 hexadecimal digits"),
        (_set("environment", "kwargs", {}), "environment.kwargs.control_rate_hz is missing"),
        (
            _set("environment", "kwargs", "control_rate_hz", 0),
            "environment.kwargs.control_rate_hz must be a positive number of Hz, got 0",
        ),
        (
            _set("environment", "kwargs", "action_delay_s", -0.01),
            "action_delay_s must be a finite number, 0 or more, got -0.01",
        ),
        (_set("view", "kind", "camera"), "view: view kind must be one of tracking, environment"),
        (_set("view", "more", 1), "view: a view has kind, preview and history; check more"),
        (_set("form", "kind", "torque"), "form: form kind must be one of direct, increment, res"),
        (
            lambda words: words.update(
                form={"kind": "residual", "authority_v": 0.3, "base": {"a": "pid"}}
            ),
            r"form: a residual names its base, a text, .* with base \{'a': 'pid'\}",
        ),
        (_set("form", "authority_v", "5"), "form: form authority_v must be a number"),
        (_set("observation", 0, ["one"]), r"observation, entry 1 must be a list of 2 or more"),
        (_set("observation", []), "observation must be a list of 12 "),
        (_set("training", "steps", -1), "training.steps must be a whole number, 0 or more, got -1"),
        (_set("training", "curve", [[1, 2]]), "training.curve, entry 1 must be a list of 3"),
        (_set("training", "seed", "one"), "training.seed must be a whole number, got 'one'"),
    ],
)
def test_wrong_words_are_named(pair, change, message):
    rewrite(pair, change)
    with pytest.raises(PolicyError, match=message) as caught:
        load_policy_file(pair[0])
    assert str(caught.value).startswith(f"{pair[0]}: ")
    assert str(caught.value).endswith("export the policy anew, or copy both files")


# -- weights ---------------------------------------------------------------------------------------


def _without(name):
    return lambda tensors: {key: value for key, value in tensors.items() if key != name}


def _spoilt(name, *values):
    def change(tensors):
        tensors[name] = tensors[name].copy()
        tensors[name].flat[: len(values)] = values
        return tensors

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_spoilt("layers.1.weight", np.nan), "layers.1.weight must hold finite .* 1 of its 4096"),
        (_spoilt("layers.0.bias", np.inf, -np.inf), "layers.0.bias .* 2 of its 64 are NaN or inf"),
        (_without("layers.2.bias"), "missing: layers.2.bias, unexpected: none"),
        (lambda t: t | {"more": np.ones(1)}, "missing: none, unexpected: more"),
        (
            lambda t: t | {"layers.0.weight": t["layers.0.weight"].T.copy()},
            r"layers.0.weight must have the shape \[64, 12\] in float32, it has \[12, 64\] in flo",
        ),
        (
            lambda t: t | {"layers.0.bias": t["layers.0.bias"].astype(np.float64)},
            r"layers.0.bias must have the shape \[64\] in float32, it has \[64\] in float64",
        ),
    ],
)
def test_wrong_weights_are_named(pair, change, message):
    rewrite(pair, lambda words: None, change(load(pair[1].read_bytes())))
    with pytest.raises(PolicyError, match=message):
        load_policy_file(pair[0])


def test_what_would_not_load_is_not_written(policy, tmp_path):
    first, *rest = policy.weights.layers
    spoilt = first._replace(bias=np.full_like(first.bias, np.nan))
    wrong = {
        "64 of its 64 are NaN": {"weights": policy.weights._replace(layers=(spoilt, *rest))},
        "layer 1 takes 64 values, layer 0 gives 1": {
            "weights": policy.weights._replace(layers=(rest[-1], *rest))
        },
        "observation must be a list of 12": {"observation": policy.observation[1:]},
        "not JSON serializable": {"training": {**policy.training, "scores": {"a": object()}}},
        "Out of range float": {"training": {**policy.training, "wall_s": float("nan")}},
        "name must be a text": {"name": ""},
    }
    for message, change in wrong.items():
        with pytest.raises(PolicyError, match=message):
            save_policy_file(replace(policy, **change), tmp_path / "wrong")
    assert not list(tmp_path.iterdir())


SOUND = save({"a": np.zeros((3, 4), np.float32), "b": np.arange(5.0)})


def blob(header, data=b"\0" * 8):
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + data


def tensor(**changed):
    return {"a": {"dtype": "F64", "shape": [1], "data_offsets": [0, 8]} | changed}


HOSTILE = {
    "empty": b"",
    "a header of exabytes": b"\xff" * 8 + b"{}",
    "cut off": SOUND[:-3],
    "too long": SOUND + b"x",
    "no JSON": blob(b"{x"),
    "deep": blob(b"[" * 100_000),
    "a list": blob(b"[]"),
    "terabytes": blob(tensor(shape=[2**40])),
    "overflow": blob(tensor(shape=[2**32, 2**32])),
    "negative": blob(tensor(shape=[-1, -1])),
    "NaN": blob(b'{"a": {"shape": [NaN]}}'),
    "unknown kind": blob(tensor(dtype="F1024")),
    "text": blob(tensor(shape="x")),
    "offsets": blob(tensor(data_offsets=[8, 0])),
    "one offset": blob(tensor(data_offsets=[8])),
    "overlap": blob(tensor() | {"b": tensor()["a"]}),
    "dimensions": blob(tensor(shape=[1] * 100)),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_weights_are_one_message(case):
    document = {"network": {}, "sha256": hashlib.sha256(HOSTILE[case]).hexdigest(), "tensors": {}}
    with pytest.raises(PolicyError, match="are no safetensors") as caught:
        weights_of(document, HOSTILE[case])
    assert len(str(caught.value)) < 300
