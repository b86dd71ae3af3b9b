"""Unknown: the law that is missing where no effect of the catalogue fits, drawn and put into words.

Forces on the slide by contraction, speed and pressure, and a load by the load that is asked for,
are fitted as straight lines between nine heights, together with the model's own parameters. The
one that explains most is shown.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_law import free_law
from pma_gym.discovery.result.misfit import ResidualLaw
from pma_gym.discovery.thresholds import BUMP_HEIGHTS, CONFIDENCE, PERIODIC_TURNS, UNDETERMINED
from pma_gym.plant import sensors
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]

LAWS = {
    "residual_force_of_contraction": ("force on the slide (N)", "contraction (mm)", "mm"),
    "residual_force_of_velocity": ("force on the slide (N)", "speed of contraction (mm/s)", "mm/s"),
    "residual_force_of_pressure": ("force on the slide (N)", "pressure (kPa)", "kPa"),
    "residual_load": ("load of the drive (N)", "load that is asked for (N)", "N"),
}
"""What each law is, of what, and the unit of that."""

RANGE = (2.0, 98.0)
"""Percentiles of the data between which heights are laid."""


@dataclass(frozen=True)
class EstimatedLaw:
    """A law that was fitted.

    Attributes:
        name: its effect in the catalogue.
        candidate: it, with its ends where the data end.
        fit: the model with it.
        gain: fall of chi-square.
    """

    name: str
    candidate: CandidateEffect
    fit: Fitted
    gain: float


def estimated_laws(problem: FitProblem, refitted: Fitted) -> list[EstimatedLaw]:
    """Every law fitted, the one that explains most first; none for a rig without a muscle.

    They are laws of a muscle and of a drive that only pulls.
    """
    if not problem.given.rig.has_muscle:
        return []
    before = (
        problem.whitened_residuals(refitted.model).sums(refitted.values, np.empty(0)).chi_square
    )
    ranges = _ranges(problem, refitted)
    laws = []
    for name in LAWS:
        candidate = free_law(problem.given, name, ranges[name])
        fit = problem.fit(refitted.model, (candidate,), {name: candidate.absent})
        if fit is not None:
            laws.append(EstimatedLaw(name, candidate, fit, before - fit.chi_square))
    return sorted(laws, key=lambda law: -law.gain)


def residual_law(drawn: EstimatedLaw) -> ResidualLaw:
    """A law as the report shows it, less what is a straight line or a constant of the model's."""
    quantity, variable, _ = LAWS[drawn.name]
    table = drawn.fit.model.values_in_files(drawn.name)
    first, reach = (float(value) for value in list(table.values())[:2])  # type: ignore[arg-type]
    at = np.linspace(first, first + reach, len(drawn.candidate.fitted_paths))
    places = [drawn.fit.paths.index(path) for path in drawn.candidate.fitted_paths]
    law = drawn.fit.values[places]
    covariance = drawn.fit.covariance[np.ix_(places, places)]
    spread = np.sqrt(np.diag(covariance))
    known = spread < UNDETERMINED * np.median(spread)
    at, law, covariance = at[known], law[known], covariance[np.ix_(known, known)]
    # The model's own parameters make any line of it, so a line says nothing about what is missing,
    # and what only a line is uncertain by is no error of the rest.
    lines = np.vander(at, 2)
    rest = np.eye(len(at)) - lines @ np.linalg.pinv(lines)
    law, errors = rest @ law, np.sqrt(np.diag(rest @ covariance @ rest))
    return ResidualLaw(
        quantity,
        variable,
        at,
        law,
        law - CONFIDENCE * errors,
        law + CONFIDENCE * errors,
        words(at, law, errors, variable),
    )


def words(at: Array, law: Array, errors: Array, variable: str) -> str:
    """The shape of a law in words."""
    name, _, unit = variable.partition(" (")
    unit = unit.rstrip(")")
    sure = np.abs(law) > 2.0 * errors
    if not sure.any():
        return f"no height of it leaves 0 by more than its error, over {name}"
    top = int(np.argmax(np.where(sure, np.abs(law), 0.0)))
    sign = "more" if law[top] > 0 else "less"
    turns = int(np.sum(np.diff(np.sign(law[sure])) != 0))
    half = np.abs(law) > 0.5 * abs(law[top])
    shape = f"most near {at[top]:.3g} {unit}: {abs(law[top]):.2g} N {sign} than the model has"
    if turns >= PERIODIC_TURNS:
        return f"it changes sign {turns} times over {name}, as a periodic law would; {shape}"
    if half.sum() <= BUMP_HEIGHTS:
        return f"a bump, confined in {name}; {shape}"
    if np.all(np.diff(law) >= -np.abs(errors[1:])) or np.all(np.diff(law) <= np.abs(errors[1:])):
        return f"it goes one way over all of {name}, bent rather than straight; {shape}"
    return f"it bends over {name}; {shape}"


def _ranges(problem: FitProblem, refitted: Fitted) -> dict[str, tuple[float, float]]:
    """Where the data of each law's variable begin and end, in file units."""
    whitened = problem.whitened_residuals(refitted.model)
    readings = whitened.readings(refitted.values)
    assert readings is not None
    speeds = np.concatenate(
        [
            np.gradient(held[0], logged.time)
            for held, logged in zip(readings, whitened.logged, strict=True)
        ]
    )
    drive = problem.given.parameters["drive"]
    motor = [sensors.voltages(problem.given, trial)[0] for trial in problem.trials]
    loads = drive.gain * np.concatenate(motor) + drive.offset
    seen = {
        "residual_force_of_contraction": np.concatenate([held[0] for held in readings]),
        "residual_force_of_velocity": speeds,
        "residual_force_of_pressure": np.concatenate(
            [
                each.row(held, "pressure")
                for each, held in zip(whitened.logged, readings, strict=True)
            ]
        ),
        "residual_load": loads,
    }
    ranges = {}
    for name, values in seen.items():
        low, high = np.percentile(values, RANGE) / SI_FACTORS[LAWS[name][2]]
        middle, half = 0.5 * (low + high), max(0.5 * (high - low), 1.0)
        ranges[name] = (float(middle - half), float(middle + half))
    return ranges
