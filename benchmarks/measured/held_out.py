"""Whole pressures left out: what models say of table I3's rows that they were not fitted to."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import Dataset
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import FreeParameters, free_parameters, values
from pma_gym.discovery.preparation.initial_floors import initial_floors
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.discovery.screening.candidates import candidate_effects
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

    def _fit(self, effects: Sequence[str], start_model: Model) -> Fitted | None:
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
        fit = self.problem.fit(self.initial_model.replace(own), chosen, starts)
        return None if fit is None else self.problem.until_converged(fit, chosen)

    def fit(self, effects: Sequence[str], amended: Model) -> Model:
        """The better of fits of some effects that begin at an amended model and at the given one.

        Raises:
            ValueError: neither can be simulated on the trials.
        """
        fits = [self._fit(effects, model) for model in (amended, self.initial_model)]
        if not any(fits):
            raise ValueError(
                f"{self.initial_model.name} with {', '.join(effects) or 'no effect'} cannot be "
                "simulated on tables I2 and I3"
            )
        return min(filter(None, fits), key=lambda fit: fit.chi_square).model


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
    """Compute predicted less measured of I3's trials from commands, in file units, by `FIGURES`.

    Args:
        model: as it is.
        data: trials of I3; those without a load are passed over.
    """
    loaded = [each for each in data.trials if each.trial.measures("angle")]
    some = ("drive.offset_n",)
    whitened = WhitenedResiduals(
        model,
        [each.trial for each in loaded],
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
    return scatter
