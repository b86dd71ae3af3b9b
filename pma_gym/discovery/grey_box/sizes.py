"""Sizes of what is proposed, with intervals."""

import numpy as np

from pma_gym.discovery.grey_box.hypothesis import Move
from pma_gym.discovery.grey_box.proposal import Proposal
from pma_gym.discovery.grey_box.slots import path_of, quantity_of
from pma_gym.discovery.result.estimates import Estimate, NamedEffect
from pma_gym.discovery.thresholds import CONFIDENCE
from pma_gym.estimation.innovations import TREND, TRIAL
from pma_gym.estimation.likelihood_fit import Fit, value_of


def named_effects(proposal: Proposal) -> tuple[NamedEffect, ...]:
    """What is missing, with sizes.

    Also the candidate that does most where nothing carries enough.
    """
    made = []
    rivals = [*proposal.last.rivals, *[()] * len(proposal.last.moves)]
    for move, others in zip(proposal.last.moves, rivals, strict=False):
        if move.candidate is not None and not move.is_free_law:
            own = {c.name for c in proposal.predictions.path[0].fit.coordinates}
            names = [
                c.name
                for c in proposal.last.fit.coordinates
                if c.name.startswith(f"{move.candidate.effect}.")
            ]
            names = [n for n in names if n not in own and TRIAL not in n and TREND not in n]
            sizes = {path_of(n).partition(".")[2]: estimate(proposal.last.fit, n) for n in names}
            tied = {n: of for n, of in proposal.last.fit.tied.items() if of in names}
            sizes |= {
                path_of(n).partition(".")[2]: estimate(proposal.last.fit, of)
                for n, of in tied.items()
                if TRIAL not in n and TREND not in n
            }
            alike = tuple(other for other in others if TREND not in other and TRIAL not in other)
            made.append(NamedEffect(move.candidate.name, alike, _chance(proposal, move), sizes))
    if proposal.delayed:
        late = proposal.last.fit.point.delay
        value, low, high = (1e3 * v for v in (late, *proposal.delays))
        made.append(
            NamedEffect(
                "drive_delay",
                _late(proposal),
                float(np.exp(-min(proposal.delay_gain, 600.0))),
                {"delay_ms": Estimate(value, low, high, "ms")},
            )
        )
    return tuple(made)


def estimate(made: Fit, name: str) -> Estimate:
    """A fitted number with its interval, in its file unit."""
    quantity = quantity_of(name.partition(TREND)[0].partition(TRIAL)[0])
    value, error = value_of(made.point, name), CONFIDENCE * made.deviations[name]
    zero = quantity.to_si(0.0) if TREND in name else 0.0
    low, value_, high = (quantity.from_si(v + zero) for v in (value - error, value, value + error))
    if TREND not in name:
        low, high = max(low, quantity.lower), min(high, quantity.upper)
    coordinate = next(c for c in made.coordinates if c.name == name)
    ends = {coordinate.lower: "lower", coordinate.upper: "upper"}
    if name.endswith(".presliding") and value_ <= quantity.lower:
        # Shorter than any that a model is written with.
        return Estimate(quantity.lower, quantity.lower, max(high, quantity.lower), quantity.unit)
    return Estimate(value_, low, high, quantity.unit, ends.get(value, ""))


def _late(proposal: Proposal) -> tuple[str, ...]:
    """What comes to the same as a delay of the command.

    A lag, and with one signal that of its sensor.
    """
    channels = proposal.last.box.channels
    sensors = [proposal.selection.trials.model.rig.signals[channel].sensor for channel in channels]
    late = [f"{sensor}_{kind}" for sensor in sensors for kind in ("delay", "lag")]
    names = [each.name for each in proposal.candidates]
    return tuple(n for n in names if n == "drive_lag" or len(channels) == 1 and n in late)


def _chance(proposal: Proposal, move: Move) -> float:
    """Bound of the chance of such a gain over all that was looked for."""
    gain = proposal.selection.gains.get(move.name, 0.0)
    return float(min(1.0, len(proposal.candidates) * np.exp(-np.clip(gain, 0.0, 600.0))))
