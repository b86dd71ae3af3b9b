"""Runs the chain step by step, and goes on where it stopped; `git diff` shows what has moved."""

import json
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console

from benchmarks.files import RESULTS, UNREADABLE, reason, say_damaged, write_text
from benchmarks.remake_steps import Step, command_line
from benchmarks.runner.fingerprint import ROOT

FOLDER = RESULTS / "remake"
DONE = "done.json"

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
    """

    def __init__(
        self,
        steps: Sequence[Step],
        folder: Path = FOLDER,
        console: Console | None = None,
        run: Run = run_command,
    ) -> None:
        self.steps, self.folder, self.run = list(steps), folder, run
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
        for number, step in enumerate(self.steps, 1):
            # Asked anew at each: the steps before may have changed what it is made of.
            grounds = step.digest
            done_before = self._commands_done(step, grounds)
            said = "done before" if done_before == len(step.commands) else step.makes
            self._say(f"{number}/{len(self.steps)} {step.name}: {said}")
            if not self._made(step, grounds, done_before):
                return False
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
