"""The batched environment as a policy meets it: entries of its view in, its actions out.

Validation error of a policy on stations that it was not trained on.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from benchmarks.report.errors import Measure, measures, task_of
from benchmarks.report.statistics import interquartile_mean
from benchmarks.training.policy_env import bounded
from benchmarks.training.preset import Preset
from benchmarks.training.stations import VALIDATION, VALIDATION_FIRST, Stations
from controllers.policies.adapter import HIGHEST_V, ActionMapping, BatchPolicyAdapter
from controllers.policies.observation_spec import ObservationSpec
from pma_gym.engine.observation import BOUND
from pma_gym.envs import PMAVectorEnv, StationInfo
from pma_gym.plant.model import load_model
from pma_gym.sb3 import EngineVecEnv

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv


class PolicyVecEnv(EngineVecEnv):
    """`PMAVectorEnv` behind a view and a form, for Stable-Baselines3.

    Args:
        count: how many environments.
        task: name of the task.
        view: what the policy sees; `tracking`.
        form: what its action does.
        nominal: name of the model that controllers receive.
        staggered: cut each environment's first episode at a random length, so that a rollout has
            all parts of a trial in it.
        reward_scale: factor on the bounded rewards.
        options: as `PMAVectorEnv`.

    Attributes:
        envs: the PMAVectorEnv.
    """

    def __init__(
        self,
        count: int,
        task: str,
        view: ObservationSpec,
        form: ActionMapping,
        nominal: str = "station",
        staggered: bool = False,
        reward_scale: float = 1.0,
        **options: Any,
    ) -> None:
        """Make the environments and their policies' adapters."""
        self.envs = PMAVectorEnv(count, task, autoreset_mode=AutoresetMode.DISABLED, **options)
        chosen, model = self.envs.options, load_model(nominal)

        def station(pressure: float) -> StationInfo:
            late = chosen.action_delay * chosen.period, chosen.observation_delay * chosen.period
            return StationInfo(model, self.envs.task, pressure, chosen.period, *late)

        self.adapters = BatchPolicyAdapter(count, view, form, station)
        self._staggered, self._scale = staggered, reward_scale
        self._length = self.envs.task.steps(chosen.control_rate_hz)
        self._left = np.zeros(count, np.int64)
        self._nothing: list[dict[str, Any]] = [{} for _ in range(count)]
        self._actions = np.zeros((count, 1), np.float32)
        self._returns = np.zeros(count)
        self._all = np.arange(count)
        super().__init__(
            count,
            spaces.Box(-BOUND, BOUND, (self.adapters.entries,), np.float32),
            spaces.Box(-1.0, 1.0, (1,), np.float32),
        )

    def reset(self) -> VecEnvObs:
        """Begin an episode in every environment, with the seeds that `seed` was given."""
        self.envs.reset(seed=self._seeds if self._seeds[0] is not None else None)
        self._left[:] = np.iinfo(np.int64).max
        if self._staggered:
            generator = np.random.default_rng(self._seeds[0])
            self._left[:] = generator.integers(1, self._length + 1, self.num_envs)
        self._reset_seeds()
        self._returns[:] = 0.0
        self.adapters.begin(self._all, self.envs.pressures)
        return self.adapters.update(self.envs.measurements(), self._all)

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions of the next step."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Step; an environment whose episode ends returns the next one's first entries."""
        volts = self.adapters.volts(self._actions[:, 0].astype(np.float64))
        commands = volts[:, None] * (2.0 / HIGHEST_V) - 1.0
        _, rewards, terminated, truncated, info = self.envs.step(commands)
        self._returns += rewards
        self._left -= 1
        entries = self.adapters.update(self.envs.measurements())
        learned = bounded(rewards, terminated, self._scale)
        over = terminated | truncated | (self._left == 0)
        infos = self._nothing.copy()
        if over.any():
            which = np.flatnonzero(over)
            for i in which.tolist():
                infos[i] = self._last(i, entries[i].copy(), info, bool(terminated[i]))
            self._begin_again(which, over)
            entries[which] = self.adapters.update(self.envs.measurements(), which)
        return entries, learned.astype(np.float32), over, infos

    def _last(
        self, i: int, entries: NDArray[np.float32], info: Mapping[str, Any], broken: bool
    ) -> dict[str, Any]:
        """Info of an environment whose episode ends; errors unless it was cut."""
        last: dict[str, Any] = {
            "terminal_observation": entries,
            "TimeLimit.truncated": not broken,
            "episode": {"r": float(self._returns[i]), "l": int(self.adapters.steps[i]), "t": 0.0},
        }
        scored = [key for key in info if key.startswith("rmse_") and info[f"_{key}"][i]]
        return last | {key: float(info[key][i]) for key in scored}

    def _begin_again(self, which: NDArray[np.int64], over: NDArray[np.bool_]) -> None:
        self.envs.reset(options={"reset_mask": over})
        self._returns[which] = 0.0
        self._left[which] = np.iinfo(np.int64).max
        self.adapters.begin(which, self.envs.pressures[which])


PRESSURE_STEP_KPA = 25
"""Distance of the pressures that episodes begin at (kPa)."""

RESERVE_KPA = 25
"""What a jump of the regulator needs below the highest pressure (kPa): the rig breaks at 600."""

USUAL = "robust"
"""Suite whose recipe validation stations are drawn by, if the preset names none."""


def training_environments(preset: Preset, threads: int = 1) -> PolicyVecEnv:
    """Make the environments that a preset trains on."""
    suite = preset.wrapper.get("stations")
    drawn = Stations(suite).options if suite else {}
    return _made(preset, preset.n_envs, drawn, staggered=True, threads=threads)


def validation_environments(preset: Preset, threads: int = 1) -> PolicyVecEnv:
    """Twice as many episodes as there are validation stations, each on one drawn from them.

    Also where a preset trains on the nominal station alone.
    """
    drawn = Stations(preset.wrapper.get("stations") or USUAL, VALIDATION_FIRST, VALIDATION)
    return _made(preset, 2 * VALIDATION, drawn.options, staggered=False, threads=threads)


def pressures_kpa(preset: Preset) -> list[float]:
    """Pressures that episodes begin at (kPa)."""
    low, high = (round(1e-3 * end) for end in preset.env.rig.task.starts)
    jumps = "regulator" in str(preset.options.get("disturbances", "none"))
    top = high - RESERVE_KPA if jumps and high > 575 - RESERVE_KPA else high
    return [float(p) for p in range(low, top + 1, PRESSURE_STEP_KPA)]


def _made(preset: Preset, count: int, drawn: Mapping[str, Any], **how: Any) -> PolicyVecEnv:
    return PolicyVecEnv(
        count,
        preset.task,
        preset.env.adapter.view,
        preset.env.adapter.form,
        str(preset.options.get("model", "station")),
        reward_scale=preset.wrapper.get("reward_scale", 1.0),
        **{"pressure_kpa": pressures_kpa(preset), **preset.options, **drawn, **how},
    )


SEED = 4_000_000
"""Seed of the first validation episode."""


class Point(NamedTuple):
    """A validation on the learning curve; errors over its episodes in the task's unit.

    Attributes:
        steps: control steps so far.
        wall_s: wall time so far, validations included (s).
        error: interquartile mean of the RMSE (mm or deg), of the phases that the suites' first
            measure of the task has: in rotation I and II.
        broken: how many episodes broke a physical limit; such a one has the error of the range.
        reward: mean reward of an episode.
        mean: mean of the RMSE of all episodes: one station that is lost shows here, not in `error`.
    """

    steps: int
    wall_s: float
    error: float
    broken: int
    reward: float
    mean: float


def measure_of(task: str) -> Measure:
    """The suites' first measure of a task; of an exercise all phases together."""
    named = task_of(task)
    if named.exercise is not None:
        return Measure(named.title, (task,), named.schedule.unit)
    return measures([task])[0]


def validate(
    model: Any,  # noqa: ANN401
    envs: "VecEnv",
    task: str,
    wall_s: float,
) -> Point:
    """Let a policy drive one episode in every environment, without exploring.

    Args:
        model: of Stable-Baselines3.
        envs: as `validation_environments` makes them.
        task: name of the task.
        wall_s: wall time so far (s).
    """
    envs.seed(SEED)
    observations: Any = envs.reset()
    measure = measure_of(task)
    errors = np.full(envs.num_envs, np.nan)
    rewards, broken = np.zeros(envs.num_envs), 0
    while np.isnan(errors).any():
        actions, _ = model.predict(observations, deterministic=True)
        observations, gained, over, infos = envs.step(actions)
        running = np.isnan(errors)
        rewards[running] += gained[running]
        for i in np.flatnonzero(over & running).tolist():
            failed = not infos[i]["TimeLimit.truncated"]
            broken += failed
            errors[i] = measure.of_row(_row(task, infos[i], failed))
    error, mean = float(interquartile_mean(errors)), float(errors.mean())
    return Point(model.num_timesteps, wall_s, error, broken, float(rewards.mean()), mean)


def _row(task: str, info: dict[str, Any], failed: bool) -> dict[str, Any]:
    """An episode's end as a row of a suite's journal."""
    schedule = task_of(task).schedule
    phases = () if failed else (phase.name for phase in schedule.phases)
    return {
        "task": task,
        "failure": "a limit" if failed else "",
        "phases": {name: {"rmse": info[f"rmse_{name}_{schedule.suffix}"]} for name in phases},
    }
