"""Connect a policy to a station: readings become entries, actions become volts.

How a policy's action becomes a voltage: as it is, as a change, or added to a controller's.

Many policy adapters side by side: the entries and voltages of `PolicyAdapter`, in arrays.
"""

import math
import reprlib
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from controllers.models.voltage import rest_voltage
from controllers.policies.observation_spec import (
    ObservationSpec,
    ahead,
    clipped,
    environment_entries,
    scales_of,
    start_entry,
    steps_of,
)
from controllers.registry import CONTROLLERS, Controller, Reference
from pma_gym.envs import Measurement, StationInfo

FormKind = Literal["direct", "increment", "residual"]
FORM_KINDS: tuple[FormKind, ...] = ("direct", "increment", "residual")

MIDDLE_V, HIGHEST_V = 5.0, 10.0
"""Middle and upper end of an actuator's voltages (V)."""


@dataclass(frozen=True)
class ActionMapping:
    """What an action of -1 to 1 does to the voltage, which is held to 0-10 V.

        direct     V = 5 + 5 a
        increment  V = V_before + authority a
        residual   V = V_base + authority a

    An increment makes the policy's memory: integral action needs nothing else.

    Args:
        kind: one of these.
        authority_v: voltage of an action of 1 (V); 5 where it is direct.
        base: name of the controller that a residual is added to; none for the others.
    """

    kind: FormKind = "increment"
    authority_v: float = 0.5
    base: str | None = None

    def __post_init__(self) -> None:
        if self.kind not in FORM_KINDS:
            raise ValueError(f"form kind must be one of {', '.join(FORM_KINDS)}, got {self.kind!r}")
        authority = self.authority_v
        real = isinstance(authority, int | float) and not isinstance(authority, bool)
        if not real or not 0.0 < authority <= HIGHEST_V:
            raise ValueError(
                f"form authority_v must be a number above 0, up to {HIGHEST_V:g} V, "
                f"got {authority!r}"
            )
        if self.kind == "direct" and authority != MIDDLE_V:
            raise ValueError(f"a direct form has authority_v {MIDDLE_V:g}, got {authority:g} V")
        named = isinstance(self.base, str) and bool(self.base.strip())
        if not (named if self.kind == "residual" else self.base is None):
            raise ValueError(
                "a residual names its base, a text, the other forms have none; got kind "
                f"{self.kind!r} with base {reprlib.repr(self.base)}"
            )

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> "ActionMapping":
        """An action mapping from JSON.

        Raises:
            ValueError: a key that is unknown or missing, or a value out of range.
        """
        strange = sorted(set(document) ^ {"kind", "authority_v", "base"})
        if strange:
            raise ValueError(f"a form has kind, authority_v and base; check {', '.join(strange)}")
        return cls(**document)

    def to_json(self) -> dict[str, Any]:
        """The mapping as JSON."""
        return asdict(self)

    def unclipped_voltage(self, action: Any, before: Any, base: Any) -> Any:  # noqa: ANN401
        """Voltage that an action asks for (V), not yet held to 0-10 V; of numbers or arrays.

        Args:
            action: -1 to 1.
            before: voltage commanded last (V).
            base: the base's (V), if there is one.
        """
        if self.kind == "direct":
            return MIDDLE_V + MIDDLE_V * action
        return (before if self.kind == "increment" else base) + self.authority_v * action


DIVERGED = (
    "the policy's action must be a finite number,{} got {}; its weights have diverged: train it "
    "with a lower learning rate, or take another policy"
)
"""What is said of an action that is no number: which of many, and the action."""


class PolicyAdapter:
    """Compute a policy's observations and voltages in one trial.

    `update` comes first in every control step, then `volts`.

    Args:
        view: what the policy sees.
        form: what its action does.
        base: controller that a residual is added to; made from `form.base` if not given.
    """

    def __init__(
        self, view: ObservationSpec, form: ActionMapping, base: Controller | None = None
    ) -> None:
        self.view, self.form = view, form
        self.base = base_of(form) if base is None and form.base else base

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Prepare for a trial.

        Raises:
            ValueError: a station that the view or the base is not made for.
        """
        self._station, self._start = station, station.pressure
        self._period = station.period
        references = steps_of(reference, station, self.view.preview)
        self._references: list[float] = references.tolist()
        self._last = len(references) - 1 - self.view.preview
        self._before = rest_voltage(station)
        self._late = round(station.observation_delay / station.period)
        if self.view.kind == "tracking":
            self._scales = scales_of(station)
            rows = ahead(references, self.view.preview, self._scales)
            self._ahead: list[list[float]] = rows.tolist()
            self._delayed: deque[tuple[float, ...]] = deque(maxlen=self.view.history + 1)
            self._volts = deque([self._before] * (self._scales.delay + 1))
            self._actions = deque([0.0] * self.view.history, maxlen=self.view.history)
        else:
            self._table = self.view.table(station)
            self._readings: deque[Measurement] = deque(maxlen=self.view.history + 1)
        if self.base is not None:
            self.base.reset(reference, station)

    def update(self, reading: Measurement, time: float) -> NDArray[np.float32]:
        """The entries of a control step, shape (entries,).

        Args:
            reading: what the sensors say.
            time: since the trial began (s).
        Raises:
            ValueError: a reading that is no number; the trial stays as it was.
        """
        # A sum of numbers is a number: one question instead of five.
        if not math.isfinite(sum(reading)):
            raise ValueError(_no_number(reading, time))
        step = min(round(time / self._period), self._last)
        self._voltage = 0.0 if self.base is None else self.base.act(reading, time)
        if self.view.kind == "environment":
            return self._environment(reading, step)
        reference = self._references[max(step - self._late, 0)]
        measured = self._scales.entries(reading[1:], reference, self._start, self._volts[0])
        memory = self._delayed
        memory.appendleft(measured)
        while len(memory) < self.view.history + 1:
            memory.append(measured)
        entries = [self._ahead[step][0], start_entry(self._start), *self._ahead[step][1:]]
        for four in memory:
            entries += four
        entries += self._actions
        entries.append((self._before - MIDDLE_V) / MIDDLE_V)
        if self.base is not None:
            entries.append(self._voltage - self._before)
        return clipped(entries)

    def _environment(self, reading: Measurement, step: int) -> NDArray[np.float32]:
        self._readings.appendleft(reading)
        return clipped(
            environment_entries(
                self._table,
                self._readings,
                lambda k: self._references[step + k],
                self._before / MIDDLE_V - 1.0,
            )
        )

    def volts(self, action: float) -> float:
        """Voltage (V) of an action; beyond -1 to 1 it is held there.

        Raises:
            ValueError: an action that is no number; the trial stays as it was.
        """
        if not math.isfinite(action):
            raise ValueError(DIVERGED.format("", action))
        clipped = min(max(action, -1.0), 1.0)
        unclipped = self.form.unclipped_voltage(clipped, self._before, self._voltage)
        self._before = min(max(unclipped, 0.0), HIGHEST_V)
        if self.view.kind == "tracking":
            self._actions.appendleft(clipped)
            self._volts.append(self._before)
            self._volts.popleft()
        return self._before


def _no_number(reading: Measurement, time: float) -> str:
    bad = [f"{k} is {v}" for k, v in reading._asdict().items() if not math.isfinite(v)]
    return f"every reading must be a number, at {time:g} s {', '.join(bad)}; check the sensor"


def base_of(form: ActionMapping) -> Controller:
    """A new controller that a residual is added to.

    Raises:
        ValueError: no such controller.
    """
    if form.base is None or form.base not in CONTROLLERS:
        raise ValueError(f"form base must be one of {', '.join(CONTROLLERS)}, got {form.base!r}")
    return CONTROLLERS[form.base]()


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
        clipped = np.clip(actions, -1.0, 1.0)
        unclipped = self.form.unclipped_voltage(clipped, self._volts[:, 0], self._base_volts)
        if self.view.history:
            self._actions[:, 1:] = self._actions[:, :-1]
            self._actions[:, 0] = clipped
        self._volts[:, 1:] = self._volts[:, :-1]
        self._volts[:, 0] = np.clip(unclipped, 0.0, HIGHEST_V)
        self.steps += 1
        return self._volts[:, 0].copy()
