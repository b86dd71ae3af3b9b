"""Runs the chain step by step, goes on where it stopped, and shows old figures beside new."""

import csv
import json
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from statistics import fmean

from rich.console import Console

from benchmarks.files import RESULTS, UNREADABLE, reason, say_damaged, write_text
from benchmarks.remake_steps import Step, command_line
from benchmarks.runner.fingerprint import ROOT
from benchmarks.suites.frozen import suite_names
from pma_gym.cli.terminal import terminal_table
from pma_gym.pages.document import TextTable
from pma_gym.plant.model import ModelError, load_model

Figures = dict[str, float]


def figures(root: Path = ROOT) -> Figures:
    """All figures that there are, by name; those of a job that has not run are not among them."""
    return dict([*_model(), *_reproduction(root), *_suites(root), *_policies(root)])


def _model() -> Iterator[tuple[str, float]]:
    try:
        model = load_model("station")
    except ModelError:
        return
    for path, note in model.notes.items():
        effect, _, file_key = path.partition(".")
        value = model.values_in_files(effect)[file_key]
        if note.low is not None and isinstance(value, float):
            yield f"station: {path}", value


def _reproduction(root: Path) -> Iterator[tuple[str, float]]:
    """Mean RMSE by controller and phase, and the replay's mean absolute errors."""
    path = root / "results" / "reproduction" / "scores.json"
    if not path.is_file():
        return
    run = json.loads(path.read_text(encoding="utf-8"))
    values: dict[str, list[float]] = {}
    for score in run["scores"]:
        if score["model"] != run["suite"]["models"][0]:
            continue
        for phase, figures in score["phases"].items():
            name = f"{score['controller']}, {score['task']} {phase}: RMSE ({score['unit']})"
            values.setdefault(name, []).append(figures["rmse"])
    for error in run.get("replay_errors", []):
        for quantity in ("slope", "intercept", "mean", "rmse", "line_error", "scatter"):
            if quantity in error:
                name = f"replay, {error['task']} {error['phase']}: error of {quantity}"
                values.setdefault(name, []).append(abs(error[quantity]))
    yield from ((f"reproduction: {name}", fmean(each)) for name, each in values.items())


def _suites(root: Path) -> Iterator[tuple[str, float]]:
    """Interquartile means of the leaderboards."""
    for suite in suite_names():
        path = root / "results" / suite / "leaderboard.csv"
        if not path.is_file():
            continue
        with path.open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                if row["mean"]:
                    name = f"{suite}: {row['controller']}, {row['measure']} ({row['unit']})"
                    yield name, float(row["mean"])


def _policies(root: Path) -> Iterator[tuple[str, float]]:
    """Validation errors of the policies that ship."""
    for path in sorted((root / "controllers" / "policies" / "shipped").glob("*.json")):
        scores = json.loads(path.read_text(encoding="utf-8"))["training"]["scores"]
        validation = scores.get("validation")
        if validation:
            yield (
                f"policy {path.stem}: validation ({validation['unit']})",
                float(validation["error"]),
            )


def compared(old: Mapping[str, float], new: Mapping[str, float]) -> list[tuple[str, str, str, str]]:
    """Return rows of name, old, new and change in percent, for changed and new figures."""
    rows = []
    for name in dict.fromkeys([*old, *new]):
        before, after = old.get(name), new.get(name)
        if before == after:
            continue
        change = ""
        if before and after is not None:
            change = f"{100.0 * (after / before - 1.0):+.1f} %"
        rows.append((name, _text(before), _text(after), change))
    return rows


def _text(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


FOLDER = RESULTS / "remake"
DONE, BEFORE, TABLE = "done.json", "before.json", "figures.txt"

Run = Callable[[Sequence[str]], int]
"""Runs a command and gives its exit code."""


def run_command(arguments: Sequence[str]) -> int:
    """Run a command of this project; its exit code. Ctrl-C reaches it, and this job after it."""
    return subprocess.run(command_line(arguments), cwd=ROOT, check=False).returncode


class Remake:
    """The chain on its way.

    Args:
        steps: in their order.
        folder: where it is kept what is done.
        console: where to print.
        run: runs a command.
        now: gives the figures that stand in files.
    """

    def __init__(
        self,
        steps: Sequence[Step],
        folder: Path = FOLDER,
        console: Console | None = None,
        run: Run = run_command,
        now: Callable[[], Figures] = figures,
    ) -> None:
        self.steps, self.folder, self.run, self.now = list(steps), folder, run, now
        self.console = console or Console()
        self.done = _read(folder / DONE)

    def left(self) -> list[Step]:
        """Steps that are not done, or whose grounds have changed since."""
        return [
            step
            for step in self.steps
            if self._commands_done(step, step.digest) < len(step.commands)
        ]

    def _commands_done(self, step: Step, grounds: str) -> int:
        """How many of a step's commands have ended well on these grounds."""
        kept = self.done.get(step.name, {})
        return int(kept["commands"]) if kept.get("grounds") == grounds else 0

    def go(self) -> bool:
        """Run what is left, in order; whether all of it is done.

        A step whose command fails ends the chain: what comes after would be made of old parts.
        """
        if not (self.folder / BEFORE).is_file():
            write_text(self.folder / BEFORE, json.dumps(self.now(), indent=1) + "\n")
        for number, step in enumerate(self.steps, 1):
            # Asked anew at each: the steps before may have changed what it is made of.
            grounds = step.digest
            done_before = self._commands_done(step, grounds)
            said = "done before" if done_before == len(step.commands) else step.makes
            self._say(f"{number}/{len(self.steps)} {step.name}: {said}")
            if not self._made(step, grounds, done_before):
                self.table()
                return False
        self.table()
        return True

    def _made(self, step: Step, grounds: str, done_before: int) -> bool:
        """Run a step's commands from a number on; whether all ended well."""
        for done, arguments in enumerate(step.commands[done_before:], done_before + 1):
            code = self.run(arguments)
            if code:
                said = " ".join(("python", *arguments))
                self._say(f"{step.name} ended with {code}: {said}; run it again to go on")
                return False
            self.done[step.name] = {"grounds": grounds, "commands": done}
            write_text(self.folder / DONE, json.dumps(self.done, indent=1) + "\n")
        return True

    def table(self) -> None:
        """Print and write the figures that have moved since the chain began."""
        rows = compared(_read(self.folder / BEFORE), self.now())
        header = ("figure", "old", "new", "change")
        table = terminal_table(TextTable("Figures that moved", header, rows))
        self.console.print(table if rows else "no figure has moved")
        lines = ["\t".join(row) for row in (header, *rows)]
        write_text(self.folder / TABLE, "\n".join(lines) + "\n")

    def _say(self, message: str) -> None:
        self.console.print(message, highlight=False, markup=False)


def _read(path: Path) -> dict:
    """What a file of the job keeps; nothing if there is none, or none that can be read."""
    if not path.is_file():
        return {}
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
    except UNREADABLE as error:
        say_damaged(path, reason(error))
        return {}
    return kept if isinstance(kept, dict) else {}
