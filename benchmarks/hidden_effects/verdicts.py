"""One answer against its truth."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from benchmarks.hidden_effects.groups import group
from benchmarks.hidden_effects.sizes import expected

STRUCTURAL = ("effect", "unknown")
"""Verdicts that claim more than parameters."""

PATHS: dict[str, tuple[str, ...]] = {
    "force_slope": ("contractile_force.slope",),
    "force_intercept": ("contractile_force.intercept",),
    "stiffness_low": ("stiffness.",),
    "damping_contracting": ("damping.contracting",),
    "damping_relaxing": ("damping.relaxing", "damping.high"),
    "drive_gain": ("drive.gain",),
    "radius": ("rotor.radius",),
    "inertia": ("rotor.inertia",),
    "mass": ("slide.mass",),
    "cable_stiffness": ("cable.stiffness",),
    "regulator_time": ("regulator_lag.time_constant",),
}
"""How the paths begin under which a diagnosis names a base parameter that is off."""

VISIBLE = 0.2
"""A signal's gap counts where it is larger than the floor by this share."""


@dataclass
class Outcome:
    """What came of one case.

    Attributes:
        block: of the case.
        truth: hidden effects.
        verdict: of the diagnosis.
        named: effects that it names.
        right: exactly what was hidden, no more.
        near: the first name, or what it is confused with, is the truth or of its group.
        wrong: it names an effect, and not so.
        detected: it says that structure is missing.
        hits: how many hidden effects it names.
        spurious: whether it names more effects than there are.
        parameters: whether each base parameter that was off is named, None without such.
        closed: shares of the gap closed on held-out trials.
        size_errors: by `effect.parameter`, relative error of a fitted size.
        covered: by `effect.parameter`, whether the interval holds the truth.
        seconds: how long it took.
    """

    block: str
    truth: tuple[str, ...]
    verdict: str
    named: tuple[str, ...]
    right: bool
    near: bool
    wrong: bool
    detected: bool
    hits: int
    spurious: bool
    parameters: bool | None
    closed: list[float] = field(default_factory=list)
    size_errors: dict[str, float] = field(default_factory=dict)
    covered: dict[str, bool] = field(default_factory=dict)
    seconds: float | None = None


def compare(truth: Mapping[str, Any], answer: Mapping[str, Any]) -> Outcome:
    """The outcome of a case from its truth and its `diagnosis.json`."""
    hidden = tuple(effect["name"] for effect in truth["effects"])
    verdict = answer["verdict"]
    effects = answer["effects"] if verdict == "effect" else []
    named = tuple(effect["name"] for effect in effects)
    near = any(_near(effect, hidden) for effect in effects[:1])
    right = bool(hidden) and sorted(named) == sorted(hidden)
    outcome = Outcome(
        block=truth["block"],
        truth=hidden,
        verdict=verdict,
        named=named,
        right=right,
        near=right or near,
        wrong=verdict == "effect" and not (right or near),
        detected=verdict in STRUCTURAL,
        hits=len(set(named) & set(hidden)),
        spurious=len(named) > len(hidden),
        parameters=_parameters(truth, answer),
    )
    for gap in answer["gap"].values():
        if gap["held_out"] and gap["before"] > (1.0 + VISIBLE) * gap["floor"]:
            outcome.closed.append(gap["closed"])
    _sizes(outcome, truth, effects)
    return outcome


def _near(effect: Mapping[str, Any], hidden: tuple[str, ...]) -> bool:
    named = {effect["name"], *effect["confused_with"][:2]}
    return any(name in named or effect["name"] in group(name) for name in hidden)


def _parameters(truth: Mapping[str, Any], answer: Mapping[str, Any]) -> bool | None:
    """Whether every base parameter that was off by a tenth is named, or said not to be told."""
    off = [n for n, factor in truth["base_factors"].items() if abs(factor - 1.0) >= 0.1]
    off = [name for name in off if name in PATHS]
    if truth["block"] != "parameters" or not off:
        return None
    said = [p for p, moved in answer["parameters"].items() if moved["significant"]]
    said += list(answer.get("not_identifiable", {}))
    return all(any(path.startswith(PATHS[name]) for path in said) for name in off)


def _sizes(outcome: Outcome, truth: Mapping[str, Any], effects: list[Mapping[str, Any]]) -> None:
    found = {effect["name"]: effect["parameters"] for effect in effects}
    for effect in truth["effects"]:
        for name, value in expected(effect["name"], effect["parameters"]).items():
            estimates = found.get(effect["name"], {})
            estimate = estimates.get(name) or estimates.get(f"cable.{name}")
            if estimate is None or value == 0.0:
                continue
            path = f"{effect['name']}.{name}"
            outcome.size_errors[path] = abs(estimate["value"] / value - 1.0)
            low, high = estimate["low"], estimate["high"]
            above = low is None or low <= value
            outcome.covered[path] = above and (high is None or value <= high)
