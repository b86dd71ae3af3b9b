"""The checkpoint of a training: one zip as Stable-Baselines3 saves it, without pickled data.

Nothing in it executes when it is loaded: its data is JSON, and tensors are read as weights only.
"""

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.save_util import load_from_zip_file, save_to_zip_file

from benchmarks.files import reason
from benchmarks.training.policy_batch import Point
from pma_gym.documents import parse_json
from pma_gym.partials import begin_partial, end_partial

REPLAYED = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
"""Arrays of the replayed transitions."""


class CheckpointError(ValueError):
    """A checkpoint that cannot be saved or used; the message says why and what remains."""


def save_checkpoint(
    path: Path, model: BaseAlgorithm, content: Mapping[str, Any], tensors: Mapping[str, Any]
) -> None:
    """Replace a training's checkpoint.

    Args:
        path: the file.
        model: what is trained.
        content: `order` and `curve`, as JSON.
        tensors: `best` and `average`, weights of the policy.
    Raises:
        CheckpointError: it could not be written; the one before is still there.
    """
    counted = {"num_timesteps": model.num_timesteps, "_n_updates": getattr(model, "_n_updates", 0)}
    learned = {"log_ent_coef": model.log_ent_coef.data} if hasattr(model, "log_ent_coef") else {}  # type: ignore[attr-defined]
    if (buffer := getattr(model, "replay_buffer", None)) is not None:
        counted |= {"replayed": [int(buffer.pos), bool(buffer.full)]}
        learned |= {name: torch.from_numpy(getattr(buffer, name)) for name in REPLAYED}
    partial = begin_partial(path)
    try:
        with partial.open("wb") as file:
            save_to_zip_file(
                file,
                {**content, "counted": counted},
                model.get_parameters(),
                {**tensors, "learned": learned},
            )
        partial.replace(path)
    # PyTorch says of a full disk that it is no OSError.
    except (OSError, RuntimeError) as error:
        raise CheckpointError(
            f"{path} cannot be saved: {error}; the checkpoint before it stays; make room or allow "
            "writing, then run the same command again: it goes on from there"
        ) from error
    finally:
        end_partial(partial)


def load_checkpoint(
    path: Path, model: BaseAlgorithm, order: Mapping[str, Any]
) -> tuple[list[Point], dict[str, torch.Tensor], list[torch.Tensor]]:
    """Put a new model where a training's checkpoint was.

    Args:
        path: the file.
        model: a new one.
        order: what is trained; `order` of the checkpoint's content must be the same.
    Returns:
        Curve, best weights and averaged weights that were to be remembered.
    Raises:
        CheckpointError: a damaged file, or another training's.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            content: Any = parse_json(archive.read("data"), str(path), finite=False)
        other = [key for key in order if content["order"][key] != order[key]]
        if not other:
            _, parameters, variables = load_from_zip_file(path, load_data=False)
            tensors: dict[str, Any] = variables or {}
            _restore(model, content["counted"], parameters, tensors["learned"])
            curve = [Point(*point) for point in content["curve"]]
            return curve, tensors["best"], tensors["average"]
    # Whatever a damaged file holds.
    except Exception as error:
        raise CheckpointError(
            f"{path} is damaged ({reason(error)}); delete it to train from the beginning"
        ) from error
    words = "; ".join(f"{key} was {content['order'][key]}, is {order[key]}" for key in other)
    raise CheckpointError(
        f"{path} is of another training: {words}; give another --out, or delete that file"
    )


def _restore(
    model: BaseAlgorithm,
    counted: dict[str, Any],
    parameters: dict[str, Any],
    learned: dict[str, torch.Tensor],
) -> None:
    model.set_parameters(parameters, exact_match=True)
    if "replayed" in counted:
        buffer: Any = model.replay_buffer  # type: ignore[attr-defined]
        buffer.pos, buffer.full = counted.pop("replayed")
        for name in REPLAYED:
            getattr(buffer, name)[:] = learned[name].numpy()
    if "log_ent_coef" in learned:
        model.log_ent_coef.data.copy_(learned["log_ent_coef"])  # type: ignore[attr-defined]
    for name, count in counted.items():
        setattr(model, name, count)
