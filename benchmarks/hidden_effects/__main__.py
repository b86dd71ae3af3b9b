"""`python -m benchmarks.hidden_effects`: draw cases, have them diagnosed, count."""

import os
from pathlib import Path
from typing import Annotated

import typer

from pma_gym.cli.options import StrictTyper
from pma_gym.terminal import safe_streams

# Each process computes on its own core.
os.environ.setdefault("OMP_NUM_THREADS", "1")

from benchmarks.hidden_effects import speed as timing  # noqa: E402
from benchmarks.hidden_effects.evaluation import (
    records,  # noqa: E402
    scoring,
)
from benchmarks.hidden_effects.generation import drawing  # noqa: E402
from benchmarks.hidden_effects.generation.cases import BLOCKS  # noqa: E402
from benchmarks.hidden_effects.generation.effects import ALL  # noqa: E402

app = StrictTyper(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)

Folder = Annotated[Path, typer.Argument(help="Folder that `draw` wrote.", exists=True)]
Jobs = Annotated[int, typer.Option(min=1, help="Processes.")]


@app.command()
def draw(
    cases: Annotated[int, typer.Option(min=1, help="How many.")],
    out: Annotated[Path, typer.Option(help="Folder to write to; cases that it has are kept.")],
    seed: Annotated[int, typer.Option(help="Same seed, same bits.")] = 0,
    blocks: Annotated[str, typer.Option(help="By commas; cases take turns.")] = ",".join(BLOCKS),
    effects: Annotated[
        str, typer.Option(help="Effects that cases of block single take turns in; else all.")
    ] = "",
    ratio: Annotated[str, typer.Option(help="Range of r, the change over the noise.")] = "0.5,2",
    trials: Annotated[int, typer.Option(min=3, help="Trials of a case.")] = 6,
    seconds: Annotated[float, typer.Option(min=3.0, help="Length of a trial (s).")] = 8.0,
    jobs: Jobs = 1,
) -> None:
    """Draw cases: OUT/cases holds what a diagnosis may read, OUT/truth the rest."""
    chosen = [name for name in effects.split(",") if name]
    for names, known in ((blocks.split(","), BLOCKS), (chosen, tuple(ALL))):
        for name in names:
            if name not in known:
                raise typer.BadParameter(f"{name!r} is none of {', '.join(known)}")
    low, high = (float(end) for end in ratio.split(","))
    case_set = drawing.CaseSet(
        seed, tuple(blocks.split(",")), tuple(chosen), (low, high), trials, seconds
    )
    drawing.draw(case_set, cases, out, jobs)


@app.command()
def take(
    blocks: Annotated[str, typer.Option(help="And how many of each: single=27,nothing=40.")],
    out: Annotated[Path, typer.Option(help="Folder to write to; cases that it has are kept.")],
    seed: Annotated[int, typer.Option(help="Same seed, same bits.")] = 0,
    jobs: Jobs = 1,
) -> None:
    """Write the first cases of blocks of `python -m benchmarks hidden-effects`, as `draw` does."""
    chosen: dict[str, int] = {}
    for item in blocks.split(","):
        name, _, count = item.partition("=")
        if name not in drawing.EVERY or not (
            count.isascii() and count.isdecimal() and len(count) < 10
        ):
            raise typer.BadParameter(
                f"must be BLOCK=CASES by commas, such as single=27,nothing=40, got {item!r}; "
                f"blocks are {', '.join(drawing.EVERY)}",
                param_hint="--blocks",
            )
        chosen[name] = int(count)
    drawing.take(chosen, seed, out, jobs)


@app.command()
def judge(
    folder: Folder,
    jobs: Jobs = 1,
    options: Annotated[str, typer.Option(help="More options of `pma-gym diagnose`.")] = "",
    limit: Annotated[float, typer.Option(help="Seconds after which a case is given up.")] = 900.0,
) -> None:
    """Diagnose every case that has no answer yet."""
    records.judge(folder, jobs, options.split(), limit)


@app.command()
def score(folder: Folder) -> None:
    """Count what was named right; writes FOLDER/score.json."""
    typer.echo(scoring.score(folder))


@app.command()
def speed(
    jobs: Annotated[int, typer.Option(min=1, help="Threads.")] = 2,
    most: Annotated[int, typer.Option(min=6, help="Sizes of so many trials at most.")] = 60,
) -> None:
    """Time diagnoses of 6, 12 and 60 trials against what they may take on two cores."""
    for size in timing.SIZES:
        if size.trials > most:
            break
        first, again, verdict, effects = timing.measure(size, jobs)
        typer.echo(
            f"{size.trials} trials of {size.seconds:g} s at {size.rate_hz:g} Hz: {again:.1f} s "
            f"(first time, with kernels to compile: {first:.1f} s); target {size.target_s:g} s; "
            f"{verdict} {', '.join(effects)}"
        )


if __name__ == "__main__":
    with safe_streams():
        app()
