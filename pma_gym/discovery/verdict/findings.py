"""What the steps of a diagnosis found, for those that make an answer of it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.held_out import HeldOutMisfit
from pma_gym.discovery.preparation.initial_floors import Level
from pma_gym.discovery.screening.score_test import ScreeningScore
from pma_gym.discovery.selection.backward_elimination import Elimination
from pma_gym.discovery.selection.forward_selection import Selection
from pma_gym.discovery.selection.rivals import Rival
from pma_gym.discovery.verdict.adequacy import Adequacy
from pma_gym.plant.model import Model


@dataclass(frozen=True)
class Findings:
    """What the steps of a diagnosis found.

    Attributes:
        named: the trials.
        given: the model.
        floors: noise of the four outputs.
        problem: with the noise as seen at rest.
        refitted: the model's own parameters refitted.
        selection: the effects.
        candidates: the catalogue.
        searched: whether effects were looked for.
        seed: of simulated chance.
        elimination: the parameters that are off, where nothing else is; None where an effect may be
            missing.
        rivals: of each effect.
        unseen: what the amended model says of trials that it was not fitted to.
        unseen_without: the same without the effects.
        discarded: whitened sums of squares of the model as given and of a refit that was discarded
            because its is larger; None where none was.
        adequacy: whether what the amended model leaves of readings left out is noise.
    """

    named: tuple[NamedTrial, ...]
    given: Model
    floors: Sequence[Level]
    problem: FitProblem
    refitted: Fitted
    selection: Selection
    candidates: tuple[CandidateEffect, ...]
    searched: bool
    seed: int
    elimination: Elimination | None = None
    rivals: tuple[tuple[Rival, ...], ...] = ()
    unseen: HeldOutMisfit | None = None
    unseen_without: HeldOutMisfit | None = None
    discarded: tuple[float, float] | None = None
    adequacy: Adequacy = field(default_factory=lambda: Adequacy({}))

    @property
    def scores(self) -> tuple[ScreeningScore, ...]:
        """The first looks at the whole catalogue, the most promising first."""
        return self.selection.stages[0].scores if self.selection.stages else ()

    @property
    def proposed(self) -> tuple[FitProblem, Fitted]:
        """The fit that is proposed, and on which bench: the fewest's, else the selection's.

        Where no parameter is off, it is the given model with nothing free.
        """
        if self.elimination is None:
            return self.selection.problem, self.selection.fit
        return self.elimination.problem, self.elimination.fit
