"""Effects that usual data cannot always tell apart; fixed before the final seeds are run."""

import math
from collections.abc import Callable, Mapping

from benchmarks.hidden_effects.physics.rig import BANDWIDTH, SENSORS, daq_steps

Values = Mapping[str, float]

COLUMNS = ("contraction_mm", "rotation_deg", "load_n", "pressure_kpa")

SAME: dict[str, tuple[str, ...]] = {
    "passive_stretch": ("factor",),
    "load_dependent_damping": ("linear", "quadratic"),
    "regulator_rate_limit": ("limit_kpa_per_s",),
    "regulator_delay": ("delay_ms",),
    "regulator_deadband": ("width_kpa",),
    "hysteresis": ("force_n",),
    "creep": ("time_constant_s", "stiffness_n_per_mm"),
    "slow_creep": ("stiffness_n_per_mm",),
    "coulomb_friction": ("dynamic_n",),
    "bearing_friction": ("force_n",),
    "filling": ("exponent",),
    "cable_slack": ("slack_mm",),
    "drive_dead_zone": ("width_n", "slope"),
    "drive_lag": ("time_constant_ms",),
    "drive_delay": ("delay_ms",),
    "torque_ripple": ("amplitude_percent",),
    "current_imbalance": ("amplitude_percent",),
    "potentiometer_backlash": ("width_deg",),
}
"""Parameters by effect that bear the same name and mean the same."""

CONVERTED: dict[str, Callable[[Values], dict[str, float]]] = {
    "regulator_asymmetry": lambda p: {"vent_ratio": math.exp(p["excess"])},
    "drive_saturation": lambda p: {"limit_n": p["most_n"] - p["cut_n"]},
    "sensor_quantisation": lambda p: {
        COLUMNS[int(p["signal"])] + "_step": p["daq_steps"] * daq_steps(int(p["signal"]))
    },
}
"""Those that the catalogue counts in another way."""


def expected(effect: str, hidden: Values) -> dict[str, float]:
    """Values in file units, by the catalogue's parameter, that describe a hidden effect."""
    if effect in CONVERTED:
        return CONVERTED[effect](hidden)
    if effect.removesuffix("_lag") in SENSORS:
        usual = BANDWIDTH[SENSORS.index(effect.removesuffix("_lag"))]
        time = 1.0 / (2.0 * math.pi * usual) + hidden["longer_ms"] * 1e-3
        return {"bandwidth_hz": 1.0 / (2.0 * math.pi * time)}
    return {name: hidden[name] for name in SAME.get(effect, ())}


GROUPS: tuple[frozenset[str], ...] = (
    frozenset({"hysteresis", "coulomb_friction"}),
    frozenset({"creep", "slow_creep", "warm_up"}),
    frozenset({"drive_lag", "drive_delay", "load_cell_lag", "load_cell_delay"}),
    frozenset(
        {
            "regulator_delay",
            "regulator_rate_limit",
            "pressure_transducer_lag",
            "pressure_transducer_delay",
        }
    ),
    frozenset({"lvdt_lag", "lvdt_delay"}),
    frozenset({"potentiometer_lag", "potentiometer_delay"}),
    frozenset({"drive_dead_zone", "cable_slack"}),
    frozenset({"nonlinear_stiffness", "passive_stretch"}),
    frozenset({"torque_ripple", "current_imbalance"}),
)
"""At most three each, where lag and delay of a sensor count once; an effect in none stands alone.

Delays of sensors came to the catalogue later; no case hides one.
"""


def group(effect: str) -> frozenset[str]:
    """The effects that one may be taken for, itself among them."""
    return next((names for names in GROUPS if effect in names), frozenset({effect}))
