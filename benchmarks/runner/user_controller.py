"""Wrapper of a user's controller in a run: time limits, errors in plain words."""

import time
from collections import deque
from pathlib import Path

from benchmarks.runner.controller_spec import ControllerError, ControllerSpec, raised_at
from controllers.registry import Reference
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
    made = spec.make()
    name = getattr(made, "name", "")
    return name.strip() if isinstance(name, str) else ""
