"""The cascade: the dissertation's linear model, a motor followed by a muscle (Serres 2008, 3.2).

    x_in = map(V, P)                                   static map of table 18
    u' = (K_M / B_M) (x_in - u)                        servo, or with inertia Eq. 10
    y' = (u - y) K / B                                 muscle, tau = B / K at the pressure
    c' = (F_ce / K - c) K / B                          contraction without load, also by Eq. 16
    x = c - y                                          contraction

The muscle does not load the motor. With J = 0 and a constant pressure, at which c stays F_ce / K,
this is Eq. 22. We assume that the load cell measures the spring's force of the extension, K y,
which is F_ce - K x.
"""

from pma_gym.codegen.trace import trace
from pma_gym.data.signals import signals
from pma_gym.effects.muscle.contractile_force import contractile_force
from pma_gym.effects.muscle.stiffness import spring_stiffness
from pma_gym.effects.ports import Port
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.equilibrium.problem import EquilibriumProblem
from pma_gym.plant.rigs.rig import REFUSED_AIR, Rig

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
    "regulator_delay": Port("pressure command that has reached the regulator (Pa)", most=1),
    "regulator_lag": Port("rate of the pressure (Pa/s)", least=1, most=1),
    "regulator_pace": Port("factor on the regulator's rate, multiplied"),
}
"""Ports of the cascade, with the number of effects and the use of their results."""

REFUSED_EFFECTS: dict[str, str] = {
    **REFUSED_AIR,
    "repperger_damping": (
        "its damping grows with the velocity, of which a cascade knows only the sign; take "
        "[damping] or [symmetric_damping], or plant = 'station'"
    ),
    "potentiometer_backlash": (
        "a cascade's motor has an angle but no spin to move it by; take plant = 'station'"
    ),
}
"""Effects without a meaning at their port on this rig, with the reason."""

PARTS: tuple[str, ...] = ("contractile_force", "stiffness", "limits", "validity")
"""Required effects that the cascade reads directly."""

POSITION_TOLERANCES: dict[str, float] = {
    "extension": 0.003,
    "free_contraction": 0.003,
    "servo": 0.01,
}
"""States with a smaller tolerance than the others, and its ratio to theirs."""

SCALES: dict[str, float] = {
    "contraction": 25e-3,
    "extension": 25e-3,
    "free_contraction": 25e-3,
    "servo": 25e-3,
    "servo_rate": 1.0,
    "pressure": 500e3,
    "rotation": 1.0,
    "load": 500.0,
}
"""Error scales of the states (SI): roughly the range of each quantity in a trial."""


def write_equations(equations: PlantEquations) -> None:
    """Write the equations of the dissertation's cascade, with the model's effects at its ports."""
    eq = equations
    stiffness, force = eq.parameters["stiffness"], eq.parameters["contractile_force"]
    eq.let("pressure_asked", eq.one("regulator_line"))
    eq.let("pressure_command", eq.passed("regulator_delay", "pressure_asked"))
    eq.let("regulator_time_constant", eq.parameters["regulator_lag"].time_constant)
    eq.let("regulator_pace", eq.product("regulator_pace"))
    eq.let("displacement_input", eq.one("position_map"))
    eq.let("muscle_stiffness", trace(spring_stiffness, eq["pressure"], stiffness))
    no_load = trace(contractile_force, eq["pressure"], force) / eq["muscle_stiffness"]
    eq.let("contraction", eq["free_contraction"] - eq["extension"])
    # Damping asks only for the sign: the muscle shortens where the motor lags behind it.
    eq.let("velocity", eq["extension"] - eq["servo"])
    eq.let("resistance", eq.one("muscle_damping"))
    # By its own direction: one sign for both would make either jump where the other turns.
    filling = no_load - eq["free_contraction"]
    filling_pace = eq["muscle_stiffness"] / eq.one("muscle_damping", velocity=filling)
    eq.outputs = {
        "contraction": eq["contraction"],
        "rotation": eq["servo"] / eq.parameters["servo"].radius,
        "load": eq["muscle_stiffness"] * eq["extension"],
        "pressure": eq["pressure"],
    }
    pull = eq["muscle_stiffness"] / eq["resistance"] * (eq["servo"] - eq["extension"])
    eq.add_state("extension", pull, SCALES["extension"])
    eq.add_state("free_contraction", filling_pace * filling, SCALES["free_contraction"])
    _write_servo(eq)
    eq.add_decaying("pressure", eq.one("regulator_lag"), SCALES["pressure"])
    eq.add_memories(("regulator_delay", "regulator_pace"))
    eq.add_sensors(SCALES)


def _write_servo(eq: PlantEquations) -> None:
    if not eq.at("servo_inertia"):
        eq.add_decaying("servo", eq.one("servo"), SCALES["servo"])
        return
    signals = {"displacement": eq["servo"], "displacement_rate": eq["servo_rate"]}
    acceleration = eq.one("servo_inertia", servo=eq.parameters["servo"], **signals)
    eq.add_state("servo", eq["servo_rate"], SCALES["servo"])
    eq.add_state("servo_rate", acceleration, SCALES["servo_rate"])


def solve_equilibrium(problem: EquilibriumProblem) -> None:
    """Set the motor, and then the muscle, to their steady states."""
    problem.relax("servo", of="servo_rate" if "servo_rate" in problem.names else "servo")
    problem["extension"] = problem["servo"]
    # From below: the muscle's pace there is that of shortening all the way.
    problem.relax("free_contraction", about=-1.0)
    problem.zero[:] = problem.output("contraction") + problem["extension"]


CASCADE = Rig(
    name="cascade",
    signals=signals("contraction", "rotation", "load", "pressure"),
    ports=PORTS,
    parts=PARTS,
    position_tolerances=POSITION_TOLERANCES,
    write_equations=write_equations,
    solve_equilibrium=solve_equilibrium,
    refused_effects=REFUSED_EFFECTS,
    shipped_example="cascade",
)
