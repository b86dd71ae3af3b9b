"""Checkpoints of a training: tensors and numbers, written whole or not at all.

Nothing in them executes when it is loaded: weights, optimisers' states and replayed transitions
travel as safetensors, counts as JSON.
"""

import json
import re
import shutil
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from stable_baselines3.common.base_class import BaseAlgorithm

from benchmarks.runner.damaged_results import reason, say_damaged
from benchmarks.training.averaging import WeightAverage
from controllers.policies.tensors import LARGEST_HEADER, check_header
from pma_gym.document_shape import check_shape
from pma_gym.documents import read_json
from pma_gym.limits import check_limit
from pma_gym.partials import begin_partial, clean_folder, end_partial

COUNTERS = ("num_timesteps", "_n_updates", "_episode_num")
"""What a model counts."""


class CheckpointError(RuntimeError):
    """A checkpoint that cannot be saved or used; the message says why and what remains."""


def save_checkpoint(
    folder: Path,
    number: int,
    model: BaseAlgorithm,
    average: WeightAverage | None,
    content: Mapping[str, Any],
) -> None:
    """Save all that the next leg of a training depends on; the last one stays until this is whole.

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
    # What a killed training left half-written goes too.
    partial, replaced = begin_partial(final), begin_partial(final)
    try:
        partial.mkdir()
        tensors, numbers = _state(model)
        if average is not None:
            # The last rollout of a leg is averaged when the next leg begins.
            numbers["averaged_at"] = average.seen
            tensors |= {f"average.{i}": one for i, one in enumerate(average.weights or ())}
        save_file(
            {key: one.contiguous().clone() for key, one in tensors.items()},
            partial / "state.safetensors",
        )
        state = json.dumps({"numbers": numbers, "told": dict(content)}, indent=1)
        (partial / "state.json").write_text(state, encoding="utf-8")
        if final.exists():
            # Whole under another name until the new one is there: a kill may come between.
            final.rename(replaced)
        partial.rename(final)
    # What fails while tensors are written is no OSError.
    except (OSError, SafetensorError) as error:
        kept = latest(folder)
        why = getattr(error, "strerror", None) or error
        stays = f"the one of leg {kept[0]} stays in {kept[1]}" if kept else "there is none before"
        raise CheckpointError(
            f"checkpoint {number} cannot be saved in {folder}: {why}; {stays}; "
            "make room or allow writing, then run the same command again: it goes on from there"
        ) from error
    finally:
        for name in (partial, replaced):
            with suppress(OSError):
                end_partial(name)
    for old in _numbered(folder)[:-2]:
        shutil.rmtree(old, ignore_errors=True)


def latest(folder: Path) -> tuple[int, Path] | None:
    """Number and folder of the newest checkpoint, if there is one.

    What a killed training left half-written beside them is removed.
    """
    clean_folder(folder)
    checkpoints = [path for path in _numbered(folder) if (path / "state.json").is_file()]
    return (int(checkpoints[-1].name), checkpoints[-1]) if checkpoints else None


def usable(folder: Path, keys: Mapping[str, Any]) -> tuple[int, Path, dict[str, Any]] | None:
    """The newest checkpoint that is not damaged, and what it says besides its tensors.

    Args:
        folder: of the checkpoints.
        keys: shapes of what there must be, by key.
    """
    for path in reversed(_numbered(folder)):
        if not (path / "state.json").is_file():
            continue
        try:
            content = read_content(path, keys)
            check_shape(content, keys)
            _check_tensors(path / "state.safetensors")
        except (CheckpointError, OSError, ValueError) as error:
            say_damaged(path, reason(error.__cause__ or error), "the one before it serves, if any")
            continue
        return int(path.name), path, content
    return None


def _numbered(folder: Path) -> list[Path]:
    """Checkpoints by number; what somebody put beside them is none."""
    return sorted(path for path in folder.glob("*") if re.fullmatch("[0-9]{6}", path.name))


def read_content(path: Path, keys: Collection[str]) -> dict[str, Any]:
    """Read the content of a checkpoint besides its tensors.

    Args:
        path: of the checkpoint.
        keys: what there must be.
    Raises:
        CheckpointError: it is damaged.
    """
    try:
        content = _words(path)["told"]
        return {key: content[key] for key in keys}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise _damaged(path, error) from error


def load_checkpoint(path: Path, model: BaseAlgorithm, average: WeightAverage | None) -> None:
    """Put a model where a checkpoint was.

    Raises:
        CheckpointError: it is damaged, or of another model.
    """
    try:
        _check_tensors(path / "state.safetensors")
        tensors = load_file(path / "state.safetensors")
        numbers = _words(path)["numbers"]
        _check_finite(tensors)
        _restore(model, tensors, numbers)
        means = [
            tensors[f"average.{i}"] for i in range(sum(k.startswith("average.") for k in tensors))
        ]
        if average is not None and means:
            average.weights = means
        if average is not None:
            average.seen = int(numbers["averaged_at"])
    except Exception as error:
        raise _damaged(path, error) from error


def _words(path: Path) -> dict[str, Any]:
    """What a checkpoint says besides its tensors; a training that diverged may hold NaN."""
    return read_json(path / "state.json", "journal_mib", own=True, finite=False)


def _check_tensors(path: Path) -> None:
    """Refuse a file of tensors that announces more than it holds, before memory is taken."""
    size = path.stat().st_size
    check_limit(str(path), "weights_mib", size / 2**20)
    with path.open("rb") as file:
        check_header(file.read(8 + LARGEST_HEADER), size)


def _check_finite(tensors: Mapping[str, torch.Tensor]) -> None:
    for name, tensor in tensors.items():
        if not torch.isfinite(tensor).all():
            raise ValueError(f"tensor {name} holds NaN or infinity: the training diverged")


def _damaged(path: Path, error: Exception) -> CheckpointError:
    return CheckpointError(
        f"checkpoint {path} cannot be used ({type(error).__name__}: {error}); delete that folder "
        "to go on from the one before"
    )


def _state(model: BaseAlgorithm) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """All that a model has learned and counts, as tensors and JSON."""
    tensors: dict[str, torch.Tensor] = {}
    numbers: dict[str, Any] = {
        "counters": {n: getattr(model, n) for n in COUNTERS if hasattr(model, n)}
    }
    for name, state in model.get_parameters().items():
        if "optimizer" in name:
            numbers[name] = state["param_groups"]
            for i, values in state["state"].items():
                tensors |= {f"{name}.{i}.{key}": value for key, value in values.items()}
        else:
            tensors |= {f"{name}.{key}": value for key, value in state.items()}
    for name in _variables(model):
        tensors[f"variable.{name}"] = getattr(model, name).data
    buffer = getattr(model, "replay_buffer", None)
    if buffer is not None:
        numbers["replayed"] = [int(buffer.pos), bool(buffer.full)]
        for name in _replayed(buffer):
            kept = getattr(buffer, name)
            tensors[f"replayed.{name}"] = torch.from_numpy(
                kept if buffer.full else kept[: buffer.pos]
            )
    return tensors, numbers


def _variables(model: BaseAlgorithm) -> list[str]:
    """Names of the tensors that a model learns outside its networks (SAC's temperature)."""
    return [name for name in ("log_ent_coef",) if getattr(model, name, None) is not None]


def _replayed(buffer: Any) -> list[str]:  # noqa: ANN401
    names = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
    return [name for name in names if isinstance(getattr(buffer, name, None), np.ndarray)]


def _restore(
    model: BaseAlgorithm, tensors: dict[str, torch.Tensor], numbers: dict[str, Any]
) -> None:
    states: dict[str, Any] = {}
    for name, state in model.get_parameters().items():
        if "optimizer" not in name:
            states[name] = {key: tensors[f"{name}.{key}"] for key in state}
            continue
        values: dict[int, dict[str, torch.Tensor]] = {}
        for key, tensor in tensors.items():
            if key.startswith(f"{name}."):
                index, _, what = key.removeprefix(f"{name}.").partition(".")
                values.setdefault(int(index), {})[what] = tensor
        states[name] = {"state": values, "param_groups": numbers[name]}
    model.set_parameters(states, exact_match=True)
    for name in _variables(model):
        getattr(model, name).data.copy_(tensors[f"variable.{name}"])
    for name, value in numbers["counters"].items():
        setattr(model, name, value)
    if "replayed" in numbers:
        buffer: Any = model.replay_buffer  # type: ignore[attr-defined]
        buffer.pos, buffer.full = numbers["replayed"]
        for name in _replayed(buffer):
            kept = tensors[f"replayed.{name}"].numpy()
            getattr(buffer, name)[: len(kept)] = kept
