"""Whole pressures left out: what models say of table I3's rows that they were not fitted to.

Effects that tables I2 and I3 cannot detect, and experiments that can.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import Dataset, NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.discovery.experiments.detectability import experiment_to_detect
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import FreeParameters, free_parameters, values
from pma_gym.discovery.preparation.initial_floors import initial_floors
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.screening.probe_scores import Baseline
from pma_gym.discovery.screening.score_test import ScreeningScore, screen
from pma_gym.effects import CATALOGUE
from pma_gym.estimation.logged import Logged
from pma_gym.plant.model import Model
from pma_gym.plant.rigs import RIGS
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]

WIDER = 3.0
"""How many times as far from the dissertation's numbers its parameters may lie as a diagnosis takes
for likely at first: its rounds, one after the other, may go as far."""

MANY = 1000.0
"""Repeats after which a muscle is worked."""

BEFORE, LOADED, BACK = 0, 2, 3
"""Rows of an I3 trial before the load, at 10 s and at 15 s."""

FIGURES = {
    "extension_mm": ("contraction", BEFORE, LOADED, "mm"),
    "return_mm": ("contraction", BACK, LOADED, "mm"),
    "rotation_deg": ("rotation", LOADED, BEFORE, "deg"),
    "return_deg": ("rotation", LOADED, BACK, "deg"),
}
"""What is judged: a signal, the row that counts plus and the one that counts minus, the unit."""


@dataclass(frozen=True)
class Rig:
    """Trials and the model that all fits begin from.

    Attributes:
        data: the trials.
        initial_model: the model.
        problem: trials and noise, ready for fits; its own parameters about the given model's.
        known: every effect that may be added, by name.
    """

    data: Dataset
    initial_model: Model
    problem: FitProblem
    known: dict[str, CandidateEffect]

    @classmethod
    def of(cls, data: Dataset, initial_model: Model, threads: int = 1) -> "Rig":
        """From trials, with noise from their repeats."""
        trials = [each.trial for each in data.trials]
        logged = [Logged.of(initial_model, i, trial) for i, trial in enumerate(trials)]
        levels = initial_floors(initial_model, logged, data.trials)
        noise = tuple(white_noise(each.level) for each in levels)
        own = free_parameters(initial_model)
        problem = FitProblem(
            trials, initial_model, FreeParameters(own.free, WIDER * own.prior), noise, threads
        )
        orders = [float(each.order or 0.0) for each in data.trials]
        return cls(
            data,
            initial_model,
            problem,
            {each.name: each for each in candidate_effects(initial_model, orders)},
        )

    def fit(self, effects: Sequence[str], start_model: Model) -> Fitted | None:
        """The given model with effects in it, fitted to the trials.

        Args:
            effects: names of the effects.
            start_model: where the fit begins; an effect that it lacks begins as usual.
        """
        chosen = [self.known[name] for name in effects]
        starts = {
            each.name: values(start_model, each.paths)
            if each.effect in start_model.parameters
            else each.probes[len(each.probes) // 2]
            for each in chosen
        }
        free = self.problem.own.free
        own = dict(zip(free, values(start_model, free).tolist(), strict=True))
        return self.problem.fit(self.initial_model.replace(own), chosen, starts)


AT_LOAD = "extension_at_load_mm"
"""The extension again, with the load that was measured in each row: what the drive gives is no
matter then."""


def _compared(readings: Sequence[Array], logged: Sequence[Logged]) -> dict[str, Array]:
    by_figure: dict[str, list[float]] = {name: [] for name in FIGURES}
    for simulated, each in zip(readings, logged, strict=True):
        for name, (signal, plus, minus, unit) in FIGURES.items():
            channel = RIGS["station"].outputs.index(signal)
            if {plus, minus} & set(each.missing[channel].tolist()):
                continue
            off = simulated[channel] - each.measured[channel]
            by_figure[name].append(float(off[plus] - off[minus]) / SI_FACTORS[unit])
    return {name: np.array(errors) for name, errors in by_figure.items()}


def limit_errors(model: Model, data: Dataset) -> dict[str, Array]:
    """Compute predicted less measured of I3's trials from commands, by `FIGURES` and `AT_LOAD`.

    Args:
        model: as it is.
        data: trials of I3; those without a load are passed over.
    """
    loaded = [each for each in data.trials if each.trial.measures("angle")]
    errors = _errors(model, loaded, [each.trial for each in loaded])
    at_load = _errors(model, loaded, [_at_measured_load(each.trial, model) for each in loaded])
    return {**errors, AT_LOAD: at_load["extension_mm"]}


def _at_measured_load(trial: Trial, model: Model) -> Trial:
    """A trial of I3 whose drive gives the load that was measured in place of the usual one."""
    volts, drive = trial.commands["motor_voltage"], model.parameters["drive"]
    scaled = (
        np.clip((trial.measurements["load"][LOADED] - drive.offset) / drive.gain, 0.0, 10.0)
        * volts
        / volts.max()
    )
    return Trial(trial.time, {**trial.commands, "motor_voltage": scaled}, trial.measurements)


def _errors(
    model: Model, loaded: Sequence[NamedTrial], trials: Sequence[Trial]
) -> dict[str, Array]:
    """Predicted less measured, in file units, by `FIGURES`."""
    some = ("drive.offset_n",)
    whitened = WhitenedResiduals(
        model,
        trials,
        some,
        tuple(white_noise(1.0) for _ in RIGS["station"].outputs),
        np.array([np.inf]),
        own={path: [float(each.order or 0.0) for each in loaded] for path in _repeats(model)},
    )
    readings = whitened.readings(values(model, some))
    if readings is None:
        return {name: np.array([np.nan]) for name in FIGURES}
    return _compared(readings, whitened.logged)


def _repeats(model: Model) -> list[str]:
    """Parameters that are the number of the repeat."""
    return [path for path in model.paths() if path == "warm_up.repeat"]


def worked(model: Model) -> Model:
    """The model of a muscle that has been worked for long, as far as it knows of warming up."""
    return model.replace({path: MANY for path in _repeats(model)})


def rms(errors: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(errors**2)))


def repeat_scatter(data: Dataset) -> dict[str, float]:
    """Rms of I3's rows about the mean of their repeats, in file units, by `FIGURES`."""
    groups: dict[str, list[int]] = {}
    loaded = [each for each in data.trials if each.trial.measures("angle")]
    for i, each in enumerate(loaded):
        groups.setdefault(each.repeat_of or each.name, []).append(i)
    scatter = {}
    for name, (signal, plus, minus, unit) in FIGURES.items():
        squares, count = 0.0, 0
        for group in groups.values():
            read = np.array([loaded[i].trial.measurements[signal] for i in group])
            apart = read[:, plus] - read[:, minus]
            apart = apart[np.isfinite(apart)] / SI_FACTORS[unit]
            squares += float(np.sum((apart - apart.mean()) ** 2)) if apart.size else 0.0
            count += apart.size
        scatter[name] = float(np.sqrt(squares / count)) if count else float("nan")
    return {**scatter, AT_LOAD: scatter["extension_mm"]}


RESTARTS = 3
"""How often the search for lengths begins anew."""

LENGTHS: Any = np.array([1.0, 2.0])
"""Where the search for lengths begins (V of the regulator, V of the motor)."""

ROUGHEST = 0.05
"""Shortest length that is tried, in volts of either command."""


def smooth_errors(seen: Dataset, unseen: Dataset) -> dict[str, float]:
    """Rms at pressures that were not seen of a Gaussian process fitted to the others.

    Args:
        seen: trials of I3 that it is fitted to.
        unseen: trials of I3 that it is judged on.
    Returns:
        Rms errors in file units (mm, deg) by `FIGURES`, as functions of the two voltages; and
        `AT_LOAD`, the extension as a function of regulator voltage and measured load.
    """
    errors = {name: _error(seen, unseen, name, at_load=False) for name in FIGURES}
    return {**errors, AT_LOAD: _error(seen, unseen, "extension_mm", at_load=True)}


def _error(seen: Dataset, unseen: Dataset, figure: str, at_load: bool) -> float:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    known, values = _rows(seen, figure, at_load)
    asked, truth = _rows(unseen, figure, at_load)
    spread = float(values.std())
    kernel = ConstantKernel(spread**2, (1e-2 * spread**2, 1e3 * spread**2)) * RBF(
        LENGTHS, (ROUGHEST, 50.0)
    ) + WhiteKernel(0.01 * spread**2, (1e-6 * spread**2, spread**2))
    process = GaussianProcessRegressor(kernel, n_restarts_optimizer=RESTARTS, random_state=0)
    process.fit(known, values - values.mean())
    return rms(process.predict(asked) + values.mean() - truth)


def _rows(data: Dataset, figure: str, at_load: bool) -> tuple[Array, Array]:
    """What is known of each row, shape (rows, 2), and its figure in file units, shape (rows,)."""
    trials: Sequence[Trial] = [each.trial for each in data.trials if each.trial.measures("angle")]
    signal, plus, minus, unit = FIGURES[figure]
    read = np.array([each.measurements[signal] for each in trials])
    values = (read[:, plus] - read[:, minus]) / SI_FACTORS[unit]
    pulled = [
        # 100 N a volt, about: what matters is that a step means as much.
        each.measurements["load"][LOADED] / 100.0 if at_load else each.commands["motor_voltage"][1]
        for each in trials
    ]
    regulator = [each.commands["regulator_voltage"][0] for each in trials]
    known, there = np.column_stack([regulator, pulled]), np.isfinite(values)
    there &= np.isfinite(known).all(axis=1)
    return known[there], values[there]


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
    return Undecidable(
        name, CATALOGUE[each.candidate.effect].port, each.resolvable, places[0] if places else None
    )
