"""Interface of an environment for pictures.

Size of pictures.

An engine that records positions and voltages per step, for the pictures of a batch.
"""

from collections.abc import Mapping
from numbers import Integral
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pma_gym.engine.engine import Engine
from pma_gym.engine.options import Options
from pma_gym.tasks import Task
from pma_gym.units import SI_FACTORS


class Scene(Protocol):
    """State of an environment, during or after an episode, that a picture shows.

    Attributes:
        options: the environment's options.
        task: the task of the episode.
        truth: true contraction (m), rotation (rad), load (N) and pressure (Pa) by name.
        position: true position of the controlled quantity (m, rad or N m).
        error: true position minus reference, in the same unit.
        motor_voltage, regulator_voltage: commands at the station in the last step (V).
        time: time since the trial began (s).
        ended_by: name of the limit that terminated the episode; "" if none has.
    """

    options: Options

    @property
    def task(self) -> Task: ...  # noqa: D102

    @property
    def truth(self) -> Mapping[str, float]: ...  # noqa: D102

    @property
    def position(self) -> float: ...  # noqa: D102

    @property
    def error(self) -> float: ...  # noqa: D102

    @property
    def motor_voltage(self) -> float: ...  # noqa: D102

    @property
    def regulator_voltage(self) -> float: ...  # noqa: D102

    @property
    def time(self) -> float: ...  # noqa: D102

    @property
    def ended_by(self) -> str: ...  # noqa: D102


USUAL_WIDTH = 800
"""Usual width of a picture (pixels); every picture is half as high as wide."""

LEAST_WIDTH, MOST_WIDTH = 400, 3200


def check_render_width(width: object) -> int:
    """Check the width of pictures and return it.

    It must be a multiple of 4, so that the height is even, as H.264 videos need.

    Raises:
        ValueError: with the rule, the unit and the invalid value.
    """
    whole = isinstance(width, Integral) and not isinstance(width, bool)
    if not whole or not LEAST_WIDTH <= int(width) <= MOST_WIDTH or int(width) % 4:  # type: ignore[call-overload]
        raise ValueError(
            f"render_width must be a multiple of 4 in {LEAST_WIDTH}-{MOST_WIDTH} pixels (a picture "
            f"is half as high), got {width!r}; leave it out for {USUAL_WIDTH}"
        )
    return int(width)  # type: ignore[call-overload]


class History(NamedTuple):
    """Recorded course of an episode.

    Attributes:
        time: times of the positions since the trial began (s), shape (k,).
        position: true positions of the controlled quantity (m, rad or N m), shape (k,).
        voltages: voltage of the task's actuator in every control step (V), shape (steps,).
    """

    time: NDArray[np.float64]
    position: NDArray[np.float64]
    voltages: NDArray[np.float64]


class RecordingEngine(Engine):
    """An `Engine` that records position and voltage of every environment at every step.

    Only a batch that renders uses it; other batches have no extra cost.

    Args:
        arguments: as `Engine`.
    """

    def __init__(self, *arguments: Any) -> None:
        """Compile, and allocate arrays for whole episodes."""
        super().__init__(*arguments)
        schedule = self.task.schedule
        self._shown = f"{schedule.quantity}_{schedule.suffix}", SI_FACTORS[schedule.unit]
        # A batch may step an episode that has ended once more.
        steps = self.task.steps(self.options.control_rate_hz) + 2
        self._every = np.arange(self.count)
        self._positions = np.full((steps + 1, self.count), np.nan)
        self._voltages = np.full((steps, self.count), np.nan)

    def step(self) -> int:
        """Step as `Engine`, and record every environment."""
        self._follow()
        ended = super().step()
        counts = self._counts()
        self._positions[counts, self._every] = self._present()
        voltages = self.numbers(f"{self.task.actuator}_voltage")
        self._voltages[np.maximum(counts - 1, 0), self._every] = voltages
        return ended

    def _counts(self) -> NDArray[np.int64]:
        return np.minimum(self.counts(), len(self._voltages))

    def _present(self) -> NDArray[np.float64]:
        name, factor = self._shown
        return self.numbers(name) * factor

    def _follow(self) -> None:
        """Begin the courses anew of environments that are not where they were left.

        They were reset, or a state was put into them.
        """
        counts, present = self._counts(), self._present()
        moved = self._every[self._positions[counts, self._every] != present]
        if len(moved):
            self._positions[:, moved], self._voltages[:, moved] = np.nan, np.nan
            self._positions[counts[moved], moved] = present[moved]

    def history(self, index: int) -> History:
        """Return the course of an environment's episode at its control steps, NaN where unknown."""
        self._follow()
        count = min(self.steps(index), len(self._voltages))
        return History(
            np.arange(count + 1.0) * self.options.period,
            self._positions[: count + 1, index].copy(),
            self._voltages[:count, index].copy(),
        )
