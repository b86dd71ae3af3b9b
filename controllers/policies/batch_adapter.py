"""Many policy adapters side by side: the entries and voltages of `PolicyAdapter`, in arrays."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from controllers.models.voltage import rest_voltage
from controllers.policies.action_mapping import HIGHEST_V, MIDDLE_V, ActionMapping
from controllers.policies.adapter import DIVERGED, base_of
from controllers.policies.observation_spec import (
    ObservationSpec,
    ahead,
    clipped,
    start_entry,
    steps_of,
)
from controllers.policies.scales import scales_of
from pma_gym.envs import Measurement, StationInfo


class BatchPolicyAdapter:
    """Trials of one task and loop, each at its own pressure and at its own time.

    What becomes of a trial is bit for bit what `PolicyAdapter` makes of it.

    Args:
        count: how many.
        view: what the policy sees; `tracking`.
        form: what its action does.
        station: the station, as controllers know it, at a pressure (Pa).
    """

    def __init__(
        self,
        count: int,
        view: ObservationSpec,
        form: ActionMapping,
        station: Callable[[float], StationInfo],
    ) -> None:
        if view.kind != "tracking":
            raise ValueError(
                f"many pilots need a tracking view, got {view.kind!r}: a batch of environments "
                "gives the environment's own observation itself"
            )
        self.count, self.view, self.form, self._station = count, view, form, station
        lowest = station(station(0.0).task.lowest_pressure)
        self._task, self._period = lowest.task, lowest.period
        self._scales = scales_of(lowest)
        self._references = steps_of(lowest.task.schedule.at, lowest, view.preview)
        self._ahead = ahead(self._references, view.preview, self._scales)
        self._late = round(lowest.observation_delay / lowest.period)
        self._last = len(self._ahead) - 1
        self._bases = [base_of(form) for _ in range(count)] if form.base else []
        self.steps = np.zeros(count, np.int64)
        self._start = np.zeros(count)
        self._delayed = np.zeros((count, view.history + 1, 4))
        self._actions = np.zeros((count, view.history))
        self._volts = np.zeros((count, self._scales.delay + 1))
        self._base_volts = np.zeros(count)

    @property
    def entries(self) -> int:
        """How many entries a policy is given."""
        own = 3 if self._bases else 2
        return self._ahead.shape[1] + self._delayed[0].size + self.view.history + own

    def begin(self, which: NDArray[np.int64], pressures: NDArray[np.float64]) -> None:
        """Begin trials anew; `update` fills their memory.

        Args:
            which: numbers of the trials, shape (m,).
            pressures: that they begin at (Pa), shape (m,).
        """
        self.steps[which], self._start[which], self._actions[which] = 0, pressures, 0.0
        for i, pressure in zip(which.tolist(), pressures.tolist(), strict=True):
            station = self._station(pressure)
            self._volts[i] = rest_voltage(station)
            if self._bases:
                self._bases[i].reset(self._task.schedule.at, station)

    def update(
        self, readings: NDArray[np.float64], which: NDArray[np.int64] | None = None
    ) -> NDArray[np.float32]:
        """Entries of a control step, shape (count, entries) or (m, entries).

        Args:
            readings: extension (m), rotation (rad), load (N), pressure (Pa), shape (4, count).
            which: numbers of trials that have just begun; all, as they go on, if not given.
        """
        at = slice(None) if which is None else which
        steps, start, volts = self.steps[at], self._start[at], self._volts[at]
        reference = self._references[np.maximum(steps - self._late, 0)]
        measured = np.stack(
            self._scales.entries(readings[:, at], reference, start, volts[:, -1]), axis=1
        )
        if which is None:
            self._delayed[:, 1:] = self._delayed[:, :-1]
            self._delayed[:, 0] = measured
        else:
            self._delayed[at] = measured[:, None]
        self._ask_bases(readings, which)
        rows = self._ahead[np.minimum(steps, self._last)]
        parts = [
            rows[:, :1],
            start_entry(start)[:, None],
            rows[:, 1:],
            self._delayed[at].reshape(len(steps), -1),
            self._actions[at],
            (volts[:, :1] - MIDDLE_V) / MIDDLE_V,
        ]
        if self._bases:
            parts.append((self._base_volts[at] - volts[:, 0])[:, None])
        return clipped(np.concatenate(parts, axis=1))

    def _ask_bases(self, readings: NDArray[np.float64], which: NDArray[np.int64] | None) -> None:
        """Let the controllers that residuals are added to say what they would do."""
        if not self._bases:
            return
        for i in range(self.count) if which is None else which.tolist():
            now = int(self.steps[i]) * self._period
            taken = max(int(self.steps[i]) - self._late, 0) * self._period
            reading = Measurement(taken, *readings[:, i].tolist())
            self._base_volts[i] = self._bases[i].act(reading, now)

    def volts(self, actions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Voltages (V) of actions, shape (count,) both; beyond -1 to 1 they are held there.

        Raises:
            ValueError: an action that is no number; the trials stay as they were.
        """
        finite = np.isfinite(actions)
        if not finite.all():
            first = int(np.argmin(finite))
            raise ValueError(DIVERGED.format(f" that of trial {first}", actions[first]))
        held = np.clip(actions, -1.0, 1.0)
        wanted = self.form.wanted(held, self._volts[:, 0], self._base_volts)
        if self.view.history:
            self._actions[:, 1:] = self._actions[:, :-1]
            self._actions[:, 0] = held
        self._volts[:, 1:] = self._volts[:, :-1]
        self._volts[:, 0] = np.clip(wanted, 0.0, HIGHEST_V)
        self.steps += 1
        return self._volts[:, 0].copy()
