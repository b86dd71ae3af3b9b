"""Environments of any rig: `RigEnv` and `RigVectorEnv`."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from pma_gym.data.signals import Signal
from pma_gym.engine.option_checks import check_keywords
from pma_gym.engine.rig.engine import RigCommands, RigEngine
from pma_gym.engine.rig.layout import key
from pma_gym.engine.rig.options import RigOptions, parse_rig_options, parse_rig_task
from pma_gym.envs.episode import Episode
from pma_gym.envs.kind import Kind
from pma_gym.envs.member import BatchMember
from pma_gym.envs.pma_env import PMAEnv
from pma_gym.envs.rendering.scene import USUAL_WIDTH
from pma_gym.envs.vector import PMAVectorEnv
from pma_gym.plant.commands import Command
from pma_gym.plant.model import Model
from pma_gym.tasks import REWARDS, Task

OWN = ("task", "goal", "render_mode", "render_width")
"""Keyword arguments of an environment in addition to the options."""

RIG = Kind(parse_rig_options, parse_rig_task, RigEngine, lambda options, _: RigCommands(options))


@dataclass(frozen=True)
class RigInfo:
    """Data of the rig that a controller receives before a trial, in copies.

    Attributes:
        model: the nominal model, also if every reset draws another plant.
        task: the task, with its schedule.
        signals: names of what its sensors measure.
        commands: the rig's commands with their limits.
        rest: commands (SI) with which an episode begins at rest.
        period: duration of a control step (s).
        action_delay: delay of a command to the rig (s), whole periods.
        observation_delay: age of a measurement when the controller receives it (s).
    """

    model: Model
    task: Task
    signals: list[str]
    commands: list[Command]
    rest: list[float]
    period: float
    action_delay: float = 0.0
    observation_delay: float = 0.0


class RigEpisode(Episode):
    """Read-only view of an episode of any rig; replaces what `Episode` has of a station."""

    _kind = RIG
    _commands: RigCommands
    options: RigOptions  # type: ignore[assignment]

    def _wanted_pressure(self, options: Mapping[str, Any]) -> Any:  # noqa: ANN401
        if options:
            raise TypeError(f"a rig's reset has no options, got {', '.join(options)}")
        return self.options.pressure_kpa

    @property
    def measurement(self) -> dict[str, float]:  # type: ignore[override]
        """The measurement that the agent receives (SI), by signal."""
        values = self._row[self._measured].tolist()
        return dict(zip((s.name for s in self.options.signals), values, strict=True))

    @property
    def truth(self) -> dict[str, float]:
        """True values of the signals (SI)."""
        return {each.name: self._number(f"true_{each.name}") for each in self.options.outputs}

    @property
    def position(self) -> float:
        """True value of the task's signal (SI)."""
        return self.truth[self.task.schedule.quantity]

    @property
    def station(self) -> RigInfo:  # type: ignore[override]
        """Data of the rig for controllers, in copies."""
        options, rest = self.options, self.options.resting()
        return RigInfo(
            copy.copy(options.nominal),
            self._detached_task,
            [signal.name for signal in options.signals],
            options.commands,
            [c.gain * rest[c.place] + c.offset for c in options.commands],
            options.period,
            options.action_delay * options.period,
            options.observation_delay * options.period,
        )

    def action(self, *commands: float) -> NDArray[np.float64]:  # type: ignore[override]
        """Return the action for commands (SI), within their limits."""
        return self._commands.action_of(commands)

    @property
    def commanded(self) -> dict[Signal, float]:
        """Commands of the last step (SI), by signal."""
        signals = [command.signal for command in self.options.commands]
        return {signal: self._number(key(signal)) for signal in signals}


class RigEnv(RigEpisode, PMAEnv):  # type: ignore[misc]
    """Follow a reference with any rig of a model: a slide, a joint, a station, your own.

    At every control step kT the agent gives the rig's commands, which are constant until (k+1)T.
    An episode begins as the model says: where its start is, or at rest under the commands `rest`.

    ## Action
    A Box of one entry for each command of the rig, -1 to 1 for its limits: those of a drive's
    or regulator's line for 0 to 10 V; a drive that takes a torque or a voltage of either sign needs
    the option `limits`.

    ## Observation
    A float32 Box, each entry clipped to -5 to 5: the rig's sensors with their noise, quantisation
    and delays, the reference, the reference less the measurement, `preview` references ahead, the
    last action, `history` earlier measurements. `table.describe()` prints it with scales. With
    `goal` a dictionary of `observation`, `achieved_goal` and `desired_goal`, for hindsight replay
    (`compute_reward`).

    ## Tasks
    A reference for any signal that a sensor of the model measures: `SIGNAL_steps`, `_ramps`,
    `_sine`, `_multisine` (`angle_steps`, `contraction_ramps_3` of seed 3, `angle_sine_2hz`), or a
    Task of `pma_gym.tasks.tracking`. `reference` draws another one at every reset, as in `PMAEnv`.

    ## Reward, info
    The rewards of `PMAEnv`, of the true error in percent of `span`. The info is in SI:
    `time_s`; true and measured signals, such as `angle_rad` and `measured_angle_rad`;
    `reference_rad` and `error_rad`; commands, such as `torque_command_n_m`; `push_force`. The last
    one has the scores `rmse_rad`, `rmse_whole_rad` and `percent_of_range`.

    ## Termination and truncation
    `terminated` beyond `bounds` of a signal; `truncated` at the end of the task.

    Args:
        task: name of a task, or a Task; steps of the first signal if not given.
        goal: whether observations are dictionaries with goals.
        render_mode: as of `PMAEnv`.
        render_width: as of `PMAEnv`.
        options: keyword arguments, see `RigOptions` and `Options`.

    Example:
        >>> env = RigEnv("contraction_sine", model="station", rest={"pressure_command": 300e3})
        >>> observation, info = env.reset(seed=1)
        >>> observation, reward, *_, info = env.step(env.action(50.0, 300e3))
        >>> round(info["load_command_n"]), round(info["pressure_command_pa"])
        (50, 300000)
    """

    def __init__(
        self,
        task: str | Task | None = None,
        goal: bool = False,
        render_mode: str | None = None,
        render_width: int = USUAL_WIDTH,
        **options: Any,
    ) -> None:
        """Check the options and compile the rig."""
        self.goal = goal
        check_keywords("RigEnv.__init__()", options, RigOptions.names(), OWN)
        super().__init__(task, render_mode, render_width, **options)  # type: ignore[arg-type]
        if goal:
            box = spaces.Box(-np.inf, np.inf, (1,), np.float64)
            goals = {"achieved_goal": box, "desired_goal": copy.deepcopy(box)}
            both = spaces.Dict({"observation": self.observation_space, **goals})
            self.observation_space = both  # type: ignore[assignment]

    _ATTACHED = PMAEnv._ATTACHED | {"compute_reward"}

    def _attach(self) -> None:
        super()._attach()
        if self.goal:
            # Libraries take an environment with such a method for one of goals.
            self.compute_reward, made = self._reward_of_goals, self._made
            self._made = lambda action: self._with_goal(made(action))
            self._wait(self._idle)

    def _with_goal(self, made: Any) -> Any:  # noqa: ANN401
        if type(made) is not tuple:
            return made
        observation, reward, terminated, *rest = made
        goals = self._goals(observation)
        if not terminated:
            # To the last bit what hindsight replay computes.
            pair = goals["achieved_goal"], goals["desired_goal"]
            reward = float(self._reward_of_goals(*pair, rest[-1]))
        return goals, reward, terminated, *rest

    def _goals(self, observation: NDArray[np.float32]) -> Any:  # noqa: ANN401
        unit = self.task.schedule.suffix
        numbers = self.position, self._number(f"reference_{unit}")
        achieved, desired = (np.array([number]) for number in numbers)
        return {"observation": observation, "achieved_goal": achieved, "desired_goal": desired}

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin a trial: draw the rig, its load and the reference, and settle."""
        observation, info = super().reset(seed=seed, options=options)
        return (self._goals(observation) if self.goal else observation), info

    def _last(self, terminated: bool) -> Any:  # noqa: ANN401
        made = super()._last(terminated)
        return self._with_goal(made) if self.goal else made

    def _reward_of_goals(self, achieved_goal: Any, desired_goal: Any, info: Any) -> Any:  # noqa: ANN401
        """Reward of achieving one value while another was desired (SI), without a change of action.

        Raises:
            ValueError: the reward is a function of more than these.
        """
        reward = self.options.reward
        if not isinstance(reward, str):
            raise ValueError("compute_reward needs a named reward, which goals alone decide")
        error = np.asarray(achieved_goal)[..., 0] - np.asarray(desired_goal)[..., 0]
        return self.options.reward_scale * REWARDS[reward](self.task.error_percent(error), 0.0)


class RigMember(RigEpisode, BatchMember):  # type: ignore[misc]
    """View of one environment of a `RigVectorEnv`."""

    def picture(self) -> NDArray[np.uint8]:
        """Raise an error, because a batch of rigs keeps no courses.

        Raises:
            gymnasium.error.UnsupportedMode: always.
        """
        raise gym.error.UnsupportedMode("a batch of rigs has no pictures; make one with gym.make")


class RigVectorEnv(PMAVectorEnv):
    """Run n `RigEnv` in parallel, with the same bits; see `PMAVectorEnv` for modes and threads.

    Args:
        num_envs: number of environments.
        task: as of `RigEnv`.
        autoreset_mode: as of `PMAVectorEnv`.
        threads: as of `PMAVectorEnv`.
        precision: as of `PMAVectorEnv`.
        options: as of `RigEnv`.
    """

    _kind, _member_type = RIG, RigMember
    metadata: dict[str, Any] = {
        "render_modes": [],
        "render_fps": 100,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        task: str | Task | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int = 1,
        precision: str = "double",
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        """Check the options and compile."""
        if "goal" in options:
            raise ValueError(
                "a batch has no goal observations: make single environments, as with "
                'vectorization_mode="sync", and leave goal out here'
            )
        check_keywords("RigVectorEnv.__init__()", options, RigOptions.names(), OWN)
        given: Any = (num_envs, task, autoreset_mode, threads, precision, None, render_mode)
        super().__init__(*given, **options)
