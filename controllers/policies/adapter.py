"""Connect a policy to a station: readings become entries, actions become volts."""

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from controllers.controller import Controller, Reference
from controllers.models.voltage import rest_voltage
from controllers.policies.action_mapping import HIGHEST_V, MIDDLE_V, ActionMapping
from controllers.policies.observation_spec import (
    ObservationSpec,
    ahead,
    clipped,
    environment_entries,
    start_entry,
    steps_of,
)
from controllers.policies.scales import scales_of
from controllers.registry import CONTROLLERS
from pma_gym.envs import Measurement, StationInfo

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
        action = self._before / MIDDLE_V - 1.0
        return clipped(
            environment_entries(
                self._table, self._readings, lambda k: self._references[step + k], action
            )
        )

    def volts(self, action: float) -> float:
        """Voltage (V) of an action; beyond -1 to 1 it is held there.

        Raises:
            ValueError: an action that is no number; the trial stays as it was.
        """
        if not math.isfinite(action):
            raise ValueError(DIVERGED.format("", action))
        held = min(max(action, -1.0), 1.0)
        wanted = self.form.wanted(held, self._before, self._voltage)
        self._before = min(max(wanted, 0.0), HIGHEST_V)
        if self.view.kind == "tracking":
            self._actions.appendleft(held)
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
