"""What the steps of a diagnosis found, for those that make an answer of it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.discovery.fitting.candidate_effect import Suspect
from pma_gym.discovery.fitting.fit_problem import Bench, Fitted
from pma_gym.discovery.fitting.held_out import Unseen
from pma_gym.discovery.preparation.initial_floors import Level
from pma_gym.discovery.screening.score_test import Look
from pma_gym.discovery.selection.backward_elimination import Fewest
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
        bench: with the noise as seen at rest.
        refitted: the model's own parameters refitted.
        selection: the effects.
        suspects: the catalogue.
        searched: whether effects were looked for.
        seed: of simulated chance.
        fewest: the parameters that are off, where nothing else is; None where something may be.
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
    bench: Bench
    refitted: Fitted
    selection: Selection
    suspects: tuple[Suspect, ...]
    searched: bool
    seed: int
    fewest: Fewest | None = None
    rivals: tuple[tuple[Rival, ...], ...] = ()
    unseen: Unseen | None = None
    unseen_without: Unseen | None = None
    discarded: tuple[float, float] | None = None
    adequacy: Adequacy = field(default_factory=lambda: Adequacy({}))

    @property
    def looks(self) -> tuple[Look, ...]:
        """The first looks at the whole catalogue, the most promising first."""
        return self.selection.stages[0].looks if self.selection.stages else ()

    @property
    def proposed(self) -> tuple[Bench, Fitted]:
        """The fit that is proposed, and on which bench: the fewest's, else the selection's.

        Where no parameter is off, it is the given model with nothing free.
        """
        if self.fewest is None:
            return self.selection.bench, self.selection.fit
        return self.fewest.bench, self.fewest.fit
