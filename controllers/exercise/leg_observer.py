"""Kalman filters of fixed gain for the leg and the regulator of an exercise.

    theta' = w,   I w' = M_h - M - D w,   M_h' = s,   s' = -s / fade + white
    e' = white,   angle = theta,   (extension + tension / k) / r = theta + e
    P' = (P_c + g - P) / tau,   g' = white

M_h is the operator's moment, M the one at the joint by the load cell, so that nothing of the
muscle need be known; I and D are the nominal leg's, rotor and slide's share with it. The angle by
the extension is finer than the potentiometer, but off by the cable's slack, which e is. g is what
the regulator's line is off, held to `Arrival`'s bound: what the safety layer holds back is not
taken for more.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from controllers.exercise.resistance import AWAY_PA
from pma_gym.envs import Measurement, StationInfo


class ProcessNoise(NamedTuple):
    """Process noise of the filters, in SI; assumptions, chosen by trial.

    Attributes:
        operator: change of the operator's moment (N m per s^0.5).
        slope: change of its slope (N m/s per s^0.5).
        fade: time constant in which a slope is lost (s).
        speed: change of the speed by what is not modelled (rad/s per s^0.5).
        slack: change of e (rad per s^0.5).
        pressure: change of the pressure by what is not modelled (Pa per s^0.5).
        line: change of g (Pa per s^0.5).
    """

    operator: float = 2.0
    slope: float = 20.0
    fade: float = 0.3
    speed: float = 1e-2
    slack: float = 3e-3
    pressure: float = 5e3
    line: float = 8e3


class LegObserver:
    """The filter of the leg.

    Args:
        station: the station as the controller knows it.
        process_noise: what is unknown.

    Attributes:
        state: theta (rad), w (rad/s), M_h (N m), s (N m/s) and e (rad) at the last reading.
    """

    def __init__(self, station: StationInfo, process_noise: ProcessNoise) -> None:
        cable, sensors = station.model.parameters["cable"], station.model.parameters
        self._radius, self._stiffness = sensors["rotor"].radius, cable.stiffness
        self._station = station
        noise = (
            process_noise.speed,
            process_noise.operator,
            process_noise.slope,
            process_noise.slack,
        )
        process = np.diag(np.square([0.0, *noise])) * station.period
        fine = sensors["lvdt"].noise / self._radius
        spread = np.square([sensors["potentiometer"].noise, fine])
        self._whole, self._push = _leg(station, process_noise.fade)
        self._seen = np.array([[1.0, 0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0, 1.0]])
        self._gain = settled_gain(self._whole, self._seen, process, np.diag(spread))
        # A load that the trial begins with has stretched the cable already.
        self._stretch = station.load / self._stiffness
        self._moment = self._radius * station.load
        self.state = np.array([0.0, 0.0, self._moment, 0.0, 0.0])

    def update(self, reading: Measurement) -> None:
        """Take a reading, a period after the last."""
        moment = self._station.moment(reading)
        wound = reading.extension + reading.load / self._stiffness - self._stretch
        said = np.array([reading.rotation, wound / self._radius])
        x = self._whole @ self.state + self._push * (0.5 * (self._moment + moment))
        self.state, self._moment = x + self._gain @ (said - self._seen @ x), moment


class PressureObserver:
    """The filter of the regulator.

    Args:
        station: the station as the controller knows it.
        process_noise: what is unknown.

    Attributes:
        pressure: P at the last reading (Pa).
        offset: g (Pa).
    """

    def __init__(self, station: StationInfo, process_noise: ProcessNoise) -> None:
        parameters = station.model.parameters
        kept = np.exp(-station.period / parameters["regulator_lag"].time_constant)
        whole = np.array([[kept, 1.0 - kept], [0.0, 1.0]])
        process = np.diag(np.square([process_noise.pressure, process_noise.line])) * station.period
        spread = np.array([[parameters["pressure_transducer"].noise ** 2]])
        gain = settled_gain(whole, np.array([[1.0, 0.0]]), process, spread)
        self._kept, self._gain = float(kept), [float(value) for value in gain[:, 0]]
        self.pressure, self.offset = station.pressure, 0.0

    def update(self, pressure: float, commanded: float) -> None:
        """Take a pressure (Pa), a period after the last, in which one was commanded (Pa)."""
        reached = commanded + self.offset
        believed = reached + self._kept * (self.pressure - reached)
        error = pressure - believed
        self.pressure = believed + self._gain[0] * error
        self.offset = min(max(self.offset + self._gain[1] * error, -AWAY_PA), AWAY_PA)


def leg_of(station: StationInfo) -> tuple[float, float]:
    """Inertia I (kg m^2) and damping D (N m s) of all that turns with the nominal joint."""
    parameters = station.model.parameters
    leg, rotor, slide = (parameters[name] for name in ("leg", "rotor", "slide"))
    inertia = leg.inertia + rotor.inertia + slide.mass * rotor.radius**2
    return inertia, leg.damping + rotor.damping


def settled_gain(
    whole: NDArray[np.float64],
    seen: NDArray[np.float64],
    process: NDArray[np.float64],
    spread: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Gain of a Kalman filter that has run for long, shape (states, outputs)."""
    covariance = solve_discrete_are(whole.T, seen.T, process, spread)
    return np.linalg.solve(seen @ covariance @ seen.T + spread, seen @ covariance).T


def _leg(station: StationInfo, fade: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The leg over a period: what becomes of its state, and of a moment at the joint."""
    inertia, damping = leg_of(station)
    rates = np.zeros((6, 6))
    rates[0, 1] = rates[2, 3] = 1.0
    rates[1, 1:3] = -damping / inertia, 1.0 / inertia
    rates[1, 5], rates[3, 3] = -1.0 / inertia, -1.0 / fade
    over = np.asarray(expm(rates * station.period), dtype=np.float64)
    return over[:5, :5], over[:5, 5]
