"""Kills commands at random moments, resumes them, and counts what was lost.

    python -m tests.kills.kill_and_resume --kills 200 [--seed 0] [--only run,diagnose]

A round starts a command in a new folder, kills its processes (SIGKILL, or SIGTERM every third time)
and starts it again, until it ends; what it has come to must be what an undisturbed run comes to.
After every kill, each case that was finished before must still be there, and none be computed
twice. Exit code 1 if anything was lost.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.kills.commands import COMMANDS, ROOT, Command

FINISHED = 0
TERMINATED_EVERY = 3


@dataclass
class Losses:
    """What was counted of one command.

    Attributes:
        kills: processes killed while they ran.
        terminated: of these, by SIGTERM.
        rounds: runs that came to their end.
        lost: finished cases that were gone after a kill or at the next one.
        twice: finished cases that were computed again.
        different: results that were not those of the undisturbed run.
        partial_files: partial files that stayed after a run had ended.
        failed: runs that ended with an error, with its last line.
    """

    kills: int = 0
    terminated: int = 0
    rounds: int = 0
    lost: list[str] = field(default_factory=list)
    twice: list[str] = field(default_factory=list)
    different: list[str] = field(default_factory=list)
    partial_files: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)

    @property
    def count(self) -> int:
        """How many things went wrong."""
        lists = (self.lost, self.twice, self.different, self.partial_files, self.failed)
        return sum(map(len, lists))

    def __str__(self) -> str:
        return (
            f"{self.kills} kills ({self.terminated} by SIGTERM), {self.rounds} runs ended; lost "
            f"{len(self.lost)}, computed twice {len(self.twice)}, different results "
            f"{len(self.different)}, leftovers {len(self.partial_files)}, failed {len(self.failed)}"
        )


class Killer:
    """Kills one command again and again.

    Args:
        make: makes the command in a folder.
        folder: for all rounds; new.
        chance: seeded.
        warm: whether what it compiles is in the cache already.
    """

    def __init__(
        self, make: type[Command], folder: Path, chance: random.Random, warm: bool = False
    ) -> None:
        self.make, self.folder, self.chance, self.warm = make, folder, chance, warm
        self.losses = Losses()
        self.undisturbed: dict[str, Any] = {}
        self.seconds = 0.0

    def run(self, kills: int) -> Losses:
        """Kill so many times, and end the last round."""
        self._undisturbed()
        while self.losses.kills < kills:
            self._round(kills)
            print(f"{self.make.name}: {self.losses}", file=sys.stderr, flush=True)
        return self.losses

    def _undisturbed(self) -> None:
        # Once to compile, once to measure.
        for name in ("undisturbed",) if self.warm else ("compiled", "undisturbed"):
            command, begun = self.make(self.folder / name), time.monotonic()
            process = start(command)
            if process.wait() != FINISHED:
                raise SystemExit(f"{command.name} fails undisturbed: {last_line(command)}")
            self.seconds, self.undisturbed = time.monotonic() - begun, command.final()

    def _round(self, kills: int) -> None:
        command = self.make(self.folder / f"round_{self.losses.rounds}")
        before = command.finished()
        first = self.losses.kills
        while True:
            process, begun = start(command), time.monotonic()
            left = kills - self.losses.kills
            try:
                # Beyond its duration too, so that some runs come to their end.
                code = process.wait(self._moment() if left > 0 else None)
            except subprocess.TimeoutExpired:
                self._kill(process)
                before = self._compare(command, before)
                if not command.complete():
                    continue
                code = FINISHED
            if self.losses.kills == first:
                # The machine may be less busy than it was when the undisturbed run was measured.
                self.seconds = time.monotonic() - begun
            self._ended(command, code, before)
            return

    def _moment(self) -> float:
        return self.chance.uniform(0.2, 1.1) * self.seconds

    def _kill(self, process: subprocess.Popen[bytes]) -> None:
        self.losses.kills += 1
        gently = self.losses.kills % TERMINATED_EVERY == 0
        self.losses.terminated += gently
        how = signal.SIGTERM if gently else signal.SIGKILL
        kill_group(process, how)
        process.wait()
        # Workers may outlive it by a moment; two runs at once are not what is tested.
        kill_group(process, signal.SIGKILL)

    def _compare(self, command: Command, before: dict[str, Any]) -> dict[str, Any]:
        now = command.finished()
        for name, value in before.items():
            if name not in now and not command.may_go(name, now):
                self.losses.lost.append(name)
            elif name in now and now[name] != value:
                self.losses.twice.append(name)
        self.losses.twice += command.faults()
        return now

    def _ended(self, command: Command, code: int, before: dict[str, Any]) -> None:
        self.losses.rounds += 1
        if code != FINISHED:
            self.losses.failed.append(last_line(command))
            return
        self._compare(command, before)
        final = command.final()
        for name in sorted(final.keys() | self.undisturbed.keys()):
            if final.get(name) != self.undisturbed.get(name):
                self.losses.different.append(f"{command.folder}: {name}")
        self.losses.partial_files += map(str, command.folder.rglob("*.partial"))


def start(command: Command) -> subprocess.Popen[bytes]:
    """Start a command as the leader of a group of processes."""
    # One folder up: the order's own is the command's alone.
    with (command.folder / "output.txt").open("ab") as output:
        return subprocess.Popen(
            command.arguments(),
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )


def kill_group(process: subprocess.Popen[bytes], how: signal.Signals) -> None:
    """Send a signal to a process and to those that it started."""
    try:
        os.killpg(process.pid, how)
    except ProcessLookupError:
        pass


def last_line(command: Command) -> str:
    """The last line of what a command printed."""
    text = (command.folder / "output.txt").read_text(errors="replace").strip()
    return text.splitlines()[-1] if text else "no output"


def main() -> int:
    """Kill as often as asked and print the losses per command."""
    parser = argparse.ArgumentParser(description="Kill commands, resume them, count losses.")
    parser.add_argument("--kills", type=int, default=200, help="in all (200)")
    parser.add_argument("--seed", type=int, default=0, help="of the moments (0)")
    parser.add_argument("--only", default=",".join(COMMANDS), help="commands, by commas (all)")
    asked = parser.parse_args()
    names = asked.only.split(",")
    total = 0
    with tempfile.TemporaryDirectory(prefix="pma_gym_kills_") as folder:
        for number, name in enumerate(names):
            kills = (asked.kills * (number + 1)) // len(names) - asked.kills * number // len(names)
            killer = Killer(COMMANDS[name], Path(folder) / name, random.Random(asked.seed))
            losses = killer.run(kills)
            print(f"{name}: {losses}", flush=True)
            for what in ("lost", "twice", "different", "leftovers", "failed"):
                for each in getattr(losses, what)[:5]:
                    print(f"  {what}: {each}", flush=True)
            total += losses.count
    return 1 if total else 0


if __name__ == "__main__":
    sys.exit(main())
