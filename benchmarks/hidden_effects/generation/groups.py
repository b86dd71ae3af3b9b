"""Effects that usual data cannot always tell apart; fixed before the final seeds are run."""

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
