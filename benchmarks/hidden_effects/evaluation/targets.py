"""Counts and targets of each block (the design, section 4); figures of a score as text."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from benchmarks.hidden_effects.evaluation.troubles import RIGHT_STRUCTURE
from benchmarks.hidden_effects.evaluation.verdicts import Outcome
from benchmarks.hidden_effects.generation.readout_noise import UGLY
from benchmarks.hidden_effects.rigs.lab import SIZES


@dataclass(frozen=True)
class Target:
    """Bounds that a figure was promised to keep.

    Attributes:
        least: smallest value, None without.
        most: largest value, None without.
    """

    least: float | None = None
    most: float | None = None

    def met(self, value: float) -> bool:
        """Whether a value keeps the bounds."""
        above = self.least is None or value >= self.least
        return above and (self.most is None or value <= self.most)

    def text(self) -> str:
        """The bounds as a reader has them: `>= 0.92`."""
        if self.least is not None and self.most is not None:
            return f"{self.least:g}-{self.most:g}"
        return f">= {self.least:g}" if self.most is None else f"<= {self.most:g}"


@dataclass(frozen=True)
class Rate:
    """A share of a block's cases.

    Attributes:
        name: as tables have it.
        hit: whether a case counts to it; None leaves the case out.
        target: what was promised, None where nothing was.
    """

    name: str
    hit: Callable[[Outcome], bool | None]
    target: Target | None = None


_SINGLE = (
    Rate("named right", lambda o: o.right, Target(least=0.92)),
    Rate("right or in its group", lambda o: o.near, Target(least=0.98)),
    Rate("... or said to be what may be meant", lambda o: o.beside),
    Rate("confidently wrong", lambda o: o.wrong, Target(most=0.02)),
    Rate("detected", lambda o: o.detected),
    Rate("a spurious second", lambda o: o.spurious),
)

_FAINT = (
    Rate("detected", lambda o: o.detected, Target(least=0.85)),
    Rate("confidently wrong", lambda o: o.wrong, Target(most=0.03)),
    Rate("named right", lambda o: o.right),
    Rate("right or in its group", lambda o: o.near),
    Rate("... or said to be what may be meant", lambda o: o.beside),
)

_NOTHING = (
    Rate("false alarm", lambda o: o.detected, Target(most=0.01)),
    Rate("a false name", lambda o: o.verdict == "effect"),
)

_SINGLE_UGLY = (
    Rate("named right", lambda o: o.right, Target(least=0.88)),
    Rate("right or in its group", lambda o: o.near),
    Rate("confidently wrong", lambda o: o.wrong, Target(most=0.02)),
    Rate("detected", lambda o: o.detected),
)

_NOTHING_UGLY = (
    Rate("false alarm", lambda o: o.detected, Target(most=0.02)),
    Rate("a false name", lambda o: o.verdict == "effect"),
)

_SLOW_DRIFT = (
    # Parameters are off in every case: `agrees` alone would never be said.
    Rate(
        "said to be of right structure", lambda o: o.verdict in RIGHT_STRUCTURE, Target(most=0.02)
    ),
    Rate("said to agree", lambda o: o.verdict == "agrees"),
    Rate("right or in its group, or unknown", lambda o: o.near or o.verdict == "unknown"),
    Rate("a false name", lambda o: o.wrong),
)

_PARAMETERS = (
    Rate("right parameter named", lambda o: o.parameters, Target(least=0.95)),
    Rate("a new effect claimed", lambda o: o.detected, Target(most=0.02)),
    Rate(
        "right parameter named, where data can tell",
        lambda o: o.parameters if o.parameters_tellable else None,
    ),
    Rate("named, or said not to be identifiable", lambda o: o.parameters_reported),
    Rate("a parameter moved that was right", lambda o: o.parameters_spurious),
)

_PAIR = (
    Rate("both named", lambda o: o.hits == 2, Target(least=0.75)),
    Rate("at least one", lambda o: o.hits >= 1, Target(least=0.97)),
    Rate("a spurious third", lambda o: o.spurious, Target(most=0.03)),
    Rate("at least one, or its group", lambda o: o.near),
    Rate("detected", lambda o: o.detected),
)

_UNKNOWN = (
    Rate("unknown", lambda o: o.verdict == "unknown", Target(least=0.85)),
    Rate("a false name", lambda o: o.verdict == "effect", Target(most=0.05)),
    Rate("detected", lambda o: o.detected),
)


def _of(kind: str, hit: Callable[[Outcome], bool | None]) -> Callable[[Outcome], bool | None]:
    """The same of the cases of one kind alone."""
    return lambda outcome: hit(outcome) if outcome.kind == kind else None


def _something(hit: Callable[[Outcome], bool | None]) -> Callable[[Outcome], bool | None]:
    """The same of those cases alone that hide something."""
    return lambda outcome: hit(outcome) if outcome.truth else None


_RIGS = (
    Rate("one effect: right or in its group", _of("one effect", lambda o: o.near), Target(0.92)),
    Rate("one effect: named right", _of("one effect", lambda o: o.right)),
    Rate("one effect: a spurious second", _of("one effect", lambda o: o.spurious)),
    Rate("two effects: both named", _of("two effects", lambda o: o.hits == 2), Target(0.7)),
    Rate("two effects: one of them, or its group", _of("two effects", lambda o: o.near)),
    Rate("outside: unknown", _of("outside", lambda o: o.verdict == "unknown")),
    Rate("outside: a false name", _of("outside", lambda o: o.verdict == "effect")),
    Rate(
        "hidden: confidently wrong, 3 noises left too",
        _something(lambda o: o.wrong or o.false_structure),
        Target(most=0.01),
    ),
    Rate(
        "hidden: said to be of right structure", _something(lambda o: o.verdict in RIGHT_STRUCTURE)
    ),
    Rate("nothing: alarm", _of("nothing", lambda o: o.detected), Target(most=0.02)),
    Rate("nothing: right structure said", _of("nothing", lambda o: o.verdict in RIGHT_STRUCTURE)),
)

_LAB = (
    Rate("trouble named, or place and kind said", lambda o: o.trouble == "said", Target(0.75)),
    Rate("... or with other claims beside it", lambda o: o.trouble in ("said", "beside")),
    Rate("confidently wrong", lambda o: o.wrong),
    Rate("detected", lambda o: o.detected),
    *(Rate(f"{name}: said", _of(name, lambda o: o.trouble == "said")) for name in SIZES),
)
"""Targets of both blocks are of 100 troubles and 200 controls at least."""

_LAB_NOTHING = (
    Rate("alarm", lambda o: o.trouble == "alarm", Target(most=0.03)),
    Rate("right structure said", lambda o: o.verdict in RIGHT_STRUCTURE),
)

RATES: dict[str, tuple[Rate, ...]] = {
    "single": _SINGLE,
    "faint": _FAINT,
    "nothing": _NOTHING,
    "parameters": _PARAMETERS,
    "pair": _PAIR,
    "unknown": _UNKNOWN,
    **{f"single_{ugly}": _SINGLE_UGLY for ugly in UGLY},
    **{f"nothing_{ugly}": _NOTHING_UGLY for ugly in UGLY},
    "slow_drift": _SLOW_DRIFT,
    "rigs": _RIGS,
    "lab": _LAB,
    "lab_nothing": _LAB_NOTHING,
}
"""By block."""

GAP_BLOCKS = ("single", "faint", "parameters", "pair", *(f"single_{ugly}" for ugly in UGLY))
"""Blocks whose truth the catalogue holds, so that an amended model could close the gap."""

GAP_MEDIAN, GAP_TENTH = Target(least=0.95), Target(least=0.80)
"""Of (before - after) / (before - floor) on trials left out: median and tenth percentile."""

SIZE_ERROR, COVERAGE = Target(most=0.05), Target(least=0.92, most=0.97)
"""Median relative error of a fitted size; share of 95 % intervals that hold the truth."""


def percent(figure: dict[str, Any]) -> str:
    """A rate with its interval, hits and n: `92.0 % (88.9-94.3), 368 of 400`."""
    if not figure["n"]:
        return "no case"
    low, high = 100 * figure["low"], 100 * figure["high"]
    share = 100 * figure["rate"]
    return f"{share:.1f} % ({low:.1f}-{high:.1f}), {figure['hits']} of {figure['n']}"
