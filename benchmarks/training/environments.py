"""Batched environments of a preset: to train on, and to validate on."""

import time

from stable_baselines3.common.vec_env import VecEnv

from benchmarks.training.configuration.preset import Preset
from benchmarks.training.policy_batch import PilotedVecEnv
from benchmarks.training.stations import VALIDATION, VALIDATION_FIRST, Stations
from pma_gym.tasks import named_task

PRESSURE_STEP_KPA = 25
"""Distance of the pressures that episodes begin at (kPa)."""

USUAL = "robust"
"""Suite whose recipe validation stations are drawn by, if the preset names none."""

RESERVE_KPA = 25
"""What a jump of the regulator needs below the highest pressure (kPa): the rig breaks at 600."""


def training_environments(preset: Preset, threads: int = 1) -> VecEnv:
    """Make the environments that a preset trains on."""
    drawn = Stations(preset.stations) if preset.stations else None
    return _made(preset, preset.environments, threads, drawn, staggered=True)


def validation_environments(preset: Preset, threads: int = 1) -> VecEnv:
    """Twice as many episodes as there are validation stations, each on one drawn from them.

    Also where a preset trains on the nominal station alone.
    """
    drawn = _validated_on(preset)
    return _made(preset, 2 * VALIDATION, threads, drawn, staggered=False)


def _validated_on(preset: Preset) -> Stations:
    return Stations(preset.stations or USUAL, VALIDATION_FIRST, VALIDATION)


def pressures_kpa(preset: Preset) -> list[float]:
    """Pressures that episodes begin at (kPa)."""
    task = named_task(preset.task)
    assert task is not None
    low, high = (round(1e-3 * end) for end in task.starts)
    jumps = "regulator" in str(preset.options.get("disturbances", "none"))
    top = high - RESERVE_KPA if jumps and high > 575 - RESERVE_KPA else high
    return [float(p) for p in range(low, top + 1, PRESSURE_STEP_KPA)]


def _made(
    preset: Preset, count: int, threads: int, drawn: Stations | None, staggered: bool
) -> VecEnv:
    options = {key: value for key, value in preset.options.items() if key != "task"}
    options.setdefault("pressure_kpa", pressures_kpa(preset))
    if drawn is not None:
        options |= {"randomisation": drawn, "model": drawn.structure}
    nominal = str(preset.options.get("model", "station"))
    return PilotedVecEnv(
        count,
        preset.task,
        preset.view,
        preset.form,
        nominal,
        staggered,
        preset.reward_scale,
        threads=threads,
        **options,
    )


def drawing_s(preset: Preset) -> float:
    """Draw all stations of a preset, unless this process has them already; how long it took (s)."""
    began = time.perf_counter()
    own = [Stations(preset.stations)] if preset.stations else []
    for stations in (*own, _validated_on(preset)):
        for number in range(stations.count):
            stations.of(number)
    return time.perf_counter() - began
