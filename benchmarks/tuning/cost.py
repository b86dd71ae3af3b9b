"""Cost of gains: whole trials with sensor noise on several stations, and the loop's margin."""

import difflib
import fnmatch
import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from benchmarks.tuning.loop_margins import Job, Loop
from controllers.design.designs import Gains
from controllers.models.nominal_motion import NominalMotion, nominal_motion
from controllers.pid import PID, FeedforwardPID
from controllers.registry import Reference
from pma_gym.effects.effect import Value
from pma_gym.envs import PMAEnv, StationInfo
from pma_gym.plant.model import Model
from pma_gym.units import SI_FACTORS


def chosen(names: Iterable[str], only: str) -> list[str]:
    """Names that patterns match, each once, in their own order.

    >>> chosen(["hard/displacement", "hard/rotation", "robust/rotation"], "*/rotation")
    ['hard/rotation', 'robust/rotation']

    Args:
        names: what there is.
        only: patterns as of file names, by commas.
    Raises:
        ValueError: a pattern matches nothing.
    """
    known = list(dict.fromkeys(names))
    matches: set[str] = set()
    for pattern in (part.strip() for part in only.split(",")):
        matching = fnmatch.filter(known, pattern)
        if not matching:
            near = difflib.get_close_matches(pattern, known, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise ValueError(
                f"only must match a table, got {pattern!r}; tables: {', '.join(known)}{hint}"
            )
        matches.update(matching)
    return [name for name in known if name in matches]


TARGETS = {
    "extension": 0.10 * SI_FACTORS["mm"],
    "rotation": 0.4 * SI_FACTORS["deg"],
    "contraction": 0.30 * SI_FACTORS["mm"],
}
"""What an RMSE is counted against (m or rad). Of contractions our choice: the regulator is slower
than the motor by about that much."""

VARIATION_WEIGHT_S_PER_V = 0.01
HIGHEST_SENSITIVITY = 2.0
SENSITIVITY_WEIGHT = 10.0
UNSTABLE_COST = 1e3

STATIONS = ((1.0, 1.0), (1.0, 1.0), (1.2, 0.8), (0.8, 1.2))
"""Factors on the muscle's force and damping of the stations that a cost is averaged over."""


class Cost:
    """Cost of gains; see `benchmarks.tuning.tune`."""

    def __init__(self, job: Job) -> None:
        self.job = job
        self.loop = Loop(job)
        self.environments = [_environment(job, *factors) for factors in STATIONS]
        self.trials = [_Trial(job, env, job.seed + i) for i, env in enumerate(self.environments)]

    def __call__(self, gains: Gains) -> float:
        """Cost of gains (SI)."""
        sensitivity = self.loop.sensitivity(gains)
        if math.isinf(sensitivity):
            return UNSTABLE_COST
        excess = max(0.0, sensitivity - HIGHEST_SENSITIVITY)
        trials = [trial.cost(gains) for trial in self.trials]
        return float(np.mean(trials)) + SENSITIVITY_WEIGHT * excess


class _Trial:
    """A trial on one station, its feed-forward computed once."""

    def __init__(self, job: Job, env: PMAEnv, seed: int) -> None:
        self.job, self.env, self.seed = job, env, seed
        env.reset(seed=seed)
        self.station = replace(env.station, model=job.model)
        self.open_loop = _OpenLoop(nominal_motion(env.reference, self.station))

    def _controller(self, gains: Gains) -> PID:
        if self.job.controller == FeedforwardPID.name:
            return FeedforwardPID(gains, self.open_loop)
        return PID(gains)

    def cost(self, gains: Gains) -> float:
        """Cost of a whole trial; that of an unstable loop if a limit of the rig ends it."""
        env, controller = self.env, self._controller(gains)
        env.reset(seed=self.seed)
        controller.reset(env.reference, self.station)
        ended = False
        while not ended:
            _, _, broken, ended, _ = env.step(env.action(controller.act(env.measurement, env.time)))
            if broken:
                return UNSTABLE_COST
        by_phase = env.episode_summary()[f"rmse_by_phase_{self.job.schedule.suffix}"]
        target = TARGETS[self.job.schedule.quantity] / SI_FACTORS[self.job.schedule.unit]
        variation = float(np.abs(np.diff(env.voltages)).sum()) / env.time
        return float(np.mean(list(by_phase.values()))) / target + (
            VARIATION_WEIGHT_S_PER_V * variation
        )


class _OpenLoop:
    """A feed-forward computed before."""

    def __init__(self, motion: NominalMotion) -> None:
        self.voltage = motion.voltage

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Nothing to compute."""


def _environment(job: Job, force: float, damping: float) -> PMAEnv:
    """The task on a station whose muscle's force and damping are scaled."""
    return PMAEnv(
        job.task,
        model=scaled_model(job.model, force, damping),
        pressure_kpa=job.pressure_kpa,
        control_rate_hz=job.rate_hz,
        action_delay_s=job.delay_s,
    )


def scaled_model(model: Model, force: float, damping: float) -> Model:
    """A model whose muscle's force and damping are so many times as large."""
    # The cascade's map is what its muscle's force is to the station; 20 % would leave its reach.
    by_port = {"muscle_force": force, "muscle_damping": damping, "position_map": force**-0.5}
    values = {}
    for name, effect in model.effects.items():
        factor = by_port.get(effect.port, 1.0)
        stems = effect.names_in_files()
        for file_key, value in model.values_in_files(name).items():
            unit = effect.quantities[stems[file_key]].unit
            # Forces and displacements by volts; not lengths, steepness and breakpoints.
            if factor != 1.0 and (unit.startswith("N") or unit in ("m", "m/V", "m/V^2")):
                values[f"{name}.{file_key}"] = _times(value, factor)
    return model.replace(values)


def _times(value: Value, factor: float) -> Value:
    return tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value
