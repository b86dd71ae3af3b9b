"""An imposed motion is as fast as its record says.

A stated bandwidth may be too low and smooth the corners of a motion away: what damping, stiffness
and friction make of these then looks like an effect. It is doubled as long as that changes the
force by more than a share of its noise, or takes from the record more than its noise and than a
contact deflects by.
"""

from dataclasses import replace

import numpy as np

from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.preparation.noise import level_of_neighbours
from pma_gym.discovery.preparation.recorded_bandwidth import BANDWIDTH, recorded_bandwidth
from pma_gym.discovery.thresholds import FALLS, LEAST_DEFLECTION, SLIGHT, STRUCTURE, WORSE
from pma_gym.plant.imposed_motion import smoothed


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
    bandwidth, most, before = stated, recorded_bandwidth(problem.trials), np.inf
    while bandwidth < most:
        twice = min(2.0 * bandwidth, most)
        change = _change_of_force(problem, refitted, bandwidth, twice)
        # What hardly falls is no motion: noise of the record, or lines between its rows.
        if not _takes_motion(problem, bandwidth) and (change < SLIGHT or change > before / FALLS):
            break
        bandwidth, before = twice, change
    if bandwidth == stated:
        return problem, refitted, ""
    faster = _at(problem, bandwidth)
    again = faster.fit(refitted.model.replace({BANDWIDTH: bandwidth}))
    if again is None or again.chi_square > WORSE * refitted.chi_square:
        return problem, refitted, ""
    words = (
        f"imposed_motion.bandwidth_hz is taken as {bandwidth:.3g} Hz, not {stated:.4g} Hz, which "
        "smooths the recorded motion more than the force bears: state that in the model"
    )
    return faster, again, words


def _at(problem: FitProblem, bandwidth: float) -> FitProblem:
    """The problem with another bandwidth (Hz)."""
    return replace(problem, given=problem.given.replace({BANDWIDTH: bandwidth}))


def _takes_motion(problem: FitProblem, bandwidth: float) -> bool:
    """Whether a bandwidth (Hz) takes more from the records than noise and a small deflection."""
    command = problem.given.rig.direct_commands["imposed_motion"]
    records = [trial.commands[command] for trial in problem.trials]
    taken = [
        record - smoothed(trial.time, record, bandwidth)[0]
        for trial, record in zip(problem.trials, records, strict=True)
    ]
    size = float(np.sqrt(np.mean(np.concatenate(taken) ** 2)))
    way = max(float(np.ptp(record)) for record in records)
    return size > max(STRUCTURE * level_of_neighbours(records), LEAST_DEFLECTION * way)


def _change_of_force(
    problem: FitProblem, refitted: Fitted, bandwidth: float, twice: float
) -> float:
    """Rms by which the refitted model's force differs between two bandwidths (Hz), in its noise."""
    forces = []
    for hertz in (bandwidth, twice):
        model = refitted.model.replace({BANDWIDTH: hertz})
        readings = _at(problem, hertz).whitened_residuals(model).readings(refitted.values)
        if readings is None:
            return 0.0
        forces.append(readings)
    (channel,) = (k for k, each in enumerate(problem.given.rig.signals) if each.is_force)
    apart = np.concatenate([b[channel] - a[channel] for a, b in zip(*forces, strict=True)])
    return float(np.sqrt(np.mean(apart**2)) / problem.noise[channel].level)
