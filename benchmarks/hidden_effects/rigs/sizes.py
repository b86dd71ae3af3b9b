"""What the catalogue's parameters are where a rig hides an effect: sizes that a fit should name.

Of every hidden law one parameter counts, the one that scales it. Phases and places do not: the
relative error of an angle depends on where its zero is.
"""

from collections.abc import Callable, Mapping

Values = Mapping[str, float]

KEYS: dict[str, tuple[str, float]] = {
    "coulomb_friction": ("dynamic_n", 1.0),
    "joint_friction": ("dynamic_n_m", 1.0),
    "contact_friction": ("force_n", 1.0),
    "load_dependent_friction": ("drive_share_percent", 100.0),
    "joint_load_friction": ("drive_share_percent", 100.0),
    "joint_weight": ("moment_n_m", 1.0),
    "joint_spring": ("stiffness_n_m_per_rad", 1.0),
    "hardening_spring": ("cubic_n_per_mm3", 1e-9),
    "joint_hardening_spring": ("cubic_n_m_per_rad3", 1.0),
    "quadratic_drag": ("coefficient_n_s2_per_mm2", 1e-6),
    "joint_drag": ("coefficient_n_m_s2", 1.0),
    "directional_damping": ("difference_n_s_per_mm", 1e-3),
    "joint_directional_damping": ("difference_n_m_s", 1.0),
    "directional_gain": ("difference_percent", 100.0),
    "cogging": ("amplitude_n", 1.0),
    "drive_delay": ("delay_ms", 1e3),
    "drive_lag": ("time_constant_ms", 1e3),
}
"""By the catalogue's effect, its parameter that is the hidden law's `size`, and file units in one
of SI."""

OTHERWISE: dict[str, Callable[[Values], dict[str, float]]] = {
    "pressure_friction": lambda p: {"slope_n_per_kpa": 1e3 * p["size"] * p["slope"]},
}
"""Those whose parameter is another."""

TURNED = {("imposed", "directional_damping")}
"""Effects with a direction on rigs whose file counts positions the other way round."""


def expected(
    kind: str, name: str, hidden: Values, beside: Mapping[str, Values] | None = None
) -> dict[str, float]:
    """Values in file units, by the catalogue's parameter, that describe a hidden effect.

    The catalogue's friction by pressure has none without pressure; what the hidden law has there
    adds to the friction of a contact.

    Args:
        kind: of the rig.
        name: the catalogue's name of the effect; one that it lacks has no values.
        hidden: parameters of the hidden law (SI).
        beside: those of all that is hidden, by the catalogue's name.
    """
    seal = (beside or {}).get("pressure_friction")
    if name == "contact_friction" and seal is not None:
        return {"force_n": hidden["size"] + seal["size"]}
    if name in OTHERWISE:
        return OTHERWISE[name](hidden)
    if name not in KEYS:
        return {}
    key, factor = KEYS[name]
    sign = -1.0 if (kind, name) in TURNED else 1.0
    return {key: sign * factor * hidden["size"]}
