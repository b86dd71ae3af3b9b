"""Common part of controllers on a lag observer: the voltage they send, and their linear law."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

import numpy as np

from controllers.controller import Reference
from controllers.models.nominal_motion import NominalMotion, nominal_motion
from controllers.models.voltage import VOLTAGE_LIMIT
from controllers.observers.extended_state_observer import ExtendedStateObserver
from pma_gym.envs import Measurement, StationInfo

if TYPE_CHECKING:
    import control

Settings = TypeVar("Settings", bound=NamedTuple)


class ObserverFeedback(ABC, Generic[Settings]):
    """A feed-forward, and beside it a voltage by what a lag observer estimates.

    z is the observer's estimate (`controllers.models.lag_model`) of when a voltage sent now begins
    to act. What is sent is held to 0-10 V, and the observer receives what was sent, so nothing
    winds up.

    Args:
        settings: settings to use instead of the designed ones.
    """

    name: str
    _motion: NominalMotion
    _observer: ExtendedStateObserver

    def __init__(self, settings: Settings | None = None) -> None:
        self._given = settings

    @abstractmethod
    def _design(self, motion: NominalMotion) -> None:
        """Keep the motion, begin an observer and compute what the places need."""

    @abstractmethod
    def _wanted(self, planned: float, z: np.ndarray) -> float:
        """Voltage (V), not held to limits, by that of the feed-forward (V) and z."""

    @abstractmethod
    def _gains(self, at: int) -> np.ndarray:
        """Gains on z (V by its units) at the place of a number, where the law is linear."""

    def _planned(self, time: float) -> float:
        """Feed-forward (V) to send at a time (s)."""
        return self._motion.command(time)

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Compute the gains at all places of the stroke, and clear the controller's state."""
        self._design(nominal_motion(reference, station))

    def act(self, measurement: Measurement, time: float) -> float:
        """Voltage (V) of the task's actuator to hold for the next control period."""
        z = self._observer.update(measurement, time)
        planned = self._planned(time)
        voltage = min(max(self._wanted(planned, z), 0.0), VOLTAGE_LIMIT)
        self._observer.send(voltage - planned)
        return voltage

    def linear(self, station: StationInfo, position: float) -> "control.StateSpace":
        """The feedback near a position (m or rad) where it is linear: volts by error."""
        made = type(self)(self._given)
        made._design(nominal_motion(station.task.schedule.at, station))
        at = made._observer.nearest(position)
        return made._observer.linear(at, made._gains(at))
