"""Curves and gaps of every trial, in file units, as the report shows them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import MEASUREMENTS
from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.fitting.free_parameters import values
from pma_gym.discovery.result.misfit import Gap, TrialRecord, rms
from pma_gym.discovery.result.noise import Floor, Judgement
from pma_gym.discovery.verdict.findings import Findings
from pma_gym.estimation.logged import Logged
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]


def trial_records(findings: Findings) -> tuple[TrialRecord, ...]:
    """Every trial as measured, and as three models have it."""
    problem, (proposing, proposed) = findings.problem, findings.proposed
    whitened = problem.whitened_residuals(findings.given)
    before = whitened.readings(values(findings.given, problem.own.free))
    unseen, without = findings.unseen, findings.unseen_without
    refitted = (
        without.readings if without is not None else whitened.readings(findings.refitted.values)
    )
    after = (
        unseen.readings
        if unseen is not None
        else proposing.whitened_residuals(proposed.model, findings.selection.chosen).readings(
            proposed.values
        )
    )
    assert refitted is not None and after is not None
    records = []
    for i, (each, logged) in enumerate(zip(findings.named, whitened.logged, strict=True)):
        measured = np.where(_there(logged), logged.measured, np.nan)
        # A model that cannot be simulated as it was given says nothing.
        started = refitted[i] if before is None else before[i]
        curves = [_zeroed(logged, held, measured) for held in (started, refitted[i], after[i])]
        gaps = {}
        for channel, signal in enumerate(logged.signals):
            if not logged.measures[channel]:
                continue
            column = BY_QUANTITY[signal.name]
            factor = SI_FACTORS[column.unit]
            started_off, refitted_off, after_off = (
                rms(curve[channel] - measured[channel]) / factor for curve in curves
            )
            floor = findings.floors[channel].level / factor
            gaps[column.name] = Gap(started_off, refitted_off, after_off, floor, unseen is not None)
        first, second, third = curves
        records.append(
            TrialRecord(
                each.name,
                each.trial.time,
                measured.T,
                first.T,
                second.T,
                third.T,
                gaps,
                unseen is not None,
                each.file or each.name,
                tuple(signal.column for signal in logged.signals),
            )
        )
    return tuple(records)


def gaps(records: Sequence[TrialRecord]) -> dict[str, Gap]:
    """Gaps over all trials, by column name."""
    by_signal: dict[str, Gap] = {}
    for column in (BY_QUANTITY[name] for name in MEASUREMENTS):
        parts = [
            (record.gaps[column.name], len(record.time))
            for record in records
            if column.name in record.gaps
        ]
        if not parts:
            continue
        weights = np.array([rows for _, rows in parts], float)
        squares = np.array([[g.before, g.parameters, g.after] for g, _ in parts]) ** 2
        before, parameters, after = np.sqrt(weights @ squares / weights.sum())
        by_signal[column.name] = Gap(
            float(before), float(parameters), float(after), parts[0][0].floor, parts[0][0].held_out
        )
    return by_signal


def floors_in_file_units(findings: Findings) -> dict[str, Floor]:
    """Noise of the signals that were measured."""
    floors = {}
    for channel, level in enumerate(findings.floors):
        if not any(
            each.measures[channel]
            for each in findings.problem.whitened_residuals(findings.given).logged
        ):
            continue
        column = BY_QUANTITY[level.signal.name]
        factor = SI_FACTORS[column.unit]
        learnt = findings.selection.problem.noise[channel]
        sources = {source: value / factor for source, value in level.by_source.items()}
        sources["autoregression"] = learnt.innovation / factor
        floors[column.name] = Floor(
            level.level / factor,
            level.source,
            sources,
            level.step / factor,
            learnt.coefficients,
        )
    return floors


def judgements(findings: Findings) -> dict[str, Judgement]:
    """What is left of each signal, by its column."""
    judged = {}
    for name, each in findings.adequacy.signals.items():
        column = BY_QUANTITY[name]
        figures = (each.misfit, each.explained, each.bound, each.fitted)
        misfit, explained, bound, fitted = (
            value if np.isfinite(value) else None for value in figures
        )
        judged[column.name] = Judgement(
            None if each.floor is None else each.floor.level / SI_FACTORS[column.unit],
            "" if each.floor is None else each.floor.source,
            misfit,
            explained,
            bound,
            fitted,
            each.fault,
        )
    return judged


def _there(logged: Logged) -> NDArray[np.bool_]:
    there = np.ones(logged.measured.shape, bool)
    for channel, missing in enumerate(logged.missing):
        there[channel, missing] = False
    return there


def _zeroed(logged: Logged, held: Array, measured: Array) -> Array:
    """A curve with the zeros that are free put where they fit best."""
    curve = held.copy()
    for channel, signal in enumerate(logged.signals):
        off = measured[channel] - held[channel]
        if signal.has_free_zero and np.isfinite(off).any():
            curve[channel] += np.nanmean(off)
    return curve
