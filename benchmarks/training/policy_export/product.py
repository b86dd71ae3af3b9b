"""Product of a training: a policy file with its provenance."""

from typing import Any

from benchmarks.runner.provenance import ROOT, git_state
from benchmarks.training.configuration.preset import Preset
from benchmarks.training.environments import pressures_kpa
from benchmarks.training.policy_export.from_sb3 import policy_from_sb3
from benchmarks.training.run import Order, Trained
from benchmarks.training.validation import unit_of
from controllers.design.designs import loop_name, task_kind
from controllers.policies.policy_file import PolicyFile
from pma_gym.envs import PMAEnv, StationInfo

TITLES = {"ppo": "PPO", "sac": "SAC", "td3": "TD3", "tqc": "TQC"}
"""How algorithms are called."""


def station_of(preset: Preset) -> StationInfo:
    """The station of a preset as controllers receive it."""
    options = {key: value for key, value in preset.options.items() if key != "task"}
    options.setdefault("pressure_kpa", pressures_kpa(preset)[0])
    environment = PMAEnv(preset.task, **options)
    environment.reset(seed=0)
    return environment.station


def policy_name(preset: Preset) -> str:
    """Return the name of a preset's policies: kind of task, loop, algorithm."""
    station = station_of(preset)
    return f"{task_kind(station)}-{loop_name(station)}-{preset.algorithm}"


def policy_of(order: Order, trained: Trained) -> PolicyFile:
    """The trained policy.

    Raises:
        ExportError: its network is none that a policy file holds.
    """
    preset, station = order.preset, station_of(order.preset)
    kind = task_kind(station)
    return policy_from_sb3(
        trained.model,
        name=policy_name(preset),
        title=f"{TITLES[preset.algorithm]}, {preset.name}",
        task=kind,
        environment={"id": preset.environment, "kwargs": _kwargs(preset, station)},
        view=preset.view,
        form=preset.form,
        observation=preset.view.rows(station, preset.form.base),
        training=_training(order, trained),
    )


def _kwargs(preset: Preset, station: StationInfo) -> dict[str, Any]:
    return dict(preset.options) | {
        "control_rate_hz": 1.0 / station.period,
        "action_delay_s": station.action_delay,
        "observation_delay_s": station.observation_delay,
        "model": station.model.name,
    }


def _training(order: Order, trained: Trained) -> dict[str, Any]:
    course, state = trained.course, git_state(ROOT)
    commit = str(state["commit"])[:12] + ("+" if state["dirty"] else "")
    error, broken, reward, mean = trained.final
    return {
        "algorithm": order.preset.algorithm,
        "preset": order.preset.name,
        "seed": order.seed,
        "steps": trained.model.num_timesteps,
        "wall_s": round(course.wall_s, 1),
        "code": commit,
        "curve": [[point.steps, point.wall_s, point.error] for point in course.curve],
        "scores": {
            "validation": {
                "error": error,
                "mean": mean,
                "unit": unit_of(order.preset.task),
                "broken": broken,
                "reward": reward,
            }
        },
    }
