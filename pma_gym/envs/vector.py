"""Many environments that step together, in SIMD lanes and threads."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from pma_gym.engine.engine import ActionError
from pma_gym.engine.observation import ObservationTable
from pma_gym.engine.option_checks import (
    Pressure,
    check_count,
    check_known,
    check_named,
    parse_pressures,
    plain_scalar,
)
from pma_gym.engine.options import EnvironmentOptions
from pma_gym.engine.snapshot import put, take
from pma_gym.envs.batch import BatchActions, FunctionRewards, all_seeds, masked, requested_pressures
from pma_gym.envs.kind import STATION
from pma_gym.envs.member import BatchMember
from pma_gym.envs.rendering.display import Display
from pma_gym.envs.rendering.scene import USUAL_WIDTH, RecordingEngine, check_render_width
from pma_gym.envs.setup import SINGLE, Copies, SeededByReset, Setup, own_seeds, setup
from pma_gym.envs.specs import completed_spec
from pma_gym.envs.state import EnvState, check_state, generator_at, generator_state
from pma_gym.envs.summary import last_infos
from pma_gym.tasks import Task

OWN = (
    *("num_envs", "task", "autoreset_mode", "threads", "precision", "pressures_kpa"),
    *("render_mode", "render_width"),
)
"""Keyword arguments of a batch in addition to the options."""


class PMAVectorEnv(
    Copies, SeededByReset, VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]
):
    """Run n `PMAEnv` in parallel, with the same actions, observations, rewards and ends.

    An environment gives the same bits as a single environment with the same seed, for every n and
    number of threads. `gym.make_vec(id, num_envs=n, vectorization_mode="vector_entry_point")` makes
    a batch.

    `info` is empty unless episodes end. Then it contains the last info of `PMAEnv` as arrays of
    shape (num_envs,), each with its mask `_name`; with SAME_STEP they are in `final_info`, beside
    `final_obs`. `station_info()` returns the values of any step.

    Args:
        num_envs: number of environments.
        task: name of a task, or a Task; as `PMAEnv`.
        autoreset_mode: NEXT_STEP (default), SAME_STEP or DISABLED (then `reset` takes the option
            `reset_mask`).
        threads: number of threads, at most one per block of environments: 8 with AVX-512, else 4
            (twice as many in single precision).
        precision: `double`, or `single`: faster, with errors of positions mostly below 2e-5 of
            their range, rarely 1e-3, where rounding decides when friction slips.
        pressures_kpa: pressure of each environment, instead of `pressure_kpa` for all.
        render_mode: None or `rgb_array`; a batch that renders records the course of every episode.
        render_width: width of the pictures (pixels), a multiple of 4; they are half as high.
        options: as `PMAEnv`; a `reward` that is a function is called once for each environment.

    Attributes:
        task: the Task; with `reference`, `member(index).task` is that of an episode.
        options: the checked Options.
        table: the ObservationTable.

    Example:
        >>> envs = PMAVectorEnv(4, "displacement", model="serres2008", pressures_kpa=[200, 300] * 2)
        >>> observations, _ = envs.reset(seed=1)
        >>> observations, rewards, *_ = envs.step(np.zeros((4, 1), np.float32))
        >>> observations.shape, rewards.shape
        ((4, 7), (4,))
    """

    metadata: dict[str, Any] = {
        "render_modes": ["rgb_array"],
        "render_fps": 100,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    _kind, _member_type = STATION, BatchMember

    def __init__(
        self,
        num_envs: int = 1,
        task: str | Task = "displacement",
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int = 1,
        precision: str = "double",
        pressures_kpa: Sequence[Pressure] | None = None,
        render_mode: str | None = None,
        render_width: int = USUAL_WIDTH,
        **options: Unpack[EnvironmentOptions],
    ) -> None:
        """Check the options and compile."""
        num_envs, threads = plain_scalar(num_envs), plain_scalar(threads)
        check_count("num_envs", num_envs, 1 << 24)
        check_count("threads", threads, 256)
        check_named("precision", precision, ("double", "single"))
        if not isinstance(autoreset_mode, AutoresetMode):
            check_named("autoreset_mode", autoreset_mode, [mode.value for mode in AutoresetMode])
        if render_mode is not None:
            check_named("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self.render_width = check_render_width(render_width)
        self.num_envs = num_envs = int(num_envs)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.options = self._kind.options(options, "PMAVectorEnv.__init__()", OWN)
        self.task = self._kind.task(task, self.options)
        self.metadata = self.metadata | {
            "render_fps": round(self.options.control_rate_hz),
            "autoreset_mode": self.autoreset_mode,
        }
        if pressures_kpa is not None:
            if "pressure_kpa" in options:
                raise ValueError("give either pressure_kpa for all or pressures_kpa for each")
            pressures_kpa = parse_pressures(pressures_kpa, num_envs, self.options.nominal)
        single = precision == "single"
        kind = self._kind.engine if render_mode is None else RecordingEngine
        self.engine = kind(self.task, self.options, num_envs, int(threads), single, pressures_kpa)
        self.single_observation_space = self.engine.table.space
        self._commands = self._kind.commands(self.options, self.task)
        self.single_action_space = self._commands.space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._all = np.arange(num_envs)
        self._seeds: tuple[int | None, ...] = (None,) * num_envs
        self._started = np.zeros(num_envs, np.bool_)
        self._ended = np.zeros(num_envs, np.bool_)
        # Which of them have ended, None if none has: looking through them takes a microsecond.
        self._waiting: NDArray[np.int64] | None = None
        self._idle = True
        self._attach()

    _ATTACHED = frozenset({"table", "_actions", "_advance", "_rewards", "_display"})

    def _attach(self) -> None:
        """Point into the engine."""
        self.table: ObservationTable = self.engine.table
        self._actions = BatchActions(self.engine.actions[: self.num_envs])
        self._advance = self._rewarded if callable(self.options.reward) else self.engine.step
        self._display = Display(self.task, self.render_width)
        if self.closed:
            self.engine.close()

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode in every environment.

        Args:
            seed: seed of the first environment, with consecutive seeds for the others; or one each.
            options: may contain, for these episodes, `pressure_kpa` (for all) or `pressures_kpa`
                (for each environment); and `reset_mask`, bool of shape (num_envs,): the
                environments to reset, while the others continue.
        Raises:
            TypeError: an unknown option.
            ValueError: a pressure out of range, or seeds, pressures or a mask of another length.
        """
        requested = dict(options or {})
        pressures = ["pressures_kpa"] if self._kind.reset_options else []
        known = [*self._kind.reset_options, *pressures, "reset_mask"]
        check_known("reset option", requested, known)
        indices = (
            masked(requested["reset_mask"], self.num_envs)
            if "reset_mask" in requested
            else self._all
        )
        pressures = requested_pressures(
            requested, indices, self.num_envs, self.engine.nominal_model
        )
        seeds = self._own_seeds(all_seeds(self._or_drawn(seed), self.num_envs), indices)
        # Should it fail on the way, these have no episode.
        self._started[indices], self._idle = False, True
        self.engine.seed(indices, seeds)
        self.engine.reset(indices, pressures)
        self._started[indices], self._ended[indices] = True, False
        self._idle = not self._started.all()
        self._waiting = np.flatnonzero(self._ended) if self._ended.any() else None
        return self.engine.observations.copy(), {}

    def _own_seeds(
        self, requested: Sequence[int | None], indices: NDArray[np.int64]
    ) -> list[int | None]:
        """Seeds for the engine, in the order of indices; `np_random` begins anew with the first."""
        super().reset(seed=requested[0])
        fresh = not any(seed is not None for seed in (*requested, *self._seeds))
        first = VectorEnv.np_random_seed.fget(self) if fresh else None  # type: ignore[attr-defined]
        seeds = own_seeds(requested, self._seeds, indices, first)
        known = list(self._seeds)
        for i, seed in zip(indices.tolist(), seeds, strict=True):
            known[i] = known[i] if seed is None else seed
        self._seeds = tuple(known)
        return seeds

    @property
    def np_random_seed(self) -> int | tuple[int | None, ...]:  # type: ignore[override]
        """Seed that repeats the last reset as `reset(seed=...)`.

        It is the first environment's seed if the others are consecutive, else all seeds.
        """
        first = self._seeds[0]
        if not any(seed is not None for seed in self._seeds):
            return super().np_random_seed  # type: ignore[return-value]
        if first is not None and self._seeds == tuple(range(first, first + self.num_envs)):
            return first
        return self._seeds

    def get_state(self) -> EnvState:
        """Return the state from which the environments continue with the same bits.

        It works before the first `reset` too.
        """
        return EnvState(
            self._setup,
            take(self.engine),
            self._started.tobytes(),
            self._ended.tobytes(),
            None,
            self._seeds,
            generator_state(self._np_random),
        )

    def set_state(self, state: EnvState) -> None:
        """Continue from a state of these environments or of ones with the same arguments.

        Args:
            state: result of `get_state`; or of `PMAEnv.get_state`, from which all environments then
                continue, for example to try several actions.
        Raises:
            TypeError: not a state.
            StateError: a damaged state, or one with another task, options or model, with the
                differences. The environments are unchanged then.
        """
        state = check_state(self._spread(state), self._setup, self.num_envs)
        put(self.engine, state.simulation)
        self._started = np.frombuffer(state.begun, np.bool_).copy()
        self._ended = np.frombuffer(state.ended, np.bool_).copy()
        self._idle = not self._started.all()
        self._waiting = np.flatnonzero(self._ended) if self._ended.any() else None
        self._seeds = state.seeds
        self._np_random = generator_at(state.generator, self._np_random)

    def _spread(self, state: EnvState) -> EnvState:
        """The state of a PMAEnv that was made as these as one of them all; others as they came."""
        if not isinstance(state, EnvState) or ("num_envs", SINGLE) not in state.setup:
            return state
        if state.setup != self._single_setup:
            return state
        return check_state(state, self._single_setup, 1).spread(self._setup, self.num_envs)

    @property
    def _single_setup(self) -> Setup:
        own = {name: text for name, text in self._setup if name != "autoreset_mode"}
        return tuple((own | {"num_envs": SINGLE}).items())

    def _made_as(self) -> Setup:
        precision = "single" if self.engine.kernel.single else "double"
        mode = self.autoreset_mode.value
        count = str(self.num_envs)
        return setup(self.engine, num_envs=count, precision=precision, autoreset_mode=mode)

    def step(
        self, actions: NDArray[np.floating]
    ) -> tuple[
        NDArray[np.float32],
        NDArray[np.float64],
        NDArray[np.bool_],
        NDArray[np.bool_],
        dict[str, Any],
    ]:
        """Apply actions for one control step and return the results.

        Args:
            actions: shape (num_envs, entries of an action).
        Raises:
            ValueError: actions of another shape, or not finite; the environments are unchanged
                then.
            gymnasium.error.ResetNeeded: `reset` was not called; or, without autoreset, an episode
                has ended.
        """
        waiting = self._waiting
        if self._idle or waiting is not None:
            self._require_episodes()
        self._actions.take(actions, waiting)
        engine = self.engine
        try:
            ended = self._advance()
        except ActionError:
            raise self._actions.not_finite() from None
        if waiting is not None:
            ended = self._begin_again(waiting)
        if ended:
            return self._last()
        flags = engine.terminated.copy(), engine.truncated.copy()
        return engine.observations.copy(), engine.rewards.copy(), *flags, {}

    @cached_property
    def _rewards(self) -> FunctionRewards:
        return FunctionRewards(self.engine)

    def _rewarded(self) -> int:
        """A step, and the rewards of a user's function."""
        ended = self.engine.step()
        self._rewards.write(() if self._waiting is None else self._waiting)
        return ended

    @property
    def spec(self) -> EnvSpec | None:
        """Gymnasium's spec with JSON arguments and the true number of steps."""
        return self.__dict__.get("spec")

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:  # type: ignore[override]
        if spec is not None:
            # Those are of single environments.
            spec = replace(spec, additional_wrappers=())
        self.__dict__["spec"] = completed_spec(spec, self.engine.horizon)

    def _require_episodes(self) -> None:
        if self._idle:
            late = np.flatnonzero(~self._started)
            which = "" if len(late) == self.num_envs else f" in environments {_few(late)}"
            raise gym.error.ResetNeeded(f"no episode has begun{which}: call reset() before step()")
        if self.autoreset_mode == AutoresetMode.DISABLED:
            raise gym.error.ResetNeeded(
                f"the episodes of environments {_few(np.flatnonzero(self._ended))} have ended and "
                'autoreset is disabled: call reset(options={"reset_mask": terminated | truncated})'
            )

    def _last(self) -> tuple[Any, ...]:
        """What a step in which episodes end returns."""
        engine = self.engine
        rewards = engine.rewards.copy()
        terminated, truncated = engine.terminated.copy(), engine.truncated.copy()
        over = terminated | truncated
        indices = np.flatnonzero(over)
        if self.autoreset_mode == AutoresetMode.SAME_STEP:
            info = self._final(over, indices)
            engine.reset(indices)
        else:
            info = last_infos(engine, over, indices)
            self._ended, self._waiting = over, indices
            # With autoreset they are stepped once more: from somewhere harmless.
            engine.park(np.flatnonzero(terminated))
        return engine.observations.copy(), rewards, terminated, truncated, info

    def _final(self, over: NDArray[np.bool_], indices: NDArray[np.int64]) -> dict[Any, Any]:
        """The info of episodes that end before the next ones begin in the same step."""
        final = np.full(self.num_envs, None, object)
        for i in indices.tolist():
            final[i] = self.engine.observations[i].copy()
        return {
            "final_obs": final,
            "_final_obs": over,
            "final_info": last_infos(self.engine, over, indices),
            "_final_info": over.copy(),
        }

    def _begin_again(self, indices: NDArray[np.int64]) -> int:
        """The step after an episode's end begins the next one, whatever the action.

        Returns:
            Whether any other episode ended in this step.
        """
        engine = self.engine
        engine.reset(indices)
        engine.rewards[indices] = 0.0
        engine.terminated[indices] = engine.truncated[indices] = False
        self._ended[:], self._waiting = False, None
        return int(engine.terminated.any() or engine.truncated.any())

    def station_info(self) -> dict[str, NDArray[Any]]:
        """Return the values of `PMAEnv`'s info in the last step, shape (num_envs,) each."""
        return {name: self.engine.numbers(name) for name in self.engine.state_layout.info}

    def measurements(self) -> NDArray[np.float64]:
        """Measurements that agents receive, `observation_delay_s` old (SI), shape (4, num_envs).

        The rows are extension (m), rotation (rad), load (N) and pressure (Pa), as in
        `PMAEnv.measurement`.
        """
        late = self.options.observation_delay
        parts = self.engine.state_layout.parts
        return np.stack([self.engine.numbers(f"{part}_{late}") for part in parts])

    @property
    def pressures(self) -> NDArray[np.float64]:
        """Gauge pressure at the start of every episode (Pa), shape (num_envs,)."""
        return self.engine.pressures.copy()

    def set_pressures(self, pressures: Mapping[int, Pressure]) -> None:
        """Begin later episodes at other pressures (kPa), by the index of the environment."""
        self.engine.set_pressures(pressures)
        # States are of environments with the same pressures.
        self._setup_of = None, ()

    def member(self, index: int) -> BatchMember:
        """Return a read-only view of one environment, with the attributes of a `PMAEnv`.

        Args:
            index: index of the environment, from 0; negative ones count from the end.
        Raises:
            IndexError: there is no such environment.
        """
        if not -self.num_envs <= index < self.num_envs:
            raise IndexError(
                f"there is no environment {index} in a batch of {self.num_envs}: numbers go from "
                f"{-self.num_envs} to {self.num_envs - 1}"
            )
        return self._member_type(self, index % self.num_envs)

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:  # type: ignore[override]
        """Return a picture of every station and of its trial so far, RGB.

        Returns:
            Shape (render_width / 2, render_width, 3) each.

        Raises:
            gymnasium.error.ResetNeeded: an environment has no episode yet.
        """
        if self.render_mode is None:
            gym.logger.warn(
                "render() draws nothing without a render mode; make the environments with "
                'render_mode="rgb_array"'
            )
            return None
        return tuple(self.member(i).picture() for i in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Free the picture and stop the threads."""
        # Gymnasium 1.1 closes a batch whose options were refused too.
        if hasattr(self, "engine"):
            self._display.close()
            self.engine.close()


def _few(indices: NDArray[np.int64]) -> str:
    """Numbers of environments, the first five of them."""
    return f"{indices[:5].tolist()}" + (" and others" if len(indices) > 5 else "")
