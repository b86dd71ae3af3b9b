"""Answers to cases of blocks `lab` and `lab_nothing`: what counts as naming a trouble.

A trouble is said where the answer names it, or says its place and kind: which trial alone has how
much more friction, by what share the gain falls from trial to trial, at what frequency a sensor
hums. An effect that is named for sure and is another is wrong, also beside the right one; so is a
claim about trials that differ, where they do not so. A list of all that could be wrong says
nothing: words count only where they are those of one trouble.
"""

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

RIGHT_STRUCTURE = ("agrees", "parameters")
"""Verdicts that say that no structure is missing."""

NAMES: dict[str, str] = {
    "clock": r"(.*_)?clock(_.*)?",
    "bent_sensor": r"(.*_)?(bend|bent_sensor|nonlinearity|linearity)",
    "play": r"(.*_)?(backlash|play|lost_motion)",
    "dead_band": r"drive_dead_(zone|band)",
    "hum": r"(.*_)?(hum|mains)",
}
"""Patterns of an effect's name by the trouble that it is; the other troubles are no effect."""

SENSOR = r"\b(sensor|reading|readings|lvdt|encoder|contraction|angle)\b"
"""Words for the place of what is wrong with a reading."""

WORDS: dict[str, tuple[str, ...]] = {
    "clock": (r"\bclocks?\b", r"\b(fast|slow|drifts)\b"),
    "bent_sensor": (SENSOR, r"\b(bent|bends|nonlinear|not linear)\b"),
    "play": (r"\b(play|backlash|lost motion)\b",),
    "dead_band": (r"\bdrive\b", r"\bdead (band|zone)\b"),
    "hum": (SENSOR, r"\b(hum|hums|mains|ripple|oscillates)\b"),
}
"""Words of place and kind, all of which say a trouble."""

ALONE = re.compile(r"(\S+) alone needs (\S+) (-?[\d.e+-]+)")
TREND = re.compile(r"(\S+) (falls|rises) by (?:< )?([\d.]+) % from trial to trial")
SHARE = re.compile(r"([\d.]+) % of it acts in (\S+?)\.?(?: |$)")
CANDIDATE = re.compile(r"Best candidate: (.+?), which leaves")
"""Sentences about trials, and about what comes nearest where nothing is named."""

MOSTLY = 80.0
"""Share of what is unknown that is in one trial, so that it counts as that trial's (%)."""

SIZE, GAIN, FREQUENCY = 0.2, 0.3, 0.02
"""Relative errors at most: of friction, of a share of the gain, of a frequency."""

ROUNDING = 0.5
"""Of a share that is printed in whole per cents."""


def judged(truth: Mapping[str, Any], answer: Mapping[str, Any], effects: Sequence[str]) -> str:
    """Say "said", "beside", "wrong" or "missed"; of a case without a trouble "alarm" or "quiet".

    "beside" is the trouble with other claims beside it.

    Args:
        truth: of the case.
        answer: its `diagnosis.json`.
        effects: names that it says for sure, besides what is true of the rig.
    """
    name, sentence = truth["trouble"]["name"], answer["sentence"]
    claims = [*(_is_name(name, each) for each in effects), *_of_trials(truth, sentence)]
    if name == "nothing":
        return "alarm" if claims or answer["verdict"] == "unknown" else "quiet"
    if claims:
        return "said" if all(claims) else "beside" if any(claims) else "wrong"
    return "said" if _said(truth, answer) else "missed"


def _is_name(trouble: str, name: str) -> bool:
    return bool(re.fullmatch(NAMES.get(trouble, "(?!)"), name.replace(" ", "_")))


def _of_trials(truth: Mapping[str, Any], sentence: str) -> list[bool]:
    """Whether claims about trials are that of the trouble, of its size, each."""
    trouble, friction = truth["trouble"], truth["friction"]["true"]
    alone = [
        trouble["name"] == "one_trial"
        and file == trouble["trial"]
        and "friction." in path
        and _near(float(value), friction * (1.0 + trouble["size"]), SIZE)
        for file, path, value in ALONE.findall(sentence)
    ]
    trends = [
        trouble["name"] == "gain_drift"
        and path.split(".")[-1].startswith("gain")
        and way == "falls"
        and abs(float(share) - 100.0 * trouble["size"]) <= 100.0 * trouble["size"] * GAIN + ROUNDING
        for path, way, share in TREND.findall(sentence)
    ]
    # A claim in other words is none of these troubles.
    return [*alone, *trends] or [False] * ("Trials differ" in sentence)


def _said(truth: Mapping[str, Any], answer: Mapping[str, Any]) -> bool:
    """Whether an answer that names no effect says place and kind."""
    trouble, sentence = truth["trouble"], answer["sentence"]
    name, verdict = trouble["name"], answer["verdict"]
    if name == "in_motion":
        begins = _has((r"\bbegins? (at rest|in motion)\b",), sentence)
        return verdict in RIGHT_STRUCTURE or (verdict == "undecidable" and begins)
    candidate = CANDIDATE.search(sentence)
    nearest = re.split(r", | and ", candidate[1]) if candidate else []
    if name == "one_trial":
        shares = [float(x) for x, file in SHARE.findall(sentence) if file == trouble["trial"]]
        moves = bool(re.search("goes with (speed|velocity)", sentence, re.IGNORECASE))
        rubs = moves or any(each.endswith("friction") for each in nearest)
        return max(shares, default=0.0) >= MOSTLY and rubs
    words = [name for name in WORDS if _has(WORDS[name], sentence)]
    if name == "hum":
        listed = json.dumps([answer.get("tones"), answer.get("nuisances")])
        spoken = re.findall(r"(\d+(?:\.\d+)?) Hz", sentence) if words == [name] else []
        numbers = map(float, [*re.findall(r"\d+(?:\.\d+)?", listed), *spoken])
        true = trouble["mains"], trouble["seen_hz"]
        return any(_near(x, each, FREQUENCY) for x in numbers for each in true)
    alone = bool(nearest) and all(_is_name(name, each) for each in nearest)
    return words == [name] or alone


def _has(patterns: Sequence[str], sentence: str) -> bool:
    return all(re.search(each, sentence, re.IGNORECASE) for each in patterns)


def _near(value: float, truth: float, share: float) -> bool:
    return abs(value - truth) <= share * abs(truth)
