"""Which effects, or parameters that differ by trial, carry the latent force."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.grey_box.effect_fits import free_laws, tried
from pma_gym.discovery.grey_box.first_fit import first_fit, unmoved
from pma_gym.discovery.grey_box.hypothesis import Hypothesis, Move
from pma_gym.discovery.grey_box.moves import Screening
from pma_gym.discovery.grey_box.prepared_trials import PreparedTrials
from pma_gym.discovery.grey_box.refined_fits import (
    again,
    other_hold,
    refined,
    trend_instead,
    without,
)
from pma_gym.discovery.grey_box.slots import own_coordinates
from pma_gym.discovery.grey_box.thresholds import LIKE, MATERIAL
from pma_gym.discovery.thresholds import CONFIDENCE, LEFT, MOST_EFFECTS
from pma_gym.effects import CATALOGUE
from pma_gym.estimation.innovations import TREND, TRIAL, is_rugged
from pma_gym.estimation.likelihood_fit import BLOCKS, value_of

Array = NDArray[np.float64]

BEAM, BESIDE = 3, 3
"""Hypotheses that a stage hands on, and moves that each but the likeliest is extended by."""

COST, AFTER = 3, 1.5
"""For the time left.

What a fit takes that needs shorter steps than the one before, in others; what a stage takes, in
its moves' fits.
"""

DELAYS = ("drive_delay", "lvdt_delay", "tachometer_delay", "encoder_delay", "gyroscope_delay")
"""Candidates that are not tried: the delay between command and readings is free in every fit."""

LAGS = ("lvdt_lag", "tachometer_lag", "encoder_lag", "gyroscope_lag")
"""The same where there is one signal."""


SIMULATED = ("second_mass",)
"""Effects that no fit tries: on a slide with nothing of it one stood in for the presliding of its
friction (share 0.034, damping 0.28)."""


class EffectSelection:
    """A selection of what a model lacks.

    Args:
        trials: with the model as it came.
        candidates: effects that may be missing.
        seed: of the starts.
        tell: called with what is being done, what is done of it and its total.
    """

    def __init__(
        self,
        trials: PreparedTrials,
        candidates: Sequence[CandidateEffect],
        seed: int,
        tell: Callable[[str, int, int], None],
    ) -> None:
        self.trials, self.seed, self.tell = trials, seed, tell
        # The delay between command and readings is free in every fit; a lag of the only sensor
        # is no other thing.
        late = DELAYS[:1] if len(trials.channels) > 1 else (*DELAYS, *LAGS)
        self.candidates = [each for each in candidates if each.name not in (*late, *SIMULATED)]
        self.gains: dict[str, float] = {}
        self.fitted: dict[frozenset[str], Hypothesis] = {}
        # What the latent force goes with, where a law of free shape is ahead of none.
        self.free_law: Hypothesis | None = None

    def run(self) -> list[Hypothesis]:
        """From the model as it came to the last hypothesis that is worth its price.

        A beam: the likeliest hypotheses of a stage are all extended in the next, for an effect that
        is likeliest alone may have no part in the likeliest pair.
        """
        base = first_fit(self.trials, self.seed, self.tell)
        screening = Screening(self.trials, self.candidates, unmoved(self.trials, base), self.tell)
        best, beam = [base], [[base]]
        for stage in range(MOST_EFFECTS):
            chains = self._extended(screening, beam, f"effect {stage + 1}")
            self._keep(chains)
            if not chains or self._lead(chains[0], best) < 0.0:
                break
            bent = self.trials.is_bent(chains[0][-1].fit.point, MATERIAL)
            for at, chain in enumerate(chains[: 2 if bent else 1]):
                self.tell(f"effect {stage + 1}", self.planned * (4 + at) // 6, self.planned)
                *before, last = chain
                closer = tried(self.trials, before[-1], last.moves[-1], careful=True)
                if closer.fit.value > last.fit.value:
                    chains[at] = [*before, closer]
            chains.sort(key=self._worth, reverse=True)
            self.tell(f"effect {stage + 1}", self.planned * 5 // 6, self.planned)
            # Others begin where the likeliest one ended: no start is ahead.
            for at, (*before, last) in enumerate(chains[1:BEAM], 1):
                chains[at] = [*before, again(self.trials, last, chains[0][-1])]
            chains.sort(key=self._worth, reverse=True)
            self._keep(chains)
            *before, now, last = chains[0]
            last = again(self.trials, last, last)
            chain = [*before, again(self.trials, now, last), last]
            if not before:
                best = chain[:1]
            if self._lead(chain[:-1], best) > 0.0:
                best = chain[:-1]
            if self._lead(chain, best) < LIKE:
                break
            near = [
                other[-1]
                for other in chains[1:]
                if other[:-1] == chains[0][:-1] and not self._is_ahead(last, other[-1])
            ]
            alike = {each.moves[-1].name: each for each in reversed(near)}
            names = tuple(dict.fromkeys(each.moves[-1].name for each in near))
            rivals = tuple(name for name in names if name != last.moves[-1].name)
            last = replace(
                last, rivals=(*now.rivals, rivals), alike=tuple(alike[name] for name in rivals)
            )
            last = refined(self.trials, other_hold(self.trials, last))
            best = [*chain[:-1], trend_instead(self.trials, last)]
            beam = [best]
            if self.trials.is_bent(best[-1].fit.point, MATERIAL):
                beam += [c for c in chains[1:BEAM] if self._lead(c, c[:-1]) > 0.0]
        return self._or_free_law(self._pruned(best))

    def _or_free_law(self, chain: list[Hypothesis]) -> list[Hypothesis]:
        """A law of free shape in place of what was added, where it is ahead and leaves less.

        Less than `LEFT` of the latent force (mean square). Some effects together imitate what no
        catalogue has; what has their own shape is as likely as one of free shape, for less.
        """
        base, last = chain[0], chain[-1]
        named = any(move.candidate for move in last.moves)
        if not named and not self.trials.is_bent(last.fit.point, MATERIAL):
            return chain
        self.tell("laws of free shape", 0, 1)
        # Beside the same noise and clock.
        plain = last if any(move.is_nuisance for move in last.moves) else base
        for move in last.moves if plain is last else ():
            plain = plain if move.is_nuisance else without(self.trials, base, plain, move)
        free = max(free_laws(self.trials, plain), key=lambda each: each.fit.value)
        self.free_law = free if self._is_ahead(free, plain) else None
        is_less = free.latent < LEFT * last.latent
        return [base, free] if is_less and self._is_ahead(free, last) else chain

    def _pruned(self, chain: list[Hypothesis]) -> list[Hypothesis]:
        """A chain without what is no longer worth its price beside what was added later."""
        last = chain[-1]
        for move in last.moves[:-1]:
            less = without(self.trials, chain[0], last, move)
            if less.fit.value > last.fit.value - self.price(last, less) - LIKE:
                kept = [each for each in chain[:-1] if move not in each.moves]
                return self._pruned([*kept, less] if less.moves else kept)
        return chain

    def _extended(
        self, screening: Screening, beam: Sequence[list[Hypothesis]], step: str
    ) -> list[list[Hypothesis]]:
        """Every chain with each of its most promising moves, the likeliest for its price first."""
        seen, chains = set[tuple[frozenset[str], float]](), list[list[Hypothesis]]()
        plans = [
            (chain, move)
            for rank, chain in enumerate(beam)
            for move in screening.worth_a_fit(chain[-1])[: BESIDE if rank else None]
        ]
        costs = np.cumsum([0, *(_cost(chain[-1], move) for chain, move in plans)])
        self.planned, self.most = int(AFTER * costs[-1]), 0.0
        for (chain, move), done in zip(plans, costs.tolist(), strict=False):
            now = chain[-1]
            names = frozenset(each.name for each in (*now.moves, move))
            key = names, move.promise if move.start else 0.0
            if key in seen:
                continue
            seen.add(key)
            self.tell(step, done, self.planned)
            larger = self._tried(now, move)
            chains += [[*chain, larger]] if larger else []
        return sorted(chains, key=self._worth, reverse=True)

    def _tried(self, now: Hypothesis, move: Move) -> Hypothesis | None:
        """With a move; with a trend where one trial's value gains most but carries too little."""
        larger = tried(self.trials, now, move)
        gain = larger.fit.value - now.fit.value
        self.gains.setdefault(move.name, gain)
        self.most = max(self.most, gain)
        of_all = move.candidate or move.is_nuisance
        if _ends_within(larger) if of_all else is_carried(now, larger):
            return larger
        base, is_trial, _ = move.name.partition(TRIAL)
        slot = f"{base}{TREND}"
        if is_trial and gain == self.most > now.price_of(1) + LIKE:
            return self._tried(now, Move(slot, 0.0, 1, slots=(slot,)))
        return None

    def _keep(self, chains: Sequence[Sequence[Hypothesis]]) -> None:
        """Keep what was fitted last by what was added, the likeliest of each."""
        for *_, last in reversed(chains):
            self.fitted[frozenset(move.name for move in last.moves)] = last

    def price(self, one: Hypothesis, other: Hypothesis) -> float:
        """Log likelihood that a larger hypothesis must gain over a smaller.

        BIC's, and that of the search.
        """
        numbers = len(one.fit.coordinates) - len(other.fit.coordinates)
        own, _ = own_coordinates(self.trials.box(self.trials.model))
        looked = len(self.candidates) + len(self.trials.logged) * len(own)
        moves = len(one.moves) - len(other.moves)
        return one.price_of(numbers) + moves * np.log(looked)

    def _worth(self, chain: Sequence[Hypothesis]) -> float:
        """Log likelihood of a chain's last hypothesis, less its price."""
        return chain[-1].fit.value - self.price(chain[-1], chain[0])

    def _lead(self, chain: Sequence[Hypothesis], other: Sequence[Hypothesis]) -> float:
        return self._worth(chain) - self._worth(other)

    def _is_ahead(self, one: Hypothesis, other: Hypothesis) -> bool:
        """Whether a hypothesis would be likelier than another by other readings of the rigs, too.

        Not where the lead is within its own scatter over blocks of readings: where no model is
        quite right, a lead of many units may be chance (Q. H. Vuong 1989, "Likelihood ratio tests
        for model selection and non-nested hypotheses", Econometrica 57).
        """
        lead = one.fit.value - other.fit.value - self.price(one, other)
        if lead < LIKE:
            return False
        differ = _densities(one) - _densities(other)
        edges = np.linspace(0, len(differ), BLOCKS + 1).astype(int)[:-1]
        scatter = BLOCKS**0.5 * float(np.std(np.add.reduceat(differ, edges)))
        return lead >= CONFIDENCE * scatter


def _cost(now: Hypothesis, move: Move) -> int:
    """How long a move's fits take, in those of one that needs no shorter steps."""
    rougher = move.candidate and is_rugged(move.candidate.beside(now.box.model))
    return COST if rougher and not is_rugged(now.box.model) else 1


def _ends_within(larger: Hypothesis) -> bool:
    """Whether no number of what was added last has gone as far as it may.

    A ripple whose period is as long as the way is none, nor is noise that lasts, which is drift.
    Friction's shape may be at its end.
    """
    move = larger.moves[-1]
    if move.candidate and CATALOGUE[move.candidate.effect].rate_independent_law:
        return True
    effect = move.candidate.effect if move.candidate else ""
    added = (
        c.name in move.slots or c.name.startswith(f"{effect}.") for c in larger.fit.coordinates
    )
    own = [c for c, is_own in zip(larger.fit.coordinates, added, strict=True) if is_own]
    values = [value_of(larger.fit.point, c.name) for c in own]
    return not any(value in (c.lower, c.upper) for value, c in zip(values, own, strict=True))


def is_carried(now: Hypothesis, larger: Hypothesis) -> bool:
    """Whether a parameter that differs by trial carries most of the latent force (mean square).

    And differs by as much as matters, and has not gone as far as it may. The parameters of a model
    that lacks another thing differ by trial too, surely, and leave that thing as it was.
    """
    last, point = larger.fit.coordinates[-1], larger.fit.point
    own, base = value_of(point, last.name), last.name.partition(TRIAL)[0].removesuffix(TREND)
    usual = value_of(point, base)
    differs = own * np.ptp(larger.box.order) if last.name.endswith(TREND) else own - usual
    if abs(differs) < MATERIAL * abs(usual):
        return False
    if not last.lower * 1.01 < own < last.upper * 0.99:
        return False
    return larger.latent < LEFT * now.latent


def _densities(each: Hypothesis) -> Array:
    """Log likelihood of each reading, less a constant."""
    results = zip(each.box.innovations([each.fit.point]), each.box.rows, strict=True)
    rows = [(e[0] ** 2 / s[0] + np.log(s[0]))[trial.there] for (e, s), trial in results]
    return -0.5 * np.concatenate(rows)
