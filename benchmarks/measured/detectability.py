"""Effects that tables I2 and I3 cannot detect, and experiments that can."""

from collections.abc import Callable
from dataclasses import dataclass

from benchmarks.measured.held_out import Rig
from pma_gym.data.datasets.dataset import Dataset
from pma_gym.discovery.experiments.detectability import experiment_to_detect
from pma_gym.discovery.screening.probe_scores import Baseline
from pma_gym.discovery.screening.score_test import ScreeningScore, screen
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model

MOST = 3
"""Most experiments that are proposed, each for what those before would not show."""


@dataclass(frozen=True)
class Undecidable:
    """An effect that these tables cannot tell from none.

    Attributes:
        name: its name.
        acts: where it acts: its port in the station.
        shows_from: how many times its usual size it would need to show; None if no size would.
        experiment: which proposal would show it, counted from 1; None if none of them.
    """

    name: str
    acts: str
    shows_from: float | None
    experiment: int | None


@dataclass(frozen=True)
class Proposal:
    """An experiment.

    Attributes:
        excitation: in words.
        shows: effects that it would show at their usual size.
        minutes: how long it takes.
    """

    excitation: str
    shows: tuple[str, ...]
    minutes: float


def undecidable(
    model: Model,
    data: Dataset,
    threads: int = 1,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[list[Undecidable], list[Proposal]]:
    """Effects that trials would not show at their usual size, beside a model; and what would.

    Args:
        model: the amended model.
        data: the trials.
        threads: how many simulate.
        seed: of what is random in excitations.
        progress: called with what is done and the total.
    """
    rig = Rig.of(data, model, threads)
    fit = rig.fit((), model)
    if fit is None:
        raise ValueError(f"{model.name} cannot be simulated on tables I2 and I3")
    every = list(rig.known.values())
    baseline = Baseline.at(rig.problem.whitened_residuals(fit.model), fit.values, fit.steps)
    scores = screen(
        baseline,
        every,
        seed,
        lambda candidate: rig.problem.probed(fit.model, candidate),
        None if progress is None else lambda done: progress(done, len(every) + MOST),
    )
    dim = [each for each in scores if each.resolvable is None or each.resolvable > 1.0]
    proposals: list[Proposal] = []
    left = [each.candidate for each in dim]
    while left and len(proposals) < MOST:
        proposal = experiment_to_detect(rig.problem, fit, left, scores, seed)
        if proposal is None:
            break
        proposals.append(Proposal(proposal.excitation, tuple(proposal.separates), proposal.minutes))
        left = [candidate for candidate in left if candidate.name not in proposal.separates]
    return [_entry(each, proposals) for each in dim], proposals


def _entry(each: ScreeningScore, proposals: list[Proposal]) -> Undecidable:
    name = each.candidate.name
    places = [k for k, proposal in enumerate(proposals, 1) if name in proposal.shows]
    port = CATALOGUE[each.candidate.effect].port
    return Undecidable(name, port, each.resolvable, places[0] if places else None)
