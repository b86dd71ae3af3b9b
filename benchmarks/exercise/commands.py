"""The command about the exercise device: `exercise`."""

import sys
from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command()(exercise)


def exercise(
    muscles: Annotated[
        str, typer.Option(help="How many side by side; several by commas, common ones if empty.")
    ] = "",
    diameter: Annotated[
        str, typer.Option(help="Of a muscle (mm); several by commas, 10, 20 and 40 if empty.")
    ] = "",
    length: Annotated[
        str, typer.Option(help="Of a muscle at rest (mm); several by commas, common if empty.")
    ] = "",
    radius: Annotated[
        str, typer.Option(help="Of the pulley (mm); several by commas, the station's if empty.")
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
    out: Annotated[Path, typer.Option(help="Folder of the report.")] = Path("results/exercise"),
) -> None:
    """Show which moments muscles of which size give, and the smallest for a prescription."""
    from rich.console import Console

    from benchmarks.exercise.choice import Choice, ChoiceError
    from benchmarks.exercise.job import run_exercise
    from benchmarks.exercise.profile import ProfileError, held, read_profile
    from pma_gym.studies.prescription import UnreachableError

    try:
        if out.exists() and not out.is_dir():
            raise ChoiceError(f"--out {out} is a file; name a folder for the results")
        if moment is not None and profile is not None:
            raise ChoiceError("--moment and --profile are two prescriptions; give one of them")
        choice = Choice(muscles, diameter, length, radius)
        wanted = read_profile(profile) if profile else None if moment is None else held(moment)
        run_exercise(choice, wanted, out, Console())
    except (ChoiceError, ProfileError, UnreachableError) as error:
        print(f"error: {error}", file=sys.stderr)
        raise typer.Exit(2) from None
