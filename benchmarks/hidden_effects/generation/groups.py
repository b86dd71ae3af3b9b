"""Effects that usual data cannot always tell apart; fixed before the final seeds are run."""

GROUPS: tuple[frozenset[str], ...] = (
    frozenset({"hysteresis", "coulomb_friction"}),
    frozenset({"creep", "slow_creep", "warm_up"}),
    frozenset({"drive_lag", "drive_delay", "load_cell_lag"}),
    frozenset({"regulator_delay", "regulator_rate_limit", "pressure_transducer_lag"}),
    frozenset({"drive_dead_zone", "cable_slack"}),
    frozenset({"nonlinear_stiffness", "passive_stretch"}),
    frozenset({"torque_ripple", "current_imbalance"}),
)
"""At most three each; an effect in none stands alone."""


def group(effect: str) -> frozenset[str]:
    """The effects that one may be taken for, itself among them."""
    return next((names for names in GROUPS if effect in names), frozenset({effect}))
