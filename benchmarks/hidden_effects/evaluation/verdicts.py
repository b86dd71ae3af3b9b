"""One answer against its truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from benchmarks.hidden_effects.evaluation.intervals import held
from benchmarks.hidden_effects.evaluation.troubles import RIGHT_STRUCTURE, judged
from benchmarks.hidden_effects.generation.effect_size import UNTOLD
from benchmarks.hidden_effects.generation.effects import ALL
from benchmarks.hidden_effects.generation.groups import expected, group
from benchmarks.hidden_effects.rigs import effect_size

STRUCTURAL = ("effect", "unknown")
"""Verdicts that claim more than parameters."""

MOST_LEFT = 3.0
"""Noises that such a verdict may leave."""

NO_ANSWER = "no answer"
"""Verdict where the diagnosis raised an error."""

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
    """Result of one case.

    Attributes:
        block: of the case.
        truth: hidden effects.
        verdict: of the diagnosis.
        named: effects that it names.
        right: exactly what was hidden, no more.
        near: what it names first is the truth or of its group (`groups`).
        beside: as near, where it also counts to say that the truth or one of its group may be
            meant instead: the first two that `confused_with` lists.
        wrong: it names an effect, and not so.
        detected: it says that structure is missing.
        hits: how many hidden effects it names.
        spurious: whether it names more effects than there are.
        parameters: whether each base parameter that was off is named, None without such.
        parameters_reported: the same, where it also counts to say that the data do not tell it.
        parameters_tellable: whether the data tell each at all, by the generator's own ruler.
        parameters_spurious: whether one is named that was right, None outside such a block.
        closed: shares of the gap closed on held-out trials.
        size_errors: by `effect.parameter`, relative error of a fitted size.
        covered: by `effect.parameter`, whether the interval holds the truth.
        held: the same of the model's own parameters (`intervals.held`).
        seconds: how long the diagnosis took.
        number: of the case in its set.
        ratio: the smallest r of what is hidden, None where nothing is.
        answered: whether there was an answer; without one it hits nothing and claims nothing.
        off: base parameters that were off by a tenth, where nothing else is hidden.
        moved: paths of base parameters that are named as off, in such a block.
        sentence: the answer as a person would say it, or what was raised instead.
        kind: of what a rig of another lab hides; empty elsewhere.
        trouble: what the answer is worth to a laboratory (`troubles.judged`); empty elsewhere.
        left: the largest misfit of a signal after the amended model, over its noise; None where
            the truth has no noise.
    """

    block: str
    truth: tuple[str, ...]
    verdict: str
    named: tuple[str, ...]
    right: bool
    near: bool
    beside: bool
    wrong: bool
    detected: bool
    hits: int
    spurious: bool
    parameters: bool | None = None
    parameters_reported: bool | None = None
    parameters_tellable: bool | None = None
    parameters_spurious: bool | None = None
    closed: list[float] = field(default_factory=list)
    size_errors: dict[str, float] = field(default_factory=dict)
    covered: dict[str, bool] = field(default_factory=dict)
    held: dict[str, bool] = field(default_factory=dict)
    seconds: float | None = None
    number: int = 0
    ratio: float | None = None
    answered: bool = True
    off: tuple[str, ...] = ()
    moved: tuple[str, ...] = ()
    kind: str = ""
    trouble: str = ""
    left: float | None = None
    sentence: str = ""

    @property
    def hidden(self) -> str:
        """What was hidden, in words."""
        if self.truth:
            return " + ".join(sorted(self.truth))
        return "parameters alone" if self.off else "nothing"

    @property
    def false_structure(self) -> bool:
        """Whether the structure is said to be right with more than `MOST_LEFT` noises left."""
        return self.verdict in RIGHT_STRUCTURE and (self.left or 0.0) > MOST_LEFT

    @property
    def said(self) -> str:
        """What was named, or the verdict that names nothing."""
        return " + ".join(sorted(self.named)) or self.verdict

    @property
    def sized(self) -> bool:
        """Whether what is hidden could have been of any size."""
        return all(name not in ALL or ALL[name].sized for name in self.truth)

    @property
    def beyond(self) -> tuple[str, ...]:
        """Paths of base parameters that are named and were right."""
        known = tuple(start for name in self.off for start in PATHS[name])
        return tuple(path for path in self.moved if not path.startswith(known))

    @property
    def missing(self) -> tuple[str, ...]:
        """Base parameters that were off and are not named."""
        return tuple(name for name in self.off if not _all_start_with(self.moved, PATHS[name]))


def compare(truth: Mapping[str, Any], answer: Mapping[str, Any]) -> Outcome:
    """The outcome of a case from its truth and its `diagnosis.json`."""
    hidden = tuple(effect["name"] for effect in truth["effects"])
    verdict = answer["verdict"]
    # What is true of the rig besides what is hidden, such as the step of its encoder, is no claim.
    true = truth.get("true_besides", ())
    effects = [e for e in answer["effects"] if e["name"] not in true]
    if verdict == "effect" and not effects:
        verdict = "parameters"
    effects = effects if verdict == "effect" else []
    named = tuple(effect["name"] for effect in effects)
    meant = set().union(*(e.get("group") or group(e["name"]) for e in truth["effects"]))
    near = any(effect["name"] in meant for effect in effects[:1])
    beside = any(meant & {effect["name"], *effect["confused_with"][:2]} for effect in effects[:1])
    right = bool(hidden) and sorted(named) == sorted(hidden)
    block, ratios = truth["block"], [e["r"] for e in truth["effects"] if "r" in e]
    odds = list((truth.get("log_odds") or {}).values())
    outcome = Outcome(
        block=block,
        truth=hidden,
        number=truth.get("number", 0),
        ratio=min(ratios, default=None),
        parameters_tellable=min(odds) > UNTOLD if odds else None,
        off=tuple(_off(truth)) if block == "parameters" else (),
        kind=truth.get("kind", ""),
        verdict=verdict,
        named=named,
        right=right,
        near=right or near,
        beside=right or beside,
        wrong=verdict == "effect" and not (right or near),
        detected=verdict in STRUCTURAL,
        hits=len(set(named) & set(hidden)),
        spurious=len(named) > len(hidden),
        answered=verdict != NO_ANSWER,
        sentence=answer.get("sentence", ""),
        left=_left(truth, answer),
        held=held(truth, answer),
    )
    _parameters(outcome, truth, answer)
    for gap in answer["gap"].values():
        if gap["held_out"] and gap["before"] > (1.0 + VISIBLE) * gap["floor"]:
            outcome.closed.append(gap["closed"])
    _sizes(outcome, truth, effects)
    if "trouble" in truth:
        outcome.trouble = judged(truth, answer, named)
        outcome.truth = (outcome.kind,) if outcome.kind != "nothing" else ()
        outcome.wrong = outcome.trouble in ("wrong", "beside")
    return outcome


def no_answer(message: str) -> dict[str, Any]:
    """What stands for the answer of a diagnosis that raised an error: no hit, and no claim."""
    return {"verdict": NO_ANSWER, "effects": [], "parameters": {}, "gap": {}, "sentence": message}


def _off(truth: Mapping[str, Any]) -> list[str]:
    """Base parameters that were off by a tenth at least."""
    off = [n for n, factor in truth["base_factors"].items() if abs(factor - 1.0) >= 0.0999]
    return [name for name in off if name in PATHS]


def _all_start_with(paths: Sequence[str], starts: tuple[str, ...]) -> bool:
    """Whether one of some paths begins in one of some ways."""
    return any(path.startswith(starts) for path in paths)


def _parameters(outcome: Outcome, truth: Mapping[str, Any], answer: Mapping[str, Any]) -> None:
    """Whether every base parameter that was off is named or listed as not identifiable."""
    off = _off(truth)
    if truth["block"] != "parameters" or not off:
        return
    moved = [path for path, each in answer["parameters"].items() if each["significant"]]
    named = [*moved, *answer.get("not_identifiable", {})]
    outcome.moved = tuple(moved)
    outcome.parameters = not outcome.missing
    outcome.parameters_reported = all(_all_start_with(named, PATHS[name]) for name in off)
    outcome.parameters_spurious = bool(outcome.beyond) if outcome.answered else None


def _left(truth: Mapping[str, Any], answer: Mapping[str, Any]) -> float | None:
    noise, gap = truth.get("noise"), answer["gap"]
    if not noise:
        return None
    return max((gap[name]["after"] / noise[name] for name in noise if name in gap), default=None)


def _sizes(outcome: Outcome, truth: Mapping[str, Any], effects: list[Mapping[str, Any]]) -> None:
    parameters = {effect["name"]: effect["parameters"] for effect in effects}
    hidden = {effect["name"]: effect["parameters"] for effect in truth["effects"]}
    for effect in truth["effects"]:
        if truth["block"] == "rigs":
            kind = truth["rig"].get("kind", "imposed")
            values = effect_size.expected(kind, effect["name"], effect["parameters"], hidden)
        else:
            values = expected(effect["name"], effect["parameters"])
        for name, value in values.items():
            estimates = parameters.get(effect["name"], {})
            estimate = estimates.get(name) or estimates.get(f"cable.{name}")
            if estimate is None or estimate["value"] is None or value == 0.0:
                continue
            path = f"{effect['name']}.{name}"
            outcome.size_errors[path] = abs(estimate["value"] / value - 1.0)
            low, high = estimate["low"], estimate["high"]
            above = low is None or low <= value
            outcome.covered[path] = above and (high is None or value <= high)
