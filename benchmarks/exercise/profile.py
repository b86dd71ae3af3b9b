"""Prescriptions: a moment held at 90 deg, or a profile of moments over angle from a CSV file."""

import csv
import math
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pma_gym.documents import read_content
from pma_gym.plant.exercise_device.device import FULL_ANGLE, Device
from pma_gym.plant.exercise_device.prescription import Held, Schedule, follow, hold, smallest
from pma_gym.plant.model import Model
from pma_gym.units import SI_FACTORS, parse_number

COLUMNS = ("angle_deg", "moment_nm")
_LARGEST_NM = 10_000.0
_FILL = 5.0
"""Largest step (deg) between the angles at which a profile is checked."""


class ProfileError(ValueError):
    """A prescription that cannot be read; says file, row, column, rule, unit, what came, fix."""


class Prescription(NamedTuple):
    """Moments over angle.

    Attributes:
        angle: of the pulley (rad), increasing.
        moment: wanted there (N m).
        scheduled: whether the pressure may follow the angle.
    """

    angle: NDArray[np.float64]
    moment: NDArray[np.float64]
    scheduled: bool


def constant_prescription(moment: float) -> Prescription:
    """A moment (N m) that one pressure holds at 90 deg.

    Raises:
        ProfileError: not a positive number.
    """
    if not 0.0 < moment <= _LARGEST_NM:
        raise ProfileError(
            f"--moment must lie above 0, to {_LARGEST_NM:g} N m, got {moment!r}; give the moment "
            "against the operator at 90 deg in N m"
        )
    return Prescription(np.array([FULL_ANGLE]), np.array([moment]), scheduled=False)


def read_profile(path: Path) -> Prescription:
    """A profile of moments, filled by lines so that no two angles are more than 5 deg apart.

    Args:
        path: CSV file with columns angle_deg (0-90, increasing) and moment_nm (not negative).
    Raises:
        ProfileError: no such file, not these columns, no rows, or a value that breaks a rule.
    """
    rows = _rows(path)
    angle, moment = (np.array(column) for column in zip(*rows, strict=True))
    between = [np.linspace(a, b, 1 + math.ceil((b - a) / _FILL)) for a, b in pairwise(angle)]
    filled = np.unique(np.concatenate([angle, *between]))
    factor = SI_FACTORS["deg"]
    return Prescription(factor * filled, np.interp(filled, angle, moment), scheduled=True)


def _rows(path: Path) -> list[tuple[float, float]]:
    """Angles (deg) and moments (N m) of the file, checked row by row."""
    if not path.exists():
        raise ProfileError(f"--profile {path}: No such file or directory; name a CSV file in UTF-8")
    try:
        lines = read_content(path).decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise ProfileError(f"--profile {path}: not UTF-8 text; name a CSV file in UTF-8") from None
    except ValueError as error:
        raise ProfileError(f"--profile {error}; name a CSV file in UTF-8") from None
    try:
        return _parsed(csv.DictReader(lines), path)
    except csv.Error as error:
        raise ProfileError(f"--profile {path}: {error}; name a CSV file in UTF-8") from None


def _parsed(reader: csv.DictReader, path: Path) -> list[tuple[float, float]]:
    names = [name.strip() for name in reader.fieldnames or ()]
    if set(names) != set(COLUMNS):
        raise ProfileError(
            f"{path} must have the columns {' and '.join(COLUMNS)}, got "
            f"{', '.join(names) or 'an empty file'}; write them as its first line"
        )
    reader.fieldnames = names
    rows: list[tuple[float, float]] = []
    for row in reader:
        place = f"row {reader.line_num} of {path}"
        angle = _number(row, "angle_deg", 90.0, place)
        if rows and angle <= rows[-1][0]:
            raise ProfileError(
                f"angle_deg must increase from row to row, {place} has {angle:g} after "
                f"{rows[-1][0]:g}; sort the rows and keep one for each angle"
            )
        rows.append((angle, _number(row, "moment_nm", _LARGEST_NM, place)))
    if not rows:
        raise ProfileError(f"{path} has no rows below its header; give an angle and a moment each")
    return rows


def _number(row: dict, column: str, largest: float, place: str) -> float:
    """A cell as a number in 0 to a largest."""
    value = parse_number(row[column] or "")
    if value is None or not 0.0 <= value <= largest:
        raise ProfileError(
            f"{column} must be a number in 0 to {largest:g} "
            f"{'deg' if column == 'angle_deg' else 'N m'}, {place} has {row[column]!r}; check "
            "unit, sign and decimal point"
        )
    return value


class Answer(NamedTuple):
    """A prescription's smallest configuration and its pressures."""

    prescription: Prescription
    device: Device
    setting: Held | Schedule

    @property
    def text(self) -> str:
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
        return f"{_pressures(self.prescription, self.setting)} {trust}"


def _pressures(prescription: Prescription, setting: Held | Schedule) -> str:
    if isinstance(setting, Held):
        return (
            f"{prescription.moment[0]:g} N m at 90 deg is held at "
            f"{1e-3 * setting.pressure:.0f} kPa, the cable set at that pressure."
        )
    degrees = prescription.angle / SI_FACTORS["deg"]
    shown = np.unique(np.linspace(0, len(degrees) - 1, 7).round().astype(int))
    points = ", ".join(f"{degrees[i]:g} deg {1e-3 * setting.pressure[i]:.0f}" for i in shown)
    return (
        f"The cable set at {1e-3 * setting.rest_pressure:.0f} kPa, the pressure following the "
        f"angle (kPa): {points}."
    )


def answer(model: Model, devices: list[Device], prescription: Prescription) -> Answer:
    """The smallest of the devices that gives a prescription.

    Args:
        model: of the station.
        devices: to choose from.
        prescription: the prescription.
    Raises:
        UnreachableError: none gives it.
    """

    def attempt(device: Device) -> Held | Schedule:
        if prescription.scheduled:
            return follow(model, device, prescription.angle, prescription.moment)
        return hold(model, device, float(prescription.moment[0]))

    return Answer(prescription, *smallest(devices, attempt))
