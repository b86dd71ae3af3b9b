"""Checkpoints of a training: parameters as Stable-Baselines3 saves them, arrays, JSON.

Nothing in them executes when it is loaded: of the zip no pickled data is written or read, and
tensors are read as weights only.
"""

import json
import re
import shutil
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.save_util import load_from_zip_file, save_to_zip_file

from benchmarks.runner.damaged_results import reason, say_damaged
from benchmarks.training.averaging import WeightAverage
from pma_gym.document_shape import check_shape
from pma_gym.documents import read_json
from pma_gym.limits import check_limit
from pma_gym.partials import begin_partial, clean_folder, end_partial

COUNTERS = ("num_timesteps", "_n_updates", "_episode_num")
"""What a model counts."""

REPLAYED = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
"""Arrays of the replayed transitions."""


class CheckpointError(RuntimeError):
    """A checkpoint that cannot be saved or used; the message says why and what remains."""


def save_checkpoint(
    folder: Path,
    number: int,
    model: BaseAlgorithm,
    average: WeightAverage | None,
    content: Mapping[str, Any],
) -> None:
    """Save all that the next leg of a training depends on; the last one stays beside it.

    Args:
        folder: of the checkpoints.
        number: of legs that are done.
        model: what is trained.
        average: its averaged weights.
        content: what else is to be remembered, as JSON.
    Raises:
        CheckpointError: it could not be written; the one before is still there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    final = folder / f"{number:06d}"
    partial = begin_partial(final)
    try:
        partial.mkdir()
        variables = {name: getattr(model, name).data for name in _variables(model)}
        if average is not None:
            variables |= {f"average.{i}": one for i, one in enumerate(average.weights or ())}
        with (partial / "model.zip").open("wb") as file:
            save_to_zip_file(file, None, model.get_parameters(), variables)
        buffer, counters = getattr(model, "replay_buffer", None), _counters(model)
        if buffer is not None:
            counters["replayed"] = [int(buffer.pos), bool(buffer.full)]
            rows = len(buffer.rewards) if buffer.full else buffer.pos
            np.savez(partial / "replay.npz", **{k: getattr(buffer, k)[:rows] for k in REPLAYED})
        # The last rollout of a leg is averaged when the next leg begins.
        counters["averaged_at"] = average.seen if average is not None else 0
        state = json.dumps({**content, "counters": counters}, indent=1)
        (partial / "state.json").write_text(state, encoding="utf-8")
        if final.exists():
            shutil.rmtree(final)
        partial.rename(final)
    # PyTorch says of a full disk that it is no OSError.
    except (OSError, RuntimeError) as error:
        raise CheckpointError(
            f"checkpoint {number} cannot be saved in {folder}: {error}; those before it stay; make "
            "room or allow writing, then run the same command again: it goes on from there"
        ) from error
    finally:
        with suppress(OSError):
            end_partial(partial)
    for old in _numbered(folder)[:-2]:
        shutil.rmtree(old, ignore_errors=True)


def load_checkpoint(
    folder: Path,
    model: BaseAlgorithm,
    average: WeightAverage | None,
    shape: Mapping[str, Any],
    order: Mapping[str, Any],
) -> tuple[int, dict[str, Any]] | None:
    """Put a model where the newest checkpoint that is not damaged was.

    Args:
        folder: of the checkpoints.
        model: a new one.
        average: its averaged weights.
        shape: of what `save_checkpoint` was to remember.
        order: what is trained; that of the checkpoint must be the same.
    Returns:
        Number of legs that are done, and what was remembered; None without a checkpoint.
    Raises:
        CheckpointError: the folder is another training's.
    """
    clean_folder(folder)
    for path in reversed(_numbered(folder)):
        try:
            content = read_json(path / "state.json", "journal_mib", own=True, finite=False)
            check_shape(content, {**shape, "order": dict, "counters": dict})
            _check_same(path, content["order"], order)
            for name in ("model.zip", "replay.npz"):
                if (path / name).exists():
                    size = (path / name).stat().st_size
                    check_limit(str(path / name), "weights_mib", size / 2**20)
            _restore(model, average, path, content.pop("counters"))
        except CheckpointError:
            raise
        except Exception as error:
            say_damaged(path, reason(error), "the one before it serves, if any")
            continue
        return int(path.name), content
    return None


def _check_same(path: Path, old: Mapping[str, Any], new: Mapping[str, Any]) -> None:
    new = json.loads(json.dumps(new))
    other = [key for key in {**old, **new} if old.get(key) != new.get(key)]
    if other:
        words = "; ".join(f"{key} was {old.get(key)!r}, is {new.get(key)!r}" for key in other)
        raise CheckpointError(
            f"{path} is of another training: {words}; give another --out, or delete that folder"
        )


def _restore(
    model: BaseAlgorithm, average: WeightAverage | None, path: Path, counters: dict[str, Any]
) -> None:
    _, parameters, variables = load_from_zip_file(path / "model.zip", load_data=False)
    tensors = variables or {}
    means = [tensors[f"average.{i}"] for i in range(sum(k.startswith("average.") for k in tensors))]
    if not all(torch.isfinite(one).all() for one in parameters["policy"].values()):
        raise ValueError("weights hold NaN or infinity: the training diverged")
    model.set_parameters(parameters, exact_match=True)
    for name in _variables(model):
        getattr(model, name).data.copy_(tensors[name])
    if average is not None:
        average.weights, average.seen = means or None, int(counters["averaged_at"])
    buffer: Any = getattr(model, "replay_buffer", None)
    if buffer is not None:
        with np.load(path / "replay.npz", allow_pickle=False) as replayed:
            for name in REPLAYED:
                getattr(buffer, name)[: len(replayed[name])] = replayed[name]
        buffer.pos, buffer.full = counters["replayed"]
    for name in _counters(model):
        setattr(model, name, counters[name])


def _numbered(folder: Path) -> list[Path]:
    """Checkpoints by number; what somebody put beside them is none."""
    return sorted(path for path in folder.glob("*") if re.fullmatch("[0-9]{6}", path.name))


def _counters(model: BaseAlgorithm) -> dict[str, Any]:
    return {name: getattr(model, name) for name in COUNTERS if hasattr(model, name)}


def _variables(model: BaseAlgorithm) -> list[str]:
    """Names of the tensors that a model learns outside its networks (SAC's temperature)."""
    return [name for name in ("log_ent_coef",) if getattr(model, name, None) is not None]
