"""Puts a run's figures into README and documentation: `python -m benchmarks.readme_table`.

A block of figures, of the run or of those that `docs/figures` keeps, stands between
`<!-- figures: NAME -->` and `<!-- end of figures -->`; nobody types one in. `--kept` needs no run
and leaves its blocks alone. `--check` changes nothing and fails if a file is not as it would be.
"""

import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import Annotated, Any

import typer

from benchmarks.files import write_text
from benchmarks.hidden_effects.evaluation.summary import diagnosis
from benchmarks.runner.phase_score import PHASES, UNITS
from pma_gym.documents import read_json

ROOT = Path(__file__).resolve().parent.parent
PAGES = ("results.md", "measured.md", "notebook/reproduction.md")
FILES = (ROOT / "README.md", *(ROOT / "docs" / name for name in PAGES))
SCORES = ROOT / "results" / "reproduction" / "scores.json"

Run = Mapping[str, Any]
"""What scores.json holds."""

_BLOCK = re.compile(
    r"(?P<start><!-- figures: (?P<name>\w+) -->\n).*?(?P<end><!-- end of figures -->)", re.DOTALL
)
_REPLAY = "serres_replay"
_SUMMARISED = (_REPLAY, "pid", "ppo")
"""Controllers of the README's table."""
_PARTS, _PART_NAMES = ("rmse", "line_error", "scatter"), ("RMSE", "line part", "scatter")


class RunError(ValueError):
    """A run whose figures are not for print; the message says why and what to do."""


def displacement(run: Run) -> str:
    """Table 22: RMSE in mm by pressure, measured and simulated."""
    return _rmse_table(run, "displacement", "{:.3f}")


def rotation(run: Run) -> str:
    """Table 30: RMSE in deg of phases I / II / III by pressure, measured and simulated."""
    return _rmse_table(run, "rotation", "{:.2f}")


def summary(run: Run) -> str:
    """Means of the RMSE over the pressures, of the measured trials and of three controllers."""
    tasks = [_columns(run, task) for task in PHASES]
    suite = {each["name"]: each["title"] or each["name"] for each in run["suite"]["controllers"]}
    shown = ["Measured", *(suite[name] for name in _SUMMARISED if name in suite)]
    rows = [
        [title, *(f"{mean:.3g}" for columns in tasks for mean in _means(columns[title]))]
        for title in tasks[0]
        if title in shown
    ]
    phases = [f"{phase} (deg)" for phase in PHASES["rotation"]]
    return _table(
        ["Mean RMSE", "Displacement (mm)", "Rotation " + phases[0], *phases[1:]], rows, words=1
    )


def setting(run: Run) -> str:
    """Describe the run in a sentence."""
    suite = run["suite"]
    noise = "with" if suite["noise"] else "without"
    return (
        f"Suite `{suite['name']}` version {suite['version']}, seed {suite['seed']}, on the model "
        f"`{suite['models'][0]}`: control at {suite['control_rate_hz']:g} Hz {noise} sensor noise, "
        "scored on the true motion at 384 Hz."
    )


def parts(run: Run) -> str:
    """The two parts of the RMSE, measured and of the replay, by task and phase: means."""
    first = run["suite"]["models"][0]
    replayed = [s for s in run["scores"] if s["controller"] == _REPLAY and s["model"] == first]
    rows = []
    for task, phases in PHASES.items():
        for phase in phases:
            cells = []
            for scores in (run["measured"], replayed):
                every = [s["phases"][phase] for s in scores if s["task"] == task]
                cells += [f"{fmean(one[part] for one in every):.2f}" for part in _PARTS]
            name = task if task == phase else f"{task}, phase {phase}"
            rows.append([f"{name} ({UNITS[task]})", *cells])
    header = [
        "Mean over the trials",
        *(f"{who}: {part}" for who in ("measured", "simulated") for part in _PART_NAMES),
    ]
    return _table(header, rows, words=1)


FIGURES: dict[str, Callable[[Run], str]] = {
    function.__name__: function
    for function in (
        displacement,
        rotation,
        summary,
        setting,
        parts,
    )
}
"""Blocks by name."""

KEPT: dict[str, Callable[[], str]] = {diagnosis.__name__: diagnosis}
"""Blocks that are not of the run: their figures were kept in `docs/figures`."""


def refreshed(text: str, run: Run | None) -> str:
    """Fill a text's blocks with the run's figures and the kept ones; without a run, the kept only.

    Raises:
        RunError: a block that nobody renders, or figures that are missing.
    """

    def block(match: re.Match[str]) -> str:
        name = match["name"]
        if name not in FIGURES and name not in KEPT:
            known = ", ".join([*FIGURES, *KEPT])
            raise RunError(f"no figures {name!r}; there are {known}")
        if name in KEPT:
            try:
                figures = KEPT[name]()
            except KeyError as error:
                raise RunError(
                    f"what docs/figures keeps for {name} has no {error}; put a newer run's there"
                ) from None
        elif run is None:
            return match[0]
        else:
            figures = FIGURES[name](run)
        return f"{match['start']}\n{figures}\n\n{match['end']}"

    return _BLOCK.sub(block, text)


def load_run(scores: Path) -> Run:
    """The run in a scores.json.

    Raises:
        RunError: there is none, or it is not the whole suite.
    """
    if not scores.is_file():
        raise RunError(f"there is no file {scores}; run `python -m benchmarks` first")
    try:
        run = read_json(scores, "journal_mib", own=True, finite=False)
    except ValueError as error:
        raise RunError(f"{error}; run `python -m benchmarks` again") from None
    failed = [score for score in run["scores"] if score["failure"]]
    if not run["complete"] or run["suite"]["selected"] or failed:
        raise RunError(
            f"{scores} is not a whole run of the suite ({len(failed)} cases failed); run "
            "`python -m benchmarks` without a selection"
        )
    return run


def main(
    scores: Annotated[Path, typer.Argument(help="scores.json of a whole run.")] = SCORES,
    check: Annotated[
        bool, typer.Option("--check", help="Change nothing; fail on a difference.")
    ] = False,
    kept: Annotated[
        bool, typer.Option("--kept", help="Only figures that docs/figures keeps; needs no run.")
    ] = False,
) -> None:
    """Put a run's figures into README.md and the pages of results."""
    try:
        run = None if kept else load_run(scores)
        texts = {path: path.read_text(encoding="utf-8") for path in FILES}
        contents = {path: refreshed(text, run) for path, text in texts.items()}
    except RunError as error:
        print(f"error: {error}", file=sys.stderr)
        raise typer.Exit(2) from None
    changed = [path for path in FILES if contents[path] != texts[path]]
    for path in changed:
        if not check:
            write_text(path, contents[path])
        print(f"{path.relative_to(ROOT)}: {'differs' if check else 'refreshed'}")
    if check and changed:
        raise typer.Exit(1)


def _rmse_table(run: Run, task: str, form: str) -> str:
    """A row a pressure: RMSE of every phase, of the measured trial and of every controller."""
    columns = _columns(run, task)
    pressures = run["suite"]["pressures_kpa"][task]
    rows = [
        [f"{p:g}", *(" / ".join(map(form.format, column[p])) for column in columns.values())]
        for p in pressures
    ]
    means = map(_means, columns.values())
    rows.append(["mean", *(" / ".join(map(form.format, mean)) for mean in means)])
    return _table(["Pressure (kPa)", *columns], rows)


def _columns(run: Run, task: str) -> dict[str, dict[float, list[float]]]:
    """RMSE of every phase by pressure, of the measured trials and of every controller by title."""
    suite = run["suite"]
    columns = {"Measured": _figures(run["measured"], task)}
    for controller in suite["controllers"]:
        own = [s for s in run["scores"] if s["controller"] == controller["name"]]
        own = [score for score in own if score["model"] == suite["models"][0]]
        columns[controller["title"] or controller["name"]] = _figures(own, task)
    return columns


def _means(column: Mapping[float, Sequence[float]]) -> list[float]:
    """Mean of each phase over the pressures."""
    return [fmean(phase) for phase in zip(*column.values(), strict=True)]


def _figures(scores: Sequence[Mapping[str, Any]], task: str) -> dict[float, list[float]]:
    """RMSE of every phase, by pressure."""
    return {
        score["pressure_kpa"]: [score["phases"][phase]["rmse"] for phase in PHASES[task]]
        for score in scores
        if score["task"] == task
    }


def _table(header: Sequence[str], rows: Sequence[Sequence[str]], words: int = 0) -> str:
    rules = [":--" if column < words else "--:" for column in range(len(header))]
    return "\n".join(f"| {' | '.join(line)} |" for line in (header, rules, *rows))


if __name__ == "__main__":
    typer.run(main)
