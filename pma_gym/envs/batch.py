"""Checks of a batch's arguments, and its infos in Gymnasium's form.

Rewards from a user's Python function, called after every step.
"""

import math
import numbers
from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from pma_gym.engine.engine import Engine
from pma_gym.engine.option_checks import (
    RULE,
    Pressure,
    parse_pressure,
    parse_pressures,
    plain_scalar,
)
from pma_gym.plant.model import Model
from pma_gym.units import SI_FACTORS


def all_seeds(seed: int | Sequence[int | None] | None, count: int) -> list[int | None]:
    """Return one seed per environment, None for an environment that keeps its seed.

    Args:
        seed: seed of the first environment, with consecutive seeds for the others; or one each.
        count: number of environments.
    Raises:
        ValueError: with the rule and the invalid value.
    """
    if seed is None:
        return [None] * count
    rule = f"seed must be a whole number from 0 on, or one for each of the {count} environments"
    plain: Any = plain_scalar(seed)
    if _is_seed(plain):
        return [plain + i for i in range(count)]
    if not isinstance(plain, Sequence | np.ndarray) or isinstance(plain, str):
        raise ValueError(f"{rule}; got {seed!r}")
    if len(plain) != count:
        raise ValueError(f"{rule}; got {len(plain)}")
    seeds = [plain_scalar(one) for one in plain]
    for one in seeds:
        if one is not None and not _is_seed(one):
            raise ValueError(f"{rule}; got {one!r} among them")
    return seeds


def parse_seed(seed: object) -> int | None:
    """Check the seed of a single environment and return it as an int.

    Raises:
        ValueError: with the rule and the invalid value.
    """
    plain = plain_scalar(seed)
    if plain is not None and not _is_seed(plain):
        raise ValueError(f"seed must be a whole number from 0 on, or None, got {seed!r}")
    return plain


def _is_seed(value: object) -> TypeGuard[int]:
    return isinstance(value, Integral) and not isinstance(value, bool) and int(value) >= 0


def masked(mask: object, count: int) -> NDArray[np.int64]:
    """Check a reset mask and return the indices of its environments.

    Raises:
        ValueError: with the rule and the invalid value.
    """
    array = np.asarray(mask)
    if array.shape != (count,) or array.dtype != np.bool_ or not array.any():
        raise ValueError(
            f"reset_mask must be bool of shape ({count},) with at least one true, got "
            f"{array.dtype} of shape {array.shape}, {np.count_nonzero(array)} of them true"
        )
    return np.flatnonzero(array)


def requested_pressures(
    options: Mapping[str, Any], indices: NDArray[np.int64], count: int, model: Model
) -> list[Pressure] | None:
    """Return the pressures that a reset's options set, or None.

    Args:
        options: may contain `pressure_kpa` for all, or `pressures_kpa` for each environment.
        indices: the environments to reset.
        count: number of environments.
        model: the nominal model.
    Raises:
        ValueError: with the rule and the invalid value.
    """
    if "pressures_kpa" in options:
        if "pressure_kpa" in options:
            raise ValueError("give either pressure_kpa for all or pressures_kpa for each")
        pressures = parse_pressures(options["pressures_kpa"], count, model)
        return [pressures[i] for i in indices.tolist()]
    if "pressure_kpa" in options:
        return [parse_pressure(options["pressure_kpa"], model)] * len(indices)
    return None


def spread(
    columns: Mapping[str, NDArray[Any]], mask: NDArray[np.bool_], indices: NDArray[np.int64]
) -> dict[str, Any]:
    """Expand values of some environments to arrays over all, each with its mask.

    Args:
        columns: arrays by name, one value per environment in the mask.
        mask: bool, shape (num_envs,).
        indices: indices where the mask is true.
    """
    info: dict[str, Any] = {}
    for name, values in columns.items():
        info[name], info[f"_{name}"] = np.zeros(len(mask), values.dtype), mask.copy()
        info[name][indices] = values
    return info


class BatchActions:
    """Copy the actions of a batch to the engine, or reject invalid ones.

    Args:
        inputs: the engine's array of actions, shape (num_envs, entries of an action).

    Attributes:
        inputs: the same array.
    """

    def __init__(self, inputs: NDArray[Any]) -> None:
        self.inputs = inputs

    def take(self, actions: object, waiting: NDArray[np.int64] | None) -> None:
        """Copy actions to the engine; actions of ended episodes have no effect.

        Args:
            actions: shape (num_envs, entries of an action).
            waiting: indices of the environments whose episode has ended, None if none has.
        Raises:
            ValueError: actions of another shape or type; with the rule.
        """
        try:
            array = np.asarray(actions)
            if array.dtype.kind not in "fiu":
                raise TypeError
        except (TypeError, ValueError):
            raise ValueError(
                f"{self._rule}; got {type(actions).__name__} of no real numbers"
            ) from None
        if array.shape != self.inputs.shape:
            raise ValueError(f"{self._rule}; got shape {array.shape}")
        self.inputs[:] = array
        if waiting is not None:
            self.inputs[waiting] = 0.0

    def not_finite(self) -> ValueError:
        """Return the error for actions that are not finite."""
        row = int(np.flatnonzero(~np.isfinite(self.inputs).all(axis=1))[0])
        return ValueError(
            f"{self._rule}, all of them finite; environment {row} got "
            f"{self.inputs[row].tolist()}; look for a division by zero or a diverged policy"
        )

    @property
    def _rule(self) -> str:
        return (
            f"actions must have shape {self.inputs.shape}: one row an environment, each entry "
            "-1 to 1 for 0 to 10 V"
        )


class FunctionRewards:
    """Write the rewards of a user's function into an engine's array of rewards.

    The compiled step writes the action's change to this array (`ControlStepGraph.reward`). For
    every step that a terminated episode did not reach, its reward includes that of an error of the
    whole range, as with the named rewards.

    Args:
        engine: the engine; its options have the function.
    """

    def __init__(self, engine: Engine) -> None:
        task, options = engine.task, engine.options
        assert callable(options.reward)
        self._engine, self._reward, self._scale = engine, options.reward, options.reward_scale
        unit, quantity = task.schedule.suffix, task.schedule.quantity
        self._names = (f"error_{unit}", f"{quantity}_{unit}", f"reference_{unit}")
        self._span = task.schedule.span / SI_FACTORS[task.schedule.unit]

    def write(self, skipped: NDArray[np.int64] | Sequence[int] = ()) -> None:
        """Compute and write the rewards of the last step.

        Args:
            skipped: environments without a reward, because the step only began an episode.
        Raises:
            ValueError: the function returned no finite number.
        """
        engine = self._engine
        columns = [engine.numbers(name).tolist() for name in ("reward", *self._names)]
        ended, counts = engine.numbers("ended").tolist(), engine.counts().tolist()
        left_out = set(np.asarray(skipped, int).tolist())
        place, width = engine.state_layout.offsets["reward"], engine.width
        for i, (change, error, position, reference) in enumerate(zip(*columns, strict=True)):
            if i in left_out:
                continue
            missed = engine.horizon - counts[i] if ended[i] else 0
            value = self._of_step(change, error, position, reference, missed)
            engine.rewards[i] = engine.records[i // width, place, i % width] = value

    def _of_step(
        self, change: float, error: float, position: float, reference: float, missed: int
    ) -> float:
        value = self._call(100.0 * error / self._span, change, position, reference)
        if missed:
            value += missed * self._call(100.0, 0.0, reference + self._span, reference)
        return self._scale * value

    def _call(self, *step_numbers: float) -> float:
        value = self._reward(*step_numbers)
        is_number = isinstance(value, numbers.Real) and not isinstance(value, bool | np.bool_)
        if not is_number or not math.isfinite(value):
            error, change, position, reference = step_numbers
            raise ValueError(
                f"reward must be {RULE}; it returned {value!r} for error {error:g} %, change "
                f"{change:g}, position {position:g}, reference {reference:g}"
            )
        return float(value)
