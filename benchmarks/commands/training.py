"""The commands from logs and about policies: `from-logs`, `foreign-rigs`, `train`, `export`."""

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.commands.options import Jobs, app
from benchmarks.files import RESULTS


@app.command("from-logs", epilog="Example: python -m benchmarks from-logs my_logs")
def from_logs(
    logs: Annotated[Path, typer.Argument(help="Folder of logs, as `pma-gym diagnose` takes it.")],
    model: Annotated[
        str | None, typer.Option(help="Shipped name or TOML file; else the data set's own.")
    ] = None,
    diagnosis: Annotated[
        Path | None, typer.Option(help="Folder of a diagnosis; else the logs are diagnosed.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder; else results/from-logs/NAME.")] = None,
    steps: Annotated[
        int, typer.Option(min=1, help="Control steps that each policy is trained for.")
    ] = 1_000_000,
) -> None:
    """Diagnose logs, then tune a PID and train a policy on the model; score them on both models."""
    from rich.progress import Progress

    from benchmarks.rigs.from_logs import run_from_logs
    from pma_gym.cli.discovery import diagnose

    folder = out or RESULTS / "from-logs" / logs.resolve().name
    answer = diagnosis or folder / "diagnosis"
    if not (answer / "diagnosis.json").exists():
        folder.mkdir(parents=True, exist_ok=True)
        diagnose(logs, model, answer, resume=answer.is_dir())
    with Progress() as progress:
        run_from_logs(logs, model, answer, folder, progress, steps)
    print(f"Report: {folder / 'report.html'}")


@app.command(
    "foreign-rigs", epilog="Example: python -m benchmarks foreign-rigs --cases 4 --seed 31"
)
def foreign_rigs(
    cases: Annotated[int, typer.Option(min=1, help="Rigs; more extend the set.")] = 32,
    policies: Annotated[int, typer.Option(min=0, help="Of these rigs so many get policies.")] = 8,
    seeds: Annotated[int, typer.Option(min=2, help="References and noises of a rig.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same rigs.")] = 0,
    steps: Annotated[
        int, typer.Option(min=1, help="Control steps that each policy is trained for.")
    ] = 1_000_000,
    out: Annotated[Path, typer.Option(help="Folder of the results.")] = RESULTS / "foreign-rigs",
    jobs: Jobs = 2,
) -> None:
    """Score controllers made from foreign rigs' logs on these rigs; a stopped run goes on."""
    from benchmarks.rigs.foreign_rigs import run_foreign_rigs

    raise typer.Exit(run_foreign_rigs(cases, policies, seeds, seed, steps, out, jobs))


@app.command(epilog="Example: python -m benchmarks train --algo ppo --task displacement --seed 1")
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
    try:
        from benchmarks.training.preset import PresetError
        from benchmarks.training.train_policies import ordered, run_train
    except ImportError as error:
        raise ValueError(
            f"training needs Stable-Baselines3 ({error}); install it: "
            "pip install -c constraints.txt -e '.[rl]'"
        ) from None
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


class Target(StrEnum):
    """What a controller is exported to."""

    POLICY = "policy"
    ONNX = "onnx"
    C = "c"


@app.command(
    epilog="Example: python -m benchmarks export model.zip --env pma_gym/IsokineticRotation-v0"
)
def export(
    controller: Annotated[
        Path, typer.Argument(help="Zip that Stable-Baselines3 saved, a policy's .json, or pid.")
    ],
    env: Annotated[
        str | None, typer.Option(help="Id of the environment of a zip's training or of a PID.")
    ] = None,
    to: Annotated[
        Target, typer.Option(help="A policy file, ONNX beside it, or C.")
    ] = Target.POLICY,
    env_kwargs: Annotated[str, typer.Option(help="Its keyword arguments, as JSON.")] = "{}",
    vecnormalize: Annotated[
        Path | None, typer.Option(help="Its statistics (.npz), if trained in a VecNormalize.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="DIR/NAME of what is written; results/policies/CONTROLLER if not given."),
    ] = None,
) -> None:
    """Make a policy file of your own model, or C of a policy or the PID."""
    from benchmarks.training.export import export_controller, parsed_kwargs

    kwargs = parsed_kwargs(env_kwargs)
    usual = RESULTS / "policies" / controller.stem
    if out is None:
        usual.parent.mkdir(parents=True, exist_ok=True)
    made = export_controller(controller, to, env, kwargs, out or usual, vecnormalize)
    print("\n".join(map(str, made)))
