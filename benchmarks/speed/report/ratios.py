"""Targets of speed: ratios within one run, as data.

A ratio is taken in every round and told by its median and quartiles. Where several rows stand on
one side, the one with the largest median counts, on either side: the fastest of the others.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Literal

from benchmarks.speed.measure import Measured, spread
from benchmarks.speed.rows import matches

Quantity = Literal["steps", "right_hand_sides", "seconds"]


@dataclass(frozen=True)
class Target:
    """A ratio of two rows' rates, or one row's rate or time, and its limit.

    Attributes:
        title: what is compared, in words.
        own: patterns of this package's rows.
        limit: least ratio or rate; most seconds.
        others: patterns of the rows that it is divided by; none for a rate or a time.
        quantity: what is compared: steps per second, right-hand sides per second, or seconds.
    """

    title: str
    own: tuple[str, ...]
    limit: float
    others: tuple[str, ...] = ()
    quantity: Quantity = "steps"

    @property
    def at_most(self) -> bool:
        """Whether the limit is an upper one."""
        return self.quantity == "seconds"


SINGLE, BATCH = ("single/own",), ("batch/own/1024",)

TARGETS = (
    Target("single: CartPole-v1", SINGLE, 1.8, ("single/CartPole",)),
    Target("single: Pendulum-v1", SINGLE, 2.9, ("single/Pendulum",)),
    Target("single: MuJoCo InvertedPendulum-v5", SINGLE, 6, ("single/InvertedPendulum",)),
    Target("single: the fastest gym-electric-motor", SINGLE, 30, ("single/gem_*",)),
    Target("single: PC-gym reactor", SINGLE, 100, ("single/pcgym",)),
    Target("single: do-mpc's simulator of the same plant", SINGLE, 120, ("plant/dompc",)),
    Target("batch of 1024: EnvPool CartPole", BATCH, 1.8, ("batch/envpool_CartPole*/1024",)),
    Target("batch of 1024: SyncVectorEnv Pendulum", BATCH, 18, ("batch/sync_Pendulum/1024",)),
    Target(
        "right-hand sides: the fastest gymnax at any n",
        BATCH,
        6,
        ("batch/gymnax_*",),
        "right_hand_sides",
    ),
    Target(
        "right-hand sides: Gymnasium's vector CartPole at its fastest n",
        BATCH,
        5,
        ("batch/vector_CartPole/*",),
        "right_hand_sides",
    ),
    Target("batch of 1024: two threads against one", ("batch/own_two/1024",), 1.85, BATCH),
    Target(
        "PPO rollouts, batch of 64: 8 copies of Pendulum-v1",
        ("rollouts/own/64",),
        9,
        ("rollouts/Pendulum/8",),
    ),
    Target(
        "PPO rollouts, batch of 256: 8 copies of Pendulum-v1",
        ("rollouts/own/256",),
        18,
        ("rollouts/Pendulum/8",),
    ),
    Target(
        "PPO end to end, batch of 256: 8 copies of Pendulum-v1, default settings",
        ("learning/own/256",),
        30,
        ("learning/Pendulum/8",),
    ),
    Target("first step after the start, compiled before", ("start/warm",), 0.6, (), "seconds"),
    Target("first step after the start, compiled anew", ("start/cold",), 4, (), "seconds"),
    Target("20 candidates fitted to 60 trials of 10 s", ("fits/own",), 15, (), "seconds"),
)
"""What is wanted."""

CHECKS = (
    Target("batch of 1024 against the kernel of one", BATCH, 2.0, ("single/own_kernel",)),
    Target("batch of 1024 against gym.make", BATCH, 3.0, SINGLE),
    Target("two threads against one, batch of 1024", ("batch/own_two/1024",), 1.5, BATCH),
)
"""What falls below its limit when a batch is no longer computed in lanes or on all threads."""


@dataclass(frozen=True)
class Verdict:
    """A target beside what was measured.

    Attributes:
        target: the target.
        got: lower quartile, median and upper quartile; None if it was not measured.
        own: key of this package's row.
        other: key of the row that it was divided by, if any.
        absence: why it was not measured.
        broke: whether a row failed.
        excused: whether a row needs more cores than this machine has.
    """

    target: Target
    got: tuple[float, float, float] | None = None
    own: str = ""
    other: str = ""
    absence: str = ""
    broke: bool = False
    excused: bool = False

    @property
    def word(self) -> str:
        """`met`, `missed` or `not measured`, of the median."""
        if self.got is None:
            return "not measured"
        kept = self.got[1] <= self.target.limit if self.target.at_most else self._reached
        return "met" if kept else "missed"

    @property
    def _reached(self) -> bool:
        assert self.got is not None
        return self.got[1] >= self.target.limit


def judge_all(targets: Sequence[Target], rows: Mapping[str, Measured]) -> list[Verdict]:
    """Verdicts on the targets whose rows were chosen."""
    chosen = list(rows.values())
    return [
        judge(target, chosen)
        for target in targets
        if all(_meant(patterns, chosen) for patterns in (target.own, target.others) if patterns)
    ]


def judge(target: Target, rows: Sequence[Measured]) -> Verdict:
    """A target's verdict."""
    best = []
    for patterns in (target.own, target.others) if target.others else (target.own,):
        meant = _meant(patterns, rows)
        row = fastest(meant, target.quantity)
        if row is None:
            return _absent(target, meant)
        best.append(row)
    values = _paired([rates(one, target.quantity) for one in best])
    if not values:
        return Verdict(target, absence="no round has both")
    return Verdict(target, spread(values), *(one.row.key for one in best))


def _meant(patterns: Sequence[str], rows: Sequence[Measured]) -> list[Measured]:
    return [one for one in rows if any(matches(one.row.key, p) for p in patterns)]


def rates(one: Measured, quantity: Quantity) -> dict[int, float]:
    """Return the compared rates of a row by round; none if it is unknown."""
    if quantity == "seconds":
        return {number: 1.0 / rate for number, rate in one.rates.items()}
    if quantity == "steps":
        return one.rates
    count = one.right_hand_sides
    return {} if count is None else {n: count * rate for n, rate in one.rates.items()}


def fastest(rows: Sequence[Measured], quantity: Quantity) -> Measured | None:
    """The row with the largest median rate, or least time; None if none was measured."""
    known = [one for one in rows if rates(one, quantity)]
    choose = min if quantity == "seconds" else max
    return choose(known, key=lambda one: median(rates(one, quantity).values()), default=None)


def _paired(sides: Sequence[Mapping[int, float]]) -> list[float]:
    """The only side's values, or the quotient of two in every round that has both."""
    if len(sides) == 1:
        return list(sides[0].values())
    own, other = sides
    return [own[number] / other[number] for number in sorted(own.keys() & other.keys())]


def _absent(target: Target, rows: Sequence[Measured]) -> Verdict:
    """The verdict where one side has nothing."""
    one = next((one for one in rows if one.broke), rows[0])
    why = one.absence or ("right-hand sides unknown" if one.rates else "not reached")
    excused = one.row.cores > (os.cpu_count() or 1)
    return Verdict(target, absence=f"{one.row.title}: {why}", broke=one.broke, excused=excused)


def wanted_rows(targets: Sequence[Target], keys: Sequence[str]) -> list[str]:
    """Keys of the rows that some targets compare."""
    patterns = [p for target in targets for p in (*target.own, *target.others)]
    return [key for key in keys if any(matches(key, pattern) for pattern in patterns)]


def neighbours(targets: Sequence[Target], keys: Sequence[str]) -> list[list[str]]:
    """Groups of rows whose steps targets compare, directly or through others.

    A shared machine's speed changes by half within a minute, and a ratio of rates says something
    where both were measured before it did. Right-hand sides are compared with the best at any
    number of environments, which are too many to be measured in one breath.
    """
    groups: list[set[str]] = []
    for target in targets:
        meant = set(wanted_rows([target], keys))
        if target.quantity == "steps" and target.others and meant:
            beside = [group for group in groups if group & meant]
            groups = [group for group in groups if not group & meant]
            groups.append(meant.union(*beside))
    return [[key for key in keys if key in group] for group in groups]
