"""The commands about the exercise device: `exercise` and `safety`."""

from pathlib import Path
from typing import Annotated

import typer

from benchmarks.commands.options import (
    LOCAL,
    ExecutorOption,
    Jobs,
    app,
)
from benchmarks.executors.choice import executor_named
from benchmarks.files import RESULTS


@app.command(epilog="Example: python -m benchmarks exercise --muscles 2 --diameter 20 --moment 10")
def exercise(
    muscles: Annotated[
        str, typer.Option(help="How many side by side; several by commas, else common ones.")
    ] = "",
    diameter: Annotated[
        str, typer.Option(help="Of a muscle (mm); several by commas, else 10, 20 and 40.")
    ] = "",
    length: Annotated[
        str, typer.Option(help="Of a muscle at rest (mm); several by commas, else common.")
    ] = "",
    radius: Annotated[
        str, typer.Option(help="Of the pulley (mm); several by commas, else the station's.")
    ] = "",
    moment: Annotated[
        float | None,
        typer.Option(help="Prescription: moment to hold at 90 deg (N m), at one pressure."),
    ] = None,
    profile: Annotated[
        Path | None,
        typer.Option(
            help="Prescription: CSV with angle_deg and moment_nm; the pressure follows the angle."
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the report.")] = RESULTS / "exercise-device",
) -> None:
    """Show which moments muscles of which size give, and the smallest for a prescription."""
    from benchmarks.exercise.choose_device import Choice, ChoiceError, run_exercise
    from benchmarks.exercise.profile import constant_prescription, read_profile
    from pma_gym.terminal import SafeConsole

    if out.exists() and not out.is_dir():
        raise ChoiceError(f"--out {out} is a file; name a folder for the results")
    if moment is not None and profile is not None:
        raise ChoiceError("--moment and --profile are two prescriptions; give one of them")
    choice = Choice(muscles, diameter, length, radius)
    prescription = (
        read_profile(profile)
        if profile
        else None
        if moment is None
        else constant_prescription(moment)
    )
    run_exercise(choice, prescription, out, SafeConsole())


@app.command(epilog="Example: python -m benchmarks safety --episodes 100")
def safety(
    episodes: Annotated[int, typer.Option(help="With the safety layer.")] = 10_000,
    bare: Annotated[int, typer.Option(help="Without it, to be compared with.")] = 1_000,
    seed: Annotated[int, typer.Option(help="Of operators, stations and agents.")] = 1,
    out: Annotated[Path, typer.Option(help="Folder of the figures.")] = RESULTS / "safety",
    jobs: Jobs = 1,
    executor: ExecutorOption = LOCAL,
) -> None:
    """Count how often adversarial commands hurt the exercise's operator; a minute or two."""
    from benchmarks.exercise.safety_layer import SafetyError, run_safety
    from pma_gym.terminal import SafeConsole

    if out.exists() and not out.is_dir():
        raise SafetyError(f"--out {out} is a file; name a folder for the results")
    run_safety(episodes, bare, seed, out, SafeConsole(), executor_named(executor, jobs))
