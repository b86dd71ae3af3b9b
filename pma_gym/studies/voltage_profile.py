"""The dissertation's open-loop voltage profiles, recomputed, and the same for any reference.

Static map from motor voltage to displacement, and the voltage that a displacement needs.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pma_gym.data.serres2008 import load_table, pressures
from pma_gym.studies.tustin import cascade_transfer, inverse_recursion, tustin_recursion

VOLTAGE_LIMIT = 10.0


class Quadratic(NamedTuple):
    """Displacement (m) by motor voltage V (V): square V^2 + linear V + constant.

    Source:
        Serres 2008, table 18.
    """

    square: float
    linear: float
    constant: float

    def displacement(self, voltage: ArrayLike) -> NDArray[np.float64]:
        """Displacement (m) at a voltage (V), any shape."""
        volts = np.asarray(voltage, dtype=np.float64)
        return (self.square * volts + self.linear) * volts + self.constant

    @property
    def highest_voltage(self) -> float:
        """Voltage (V) of the peak, or 10 V if the peak lies beyond."""
        return min(VOLTAGE_LIMIT, -self.linear / (2.0 * self.square))

    @property
    def reach(self) -> float:
        """Largest displacement (m) with 0-10 V."""
        return float(self.displacement(self.highest_voltage))


# What tables I6, I13 and I20 were computed with, recovered from their figures. Table 18 prints
# 0.0118 and -0.0052 for 250 kPa; it has no rows for 275 and 575 kPa, where table I3's fit,
# rounded as in table 18, is what was used.
_USED = {
    250: Quadratic(-0.0007, 0.0117, -0.0043607145),
    275: Quadratic(-0.0006, 0.0114, -0.0054),
    575: Quadratic(-0.0001, 0.0060, -0.0029),
}


def printed_quadratics() -> dict[int, Quadratic]:
    """Table 18, misprint corrected, by pressure (kPa)."""
    table = load_table("18")
    names = ("v2_m_per_v2", "v1_m_per_v", "v0_m")
    rows = zip(table["pressure_kpa"], *(table[name] for name in names), strict=True)
    return {int(pressure): Quadratic(*map(float, values)) for pressure, *values in rows}


def used_quadratics() -> dict[int, Quadratic]:
    """The quadratics behind tables I4-I20, by pressure (kPa), in rising order.

    Source:
        Serres 2008, table 18; 250, 275 and 575 kPa recovered from tables I6, I13 and I20.
    """
    return dict(sorted((printed_quadratics() | _USED).items()))


def voltage_from_input(x_input: ArrayLike, quadratic: Quadratic) -> NDArray[np.float64]:
    """Motor voltage that leads to a displacement: the lower root of the quadratic.

    No displacement takes no voltage (at 250 kPa and above the quadratic itself would ask for
    0.4-0.5 V, its dead zone), and a displacement below the quadratic's value at 0 V takes 0 V:
    the drive cannot unwind.

    Args:
        x_input: displacement (m), shape (n,).
        quadratic: the map at the pressure.

    Returns:
        Voltage (V), 0-10, shape of x_input.

    Raises:
        ValueError: a displacement beyond the map; names the reachable range.

    Source:
        Serres 2008, section 5.2.1 and tables I4-I20.
    """
    inputs = np.asarray(x_input, dtype=float)
    if not np.all(inputs <= quadratic.reach):
        raise ValueError(
            f"displacement must lie in 0-{1e3 * quadratic.reach:.4g} mm, which 0-10 V reach; "
            f"the input needs {1e3 * np.max(inputs):.4g} mm. Ask for a smaller or smoother "
            "reference, or another pressure"
        )
    square, linear, constant = quadratic
    # At the peak itself rounding can leave the discriminant a hair below zero.
    root = np.sqrt(np.maximum(linear**2 - 4.0 * square * (constant - inputs), 0.0))
    return np.where(
        inputs == 0.0, 0.0, np.clip((root - linear) / (2.0 * square), 0.0, VOLTAGE_LIMIT)
    )


SAMPLE_TIME = 0.2
"""Time between the samples of tables I4-I20 (s)."""

DAMPING = 2.90e3
"""Damping of the muscle (N s/m); Serres 2008, table 2, contracting."""

MOTOR_RATE = 403.9 * 25.4e-3 / 7.64e-4
"""B = F_M r / B_M of the motor (1/s).

B_M from table 3. F_M = 403.9 N is its 10.26 N m over the 25.4 mm pulley, rounded; with the
unrounded 10.26 N m the last digits of tables I4-I20 do not come out.
"""

# Recovered: the muscle's rate A = K / B of each profile is known to seven digits from the printed
# inputs. With B = 2.90 N s/mm five of the constants K are round; the others an optimiser left.
_SPRING_N_PER_MM = {
    150: 60.0,
    200: 26.32,
    250: 19.52,
    275: 43.1,
    300: 35.984311,
    350: 34.854499,
    400: 34.190224,
    450: 32.0495137,
    500: 29.4774697,
    550: 27.0180736,
    575: 42.0,
}

# Times (s) and positions (m). 45 mm for 90 degrees: a pulley of 28.65 mm, not the station's 25.4.
_REFERENCES = {
    "displacement": ((0.0, 5.0), (0.0, 0.025)),
    "rotation": ((0.0, 5.0, 10.0, 15.0), (0.0, 0.045, 0.045, 0.0)),
}


class ProfileModel(NamedTuple):
    """The model from which a profile is computed at one pressure.

    Attributes:
        muscle_rate: A = K / B of the muscle (1/s).
        quadratic: map from voltage to displacement.
    """

    muscle_rate: float
    quadratic: Quadratic


class VoltageProfile(NamedTuple):
    """A profile: arrays of shape (n,).

    Attributes:
        time: sample times (s).
        reference: wanted position y (m).
        x_input: input that the recursion needs for it (m).
        voltage: motor voltage (V).
    """

    time: NDArray[np.float64]
    reference: NDArray[np.float64]
    x_input: NDArray[np.float64]
    voltage: NDArray[np.float64]


def profile_model(pressure_kpa: float) -> ProfileModel:
    """Rate and map at a pressure, linear between the pressures of tables I4-I20.

    Args:
        pressure_kpa: 150-575.

    Raises:
        ValueError: a pressure outside.

    >>> round(profile_model(200).muscle_rate, 4)
    9.0759
    """
    known = list(_SPRING_N_PER_MM)
    if not known[0] <= pressure_kpa <= known[-1]:
        raise ValueError(
            f"pressure must lie in {known[0]}-{known[-1]} kPa, where the voltage map was "
            f"measured, got {pressure_kpa!r}"
        )
    rates = [1e3 * spring / DAMPING for spring in _SPRING_N_PER_MM.values()]
    maps = np.array(list(used_quadratics().values()))
    rate = float(np.interp(pressure_kpa, known, rates))
    quadratic = Quadratic(*(float(np.interp(pressure_kpa, known, column)) for column in maps.T))
    return ProfileModel(rate, quadratic)


def reachable_mm(pressure_kpa: float) -> float:
    """Largest position (mm) that 0-10 V reach at a pressure (150-575 kPa) by table 18's map.

    >>> round(reachable_mm(150), 1)
    27.2
    """
    return 1e3 * profile_model(pressure_kpa).quadratic.reach


def feedforward(
    reference: ArrayLike, pressure_kpa: float, sample_time: float = SAMPLE_TIME
) -> VoltageProfile:
    """The dissertation's feed-forward for any reference: inverse recursion, then the map.

    Args:
        reference: wanted position (m) at the sample times, shape (n,), the first 0.
        pressure_kpa: 150-575.
        sample_time: time between samples (s).

    Raises:
        ValueError: a pressure outside the measured range, or a reference beyond the map; names
            the range that can be reached. The oscillation of the inverse (`inverse_recursion`)
            needs some of that range, the more the shorter the sample time.

    Source:
        Serres 2008, sections 4.2 and 5.2.1.
    """
    target = np.asarray(reference, dtype=np.float64)
    model = profile_model(pressure_kpa)
    transfer = cascade_transfer(model.muscle_rate, MOTOR_RATE)
    x_input = inverse_recursion(target, tustin_recursion(transfer, sample_time))
    try:
        voltage = voltage_from_input(x_input, model.quadratic)
    except ValueError as error:
        raise ValueError(f"at {pressure_kpa:g} kPa: {error}{_cause(target, model)}") from error
    time = sample_time * np.arange(target.size, dtype=np.float64)
    return VoltageProfile(time, target, x_input, voltage)


def _cause(target: NDArray[np.float64], model: ProfileModel) -> str:
    """What to add to the error where the reference itself is within reach."""
    if not np.all(target <= model.quadratic.reach):
        return ""
    return (
        f". The reference itself needs only {1e3 * np.max(target):.4g} mm: the rest is the "
        "oscillation of the inverse, which grows with 1/T^2; use a longer sample_time"
    )


def voltage_profile(task: str, pressure_kpa: float) -> VoltageProfile:
    """The voltage profile of a task, as in tables I4-I20, at any pressure that the map covers.

    Args:
        task: "displacement" (25 mm in 5 s) or "rotation" (45 mm in 5 s, held, and back).
        pressure_kpa: 150-575; the dissertation's own are `pressures(task)`.

    Raises:
        KeyError: no such task.
        ValueError: see `feedforward`.

    Source:
        Serres 2008, tables I4-I20.
    """
    pressures(task)  # says which tasks there are
    times, positions = _REFERENCES[task]
    time = SAMPLE_TIME * np.arange(round(times[-1] / SAMPLE_TIME) + 1)
    return feedforward(np.interp(time, times, positions), pressure_kpa)
