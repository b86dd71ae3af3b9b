"""The smallest configuration for a prescription, and the words for it."""

from typing import NamedTuple

import numpy as np

from benchmarks.exercise.profile import Prescription
from pma_gym.plant.exercise_device.device import Device
from pma_gym.plant.exercise_device.prescription import Held, Schedule, follow, hold, smallest
from pma_gym.plant.model import Model
from pma_gym.units import SI_FACTORS


class Answer(NamedTuple):
    """A prescription's smallest configuration and its pressures."""

    wanted: Prescription
    device: Device
    given: Held | Schedule

    @property
    def words(self) -> str:
        """The configuration, on one line."""
        return f"Smallest configuration: {self.device}"

    @property
    def how(self) -> str:
        """The pressures that give the prescription, and how far it can be trusted."""
        trust = (
            "Scaled from the tested muscle: an extrapolation."
            if self.device.muscles.extrapolated
            else "It is the tested muscle."
        )
        return f"{_pressures(self.wanted, self.given)} {trust}"


def _pressures(wanted: Prescription, given: Held | Schedule) -> str:
    if isinstance(given, Held):
        return (
            f"{wanted.moment[0]:g} N m at 90 deg is held at {1e-3 * given.pressure:.0f} kPa, the "
            "cable set at that pressure."
        )
    degrees = wanted.angle / SI_FACTORS["deg"]
    shown = np.unique(np.linspace(0, len(degrees) - 1, 7).round().astype(int))
    points = ", ".join(f"{degrees[i]:g} deg {1e-3 * given.pressure[i]:.0f}" for i in shown)
    return (
        f"The cable set at {1e-3 * given.rest_pressure:.0f} kPa, the pressure following the angle "
        f"(kPa): {points}."
    )


def answer(model: Model, devices: list[Device], wanted: Prescription) -> Answer:
    """The smallest of the devices that gives a prescription.

    Args:
        model: of the station.
        devices: to choose from.
        wanted: the prescription.
    Raises:
        UnreachableError: none gives it.
    """

    def attempt(device: Device) -> Held | Schedule:
        if wanted.scheduled:
            return follow(model, device, wanted.angle, wanted.moment)
        return hold(model, device, float(wanted.moment[0]))

    return Answer(wanted, *smallest(devices, attempt))
