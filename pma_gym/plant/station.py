"""The station: muscle and slide, cable, rotor, regulator, sensors; a balance of forces.

    m x'' + B x' = F(P, x, memories) - T              muscle and slide, x contraction
    J theta'' + B_M theta' = r (L - T)                 rotor, L what the drive asks for
    T = tension(s, s'),  s = r theta - (x0 - x)        cable, x0 the contraction at no load
    P' from the regulator's lag                        regulator

The tension T is what the load cell reads. Effects add to these balances at their ports.
"""

from collections.abc import Mapping

from pma_gym.effects.effect import Parameters
from pma_gym.plant.compose import Equations, Port

PORTS: dict[str, Port] = {
    "muscle_force": Port("force on the slide (N), added; positive shortens the muscle", least=1),
    "muscle_damping": Port("damping coefficient of the slide (N s/m), added"),
    "slide_force": Port("force on the slide (N), added; positive shortens the muscle"),
    "cable": Port("tension of the cable (N)", least=1, most=1),
    "drive": Port("load that the drive asks for (N)", least=1, most=1),
    "regulator_line": Port("pressure that the regulator settles at (Pa)", least=1, most=1),
    "regulator_lag": Port("rate of the pressure (Pa/s)", least=1, most=1),
    "regulator_pace": Port("factor on the regulator's time constant, multiplied"),
}
"""Ports of the station: how many effects each takes, and what becomes of their results."""

PARTS: tuple[str, ...] = ("rotor", "slide", "limits", "validity")
"""Effects of port `part` that the station reads itself and cannot do without."""

OUTPUTS: dict[str, str] = {
    "contraction": "contraction",
    "rotation": "angle",
    "load": "cable_tension",
    "pressure": "pressure",
}
"""True outputs by name: the text of each, in terms of the equations' variables."""

FIRST_PARTS = 1
"""Parts of the first internal step after a command: nothing here is faster than the step."""


def write_equations(equations: Equations) -> None:
    """Write the balance of the station, with the model's effects at its ports."""
    let = equations.let
    let("load_command", equations.one("drive"))
    let("pressure_command", equations.one("regulator_line"))
    let("regulator_pace", equations.product("regulator_pace"))
    let("stretch", "p_rotor.radius * angle + contraction - zero_contraction")
    let("stretch_rate", "p_rotor.radius * spin + velocity")
    let("cable_tension", equations.one("cable"))
    let("muscle_force", equations.total("muscle_force"))
    let("slide_force", equations.total("slide_force"))
    let("resistance", equations.total("muscle_damping"))
    _write_states(equations)


def fastest_oscillation(parameters: Mapping[str, Parameters]) -> float:
    """Frequency (rad/s) at which slide and rotor swing against each other on the cable."""
    rotor, slide = parameters["rotor"], parameters["slide"]
    return (
        parameters["cable"].stiffness * (1.0 / slide.mass + rotor.radius**2 / rotor.inertia)
    ) ** 0.5


def _write_states(equations: Equations) -> None:
    add = equations.add_state
    add("contraction", "velocity")
    # Damping over mass is the fastest root, 5800 1/s: an explicit step would need 0.3 ms.
    add(
        "velocity",
        "(muscle_force + slide_force - cable_tension) / p_slide.mass",
        "resistance / p_slide.mass",
    )
    add("angle", "spin")
    add(
        "spin",
        "p_rotor.radius * (load_command - cable_tension) / p_rotor.inertia",
        "p_rotor.damping / p_rotor.inertia",
    )
    equations.add_rate("pressure", equations.one("regulator_lag"))
    equations.add_memories(("muscle_force", "slide_force", "cable", "drive"))
    equations.add_sensors(OUTPUTS)
