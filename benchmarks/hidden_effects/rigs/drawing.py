"""One case of block `rigs`: a rig, what it hides, the lab's folder and the truth."""

from collections.abc import Sequence
from typing import Any, Protocol, Self

import numpy as np

from benchmarks.hidden_effects.rigs.driven_campaign import draw_driven
from benchmarks.hidden_effects.rigs.imposed_campaign import draw_tested
from benchmarks.hidden_effects.rigs.laws import HiddenEffect
from benchmarks.hidden_effects.rigs.offers import KNOWN, OFFERS, OUTSIDE, catalogue_name, group
from benchmarks.hidden_effects.rigs.rig import log_uniform

KINDS = ("one effect", "nothing", "two effects", "one effect", "nothing", "outside")
"""Of what is hidden, in turn: of 600 cases 200 hide one, 200 none, 100 two, 100 what none has."""

SIMULATORS = ("own", "MuJoCo")
"""That cases take turns in."""

FAINT, STRONG = (0.5, 2.0), (2.0, 100.0)
"""Ranges of r, each of half of the effects."""

STEPS, NEAR, FAR = 8, 0.1, 1.5
"""Corrections of a size at most, how near r then should be, and by what factor it may miss."""

TRIES = 12
"""Draws of an effect until one is visible on a rig."""


class Campaign(Protocol):
    """One rig and what a lab logs of it."""

    @property
    def rig(self) -> Any:  # noqa: ANN401
        """The rig, with its `kind`."""
        ...

    def ratio(self, effect: HiddenEffect) -> float:
        """Size r of an effect."""
        ...

    def held(self, effects: Sequence[HiddenEffect]) -> Self:
        """The same, so that the rig stays in its range with what it hides."""
        ...

    def texts(self, effects: Sequence[HiddenEffect]) -> dict[str, str]:
        """Texts of the lab's folder by name."""
        ...

    def truth(self) -> dict[str, Any]:
        """What is true besides the effects."""
        ...


DRAWN = {"slide": draw_driven, "joint": draw_driven, "imposed": draw_tested}
"""How campaigns of each kind of rig are drawn."""


def draw(seed: int, number: int) -> tuple[dict[str, str], dict[str, Any]]:
    """Files of a case by name, and its truth; the same seed and number give the same bits."""
    rng = np.random.default_rng((seed, number, 0x51D5))
    rig, kind, simulator = turn_of(number)
    campaign: Campaign = DRAWN[rig](rng, rig, simulator, (seed, number))
    effects = _hidden(rng, kind, campaign)
    campaign = campaign.held(effects)
    truth = {
        "block": "rigs",
        "kind": kind,
        "effects": [_described(campaign, each) for each in effects],
        "base_factors": {},
        "seed": seed,
        "number": number,
    }
    return campaign.texts(effects), truth | campaign.truth()


def turn_of(number: int) -> tuple[str, str, str]:
    """Rig, kind and simulator of a case; each changes when the one before has come round."""
    rigs, turn = tuple(KNOWN), number - 1
    turn, rig = divmod(turn, len(rigs))
    turn, kind = divmod(turn, len(KINDS))
    return rigs[rig], KINDS[kind], SIMULATORS[turn % len(SIMULATORS)]


def _hidden(rng: np.random.Generator, kind: str, campaign: Campaign) -> list[HiddenEffect]:
    """What a case hides, each effect at its own r."""
    chosen: list[HiddenEffect] = []
    count = {"nothing": 0, "two effects": 2}.get(kind, 1)
    for _ in range(TRIES):
        if len(chosen) == count:
            break
        if kind == "outside":
            offer = OUTSIDE[int(rng.integers(len(OUTSIDE)))]
        else:
            taken = {name for each in chosen for name in group(each.name)}
            names = [name for name in KNOWN[campaign.rig.kind] if name not in taken]
            offer = OFFERS[str(rng.choice(names))]
        low, high = FAINT if rng.random() < 0.5 else STRONG
        wanted = log_uniform(rng, low, high)
        if offer.fits(campaign.rig):
            effect = _sized(campaign, offer.draw(rng, campaign.rig), wanted)
            chosen += [effect] if effect is not None else []
    return chosen


def _sized(campaign: Campaign, most: HiddenEffect, wanted: float) -> HiddenEffect | None:
    """An effect at some r, or as large as it may be; None where that is not visible."""
    share, ratio, scaled = 0.2, 0.0, most
    for _ in range(STEPS):
        scaled = most.scaled(share)
        ratio = campaign.ratio(scaled)
        if abs(ratio / wanted - 1.0) < NEAR or (share == 1.0 and ratio < wanted):
            break
        share = min(1.0, share * min(max(wanted / max(ratio, 1e-9), 0.02), 20.0))
    return scaled if FAINT[0] * (1.0 - NEAR) <= ratio <= FAR * wanted else None


def _described(campaign: Campaign, effect: HiddenEffect) -> dict[str, Any]:
    name = catalogue_name(campaign.rig.kind, effect.name)
    return {
        "name": name,
        "group": group(name),
        "parameters": effect.values(),
        "r": campaign.ratio(effect),
    }
