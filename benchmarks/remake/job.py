"""Runs the chain step by step, goes on where it stopped, and shows old figures beside new."""

import json
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.files import RESULTS, write_text
from benchmarks.remake.chain import Step, command_line
from benchmarks.remake.figures import Figures, compared, figures
from benchmarks.runner.damaged_results import UNREADABLE, reason, say_damaged
from benchmarks.runner.fingerprint import ROOT

FOLDER = RESULTS / "remake"
DONE, BEFORE, TABLE = "done.json", "before.json", "figures.txt"

Run = Callable[[Sequence[str]], int]
"""Runs a command and gives its exit code."""


def run_command(words: Sequence[str]) -> int:
    """Run a command of this project; its exit code. Ctrl-C reaches it, and this job after it."""
    return subprocess.run(command_line(words), cwd=ROOT, check=False).returncode


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
        return [step for step in self.steps if self._begun(step, step.digest) < len(step.commands)]

    def _begun(self, step: Step, grounds: str) -> int:
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
            begun = self._begun(step, grounds)
            said = "done before" if begun == len(step.commands) else step.makes
            self._say(f"{number}/{len(self.steps)} {step.name}: {said}")
            if not self._made(step, grounds, begun):
                self.table()
                return False
        self.table()
        return True

    def _made(self, step: Step, grounds: str, begun: int) -> bool:
        """Run a step's commands from a number on; whether all ended well."""
        for done, words in enumerate(step.commands[begun:], begun + 1):
            code = self.run(words)
            if code:
                said = " ".join(("python", *words))
                self._say(f"{step.name} ended with {code}: {said}; run it again to go on")
                return False
            self.done[step.name] = {"grounds": grounds, "commands": done}
            write_text(self.folder / DONE, json.dumps(self.done, indent=1) + "\n")
        return True

    def table(self) -> None:
        """Print and write the figures that have moved since the chain began."""
        rows = compared(_read(self.folder / BEFORE), self.now())
        table = Table("Figure", "Old", "New", "Change", title="Figures that moved")
        for row in rows:
            table.add_row(*row)
        self.console.print(table if rows else "no figure has moved")
        lines = ["\t".join(row) for row in (("figure", "old", "new", "change"), *rows)]
        write_text(self.folder / TABLE, "\n".join(lines) + "\n")

    def _say(self, words: str) -> None:
        self.console.print(words, highlight=False, markup=False)


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
