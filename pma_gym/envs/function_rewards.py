"""Rewards from a user's Python function, called after every step."""

import math
import numbers
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.engine.engine import Engine
from pma_gym.engine.reward_function import RULE
from pma_gym.units import SI_FACTORS


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

    def _call(self, *given: float) -> float:
        value = self._reward(*given)
        is_number = isinstance(value, numbers.Real) and not isinstance(value, bool | np.bool_)
        if not is_number or not math.isfinite(value):
            error, change, position, reference = given
            raise ValueError(
                f"reward must be {RULE}; it returned {value!r} for error {error:g} %, change "
                f"{change:g}, position {position:g}, reference {reference:g}"
            )
        return float(value)
