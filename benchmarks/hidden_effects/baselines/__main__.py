"""`python -m benchmarks.hidden_effects.baselines`: diagnose drawn cases with every baseline."""

import os
from pathlib import Path
from typing import Annotated

import typer

from pma_gym.cli.options import StrictTyper
from pma_gym.terminal import safe_streams

# Each process computes on its own core.
os.environ.setdefault("OMP_NUM_THREADS", "1")

app = StrictTyper(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)

Jobs = Annotated[int, typer.Option(min=1, help="Processes.")]
TRAINING_SEED = 7001
"""Of the cases that the forest learns from; no set that is judged has it."""


@app.command()
def run(
    cases: Annotated[Path, typer.Option(help="Folder that `draw` or `take` wrote.", exists=True)],
    baselines: Annotated[str, typer.Option(help="By commas; else all.")] = "",
    jobs: Jobs = 1,
    seed: Annotated[int, typer.Option(help="Of what a baseline draws.")] = 0,
    json_file: Annotated[Path | None, typer.Option("--json", help="Figures to a file.")] = None,
) -> None:
    """Run the baselines on every case that they have not answered, and print one table."""
    import json

    from benchmarks.hidden_effects.baselines import forest
    from benchmarks.hidden_effects.baselines.answers import ask_all
    from benchmarks.hidden_effects.baselines.comparison import compared, measured, table
    from benchmarks.hidden_effects.baselines.registry import BASELINES
    from pma_gym.files import replace_file

    chosen = [name for name in baselines.split(",") if name] or list(BASELINES)
    for name in chosen:
        if name not in BASELINES:
            known = ", ".join(BASELINES)
            raise typer.BadParameter(f"{name!r} is none of {known}", param_hint="--baselines")
    left_out = {name: BASELINES[name].absence for name in chosen if BASELINES[name].absence}
    chosen = [name for name in chosen if name not in left_out]
    if "random_forest" in chosen:
        try:
            forest.check_unseen(cases, forest.TABLE)
        except (FileNotFoundError, ValueError) as error:
            raise typer.BadParameter(str(error), param_hint="--cases") from None
    ask_all(cases, chosen, jobs, seed)
    document = compared(cases, chosen)
    if json_file is not None:
        whole = {"measured": measured(cases, chosen), "baselines": document, "left_out": left_out}
        replace_file(json_file, (json.dumps(whole, indent=1) + "\n").encode())
    typer.echo(table(document, left_out))


@app.command()
def train(
    cases: Annotated[int, typer.Option(min=1, help="How many.")] = 150,
    seed: Annotated[int, typer.Option(help="Of the cases.")] = TRAINING_SEED,
    out: Annotated[Path | None, typer.Option(help="The table; the shipped one if none.")] = None,
    jobs: Jobs = 1,
) -> None:
    """Add signatures of cases to the table that the forest is grown from."""
    from benchmarks.hidden_effects.baselines import forest

    forest.train(cases, seed, out or forest.TABLE, jobs)


if __name__ == "__main__":
    with safe_streams():
        app()
