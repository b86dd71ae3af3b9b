"""Rounds over all rows: each round measures every row once, in another order.

So a slow minute of the machine falls on all rows alike, and a ratio of two rows is taken within a
round. Rows that belong together are measured one soon after the other. One worker works at a time;
the others wait for their input. Rows of `ANEW` are measured in a new process each round.
"""

import os
import random
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median, quantiles
from typing import Any, Protocol

from benchmarks.speed.client import Client, StartError, WorkerError
from benchmarks.speed.loops import Missing
from benchmarks.speed.peers import PEERS, Peer
from benchmarks.speed.rows import Row

SEED = 2008
_PAUSE_S = 0.02
"""Between measurements (s): threads of the last worker that still spin go to sleep."""

ANEW = ("single",)
"""Groups of rows that a process measures for one round only. What one process takes for a step of
Python differs from what the next takes, for as long as they live: medians of six processes were
13.1 to 16.7 us for CartPole-v1 and 6.6 to 7.3 us for this package (EPYC, 12 measurements each)."""

OnDone = Callable[[str], None]
"""Called after each row that was prepared or measured, with its title."""


class Asked(Protocol):
    """Interface of what measures: a `client.Client`, or a test double."""

    versions: dict[str, str]

    def prepare(self, key: str, row: str, settings: Mapping[str, Any]) -> None:
        """Make a row ready."""
        ...

    def measure(self, key: str, seconds: float) -> dict[str, Any]:
        """Measure a row."""
        ...

    def end(self) -> None:
        """End the process."""
        ...


@dataclass(frozen=True)
class Repetition:
    """Durations and repetitions of a measurement.

    Attributes:
        rounds: number of rounds.
        seconds: least time of a measurement (s).
    """

    rounds: int = 7
    seconds: float = 0.5


QUICK = Repetition(rounds=2, seconds=0.05)
"""To see that all works; its figures say little."""


@dataclass
class Measured:
    """Measurement of a row.

    Attributes:
        row: the row.
        rates: steps per second by the number of the round.
        facts: what the worker told beside, at the last measurement.
        absence: why the row was left out or given up, if it was.
        broke: whether it failed, in place of being impossible here.
    """

    row: Row
    rates: dict[int, float] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)
    absence: str = ""
    broke: bool = False

    @property
    def right_hand_sides(self) -> float | None:
        """Evaluations of the right-hand side in a step, if anybody knows."""
        known = self.row.right_hand_sides
        return self.facts.get("right_hand_sides") if known is None else known

    def give_up(self, why: str, broke: bool) -> None:
        """Leave the row out from here on."""
        self.absence, self.broke = why, broke


def spread(values: Sequence[float]) -> tuple[float, float, float]:
    """Lower quartile, median and upper quartile.

    >>> spread([4.0, 1.0, 2.0, 3.0, 5.0])
    (2.0, 3.0, 4.0)
    """
    if len(values) == 1:
        return values[0], values[0], values[0]
    low, _, high = quantiles(values, n=4, method="inclusive")
    return low, median(values), high


class Measurement:
    """A run over rows; Ctrl-C leaves what was measured so far in `rows`.

    Args:
        rows: what to measure.
        repetition: for how long.
        clients: gives a peer's worker, or None if it is not installed.
        together: keys of rows that are measured one after the other, in groups; the others come
            anywhere.

    Attributes:
        rows: what was measured, by the row's key.
        versions: of each worker that started, by its name.
        complete: whether every round was finished.
    """

    def __init__(
        self,
        rows: Sequence[Row],
        repetition: Repetition,
        clients: Callable[[Peer], Asked | None] | None = None,
        together: Sequence[Sequence[str]] = (),
    ) -> None:
        self.rows = {row.key: Measured(row) for row in rows}
        grouped = {key for group in together for key in group}
        alone = [[key] for key in self.rows if key not in grouped]
        self._groups = [[self.rows[key] for key in group] for group in [*together, *alone]]
        self.repetition = repetition
        self.versions: dict[str, dict[str, str]] = {}
        self.complete = False
        self._make = clients or client_of
        self._clients: dict[tuple[str, bool], Asked] = {}

    @property
    def work(self) -> int:
        """Number of calls of `on_done` if no row is left out."""
        return len(self.rows) * (1 + self.repetition.rounds)

    def run(self, on_done: OnDone = lambda title: None) -> None:
        """Prepare every row, then measure them round after round."""
        order = random.Random(SEED)
        try:
            self._each(list(self.rows.values()), self._prepare, on_done)
            for number in range(self.repetition.rounds):
                if number:
                    self._end(anew=True)
                groups = order.sample(self._groups, len(self._groups))
                shuffled = [one for group in groups for one in order.sample(group, len(group))]
                self._each(shuffled, lambda one, n=number: self._measure(one, n), on_done)
            self.complete = True
        finally:
            self._end()

    def _end(self, anew: bool = False) -> None:
        """End all processes, or those that measure one round only."""
        for (_, once), client in self._clients.items():
            if once or not anew:
                client.end()

    def _each(self, rows: list[Measured], act: Callable[[Measured], None], on_done: OnDone) -> None:
        for one in rows:
            if not one.absence:
                self._safely(one, act)
            on_done(one.row.title)

    def _safely(self, one: Measured, act: Callable[[Measured], None]) -> None:
        try:
            act(one)
        except Missing as reason:
            one.give_up(str(reason), broke=False)
        except StartError as error:
            for other in self.rows.values():
                if other.row.worker == one.row.worker and not other.absence:
                    other.give_up(f"cannot be started: {error}", broke=True)
        except WorkerError as error:
            one.give_up(str(error), broke=True)

    def _prepare(self, one: Measured) -> None:
        if (os.cpu_count() or 1) < one.row.cores:
            raise Missing(f"needs {one.row.cores} cores")
        client = self._client(one.row)
        client.prepare(one.row.key, one.row.row, one.row.settings)
        self.versions[one.row.worker] = client.versions

    def _measure(self, one: Measured, number: int) -> None:
        client = self._client(one.row)
        # Again only if the process had to be started anew.
        client.prepare(one.row.key, one.row.row, one.row.settings)
        time.sleep(_PAUSE_S)
        answer = client.measure(one.row.key, self.repetition.seconds)
        one.rates[number] = answer["steps"] / answer["seconds"]
        one.facts = answer["facts"]

    def _client(self, row: Row) -> Asked:
        key = row.worker, row.group in ANEW
        if key not in self._clients:
            peer = PEERS[row.worker]
            made = self._make(peer)
            if made is None:
                raise Missing(peer.absence)
            self._clients[key] = made
        return self._clients[key]


def client_of(peer: Peer) -> Client | None:
    """A peer's worker; None if it is not installed."""
    if peer.python is None:
        return None
    return Client(peer.python, f"benchmarks.speed.workers.serve_{peer.name}")
