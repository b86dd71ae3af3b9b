"""What a trial that nobody measured yet would tell: one of a protocol, simulated by a model."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pma_gym.data.trial import Trial
from pma_gym.discovery.diagnosis import NextExperiment
from pma_gym.discovery.evidence import Evidence
from pma_gym.discovery.fits import Bench
from pma_gym.discovery.protocols import Protocol
from pma_gym.plant.model import Model

MOST = 50.0
"""Largest log odds that are promised: no model is that exact."""


def foretold(bench: Bench, model: Model, free: Sequence[str], simulated: Trial) -> Evidence:
    """One simulated trial beside a model."""
    nothing = np.full(len(free), np.inf)
    trial = as_measured(bench, simulated)
    return Evidence(model, [trial], free, bench.noise, nothing, threads=bench.threads)


def as_measured(bench: Bench, simulated: Trial) -> Trial:
    """A simulated trial with the signals that the lab measures."""
    known = {name for trial in bench.trials for name in _measured(trial)}
    readings = {name: row for name, row in simulated.measurements.items() if name in known}
    return replace(simulated, measurements=readings, truth={})


def _measured(trial: Trial) -> Iterator[str]:
    for name, row in trial.measurements.items():
        if np.isfinite(row).any():
            yield name


def proposal(protocol: Protocol, separates: Sequence[str], log_odds: float) -> NextExperiment:
    """A protocol as an experiment to propose.

    Args:
        protocol: the protocol.
        separates: names of what it tells apart.
        log_odds: natural logarithm of the odds to expect; no more than `MOST` is promised.
    """
    odds = math.exp(min(log_odds, MOST))
    note = {"note": f"proposed: {protocol.name}"}
    trial = Trial(protocol.trial.time, protocol.trial.commands, provenance=note)
    return NextExperiment(protocol.name, tuple(separates), odds, protocol.minutes, trial)
