"""What a diagnosis says: verdict, where, which effects, how large, what gap they close."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from pma_gym.discovery.result.candidate import UNFITTED, Candidate
from pma_gym.discovery.result.estimates import (
    Approximate,
    Covariance,
    Estimate,
    Moved,
    NamedEffect,
    RivalModel,
    TrialState,
    Undetermined,
)
from pma_gym.discovery.result.misfit import Gap, Map, Place, ResidualLaw, TrialRecord
from pma_gym.discovery.result.next_experiment import NextExperiment
from pma_gym.discovery.result.noise import Floor, Judgement, Nuisance
from pma_gym.discovery.result.notebook_view import notebook_view
from pma_gym.plant.model import Model

__all__ = [
    "Approximate", "Candidate", "Covariance", "Diagnosis", "Estimate", "Floor", "Gap", "Judgement",
    "Map", "Moved", "NamedEffect", "NextExperiment", "Nuisance", "Place", "ResidualLaw",
    "RivalModel", "TrialRecord", "TrialState", "Undetermined", "Verdict",
]  # fmt: skip

SCHEMA = 1
"""Version of `diagnosis.json`."""

Verdict = Literal["effect", "parameters", "agrees", "unknown", "undecidable"]
"""`effect`: the catalogue has what is missing. `parameters`: known parameters were off. `agrees`:
nothing beyond noise. `unknown`: structure is missing that no effect of the catalogue carries.
`undecidable`: these data do not decide."""


@dataclass(frozen=True)
class Diagnosis:
    """The answer, with all its evidence.

    Attributes:
        verdict: see `Verdict`.
        sentence: the verdict as a person would say it.
        where: where they disagree, the largest share first.
        effects: what is missing; empty unless the verdict is `effect`.
        parameters: the model's own parameters that moved, by path; where nothing but parameters is
            off, only those that are named.
        gap: by column name, over all trials; of slides and joints that of predictions a
            short time ahead.
        candidates: the whole catalogue, the likeliest first.
        next_experiment: what to measure next, where that would tell more.
        model: the amended model.
        given: the model as it was given.
        covariance: of the fitted parameters of the amended model.
        rivals: models that explain the data as well, as far as they were fitted.
        not_identifiable: paths of parameters that these data do not determine, with the reason.
        not_detectable: effects that these data would not have shown at their usual size.
        approximate: effects whose law is only approximate, and what they leave; None where there
            are none, or where they leave too much for their size to mean anything.
        law: the residual law, where the verdict is `unknown` or the law of an effect approximate,
            and one explains enough.
        draft: where such a law was found in a slide or joint, a Python file with it as a user
            effect; not written to the JSON.
        tones: where the verdict is `unknown`, the frequency (Hz) at which a signal's residual
            oscillates, for those that do; of a slide or joint, what acts on it.
        floors: noise by column name.
        nuisances: mains lines, drifts and coloured noise in the readings, and their clock.
        adequacy: what is left of each signal, by its column.
        states: what belongs to each trial (zeros, starts) beside the amended model, by its name.
        written: misfit of the amended model with these, over all trials, by column in its unit:
            what `model.toml` and `trials.toml` give when both are read back.
        trials: curves of each trial.
        maps: residuals over conditions.
        steps: what was done, in order, a sentence each, with its figures.
        seconds: how long each step took, by its name; not written to the JSON.
        warnings: what the reader must know first.
        converged: whether the fit of the proposed model converged.
        worsened: signals (by column) and trials (by name) that the proposed model fits worse than
            the given one, by more than their intervals.
    """

    verdict: Verdict
    sentence: str
    where: tuple[Place, ...]
    effects: tuple[NamedEffect, ...]
    parameters: Mapping[str, Moved]
    gap: Mapping[str, Gap]
    candidates: tuple[Candidate, ...]
    next_experiment: NextExperiment | None
    model: Model
    given: Model
    covariance: Covariance = field(default_factory=Covariance)
    rivals: tuple[RivalModel, ...] = ()
    not_identifiable: Mapping[str, str] = field(default_factory=dict)
    not_detectable: tuple[str, ...] = ()
    approximate: Approximate | None = None
    law: ResidualLaw | None = None
    draft: str = ""
    tones: Mapping[str, float] = field(default_factory=dict)
    floors: Mapping[str, Floor] = field(default_factory=dict)
    nuisances: tuple[Nuisance, ...] = ()
    adequacy: Mapping[str, Judgement] = field(default_factory=dict)
    states: Mapping[str, TrialState] = field(default_factory=dict)
    written: Mapping[str, float] = field(default_factory=dict)
    trials: tuple[TrialRecord, ...] = ()
    maps: tuple[Map, ...] = ()
    steps: tuple[str, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    converged: bool = True
    worsened: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())

    @property
    def unfitted(self) -> tuple[str, ...]:
        """Candidates that could not be fitted, and may carry what is missing."""
        return tuple(each.name for each in self.candidates if each.why == UNFITTED)

    def document(self) -> dict[str, Any]:
        """The content of `diagnosis.json`."""
        return {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "sentence": self.sentence,
            "where": [vars(place) for place in self.where],
            "effects": [effect.document() for effect in self.effects],
            "approximate": self.approximate and self.approximate.document(),
            "parameters": {path: each.document() for path, each in self.parameters.items()},
            "covariance": vars(self.covariance),
            "rivals": [rival.document() for rival in self.rivals],
            "gap": {signal: gap.document() for signal, gap in self.gap.items()},
            "candidates": [vars(candidate) for candidate in self.candidates],
            "next_experiment": self.next_experiment and self.next_experiment.document(),
            "not_identifiable": dict(self.not_identifiable),
            "blind": list(self.not_detectable),
            "written": dict(self.written),
            "converged": self.converged,
            "worsened": {"signals": list(self.worsened[0]), "trials": list(self.worsened[1])},
            "adequacy": {signal: vars(judged) for signal, judged in self.adequacy.items()},
            "law": self.law and self.law.document(),
            "tones": dict(self.tones),
            "nuisances": [each.document() for each in self.nuisances],
            "floors": {signal: floor.document() for signal, floor in self.floors.items()},
            "warnings": list(self.warnings),
        }

    def _repr_html_(self) -> str:
        """What a notebook shows: the verdict, the gap by signal, the effects and their sizes.

        `pma_gym.discovery.report.page.report_page` writes the whole page.
        """
        return notebook_view(self.verdict, self.sentence, self.gap, self.effects)

    def text(self) -> str:
        """`document` as JSON; the same diagnosis gives the same bytes.

        Raises:
            ValueError: a number that is not finite, which JSON does not know.
        """
        return json.dumps(self.document(), indent=1, allow_nan=False) + "\n"
