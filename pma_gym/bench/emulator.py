"""Firmware of a simulated rig on a pseudo terminal: `python -m pma_gym.bench.emulator MODEL`.

It prints `port NAME`, and later `safe NANOSECONDS` with the monotonic clock whenever it goes into
its safe state. It ends when its standard input ends.
"""

import copy
import os
import select
import sys
import time
import tty
from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np

from pma_gym.bench.line_format import LineBuffer, decoded, encoded, numbers
from pma_gym.bench.rig import RigError
from pma_gym.bench.rig_file import HIGHEST_MS, LOWEST_MS
from pma_gym.data.signals import SIGNALS
from pma_gym.plant import sensors
from pma_gym.plant.plant import Plant
from pma_gym.units import SI_FACTORS

TICK_S = 5e-3
"""Time between two looks at the watchdog, and longest step of a ramp."""


class Firmware:
    """What answers lines: a plant that moves with the clock, and a watchdog.

    Args:
        plant: the plant.
        seed: of the sensors' noise.
        clock: the time (ns).

    Attributes:
        is_safe: whether it is in its safe state; so it begins.
        commands: in force, in the units of their columns.
    """

    def __init__(self, plant: Plant, seed: int, clock: Callable[[], int]) -> None:
        """Wait without a pressure for what arms it."""
        model = plant.model
        names = [sensors.direct_command(model) or "motor_voltage"]
        names += ["regulator_voltage"] if model.rig.has_muscle else []
        self._plant, self._signals = plant, [SIGNALS[name] for name in names]
        self._sensed = [each for each in plant.signals if each.sensor in plant.parameters]
        self._generator = np.random.Generator(np.random.Philox(seed))
        self._clock, self._condition = clock, None
        self._begin = self._time = self._command_time = clock()
        self._watchdog, self._ramp = 0, -1
        self.is_safe = True
        self.commands = self._rest = self._held = [0.0] * len(names)

    def advance(self) -> None:
        """Move the plant to the clock's time and look at the watchdog."""
        now = self._clock()
        while self._time < now and self._condition is not None:
            due = self._command_time + self._watchdog
            if not self.is_safe and self._time >= due:
                self._make_safe()
            step = min(now, self._time + round(TICK_S * 1e9))
            step = step if self.is_safe else min(step, due)
            if self.is_safe and self._ramp >= 0:
                left = max(0.0, 1.0 - (self._time - self._command_time) / max(self._ramp, 1))
                pairs = zip(self._rest, self._held, strict=True)
                self.commands = [rest + left * (last - rest) for rest, last in pairs]
            self._plant.step(self._condition, *self._inputs(), (step - self._time) * 1e-9)
            self._time = step
        self._time = now

    def answer(self, line: bytes) -> bytes:
        """Answer to a line; nothing where it breaks a rule or needs none."""
        self.advance()
        try:
            kind, *words = decoded(line)
        except RigError:
            return b""
        requests = {
            "I": self._identify,
            "A": self._arm,
            "R": self._measure,
            "C": self._command,
            "S": self._make_safe,
        }
        try:
            if kind not in requests:
                raise RigError(f"requests are {', '.join(requests)}, got {kind}")
            return requests[kind](words)
        except ValueError as error:
            return encoded("E", str(error)[:150].replace("*", ""))

    def _inputs(self) -> tuple[float, float]:
        """Commands as the plant takes them (SI), the regulator's or 0."""
        pairs = zip(self.commands, self._signals, strict=True)
        motor, regulator, *_ = [*(value * SI_FACTORS[s.unit] for value, s in pairs), 0.0]
        return motor, regulator

    def _make_safe(self, words: Sequence[str] = ()) -> bytes:
        self.is_safe, self._held, self._command_time = True, self.commands, self._time
        return encoded("S", "ok")

    def _identify(self, words: list[str]) -> bytes:
        columns = (",".join(each.column for each in its) for its in (self._signals, self._sensed))
        return encoded("I", "pma-rig", 1, *columns)

    def _arm(self, words: list[str]) -> bytes:
        watchdog, ramp, *rest = numbers(words, 2 + len(self.commands))
        if not LOWEST_MS <= watchdog <= HIGHEST_MS:
            raise RigError(f"watchdog must lie in {LOWEST_MS} to {HIGHEST_MS} ms, got {watchdog:g}")
        self._check(rest)
        if self._condition is None:
            self.commands = rest
            motor, regulator = self._inputs()
            self._condition = self._plant.settle(motor, regulator_voltage=regulator)
            # The first step loads compiled code, which takes longer than a watchdog waits.
            self._plant.step(copy.deepcopy(self._condition), motor, regulator, TICK_S)
            self._time = self._clock()
        self._rest, self._watchdog, self._ramp = rest, round(watchdog * 1e6), round(ramp * 1e6)
        self.is_safe, self._command_time = False, self._time
        return encoded("A", "ok")

    def _measure(self, words: list[str]) -> bytes:
        if self._condition is None:
            raise RigError("arm first")
        plant, states = self._plant, self._condition.state[None]
        lagged = plant.lagged(states, plant.observe(states, self._condition.zero_contraction))
        measured = sensors.measure(plant.model, lagged, self._generator)
        values = [float(measured[s.name][0]) / SI_FACTORS[s.unit] for s in self._sensed]
        times = [(each - self._begin) // 1000 for each in (self._time, self._command_time)]
        number = round(numbers(words, 1)[0])
        return encoded("M", number, times[0], int(self.is_safe), times[1], *self.commands, *values)

    def _command(self, words: list[str]) -> bytes:
        values = numbers(words, len(self.commands))
        self._check(values)
        if not self.is_safe:
            self.commands, self._command_time = values, self._time
        return b""

    def _check(self, values: list[float]) -> None:
        for value, signal in zip(values, self._signals, strict=True):
            low, high = signal.limits or (-np.inf, np.inf)
            if not low <= value <= high:
                raise RigError(f"{signal.column} must lie in {low:g} to {high:g}, got {value:g}")


def serve(model: str, seed: int) -> None:
    """Run firmware on a new pseudo terminal until standard input ends."""
    plant, (ours, theirs), buffer = Plant(model), os.openpty(), LineBuffer()
    # The other end stays open here, so that a host may come and go.
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    firmware = Firmware(plant, seed, time.monotonic_ns)
    print(f"port {os.ttyname(theirs)}", flush=True)
    while True:
        ready, _, _ = select.select([ours, sys.stdin], [], [], TICK_S)
        was_safe = firmware.is_safe
        if ours in ready:
            for line in buffer.lines(os.read(ours, 4096)):
                # A host that was killed reads no more; its watchdog must not wait for that.
                with suppress(BlockingIOError):
                    os.write(ours, firmware.answer(line))
        firmware.advance()
        if firmware.is_safe and not was_safe:
            print(f"safe {time.monotonic_ns()}", flush=True)
        if sys.stdin in ready and not sys.stdin.readline():
            return


if __name__ == "__main__":
    serve(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 0)
