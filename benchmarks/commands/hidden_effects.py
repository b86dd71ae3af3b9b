"""The commands about hidden effects: `hidden-effects` and `hidden-effects-report`."""

from pathlib import Path
from typing import Annotated

import typer

from benchmarks.commands.options import (
    LOCAL,
    ExecutorOption,
    Jobs,
    Recompute,
    app,
    writable_out,
)
from benchmarks.executors.choice import executor_named
from benchmarks.files import RESULTS


@app.command(
    "hidden-effects",
    epilog="Example: python -m benchmarks hidden-effects --block single --n 20",
)
def hidden_effects(
    block: Annotated[
        str,
        typer.Option(
            help="single, faint, nothing, parameters, pair, unknown, slow_drift, rigs, lab, "
            "lab_nothing, or all."
        ),
    ],
    n: Annotated[int, typer.Option("--n", min=1, help="Cases of a block; more extend the set.")],
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same cases.")] = 0,
    jobs: Jobs = 1,
    executor: ExecutorOption = LOCAL,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder; results/hidden_effects/BLOCK-SEED if not given."),
    ] = None,
    keep: Annotated[bool, typer.Option("--keep", help="Keep the trials in FOLDER/data.")] = False,
    recompute: Recompute = False,
) -> None:
    """Hide effects in trials, diagnose them, count what was named right; goes on after Ctrl-C."""
    from benchmarks.hidden_effects.run_blocks import Order, ordered, run_hidden_effects

    places = executor_named(executor, jobs)
    blocks, orders = ordered(block), []
    for each in blocks:
        usual = (out or RESULTS / "hidden_effects") / f"{each.name}-{seed}"
        folder = usual if out is None or len(blocks) > 1 else out
        orders.append(Order(each, n, seed, folder, places, keep, recompute))
    raise typer.Exit(run_hidden_effects(orders))


@app.command(
    "hidden-effects-report",
    epilog="Example: python -m benchmarks hidden-effects-report results/blocks/single-0",
)
def hidden_effects_report(
    places: Annotated[
        list[Path],
        typer.Argument(help="Folders of `hidden-effects`, or .json files of this command."),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="Markdown, .html or .json file; printed if not given.", callback=writable_out
        ),
    ] = None,
) -> None:
    """Write the figures of several blocks of hidden effects as one page of tables."""
    from benchmarks.files import write_text
    from benchmarks.hidden_effects.evaluation.summary import report
    from benchmarks.hidden_effects.run_blocks import read_scores

    text = report(read_scores(places), out.suffix if out else ".md")
    if out is None:
        print(text)
    else:
        write_text(out, text)
