"""Static map from motor voltage to displacement, and the voltage that a displacement needs."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pma_gym.data.serres2008 import load_table

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
    wanted = np.asarray(x_input, dtype=float)
    if not np.all(wanted <= quadratic.reach):
        raise ValueError(
            f"displacement must lie in 0-{1e3 * quadratic.reach:.4g} mm, which 0-10 V reach; "
            f"the input needs {1e3 * np.max(wanted):.4g} mm. Ask for a smaller or smoother "
            "reference, or another pressure"
        )
    square, linear, constant = quadratic
    # At the peak itself rounding can leave the discriminant a hair below zero.
    root = np.sqrt(np.maximum(linear**2 - 4.0 * square * (constant - wanted), 0.0))
    voltage = (root - linear) / (2.0 * square)
    return np.where(wanted == 0.0, 0.0, np.clip(voltage, 0.0, VOLTAGE_LIMIT))
