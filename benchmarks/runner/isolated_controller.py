"""A user's controller in a separate process, which holds no environment.

Within one process nothing can be hidden: `gc.get_objects()` and the frames that called a function
lead to every object. So a class from a file runs in a process that receives the reference, the
station and the readings as copies, and returns volts. That is no sandbox: the process has the
user's rights, as any program that the user starts.

A process that a controller lives in for a whole trial: one call after the other, each limited.

A pool has pieces of work that know nothing of each other; a controller keeps its state from one
control step to the next, and steps are short, so it has a process and a pipe of its own.

`Guarded` wraps it there: time limits, errors in plain words.
"""

import multiprocessing
import pickle
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection, wait
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any

from benchmarks.executors.executor import ProcessDied, TookTooLong, run_packed, unpacked
from benchmarks.executors.local import end_with_parent, interrupts_blocked
from benchmarks.runner.controller_spec import ControllerError, ControllerSpec, raised_at
from benchmarks.runner.rollout import checked_volts
from controllers.registry import Controller, Reference
from pma_gym.envs import Measurement, StationInfo

MAKE_S, RESET_S, ACT_S = 60.0, 60.0, 2.0
"""How long importing and making a controller, its `reset` and its `act` may take before its
process is ended (s); for classes from files, see `isolated_controller`. A control period is far
shorter: one late answer is forgiven, many are not."""

LATE_S = 1.0
"""Length of the part of a trial over which `act` must on average keep up with the clock (s)."""


class LateError(ControllerError):
    """A controller that would be late on a rig."""


_clock = time.perf_counter


class Guarded:
    """A controller that is watched.

    Everything else that it has (`repetitions`...) shows through.

    Args:
        spec: whose controller is made and watched.
        period: of the control steps (s).
        keep_pace: whether `act` must keep up with the clock.
    Raises:
        ControllerError: the controller cannot be made.
    """

    def __init__(self, spec: ControllerSpec, period: float, keep_pace: bool = True) -> None:
        self._controller = spec.make()
        self.name = str(getattr(self._controller, "name", spec.name))
        self._file, self._period, self._keep_pace = spec.path, period, keep_pace
        self._latest: deque[float] = deque(maxlen=max(1, round(LATE_S / period)))

    def __getattr__(self, name: str) -> object:
        return getattr(self._controller, name)

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Its `reset`.

        Raises:
            ControllerError: it raised something; says what and where.
        """
        self._latest.clear()
        try:
            self._controller.reset(reference, station)
        except (Exception, SystemExit) as error:
            raise self._error("reset", error, "before the trial") from error

    def act(self, measurement: Measurement, time: float) -> float:
        """Its `act`.

        Raises:
            ControllerError: it raised something; says what, where and when.
            LateError: it cannot keep up with the clock.
        """
        began = _clock()
        try:
            answer = self._controller.act(measurement, time)
        except (Exception, SystemExit) as error:
            raise self._error("act", error, f"at {time:.4g} s") from error
        self._latest.append(_clock() - began)
        if self._keep_pace and len(self._latest) == self._latest.maxlen:
            self._check_pace(sum(self._latest) / len(self._latest))
        return answer

    def _check_pace(self, mean_s: float) -> None:
        if mean_s > self._period:
            raise LateError(
                f"act takes {1e3 * mean_s:.3g} ms on average over {LATE_S:g} s of the trial and a "
                f"control period is {1e3 * self._period:g} ms: on a rig it would be late; compute "
                "in reset what is known ahead, and less in act"
            )

    def _error(self, method: str, error: BaseException, when: str) -> ControllerError:
        """What it raised, in words that say where to fix it."""
        where = raised_at(error, Path(self._file)) or "outside its file"
        return ControllerError(f"{method} raised {type(error).__name__}: {error} ({where}, {when})")


def probe(spec: ControllerSpec) -> str:
    """Make a controller to see that it can be made, in whatever process this is.

    Returns:
        What it calls itself; nothing if it does not.
    Raises:
        ControllerError: it cannot be made.
    """
    name = getattr(spec.make(), "name", "")
    return name.strip() if isinstance(name, str) else ""


END_S = 5.0
"""How long a process may take to end when it is asked to, before it is killed (s)."""


class ControllerProcess:
    """A process that answers one call after the other."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,))
        with interrupts_blocked():
            self._process.start()
        # Else its death would not end the connection.
        theirs.close()

    def ask(self, work: Callable[[], object], what: str, limit_s: float) -> object:
        """Call a method in the process; return its result or raise its exception.

        Args:
            work: to be pickled.
            what: what the error calls it if it takes too long.
            limit_s: how long it may take (s).
        Raises:
            TookTooLong: it took longer.
            ProcessDied: the process ended before.
        """
        content = pickle.dumps(work)
        # A process that died since its last call is met below.
        with suppress(OSError):
            self._connection.send_bytes(content)
        # Of a controller that started a process, that one may hold the connection after its death.
        if not wait([self._connection, self._process.sentinel], limit_s):
            raise TookTooLong(what, limit_s)
        try:
            if not self._connection.poll():
                raise EOFError
            return unpacked(self._connection.recv_bytes())
        except (EOFError, OSError):
            self._process.join(END_S)
            raise ProcessDied(self._process.exitcode) from None

    def end(self) -> None:
        """End the process, whatever it is at."""
        self._connection.close()
        for stop in (self._process.terminate, self._process.kill):
            if self._process.is_alive():
                stop()
                self._process.join(END_S)


def _serve(connection: Connection) -> None:
    """Answer calls until nobody is there to ask."""
    end_with_parent()
    with suppress(EOFError, OSError):
        while True:
            connection.send_bytes(run_packed(connection.recv_bytes()))


def driver(spec: ControllerSpec, period: float, keep_pace: bool = True) -> Controller:
    """Return the driver of a case: `Isolated` for a class from a file, `Guarded` for other files.

    Args:
        spec: whose controller is made.
        period: of the control steps (s).
        keep_pace: whether `act` must keep up with the clock.
    Raises:
        ControllerError: it cannot be made.
    """
    if not spec.path:
        return spec.make()
    kind = Guarded if spec.is_policy else Isolated
    return kind(spec, period, keep_pace)


class Isolated:
    """A controller in another process, guarded there; a new one of its class for every case.

    The process stays for this process's other cases of the same class.

    Args:
        spec: whose controller is made and watched.
        period: of the control steps (s).
        keep_pace: whether `act` must keep up with the clock.

    Attributes:
        name: what it calls itself.
        repetitions: how many trials it runs, see `benchmarks.runner.rollout`.
        act_seconds: computing time of every `act` of this trial (s), without the way there.

    Raises:
        ControllerError: the controller cannot be made.
    """

    def __init__(self, spec: ControllerSpec, period: float, keep_pace: bool = True) -> None:
        self._source = spec.source
        self.act_seconds: list[float] = []
        make = partial(_make, spec, period, keep_pace)
        self.name, self.repetitions = self._ask(make, f"importing and making {spec.name}", MAKE_S)

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Its `reset`."""
        self.act_seconds.clear()
        self._ask(partial(_reset, reference, station), "reset", RESET_S)

    def act(self, measurement: Measurement, time: float) -> float:
        """Its `act`."""
        volts, seconds = self._ask(partial(_act, measurement, time), "act", ACT_S)
        self.act_seconds.append(seconds)
        return volts

    def _ask(self, work: Callable[[], object], what: str, limit_s: float) -> Any:  # noqa: ANN401
        """What a call returns there.

        Raises:
            ControllerError: what was raised there, in words.
            TookTooLong: it passed its limit; the process is ended.
            ProcessDied: the process ended.
        """
        process = _process_of(self._source)
        try:
            answer = process.ask(work, what, limit_s)
        except BaseException:
            _processes.pop(self._source).end()
            raise
        if isinstance(answer, BaseException):
            raise answer
        return answer


_processes: dict[str, ControllerProcess] = {}
"""Of this process's controllers, by source."""


def _process_of(source: str) -> ControllerProcess:
    if source not in _processes:
        process = _processes[source] = ControllerProcess()
        # Before this process waits for its children to end.
        Finalize(None, process.end, exitpriority=10)
    return _processes[source]


_controller: Guarded
"""In a controller's process: the one of the present case."""


def _make(spec: ControllerSpec, period: float, keep_pace: bool) -> tuple[str, int]:
    global _controller
    _controller = Guarded(spec, period, keep_pace)
    return _controller.name, int(getattr(_controller, "repetitions", 1))


def _reset(reference: Reference, station: StationInfo) -> None:
    _controller.reset(reference, station)


def _act(measurement: Measurement, now: float) -> tuple[float, float]:
    began = time.perf_counter()
    return checked_volts(_controller.act(measurement, now), now), time.perf_counter() - began
