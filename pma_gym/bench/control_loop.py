"""The loop of a rig: absolute deadlines, limits, a watchdog of the host."""

import gc
import math
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

from pma_gym.bench.rig import Rig, RigError, Sample
from pma_gym.bench.rig_file import RigFile

Act = Callable[[float, Sample], Sequence[float]]
"""Commands for the time since the trial began (s) and what was measured."""


class Step(NamedTuple):
    """Times of one step.

    Attributes:
        step: number of the period that it belongs to; one that is missing was passed over.
        late_us: how late it began after its deadline (us).
        read_us: how long the rig took to answer (us).
        act_us: how long the controller took (us).
        command_delay_us: time from a measurement until its command was in force, of the step before
            and by the rig's clock (us).
    """

    step: int
    late_us: float
    read_us: float
    act_us: float
    command_delay_us: float


Log = Callable[[float, Sequence[float], Sequence[float], Step], None]
"""Time of a trial (s), commands, measurements and times of a step."""


class ControlLoop:
    """Run a rig at its rate, within its limits.

    A step begins at a multiple of the period after the first one, however long those before took;
    periods that are over when a step ends are passed over. The host's watchdog is a POSIX timer:
    without a command in time the loop ends, whatever the controller does in Python.

    Args:
        rig: the rig.
        file: its limits, rate and watchdog.
    """

    def __init__(self, rig: Rig, file: RigFile) -> None:
        self._rig, self._file, self._first = rig, file, 0.0
        self._period_ns = round(1e9 / file.rate_hz)

    def run(self, seconds: float, act: Act, log: Log | None = None) -> list[Step]:
        """Arm the rig, settle at its start commands, run a trial, make the rig safe.

        Args:
            seconds: duration of the trial.
            act: gives the commands; called in the trial only.
            log: called after every step of the trial: time, commands, measurements, its times.
        Raises:
            RigError: a limit, a lost line, or no command in time.
        """
        steps: list[Step] = []
        with _quick():
            try:
                self._rig.arm()
                _alarm(1e-3 * self._file.watchdog_ms)
                for step, sample, command in self._steps(seconds, act):
                    steps.append(step)
                    if log:
                        log(sample.time - self._first, command, sample.values, step)
            finally:
                _alarm(0.0)
                self._rig.safe()
        return steps

    def _steps(self, seconds: float, act: Act) -> Iterator[tuple[Step, Sample, Sequence[float]]]:
        """Do all steps; those of the trial come out, after their command is sent."""
        rig, clock, period, start = self._rig, time.monotonic_ns, self._period_ns, self._file.start
        number = -round(1e9 * self._file.settle_s / period)
        zero = clock() + (1 - number) * period
        before = command = None
        while number * period < 1e9 * seconds:
            deadline = zero + number * period
            time.sleep(max(0, deadline - clock()) * 1e-9)
            started = clock()
            sample = rig.read()
            read = clock()
            self._check(sample, before, number)
            self._first = self._first if before and number > 0 else sample.time
            asked = start if number < 0 else act(sample.time - self._first, sample)
            acted = clock()
            command = self._limited(asked, command or sample.commands)
            rig.write(command)
            _alarm(1e-3 * self._file.watchdog_ms)
            if number >= 0:
                delay = sample.command_time - before.time if before else math.nan
                spans = started - deadline, read - started, acted - read, 1e9 * delay
                yield Step(number, *(1e-3 * span for span in spans)), sample, command
            before = sample
            number = max(number + 1, (clock() - zero) // period)

    def _check(self, sample: Sample, before: Sample | None, row: int) -> None:
        span = sample.time - before.time if before else math.inf
        if not span > 0.0:
            raise RigError(f"the rig's clock must go on, in step {row} it went {span:g} s")
        olds = before.values if before else sample.values
        table = zip(self._file.measurements.items(), sample.values, olds, strict=True)
        for (name, limits), value, old in table:
            low, high = limits.range
            if not low <= value <= high:
                raise RigError(f"{name} must lie in {low:g} to {high:g}, step {row} has {value:g}")
            if limits.rate and abs(value - old) > limits.rate * span:
                raise RigError(
                    f"{name} must change by at most {limits.rate:g} a second, in step {row} it "
                    f"goes from {old:g} to {value:g} in {1e3 * span:.3g} ms"
                )

    def _limited(self, asked: Sequence[float], last: Sequence[float]) -> list[float]:
        commands = []
        for (name, limits), value, old in zip(
            self._file.commands.items(), asked, last, strict=True
        ):
            if not math.isfinite(value):
                raise RigError(f"{name} must be a finite number, the controller gave {value}")
            change = limits.rate * self._period_ns * 1e-9
            value = min(max(value, old - change), old + change)
            commands.append(min(max(value, limits.range[0]), limits.range[1]))
        return commands


def _alarm(seconds: float) -> None:
    """Raise an error after a time without a further call; never for 0."""
    signal.setitimer(signal.ITIMER_REAL, seconds)


@contextmanager
def _quick() -> Iterator[None]:
    """No collection of garbage, and an error by the alarm."""

    def late(number: int, frame: Any) -> None:  # noqa: ANN401
        raise RigError("no command in time for the watchdog: controller or rig is too slow")

    handler = signal.signal(signal.SIGALRM, late)
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()
        signal.signal(signal.SIGALRM, handler)
