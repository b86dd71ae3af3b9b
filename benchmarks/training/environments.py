"""Batched environments of a preset: to train on, and to validate on."""

from typing import Any

from stable_baselines3.common.vec_env import VecEnv

from benchmarks.training.piloted import PilotedVecEnv
from benchmarks.training.preset import Preset
from benchmarks.training.stations import VALIDATION, VALIDATION_FIRST, Stations
from pma_gym.envs.sb3 import SB3VecEnv
from pma_gym.tasks import named_task

PRESSURE_STEP_KPA = 25
"""Distance of the pressures that episodes begin at (kPa)."""

RESERVE_KPA = 25
"""What a jump of the regulator needs below the highest pressure (kPa): the rig breaks at 600."""


def training_environments(preset: Preset, threads: int = 1) -> VecEnv:
    """What a preset trains on."""
    return _made(preset, preset.environments, threads, Stations, staggered=True)


def validation_environments(preset: Preset, threads: int = 1) -> VecEnv:
    """As many episodes, on stations that neither training nor a suite has."""

    def stations(suite: str) -> Stations:
        return Stations(suite, VALIDATION_FIRST, VALIDATION)

    return _made(preset, 2 * VALIDATION, threads, stations, staggered=False)


def pressures_kpa(preset: Preset) -> list[float]:
    """Pressures that episodes begin at (kPa)."""
    task = named_task(preset.task)
    assert task is not None
    low, high = (round(1e-3 * end) for end in task.starts)
    jumps = "regulator" in str(preset.options.get("disturbances", "none"))
    top = high - RESERVE_KPA if jumps and high > 575 - RESERVE_KPA else high
    return [float(p) for p in range(low, top + 1, PRESSURE_STEP_KPA)]


def _made(preset: Preset, count: int, threads: int, stations: Any, staggered: bool) -> VecEnv:  # noqa: ANN401
    options = {key: value for key, value in preset.options.items() if key != "task"}
    options.setdefault("pressure_kpa", pressures_kpa(preset))
    if preset.stations:
        drawn = stations(preset.stations)
        options |= {"randomisation": drawn, "model": drawn.structure}
    if preset.view.kind == "environment":
        view = preset.view
        options |= {"preview": view.preview, "history": view.history}
        return SB3VecEnv(count, preset.task, threads=threads, **options)
    told = "station" if preset.stations else options.get("model", "station")
    return PilotedVecEnv(
        count,
        preset.task,
        preset.view,
        preset.form,
        told,
        staggered,
        threads=threads,
        **options,
    )
