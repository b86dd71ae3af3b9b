"""The cascade: the dissertation's own linear model of motor, then muscle (Serres 2008, 3.2).

    x_in = map(V, P)                                   static map of table 18
    u' = (K_M / B_M) (x_in - u)                        servo, or with inertia Eq. 10
    y' = (u - y) K / B                                 muscle, tau = B / K at the pressure
    x = F_ce / K - y                                   contraction

One-way: the muscle does not load the motor. With J = 0 and one pressure this is Eq. 22. The load
cell is taken to read the spring's share of the extension, K y, which is F_ce - K x.
"""

from collections.abc import Mapping

from pma_gym.effects.effect import Parameters
from pma_gym.effects.stiffness import spring_stiffness
from pma_gym.plant.compose import Equations, Port

PORTS: dict[str, Port] = {
    "muscle_force": Port(
        "force of the muscle (N), from its two elements",
        least=2,
        most=2,
        only=("contractile_force", "stiffness"),
    ),
    "muscle_damping": Port("damping coefficient of the muscle (N s/m)", least=1, most=1),
    "position_map": Port("displacement that a voltage leads to (m)", least=1, most=1),
    "servo": Port("rate of the motor's displacement (m/s)", least=1, most=1),
    "servo_inertia": Port("acceleration of the motor's displacement (m/s^2)", most=1),
    "regulator_line": Port("pressure that the regulator settles at (Pa)", least=1, most=1),
    "regulator_lag": Port("rate of the pressure (Pa/s)", least=1, most=1),
    "regulator_pace": Port("factor on the regulator's time constant, multiplied"),
}
"""Ports of the cascade: how many effects each takes, and what becomes of their results."""

REFUSED: dict[str, str] = {
    "repperger_damping": (
        "its damping grows with the velocity, of which a cascade knows only the sign; take "
        "[damping] or [symmetric_damping], or plant = 'station'"
    ),
}
"""Effects that would fit a port and mean nothing there, and why."""

PARTS: tuple[str, ...] = ("contractile_force", "stiffness", "limits", "validity")
"""Effects that the cascade reads itself and cannot do without."""

OUTPUTS: dict[str, str] = {
    "contraction": "contraction",
    "rotation": "servo / p_servo.radius",
    "load": "muscle_stiffness * extension",
    "pressure": "pressure",
}
"""True outputs by name: the text of each, in terms of the equations' variables."""

FIRST_PARTS = 4
"""Parts of the first internal step after a command: the servo, 13 428 1/s, overtakes the muscle
there, and the damping turns with it."""


def write_equations(equations: Equations) -> None:
    """Write the dissertation's cascade, with the model's effects at its ports."""
    let = equations.let
    equations.functions.append(spring_stiffness)
    let("pressure_command", equations.one("regulator_line"))
    let("regulator_pace", equations.product("regulator_pace"))
    let("displacement_input", equations.one("position_map"))
    let("muscle_stiffness", "spring_stiffness(pressure, p_stiffness)")
    let("no_load", "contractile_force(pressure, p_contractile_force) / muscle_stiffness")
    let("contraction", "no_load - extension")
    # Damping asks only for the sign: the muscle shortens where the motor lags behind it.
    let("velocity", "extension - servo")
    let("resistance", equations.one("muscle_damping"))
    let("muscle_rate", "muscle_stiffness / resistance")
    equations.add_state("extension", "muscle_rate * (servo - extension)")
    _write_servo(equations)
    equations.add_rate("pressure", equations.one("regulator_lag"))
    equations.add_sensors(OUTPUTS)


def fastest_oscillation(parameters: Mapping[str, Parameters]) -> float:
    """Frequency (rad/s) of the motor on its position loop; 0 without inertia."""
    inertial = parameters.get("servo_inertia")
    return (parameters["servo"].stiffness / inertial.inertia) ** 0.5 if inertial else 0.0


def _write_servo(equations: Equations) -> None:
    if not equations.at("servo_inertia"):
        equations.add_rate("servo", equations.one("servo"))
        return
    call = equations.one(
        "servo_inertia", displacement="servo", displacement_rate="servo_rate", servo="p_servo"
    )
    equations.add_state("servo", "servo_rate")
    equations.add_state("servo_rate", call)
