"""`python -m benchmarks.training.study`: trains the study's policies, judges them, reports."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.commands.options import LOCAL, ExecutorOption, chosen_executor
from pma_gym.cli.options import StrictTyper
from pma_gym.terminal import safe_streams

OUT = Path("results/training/study")
FIGURES = Path("docs/figures/policies.json")
CONDITIONS = "conditions.json"

app = StrictTyper(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)

Out = Annotated[Path, typer.Option(help="Folder of the study.")]
Jobs = Annotated[int, typer.Option(min=1, help="Processes.")]
Groups = Annotated[str, typer.Option(help="Groups by commas; else all.")]


@app.command()
def run(
    out: Out = OUT, jobs: Jobs = 2, groups: Groups = "", executor: ExecutorOption = LOCAL
) -> None:
    """Train what has no policy yet; an interrupted study goes on."""
    from benchmarks.training.study.cells import cells
    from benchmarks.training.study.runs import Run, runs, train_all
    from controllers.policies.policy_file import PolicyFile

    chosen = [cell for cell in cells() if not groups or cell.group in groups.split(",")]
    todo = runs(chosen, out)

    def print_run(done: Run, policy: PolicyFile, number: int, count: int) -> None:
        scores = policy.training["scores"]["validation"]
        print(
            f"{number}/{count} {done.cell.group} {policy.name} seed {done.seed}: "
            f"{scores['error']:.4g} {scores['unit']} in {policy.training['wall_s']:.0f} s",
            flush=True,
        )

    try:
        trained = train_all(todo, chosen_executor(executor, jobs), print_run)
        print(f"{trained} trained, {len(todo)} in all")
    except KeyboardInterrupt:
        print("Interrupted; run it again, it goes on where it stopped", file=sys.stderr)
        raise typer.Exit(130) from None


@app.command()
def judge(
    out: Out = OUT,
    jobs: Jobs = 2,
    groups: Groups = "",
    suites: str = "",
    executor: ExecutorOption = LOCAL,
) -> None:
    """Run every seed's policies through the suites; what ran before stays."""
    from benchmarks.training.study.cells import cells
    from benchmarks.training.study.scored_policies import SUITES, judge_pid, seed_folders
    from benchmarks.training.study.scored_policies import judge as judge_group
    from pma_gym.terminal import SafeConsole

    places = chosen_executor(executor, jobs)
    algorithms = {cell.group: cell.algorithm for cell in cells()}
    strange = [name for name in groups.split(",") if groups and name not in algorithms]
    if strange:
        print(
            f"error: groups must be of {', '.join(algorithms)}, got {', '.join(strange)}",
            file=sys.stderr,
        )
        raise typer.Exit(2)
    if not groups:
        judge_pid(out, places, SafeConsole())
    for group, algorithm in algorithms.items():
        wanted = group in groups.split(",") if groups else not group.startswith("ablation-")
        if not wanted:
            continue
        if not seed_folders(out / group):
            print(f"{group}: no policy in {out / group}, train it first", file=sys.stderr)
            continue
        for suite in suites.split(",") if suites else SUITES:
            judge_group(out / group, algorithm, suite, places, SafeConsole())


@app.command()
def conditions(out: Out = OUT) -> None:
    """Try the best policies at 100 Hz under conditions that were never trained with."""
    import json

    from benchmarks.files import write_text
    from benchmarks.training.study.robustness import robustness
    from benchmarks.training.study.scored_policies import SHIPPED_GROUP
    from benchmarks.training.study.ship import best_policies

    best = {path.stem.rpartition("-")[0]: path for path in best_policies([out / SHIPPED_GROUP])}
    tasks = ("displacement", "rotation")
    by_task = {task: robustness(task, {"ppo": best[f"{task}-100hz"]}) for task in tasks}
    write_text(out / CONDITIONS, json.dumps(by_task, indent=1) + "\n")


@app.command()
def report(
    out: Out = OUT,
    figures: Annotated[Path, typer.Option(help="JSON file of all figures.")] = FIGURES,
    ship: Annotated[bool, typer.Option(help="Also put the best policies where they ship.")] = False,
) -> None:
    """Collect all figures and draw the curves; groups that are not in the folder keep theirs."""
    import json

    from benchmarks.files import write_text
    from benchmarks.training.study.cells import cells
    from benchmarks.training.study.figures import pid_errors, study_figures, variation
    from benchmarks.training.study.pictures import write_curves
    from benchmarks.training.study.scored_policies import PID_FOLDER, SHIPPED
    from benchmarks.training.study.ship import ship as ship_policies
    from pma_gym.documents import read_json

    figures_ = study_figures(out)
    if figures.exists():
        kept = read_json(figures, "journal_mib", own=True, finite=False)["groups"]
        merged = kept | figures_["groups"]
        names = dict.fromkeys(cell.group for cell in cells())
        figures_["groups"] = {name: merged[name] for name in names if name in merged}
    figures_["pid"] = pid_errors(out)
    figures_["pid_variation_v_per_s"] = variation(out / PID_FOLDER)
    figures_["robustness"] = read_json(out / CONDITIONS, own=True, finite=False)
    write_text(figures, json.dumps(figures_, indent=1) + "\n")
    write_curves(figures_, figures.parent.parent / "images" / "policies-curves.png")
    for names in SHIPPED if ship else ():
        for path in ship_policies([out / name for name in names], figures_["groups"]):
            print(path)


if __name__ == "__main__":
    with safe_streams():
        app()
