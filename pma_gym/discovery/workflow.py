"""The diagnosis from trials to answer: slides and joints by one likelihood, others step by step."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from pma_gym.codegen.cache.compile_cache import source_digest
from pma_gym.codegen.threads.thread_pool import linear_algebra_alone
from pma_gym.data.datasets.dataset import Dataset, NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import TrialError
from pma_gym.discovery.answer.diagnosis_from_findings import diagnosis_from_findings
from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.covariance import covariance
from pma_gym.discovery.fitting.fast_motion import with_fast_motion
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import free_parameters
from pma_gym.discovery.fitting.held_out import held_out_misfit
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.grey_box.answer import answered
from pma_gym.discovery.preparation.acceptance_floors import Stated, acceptance_floors
from pma_gym.discovery.preparation.data_checks import check_dataset
from pma_gym.discovery.preparation.initial_floors import Level, initial_floors
from pma_gym.discovery.preparation.learnt_noise import learnt_noise
from pma_gym.discovery.preparation.mains_lines import with_lines
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.prepared_trials import prepared
from pma_gym.discovery.preparation.quantisation import is_coarse
from pma_gym.discovery.preparation.recorded_bandwidth import with_recorded_bandwidth
from pma_gym.discovery.preparation.splits import fold_of_rows
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.screening.residuals import reestimated_noise, simulated_less_measured
from pma_gym.discovery.selection.backward_elimination import (
    Elimination,
    as_given,
    backward_elimination,
)
from pma_gym.discovery.selection.candidate_fits import without_absent
from pma_gym.discovery.selection.forward_selection import Selection, select
from pma_gym.discovery.selection.nested_laws import nested
from pma_gym.discovery.selection.rivals import rivals
from pma_gym.discovery.verdict.adequacy import Residual, adequacy
from pma_gym.discovery.verdict.common_drift import with_common_drift
from pma_gym.discovery.verdict.decision import suspicious
from pma_gym.discovery.verdict.findings import Findings
from pma_gym.discovery.verdict.tolerated import is_tolerated, may_be_tolerated, without_effects
from pma_gym.estimation.innovations import PORTS
from pma_gym.estimation.logged import Logged
from pma_gym.plant.model import Model, ModelError, load_model

Progress = Callable[[str, int, int], None]

DEFAULT_MODEL = "station"


def diagnose(
    trials: Sequence[Trial] | Dataset,
    model: Model | str | Path | None = None,
    *,
    seed: int = 0,
    jobs: int = 1,
    journal: Path | None = None,
    progress: Progress | None = None,
    propose: bool = True,
    checks: bool = True,
) -> Diagnosis:
    """Find what a model misses in measured trials.

    The same trials, model and seed give the same answer, whatever the number of jobs or cores.

    Args:
        trials: measured trials, or a data set (`pma_gym.data.datasets.dataset.read_dataset`).
        model: the model to compare with; what the data set names, else station.
        seed: of simulated chance.
        jobs: how many threads simulate.
        journal: a folder in which finished fits are kept, from which an interrupted diagnosis goes
            on; None keeps nothing.
        progress: called with a step's name, what is done of it and its total.
        propose: whether to look for the next experiment too, which takes seconds.
        checks: whether a column of a data set that is certainly in another unit is refused; else it
            is only said.
    Returns:
        The diagnosis; its amended model goes into `gym.make(..., model=...)`, into the benchmark,
        and into another diagnosis.
    Raises:
        TrialError: trials that cannot be used.
        ModelError: a model that cannot be used.

    Example:
        >>> from pma_gym import Plant, Trial
        >>> import numpy as np
        >>> time = np.arange(0.0, 4.0, 1 / 64)
        >>> volts = 1.0 + np.clip(time - 0.5, 0.0, 2.0)
        >>> asked = Trial(time, {"motor_voltage": volts, "regulator_voltage": 0 * time + 6.0})
        >>> diagnosis = diagnose([Plant("serres2008").simulate(asked)], "serres2008", propose=False)
        >>> diagnosis.verdict, "regulator_delay" in diagnosis.not_detectable
        ('undecidable', True)
    """
    with linear_algebra_alone():
        return _Work(trials, model, seed, jobs, journal, progress, propose, checks).run(search=True)


def refit(
    trials: Sequence[Trial] | Dataset,
    model: Model | str | Path | None = None,
    *,
    seed: int = 0,
    jobs: int = 1,
    journal: Path | None = None,
    progress: Progress | None = None,
    checks: bool = True,
) -> Diagnosis:
    """Refit a model's own parameters to measured trials, without looking for what it misses.

    Arguments and errors as `diagnose`. The verdict is `parameters` or `agrees` where the residual
    of readings left out is noise, `unknown` where parameters alone do not explain the readings, and
    `undecidable` where the trials do not decide. It is `effect` where the command of a
    slide or joint is late.
    """
    with linear_algebra_alone():
        return _Work(trials, model, seed, jobs, journal, progress, checks=checks).run(search=False)


@dataclass
class _Work:
    """One diagnosis on its way."""

    asked: Sequence[Trial] | Dataset
    wanted: Model | str | Path | None
    seed: int
    jobs: int
    folder: Path | None
    watcher: Progress | None
    propose: bool = True
    checks: bool = True
    seconds: dict[str, float] = field(default_factory=dict)

    def run(self, search: bool) -> Diagnosis:
        dataset, given = self._input()
        named, words = prepared(dataset.trials, given)
        trials = [each.trial for each in named]
        if given.plant in PORTS:
            said = self._likeliest(dataset, given, named, search)
            words = (*(dataset.checked or ()), *words, *said.warnings)
            return replace(said, warnings=words, seconds=dict(self.seconds))
        given, slower = with_recorded_bandwidth(given, trials)
        words = (*(dataset.checked or ()), *words, *slower)
        journal = Journal(self.folder, trials, given, f"diagnosis 10 seed {self.seed}")
        logged = [Logged.of(given, i, trial) for i, trial in enumerate(trials)]
        with self._timed("noise"):
            floors = initial_floors(given, logged, named, dataset.sensors)
        problem = self._problem(given, named, logged, floors)
        self._tell("refitting parameters", 0, 1)
        with self._timed("parameters"):
            refitted = self._refitted(problem)
        problem, refitted, faster = with_fast_motion(problem, refitted)
        if faster:
            given, words = problem.given, (*words, faster)
            logged = [Logged.of(given, i, trial) for i, trial in enumerate(trials)]
        problem, refitted = self._with_lines(problem, refitted, logged, named)
        every = _candidates(given, named) if search else []
        with self._timed("selection"):
            selection = (
                select(problem, refitted, every, self.seed, journal, self._tell)
                if search
                else _nothing(problem, refitted)
            )
        with self._timed("nested laws"):
            selection = self._nested(selection)
        findings = Findings(
            named=tuple(named),
            given=given,
            floors=floors,
            problem=problem,
            refitted=selection.refitted,
            selection=selection,
            candidates=tuple(every),
            searched=search,
            seed=self.seed,
        )
        with self._timed("backward elimination"):
            findings = replace(findings, elimination=_backward_elimination(findings))
        findings = _without_worse(findings)
        with self._timed("confirmation"):
            findings = self._confirmed(findings)
        with self._timed("adequacy"):
            findings = self._adequate(findings, logged)
        with self._timed("report"):
            diagnosis = diagnosis_from_findings(findings, self._tell, self.propose)
        warnings = (*words, *diagnosis.warnings)
        return replace(diagnosis, warnings=warnings, seconds=dict(self.seconds))

    def _likeliest(
        self, dataset: Dataset, given: Model, named: Sequence[NamedTrial], search: bool
    ) -> Diagnosis:
        """The answer by one likelihood."""
        every = _candidates(given, named) if search else None
        logged = [Logged.of(given, i, each.trial) for i, each in enumerate(named)]
        _check_size(logged, free_parameters(given).free)
        # Whatever a fit or a filter is computed by may be of another version.
        question = f"likelihood of version {source_digest()}"
        journal = Journal(self.folder, [each.trial for each in named], given, question)
        options = (
            dataset.tolerance,
            self.seed,
            self._tell,
            self.jobs,
            journal,
            self.propose and search,
        )
        with self._timed("grey box"):
            return answered(given, named, every, *options)

    def _problem(
        self,
        given: Model,
        named: Sequence[NamedTrial],
        logged: Sequence[Logged],
        floors: Sequence[Level],
    ) -> FitProblem:
        """What all fits share, with the noise that rest and repeats tell."""
        own = free_parameters(given)
        _check_size(logged, own.free)
        noise = tuple(white_noise(floor.level) for floor in floors)
        return FitProblem(
            [each.trial for each in named],
            given,
            own,
            learnt_noise(noise, logged, named),
            max(1, self.jobs),
            any(map(is_coarse, floors)),
            tuple(each.file or each.name for each in named),
        )

    def _input(self) -> tuple[Dataset, Model]:
        asked = self.asked
        if not isinstance(asked, Dataset):
            named = [NamedTrial(f"trial {i + 1}", trial) for i, trial in enumerate(asked)]
            asked = Dataset("", None, tuple(named))
        if not asked.trials:
            raise TrialError("a diagnosis needs at least one trial; give measured trials")
        model = load_model(self.wanted or asked.model or DEFAULT_MODEL)
        if not model.rig.is_diagnosable:
            raise ModelError(
                f"model {model.name} is a {model.plant}; a diagnosis needs a station, a slide or a "
                "joint, the balance of forces that effects act on; give serres2008, station or one "
                "made of them, or a model of your rig"
            )
        if asked.folder is not None and asked.checked is None:
            # Trials that come from files; what a program made needs no such doubts.
            asked = check_dataset(asked, model, self.checks)
        return asked, model

    def _refitted(self, problem: FitProblem) -> Fitted:
        refit = problem.careful_fit(problem.given)
        if refit is None:
            raise ModelError(
                f"model {problem.given.name} cannot be simulated on these trials: its muscle does "
                "not balance the load where one begins, or it runs away; check the units of the "
                "commands and the model's drive and force"
            )
        return refit

    def _with_lines(
        self,
        problem: FitProblem,
        refitted: Fitted,
        logged: Sequence[Logged],
        named: Sequence[NamedTrial],
    ) -> tuple[FitProblem, Fitted]:
        """With mains lines as a nuisance of every fit, where the residual has any."""
        whitened = problem.whitened_residuals(refitted.model)
        held = whitened.readings(refitted.values)
        assert held is not None
        noise = with_lines(problem.noise, logged, simulated_less_measured(whitened, held))
        if noise == problem.noise:
            return problem, refitted
        problem = replace(problem, noise=learnt_noise(noise, logged, named))
        return problem, problem.fit(refitted.model) or refitted

    def _nested(self, selection: Selection) -> Selection:
        """Without the parameters of effects that the trials do not determine."""
        if not selection.chosen:
            return selection
        # Where all is determined it takes milliseconds, else a few fits: no step of its own.
        problem = selection.problem
        less = nested(problem, selection.fit, selection.chosen)
        chosen, fit = without_absent(problem, less.fit, less.chosen)
        if fit is not less.fit:
            fit = replace(fit, covariance=covariance(problem, fit, chosen))
        effects = {each.effect for each in chosen}
        undetermined = {
            path: known
            for path, known in less.undetermined.items()
            if path.partition(".")[0] in effects
        }
        return replace(selection, chosen=chosen, fit=fit, undetermined=undetermined)

    def _confirmed(self, findings: Findings) -> Findings:
        """With rivals of each effect, and how it fares on trials that it was not fitted to."""
        selection = findings.selection
        nearest = [
            tuple(
                rivals(
                    selection.problem,
                    selection.fit,
                    selection.chosen,
                    selection.stages[min(place, len(selection.stages) - 1)],
                    place,
                    findings.candidates,
                )
            )
            for place in range(len(selection.chosen))
        ]
        left_out = held_out_misfit(
            *findings.proposed,
            selection.chosen,
            lambda done, total: self._tell("trials left out", done, total),
            judged=bool(selection.chosen),
        )
        without = (
            held_out_misfit(selection.problem, findings.refitted, (), judged=True)
            if selection.chosen and left_out is not None
            else left_out
        )
        return replace(findings, rivals=tuple(nearest), unseen=left_out, unseen_without=without)

    def _judged(self, findings: Findings, logged: Sequence[Logged]) -> Findings:
        """With whether what the proposed model leaves of readings left out is noise."""
        problem, fit = findings.proposed
        stated = Stated()
        if isinstance(self.asked, Dataset):
            noise = {each.signal.name: each.shown for each in findings.floors}
            stated = Stated(self.asked.tolerance, self.asked.standard_error, noise)
        pairs = zip(logged[0].signals, problem.noise, strict=True)
        humming = {signal.name for signal, noise in pairs if noise.lines}
        floors = acceptance_floors(logged, findings.named, stated, humming)
        whitened = problem.whitened_residuals(fit.model, findings.selection.chosen)
        held = whitened.readings(fit.values)
        assert held is not None
        fitted = Residual(held, simulated_less_measured(whitened, held))
        unseen_ = None
        if findings.unseen is not None:
            unseen_ = Residual(
                findings.unseen.readings,
                simulated_less_measured(whitened, findings.unseen.readings),
            )
        folds = fold_of_rows(problem.trials, problem.files)
        judged = adequacy(logged, unseen_, fitted, floors, folds, self.seed)
        # A log cut at its gaps drifts alike in all its pieces.
        if len(set(problem.files)) == len(problem.trials):
            beside = bool(findings.selection.chosen)
            judged = with_common_drift(judged, logged, fitted.left, problem.noise, beside)
        return replace(findings, adequacy=judged)

    def _adequate(self, findings: Findings, logged: Sequence[Logged]) -> Findings:
        """Judged; with all parameters free where the fewest leave structure that they would not.

        Odds weigh a drift that a few repeats tell badly: it may stand for a parameter's offset.
        """
        judged = self._judged(findings, logged)
        if judged.adequacy.structure is None or findings.elimination is None:
            return self._tolerated(judged, logged)
        if findings.discarded is not None:
            return judged
        free = self._judged(self._confirmed(replace(findings, elimination=None)), logged)
        return judged if free.adequacy.structure is not None else free

    def _tolerated(self, findings: Findings, logged: Sequence[Logged]) -> Findings:
        """Without effects, where these carry too little and the lab's tolerances are kept."""
        if not may_be_tolerated(findings):
            return findings
        bare = without_effects(findings)
        bare = replace(bare, elimination=_backward_elimination(bare))
        bare = self._judged(self._confirmed(bare), logged)
        return bare if is_tolerated(bare) else findings

    @contextmanager
    def _timed(self, step: str) -> Iterator[None]:
        begun = time.perf_counter()
        yield
        self.seconds[step] = time.perf_counter() - begun

    def _tell(self, step: str, done: int, total: int) -> None:
        if self.watcher is not None:
            self.watcher(step, done, total)


def _candidates(given: Model, named: Sequence[NamedTrial]) -> list[CandidateEffect]:
    """The whole catalogue for these trials."""
    orders = [each.order for each in named]
    known = None if None in orders else [float(order or 0.0) for order in orders]
    return candidate_effects(given, known, [each.trial for each in named])


def _nothing(problem: FitProblem, refitted: Fitted) -> Selection:
    """A selection from no candidates."""
    noise = reestimated_noise(problem, refitted, ())
    return Selection((), (), refitted, replace(problem, noise=noise), refitted)


def _without_worse(findings: Findings) -> Findings:
    """With the model as it was given in place of a refit that fits its own readings worse."""
    if findings.selection.chosen:
        return findings
    fit = findings.proposed[1]
    given = findings.problem.sum_of_squares(findings.given)
    refitted = findings.problem.sum_of_squares(fit.model)
    if not refitted > given * (1.0 + 1e-9):
        return findings
    return replace(
        findings, elimination=as_given(findings.selection.problem), discarded=(given, refitted)
    )


def _backward_elimination(findings: Findings) -> Elimination | None:
    """The parameters that are off, where effects were looked for and nothing speaks for one."""
    selection = findings.selection
    if not selection.stages or selection.chosen:
        return None
    first = selection.stages[0]
    if first.gate or first.missing or suspicious(findings):
        return None
    return backward_elimination(selection.problem, selection.fit)


def _check_size(logged: Sequence[Logged], free: Sequence[str]) -> None:
    count = sum(each.count for each in logged)
    if count < 2 * len(free):
        raise TrialError(
            f"the trials have {count} readings for {len(free)} parameters of the model; measure "
            "more, or faster: a diagnosis needs at least twice as many, and tells little below "
            "some hundreds"
        )
