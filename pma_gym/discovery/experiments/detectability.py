"""The experiment after trials that cannot show some effects: where most of those would show."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.diagnosis import NextExperiment
from pma_gym.discovery.experiments.excitation import Protocol, library
from pma_gym.discovery.experiments.predicted_trials import Columns, columns, derivatives, proposal
from pma_gym.discovery.fitting.candidate_effect import Suspect, bounds
from pma_gym.discovery.fitting.fit_problem import Bench, Fitted
from pma_gym.discovery.fitting.predictive_density import unabsorbed
from pma_gym.discovery.screening.score_test import SHOWN_GAIN, Look
from pma_gym.effects import CATALOGUE

Array = NDArray[np.float64]

SMALLEST = 0.1
"""Least size of an effect that is reckoned with, as a share of its usual one."""


def for_blind(
    bench: Bench, fit: Fitted, suspects: Sequence[Suspect], looks: Sequence[Look], seed: int = 0
) -> NextExperiment | None:
    """The protocol in which most would show of what these trials cannot show.

    How large an effect is if it is there nobody knows: any size from a tenth of the usual one to
    that counts as equally likely, in proportion. The best protocol makes the most effects show that
    would not have shown by now, on average; among equals the shortest.

    Args:
        bench: the trials so far.
        fit: the refitted model, without any suspect that is looked for.
        suspects: those that would be worth seeing.
        looks: at them in the trials so far, which say from what size on they would have been seen.
        seed: of what is random in protocols.
    Returns:
        What to measure next; None where every effect would have been seen at its usual size, or no
        protocol would show one that would not.
    """
    known = {each.suspect.name: each for each in looks}
    wanted = [suspect for suspect in suspects if suspect.name in known]
    hidden = np.array([not _was_visible(known[suspect.name]) for suspect in wanted], bool)
    if not hidden.any():
        return None
    before = np.array([_strength(known[suspect.name]) for suspect in wanted])
    pairs = [(suspect, _usual(suspect)) for suspect in wanted]
    best: tuple[tuple[float, float], Protocol, Array] | None = None
    protocols = list(library([fit.model, bench.given], seed))
    for protocol, gains in zip(protocols, _shown(bench, fit, protocols, pairs), strict=True):
        new = float(np.sum(chance_to_show(before + gains) - chance_to_show(before)))
        rank = round(new, 6), -protocol.minutes
        if (hidden & (gains >= SHOWN_GAIN)).any() and (best is None or rank > best[0]):
            best = rank, protocol, gains
    if best is None:
        return None
    seen = hidden & (best[2] >= SHOWN_GAIN)
    names = [suspect.name for suspect, shows in zip(wanted, seen, strict=True) if shows]
    return proposal(best[1], names, 0.5 * float(np.min(best[2][seen])))


def chance_to_show(gains: Array) -> Array:
    """Chance that effects show which are as large as usual, or down to a tenth of that.

    Args:
        gains: chi-square that each gains at its usual size, shape (k,); it goes with the square of
            the size.
    """
    share = np.sqrt(SHOWN_GAIN / np.maximum(gains, 1e-12))
    return np.clip(np.log(share) / np.log(SMALLEST), 0.0, 1.0)


def _strength(each: Look) -> float:
    """Chi-square that an effect of usual size would have gained in the trials so far."""
    return SHOWN_GAIN / each.resolvable**2 if each.resolvable else 0.0


def _was_visible(each: Look) -> bool:
    return each.resolvable is not None and each.resolvable <= 1.0


def _shown(
    bench: Bench,
    fit: Fitted,
    protocols: Sequence[Protocol],
    hidden: Sequence[tuple[Suspect, Array]],
) -> Array:
    """Chi-square that hidden suspects of usual size would gain in protocols, shape (n, k)."""
    trials = [protocol.simulated[0] for protocol in protocols]
    grown = list[list[Columns | None]]()
    for suspect, usual in hidden:
        model, tried = suspect.beside(fit.model), np.stack([suspect.absent, usual])
        grown.append(columns(bench, model, suspect.paths, trials, tried))
    found = np.zeros((len(protocols), len(hidden)))
    for k, by in enumerate(derivatives(bench, fit.model, fit, trials)):
        if by is None:
            continue
        changes = np.zeros((len(hidden), by.shape[1]))
        for row, each in zip(changes, grown, strict=True):
            one = each[k]
            if one is not None:
                row[:] = one[1].ravel()
        found[k] = unabsorbed(changes, by, fit)
    return found


def _usual(suspect: Suspect) -> Array:
    """Values of a suspect's parameters at its usual size, at the door."""
    found = []
    for path in suspect.paths:
        effect, _, door = path.partition(".")
        law = CATALOGUE[effect]
        found.append(law.quantities[law.names_at_the_door()[door]].usual)
    absent = zip(found, suspect.absent, strict=True)
    usual = np.array([other if value is None else value for value, other in absent], float)
    if np.array_equal(usual, suspect.absent):
        # A sensor whose usual bandwidth is what the model says: a slower one.
        return suspect.probes[len(suspect.probes) // 2]
    return np.clip(usual, *bounds(suspect.paths))
