"""An imposed motion is as fast as its record says.

A stated bandwidth may be too low and smooth the corners of a motion away: what damping, stiffness
and friction make of these then looks like an effect. It is doubled as long as what it takes from
the record is far more than the record's noise, up to what the rows record.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.preparation.noise import level_of_neighbours
from pma_gym.discovery.preparation.recorded_bandwidth import BANDWIDTH, recorded_bandwidth
from pma_gym.plant.imposed_motion import smoothed
from pma_gym.plant.model import Model

MOTION = 3.0
"""Noises of the record from which on what a bandwidth takes from it counts as motion."""

WORSE = 1.01
"""Chi-square over that at the stated bandwidth from which on a faster motion is refused: the record
has hum, say, which nothing moves by."""


def with_fast_motion(problem: FitProblem, refitted: Fitted) -> tuple[FitProblem, Fitted, str]:
    """Trials with a motion as fast as their records say, the refitted model, and words.

    Args:
        problem: the trials with the motion as it is stated.
        refitted: the model with its own parameters refitted.
    Returns:
        Both as they are, and no words, where the motion is not imposed or fast enough.
    """
    if not problem.given.rig.imposes_motion:
        return problem, refitted, ""
    stated = problem.given.parameters["imposed_motion"].bandwidth
    bandwidth = _bandwidth(problem.given, problem.trials, stated)
    if bandwidth == stated:
        return problem, refitted, ""
    faster = replace(problem, given=problem.given.replace({BANDWIDTH: bandwidth}))
    again = faster.fit(refitted.model.replace({BANDWIDTH: bandwidth}))
    if again is None or again.chi_square > WORSE * refitted.chi_square:
        return problem, refitted, ""
    words = (
        f"imposed_motion.bandwidth_hz is taken as {bandwidth:.3g} Hz, not {stated:.4g} Hz, which "
        "takes more from the recorded motion than its noise: state that in the model"
    )
    return faster, again, words


def _bandwidth(model: Model, trials: Sequence[Trial], stated: float) -> float:
    """Bandwidth (Hz) that takes no motion from the records; the stated one where that does not."""
    command = model.rig.direct_commands["imposed_motion"]
    records = [trial.commands[command] for trial in trials]
    noise, bandwidth = level_of_neighbours(records), stated
    most = recorded_bandwidth(trials)
    while bandwidth < most:
        taken = [
            record - smoothed(trial.time, record, bandwidth)[0]
            for trial, record in zip(trials, records, strict=True)
        ]
        if np.sqrt(np.mean(np.concatenate(taken) ** 2)) <= MOTION * noise:
            break
        bandwidth = min(2.0 * bandwidth, most)
    return bandwidth
