"""Margins of the linear controllers' loops: how much gain, phase and delay each can bear.

The loop is that of the nominal plant, linearised near rest at a place of the stroke, sampled at the
control rate with the sensor's lag and all delays in it (`benchmarks.tuning.loop_margins`), and of
the controller's own linear law (`controllers.registry.LinearController`). The task's actuator,
motor or regulator, closes it. What is not in it: voltage limits, feed-forward, hysteresis and dry
friction, and how gains change as the reference moves.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

from benchmarks.tuning.loop_margins import STROKES, Place, linearised, sampled
from controllers.registry import Controller, LinearController
from pma_gym.envs import StationInfo

FREQUENCIES = 600
"""Points of a frequency response, evenly spaced in the logarithm up to half the control rate."""

LOWEST_RAD_S = 1e-2
"""The first of them (rad/s)."""

_SAME = 1e-5
"""Difference of two plants' coefficients, as a share, that differences of equations leave."""

MIDDLE = 0.5
"""Place of the stroke that is pictured, as a share of it."""


class Margins(NamedTuple):
    """Margins of a loop; nothing but `stable` and `sensitivity` says anything if it is unstable.

    Attributes:
        stable: whether the closed loop is.
        gain: factor by which the loop's gain may rise before it is unstable.
        phase: additional lag (rad) that it bears at its crossover.
        delay: additional delay (s) that it bears.
        sensitivity: largest |S|: by how much disturbances are amplified at worst.
        crossover: highest frequency at which the loop's gain is 1 (rad/s); NaN if it never is.
    """

    stable: bool
    gain: float
    phase: float
    delay: float
    sensitivity: float
    crossover: float


class Loop(NamedTuple):
    """A controller's loop at one place.

    Attributes:
        name: of the controller.
        share: place, as a share of the stroke.
        direction: of the motion.
        plant: measured position (m or rad) by the actuator's voltage (V).
        load: measured position (m or rad) by the motor's voltage (V), through which loads come; of
            a loop of the motor the plant again.
        law: voltage (V) by error (m or rad).
        margins: of plant and law, closed by negative feedback.
    """

    name: str
    share: float
    direction: str
    plant: control.StateSpace
    load: control.StateSpace
    law: control.StateSpace
    margins: Margins


class Condition(NamedTuple):
    """Loops of all linear controllers at one pressure.

    Attributes:
        station: what they receive.
        everywhere: loops at all places of the stroke.
    """

    station: StationInfo
    everywhere: list[Loop]

    @property
    def pressure_kpa(self) -> float:
        """Gauge pressure (kPa)."""
        return self.station.pressure / 1e3

    @property
    def pictured(self) -> list[Loop]:
        """Loops in the middle of the stroke, in the first direction of motion."""
        middle = [loop for loop in self.everywhere if loop.share == MIDDLE]
        return [loop for loop in middle if loop.direction == middle[0].direction]


def conditions(
    controllers: Sequence[Controller], stations: Sequence[StationInfo]
) -> list[Condition]:
    """Loops of controllers at several pressures."""
    return [Condition(station, loops(controllers, station)) for station in stations]


def is_linear(controller: Controller) -> bool:
    """Return whether a controller provides its linear law."""
    return isinstance(controller, LinearController)


def loops(
    controllers: Iterable[Controller], station: StationInfo, shares: Iterable[float] = STROKES
) -> list[Loop]:
    """Loops of linear controllers at places of the stroke, in the task's directions of motion.

    Args:
        controllers: those that are not linear are left out.
        station: what they receive.
        shares: places, as shares of the task's range.
    """
    linear = [each for each in controllers if isinstance(each, LinearController)]
    every = []
    for place in _different(linearised(station, shares)):
        plant, load = sampled(place, station), sampled(place, station, "motor")
        for each in linear:
            law = each.linear(station, place.share * station.task.schedule.span)
            check_law(each.name, law, station.period)
            known = margins(plant, law)
            every.append(Loop(each.name, place.share, place.direction, plant, load, law, known))
    return every


def _different(places: Iterable[Place]) -> list[Place]:
    """Places whose plants differ: without those of a direction that is damped like the other."""
    kept: list[Place] = []
    for place in places:
        same = (np.allclose(place.system.A, known.system.A, rtol=_SAME) for known in kept)
        if not any(same):
            kept.append(place)
    return kept


def check_law(name: str, law: control.StateSpace, period: float) -> None:
    """Refuse a law that does not fit the loop.

    Raises:
        ValueError: it has several inputs or outputs, or another period.
    """
    shape = law.noutputs, law.ninputs
    if shape != (1, 1) or not isinstance(law.dt, float) or not math.isclose(law.dt, period):
        raise ValueError(
            f"{name}.linear must give one voltage by one error, sampled every {period:g} s, got "
            f"{shape[0]} outputs, {shape[1]} inputs and dt={law.dt!r}; give "
            "control.StateSpace(a, b, c, d, station.period)"
        )


def margins(plant: control.StateSpace, law: control.StateSpace) -> Margins:
    """Margins of plant and law, closed by negative feedback; both sampled at one period.

    From the frequency response, by python-control's interpolation: a ratio of polynomials in z has
    all its roots near 1 here, and says little.
    """
    period = float(plant.dt)  # type: ignore[arg-type]
    loop = plant * law
    frequencies = frequencies_of(period)
    response = response_of(loop, frequencies)
    known: Any = control.stability_margins(
        control.FrequencyResponseData(response, frequencies, smooth=True), returnall=True
    )
    gains, phases, _, _, crossings, _ = map(np.atleast_1d, known)
    # Where the response ends on the negative real axis, at half the control rate, it crosses too.
    last = response[-1].real
    gains = np.append(gains, -1.0 / last if last < 0.0 else np.inf)
    lags = np.deg2rad(np.mod(phases, 360.0))
    return Margins(
        stable=bool(np.abs(closed_poles(loop)).max() < 1.0),
        gain=float(np.min(gains[gains > 1.0], initial=np.inf)),
        phase=float(np.min(lags, initial=np.inf)),
        delay=float(np.min(lags / crossings, initial=np.inf)),
        sensitivity=float(np.max(1.0 / np.abs(1.0 + response))),
        crossover=float(np.max(crossings)) if len(crossings) else math.nan,
    )


def frequencies_of(period: float) -> NDArray[np.float64]:
    """Frequencies (rad/s) up to half the control rate, shape (600,)."""
    return np.geomspace(LOWEST_RAD_S, math.pi / period, FREQUENCIES)


def response_of(
    system: control.StateSpace, frequencies: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Frequency response of a system of one input and one output, shape (frequencies,)."""
    at_z = np.exp(1j * frequencies * float(system.dt))  # type: ignore[arg-type]
    a, b, c, d = (np.asarray(each) for each in (system.A, system.B, system.C, system.D))
    # All frequencies at once: python-control solves for one after the other.
    states = np.linalg.solve(at_z[:, None, None] * np.eye(len(a)) - a, b[None].astype(complex))
    response: Any = c @ states + d
    return response[:, 0, 0]


def closed_poles(loop: control.StateSpace) -> NDArray[np.complex128]:
    """Poles of a loop closed by negative feedback."""
    closed: Any = control.feedback(loop, 1)
    return np.asarray(closed.poles())


def worst(loops_: Sequence[Loop]) -> Margins:
    """The least margins of several loops: of a controller at all places of the stroke."""

    def least(field: Callable[[Margins], float]) -> float:
        return min(field(loop.margins) for loop in loops_)

    return Margins(
        stable=all(loop.margins.stable for loop in loops_),
        gain=least(lambda m: m.gain),
        phase=least(lambda m: m.phase),
        delay=least(lambda m: m.delay),
        sensitivity=max(loop.margins.sensitivity for loop in loops_),
        crossover=max(loop.margins.crossover for loop in loops_),
    )


def reference_step(loop: Loop, duration: float) -> tuple[NDArray, NDArray]:
    """Simulate a step of the reference with feedback only: times (s), measured position."""
    return _step(control.feedback(loop.plant * loop.law, 1), duration)


def load_step(loop: Loop, duration: float) -> tuple[NDArray, NDArray]:
    """Times (s) and measured position (m or rad) after a step of 1 V of the motor's voltage.

    The law says nothing about that volt: a load that the motor could have made.
    """
    closed_loop: Any = control.feedback(1, loop.plant * loop.law)
    return _step(closed_loop * loop.load, duration)


def _step(system: Any, duration: float) -> tuple[NDArray, NDArray]:  # noqa: ANN401
    period = float(system.dt)
    times = period * np.arange(round(duration / period) + 1)
    return times, np.squeeze(np.asarray(control.step_response(system, times).outputs))
