"""The commands about policies: `train` and `export`."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.commands.options import INTERRUPTED, RESULTS, refuse


def register(app: typer.Typer) -> None:
    """Add the commands to the program."""
    app.command(
        epilog="Example: python -m benchmarks train --algo ppo --task displacement --seed 1"
    )(train)
    app.command(
        epilog="Example: python -m benchmarks export model.zip --env pma_gym/IsokineticRotation-v0"
    )(export)


def train(
    algo: Annotated[str, typer.Option(help="ppo, sac, td3 or tqc.")],
    task: Annotated[
        str,
        typer.Option(
            help="displacement, rotation, exercise, isotonic_exercise or profile_exercise."
        ),
    ],
    preset: Annotated[str, typer.Option(help="A preset, or a .yml file's path.")] = "increment",
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same policy.")] = 0,
    seeds: Annotated[
        int,
        typer.Option(min=1, help="So many seeds from --seed on, in turn, a folder each."),
    ] = 1,
    steps: Annotated[
        int | None, typer.Option(min=1, help="Control steps; the preset's if not given.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Else results/training/PRESET-ALGO/TASK-SEED."),
    ] = None,
    threads: Annotated[int, typer.Option(min=1, help="Of PyTorch and the environments.")] = 1,
    ship: Annotated[bool, typer.Option("--ship", help="Put the policy into the package.")] = False,
) -> None:
    """Train policies on stations of no suite; an interrupted training goes on."""
    usual = RESULTS / "training" / f"{Path(preset).stem}-{algo}"
    folder = out or usual / f"{task}-{seed}"
    with _failures_in_words():
        from benchmarks.training.preset import PresetError
        from benchmarks.training.train_policies import ordered, run_train
        from pma_gym.terminal import SafeConsole

        if folder.exists() and not folder.is_dir():
            raise PresetError(f"--out {folder} is a file; name a folder")
        if ship and seeds > 1:
            raise PresetError(f"--ship takes one seed, got --seeds {seeds}; name it by --seed")
        order = ordered(algo, task, preset, seed, steps, threads)
        for number in range(seed, seed + seeds):
            if seeds > 1:
                folder = out / f"seed-{number}" if out else usual / f"{task}-{number}"
            run_train(replace(order, seed=number), folder, SafeConsole(), ship)


@contextmanager
def _failures_in_words() -> Iterator[None]:
    """End the program with a message of what stopped a training."""
    try:
        from benchmarks.training.checkpoint import CheckpointError
        from benchmarks.training.preset import PresetError
        from benchmarks.training.train_policies import run_train  # noqa: F401 - needs Stable-Baselines3
    except ImportError as error:
        print(
            f"error: training needs Stable-Baselines3 ({error}); install it: "
            "pip install -c constraints.txt -e '.[rl]'",
            file=sys.stderr,
        )
        raise typer.Exit(2) from None
    try:
        yield
    except PresetError as error:
        refuse(error)
    except CheckpointError as error:
        print(f"error: {error}", file=sys.stderr)
        raise typer.Exit(1) from None
    except KeyboardInterrupt:
        print(
            "Interrupted; run it again, it goes on from the checkpoint of the last validation",
            file=sys.stderr,
        )
        raise typer.Exit(INTERRUPTED) from None


def export(
    model: Annotated[Path, typer.Argument(help="Zip that Stable-Baselines3 saved.")],
    env: Annotated[str, typer.Option(help="Id of the environment that it was trained on.")],
    env_kwargs: Annotated[str, typer.Option(help="Its keyword arguments, as JSON.")] = "{}",
    vecnormalize: Annotated[
        Path | None, typer.Option(help="Its statistics (.npz), if trained in a VecNormalize.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="DIR/NAME of the policy; results/policies/MODEL if not given."),
    ] = None,
    onnx: Annotated[bool, typer.Option("--onnx", help="Write NAME.onnx too.")] = False,
) -> None:
    """Make a policy file of your own model, which the benchmark runs without torch."""
    from benchmarks.training.export import export_model, parsed_kwargs

    try:
        kwargs = parsed_kwargs(env_kwargs)
        usual = RESULTS / "policies" / model.stem
        if out is None:
            usual.parent.mkdir(parents=True, exist_ok=True)
        written = export_model(model, env, kwargs, out or usual, vecnormalize, onnx)
    except ValueError as error:
        refuse(error)
    print("\n".join(map(str, written)))
