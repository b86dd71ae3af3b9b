"""Read access to one environment of a batch, as if it were a single environment."""

import copy
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn, Protocol, Self

import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from pma_gym.engine.actions import CommandLine
from pma_gym.engine.engine import Engine
from pma_gym.engine.observation import ObservationTable
from pma_gym.engine.option_checks import Pressure, check_known
from pma_gym.engine.options import Options
from pma_gym.envs.episode import NOT_BEGUN
from pma_gym.envs.pma_env import PMAEnv
from pma_gym.envs.rendering.display import Display
from pma_gym.envs.rendering.scene import History, RecordingEngine
from pma_gym.envs.summary import step_info
from pma_gym.plant.plant import Plant
from pma_gym.tasks import Task

TOGETHER = "the environments of a batch share one engine"


class Batch(Protocol):
    """Interface of a batch for the view of one environment; see `PMAVectorEnv`."""

    engine: Engine
    num_envs: int
    options: Options
    task: Task
    table: ObservationTable
    render_mode: str | None
    metadata: dict[str, Any]
    # In quotes: Gymnasium 1.1's Box takes no type.
    single_observation_space: "spaces.Box[Any]"
    single_action_space: "spaces.Box[Any]"
    _commands: CommandLine
    _started: NDArray[np.bool_]
    _ended: NDArray[np.bool_]

    @property
    def spec(self) -> EnvSpec | None:
        """Gymnasium's spec of the batch."""
        ...

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Reset every environment, or those of `reset_mask`."""
        ...

    _display: Display


class BatchMember(PMAEnv):
    """View of one environment of a `PMAVectorEnv`, with all readable attributes of a `PMAEnv`.

    The view shows the batch's present episode. `reset` resets only this environment. There is no
    `step`, because the environments of a batch step together, and attributes cannot be set.

    Args:
        batch: the batch.
        index: index of the environment, from 0.
    """

    _batch: Batch

    def __init__(self, batch: Batch, index: int) -> None:
        """Find the environment's data in the batch."""
        engine = batch.engine
        block, lane = divmod(index, engine.width)
        # A view takes no attributes, see `__setattr__`.
        values = {
            "_batch": batch,
            "_engine": engine,
            "_index": index,
            "_row": engine.records[block, :, lane],
            "_commands": batch._commands,
            "render_mode": batch.render_mode,
            "spec": batch.spec,
            "metadata": {k: v for k, v in batch.metadata.items() if k != "autoreset_mode"},
            "options": batch.options,
            "nominal_plant": engine.nominal,
            "table": batch.table,
            "observation_space": batch.single_observation_space,
            "action_space": batch.single_action_space,
        }
        self.__dict__.update(values)
        self._find_offsets()

    @property
    def pressure_kpa(self) -> Pressure:
        """The option `pressure_kpa` of the later episodes."""
        return self._engine.wanted[self._index]

    @property
    def index(self) -> int:
        """Index of the environment in the batch."""
        return self._index

    def __setattr__(self, name: str, value: object) -> None:
        """Set an attribute of the class; reject any other."""
        if name not in _OWN:
            raise AttributeError(refusal(name))
        super().__setattr__(name, value)

    def set_wrapper_attr(self, name: str, value: object, *, force: bool = True) -> NoReturn:
        """Raise an error, because attributes cannot be set."""
        raise AttributeError(refusal(name))

    @property
    def _idle(self) -> str | None:  # type: ignore[override]
        """Why there is no episode to go on with; None if there is one."""
        if not self._batch._started[self._index]:
            return NOT_BEGUN
        return "the episode ended" if self._batch._ended[self._index] else None

    @property
    def ended_by(self) -> str:  # type: ignore[override]
        """Name of the limit that terminated the episode, or ""."""
        return self._engine.limit_in_words(self._index, self._number("ended"))

    @property
    def plant(self) -> Plant:  # type: ignore[override]
        """The Plant of this episode; differs from the nominal one with `randomisation`."""
        return self._episode_plant()

    def station_info(self) -> dict[str, Any]:
        """The values of `PMAEnv`'s info in the last step or reset."""
        return step_info(self._engine, self._index)

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Reset this environment; the others continue. See `PMAEnv.reset`."""
        check_known("reset option", options or {}, self._kind.reset_options)
        mask = np.arange(self._batch.num_envs) == self._index
        seeds = [seed if mine else None for mine in mask.tolist()]
        observations, _ = self._batch.reset(
            seed=seeds, options={**(options or {}), "reset_mask": mask}
        )
        return observations[self._index].copy(), self.station_info()

    def step(self, action: object) -> NoReturn:
        """Raise an error, because the environments of a batch step together.

        Raises:
            RuntimeError: always.
        """
        raise RuntimeError(f"{TOGETHER} and step together; call step() of the batch")

    def get_state(self) -> NoReturn:
        """Raise an error, because the batch has the state.

        Raises:
            RuntimeError: always.
        """
        raise RuntimeError(f"{TOGETHER}; take the state of the whole batch, by its get_state()")

    def set_state(self, state: object) -> NoReturn:
        """Raise an error, because the batch has the state.

        Raises:
            RuntimeError: always.
        """
        raise RuntimeError(f"{TOGETHER}; put a state into the whole batch, by its set_state()")

    def __copy__(self) -> Self:
        """Return another view of the same environment."""
        return type(self)(self._batch, self._index)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return a view of the same environment in a copy of the batch."""
        return type(self)(copy.deepcopy(self._batch, memo), self._index)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the batch and the index."""
        return type(self), (self._batch, self._index)

    def action(self, voltage: float, regulator_voltage: float | None = None) -> NDArray[np.float64]:
        """Return the action for given voltages (V), see `PMAEnv.action`."""
        self._commands.begin(self._number("rest_regulator"))
        return super().action(voltage, regulator_voltage)

    @property
    def voltages(self) -> NDArray[np.float64]:
        """Voltage of the task's actuator in every step so far (V); only in a batch that renders."""
        return self._history().voltages

    def trajectory(self) -> NoReturn:
        """Raise an error, because a batch does not keep trajectories.

        Raises:
            AttributeError: always.
        """
        raise AttributeError(
            "a batch keeps no trajectory at 384 Hz; step a single PMAEnv with the same seed and "
            "actions, which has the same episode"
        )

    def _history(self) -> History:
        if not isinstance(self._engine, RecordingEngine):
            raise AttributeError(
                "a batch keeps the voltages of its episodes only when it renders; make it with "
                'render_mode="rgb_array"'
            )
        return self._engine.history(self._index)

    @property
    def _display(self) -> Display:  # type: ignore[override]
        return self._batch._display

    def close(self) -> None:
        """Do nothing, because the batch owns the picture and the threads."""


_OWN = ("_offsets", "_datum", "_measured", "_np_random", "_np_random_seed")


def refusal(name: str) -> str:
    """Message on an attribute of a batch's environment that cannot be set, with the fix."""
    return (
        f"attribute {name!r} cannot be set: {TOGETHER}, and have no attributes of their own; give "
        "options, a task or a load when the environments are made, and pressure_kpa by set_attr() "
        "of the VecEnv for all later episodes or by set_options() for the next reset()"
    )
