"""What belongs to each trial and not to the model: zeros, the trial's own parameters.

A diagnosis writes them beside the model (`model.toml` and `trials.toml`). Both read back give the
misfit that it printed, so that nothing that was fitted is lost on the way.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import MEASUREMENTS, Trial
from pma_gym.data.trial_columns import BY_NAME, BY_QUANTITY, TrialError
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import unit
from pma_gym.discovery.result.estimates import TrialState
from pma_gym.documents import read_toml
from pma_gym.plant.memory_start import memory_states
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]


def trial_states(
    problem: FitProblem, fit: Fitted, chosen: Sequence[CandidateEffect], names: Sequence[str]
) -> dict[str, TrialState]:
    """The state of every trial of a fit, by the trial's name."""
    own: dict[str, Sequence[float]] = {}
    for candidate in chosen:
        own |= candidate.own
    whitened = problem.whitened_residuals(fit.model, chosen)
    memories = memory_states(fit.model)
    begun = whitened.first_states(fit.values) if memories else None
    by_trial = {}
    for i, name in enumerate(names):
        parameters = {path: each[i] / SI_FACTORS[unit(path)] for path, each in own.items()}
        if begun is not None:
            states = dict(zip(whitened.plant.states, begun[i].tolist(), strict=True))
            parameters |= {
                path: states[state] / SI_FACTORS[unit(path)] for state, path in memories.items()
            }
        held = simulated(fit.model, problem.trials[i], TrialState({}, parameters))
        by_trial[name] = TrialState(_zeros(problem.trials[i], held), parameters)
    return by_trial


def simulated(model: Model, trial: Trial, state: TrialState) -> dict[str, Array]:
    """What a model's sensors hold in a trial (SI), with the trial's own state."""
    plant = Plant(model.replace(dict(state.parameters)))
    held = plant.simulate(Trial(trial.time, trial.commands), noise=False).measurements
    zeros = {
        BY_NAME[name].quantity: value * SI_FACTORS[BY_NAME[name].unit]
        for name, value in state.zeros.items()
    }
    return {name: row + zeros.get(name, 0.0) for name, row in held.items()}


def misfits(
    named: Iterable[NamedTrial], model: Model, states: Mapping[str, TrialState]
) -> dict[str, float]:
    """Misfit of a model by signal, over all trials (root mean square, by column, in its unit).

    Args:
        named: measured trials.
        model: the model.
        states: of the trials, by name; a trial without one begins as the model says.
    """
    squares: dict[str, float] = dict.fromkeys(model.rig.outputs, 0.0)
    counts: dict[str, int] = dict.fromkeys(model.rig.outputs, 0)
    for each in named:
        held = simulated(model, each.trial, states.get(each.name, TrialState()))
        for name, row in held.items():
            if name not in each.trial.measurements:
                continue
            off = row - each.trial.measurements[name]
            squares[name] += float(np.nansum(off**2))
            counts[name] += int(np.isfinite(off).sum())
    return {
        BY_QUANTITY[name].name: float(np.sqrt(squares[name] / count))
        / SI_FACTORS[BY_QUANTITY[name].unit]
        for name, count in counts.items()
        if count
    }


def dump_states(states: Mapping[str, TrialState]) -> str:
    """The states as TOML text; the same states give the same bytes."""
    lines = ["# What belongs to each trial: zeros of the signals, and its own parameters."]
    for name, state in states.items():
        # JSON's strings are TOML's; what no text holds (a stray byte of a file's name) is replaced.
        key = json.dumps(name.encode("utf-8", "replace").decode("utf-8"))
        for part in ("zeros", "parameters"):
            numbers = getattr(state, part)
            lines += ["", f"[trials.{key}.{part}]"] * bool(numbers)
            lines += [f"{json.dumps(path)} = {value!r}" for path, value in numbers.items()]
    return "\n".join(lines) + "\n"


def read_states(path: Path) -> dict[str, TrialState]:
    """The states in a file that `dump_states` made.

    Raises:
        TrialError: names what is wrong, the rule and what came.
    """
    tables = read_toml(path, finite=False).get("trials", {})
    if not isinstance(tables, dict):
        raise TrialError(f"trials in {path} must be a table, [trials], got {tables!r:.80}")
    states = {}
    for name, table in tables.items():
        parts = {part: _numbers(path, name, table, part) for part in ("zeros", "parameters")}
        states[name] = TrialState(**parts)
    return states


def _numbers(path: Path, name: str, table: object, part: str) -> dict[str, float]:
    """The numbers of one part of a trial's table."""
    place = f'[trials."{name}".{part}] in {path}'
    given = table.get(part, {}) if isinstance(table, dict) else None
    if not isinstance(given, dict):
        raise TrialError(f"{place} must be a table of numbers, got {given!r:.80}")
    numbers = {}
    for key, value in given.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
            raise TrialError(f"{key} in {place} must be a finite number, got {value!r:.80}")
        if part == "zeros" and (key not in BY_NAME or BY_NAME[key].kind != "measurement"):
            known = [BY_QUANTITY[each].name for each in MEASUREMENTS]
            raise TrialError(f"{place} takes {', '.join(known)}, got {key!r:.80}")
        numbers[key] = float(value)
    return numbers


def _zeros(trial: Trial, held: Mapping[str, Array]) -> dict[str, float]:
    """What a trial's signals with a free zero read above the model, on average."""
    zeros = {}
    for name in held:
        if name in trial.measurements and SIGNALS[name].has_free_zero:
            off = trial.measurements[name] - held[name]
            if np.isfinite(off).any():
                column = BY_QUANTITY[name]
                zeros[column.name] = float(np.nanmean(off)) / SI_FACTORS[column.unit]
    return zeros
