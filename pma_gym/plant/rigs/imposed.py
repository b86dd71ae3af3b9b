"""The imposed motion: an external drive moves a muscle, a rod or a seal, and the force is measured.

x'' = w^2 (c - x) - 2 w x'                         c the record, advanced by the states' lag
    F = F_muscle(P, x, memories) + F_contact(P, x, x', memories) - B x'

The motion is the input, so there is no balance of forces: F is the force on the drive, without the
inertia of the moved parts. The pressure follows a regulator's command or a measured record.
"""

from pma_gym.codegen.trace import trace
from pma_gym.data.signals import signals
from pma_gym.effects.contact.imposed_motion import following_rate
from pma_gym.effects.rig_ports import IMPOSED_PORTS
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.equilibrium.problem import EquilibriumProblem
from pma_gym.plant.rigs.rig import REFUSED_AIR, Rig
from pma_gym.plant.rigs.station import TURNING_M

REFUSED_EFFECTS: dict[str, str] = {
    **REFUSED_AIR,
    "load_dependent_damping": "there is no cable; take [damping] or [symmetric_damping]",
    "residual_load": "there is no load beside the force that is measured",
}
"""Effects without a meaning at their port on this rig, with the reason."""

SCALES: dict[str, float] = {
    "contraction": 25e-3,
    "velocity": 0.4,
    "pressure": 500e3,
    "force": 500.0,
}
"""Error scales of the states (SI): roughly the range of each quantity in a trial."""


def write_equations(equations: PlantEquations) -> None:
    """Write the equations of motion and force, with the model's effects at its ports."""
    eq = equations
    eq.travelled = (eq["contraction"], eq["velocity"])
    # The states follow two commands, a position (m) and what gives the pressure (V or Pa).
    eq.let("command", eq["motor_voltage"])
    eq.let("position", eq["contraction"])
    acceleration = eq.one("imposed_motion")
    regulated = bool(eq.at("regulator_line"))
    eq.let("pressure_asked", eq.one("regulator_line") if regulated else eq["regulator_voltage"])
    eq.let("pressure_command", eq.passed("regulator_delay", "pressure_asked"))
    corner = trace(following_rate, eq.parameters["imposed_motion"])
    lag = eq.parameters.get("regulator_lag")
    eq.let("regulator_time_constant", lag.time_constant if lag else 1.0 / corner)
    eq.let("regulator_pace", eq.product("regulator_pace"))
    at_once = corner * eq["pressure_command"], corner
    force = eq.total("muscle_force") + eq.total("contact_force") + eq.total("rod_force")
    resistance = eq.total("muscle_damping") * eq.product("damping_factor")
    eq.outputs = {
        "contraction": eq["contraction"],
        "force": force - resistance * eq["velocity"],
        "pressure": eq["pressure"],
    }
    eq.add_state("contraction", eq["velocity"], SCALES["contraction"])
    eq.add_state("velocity", acceleration, SCALES["velocity"])
    source = eq.one("regulator_lag") if lag else at_once
    eq.add_decaying("pressure", source, SCALES["pressure"], "chamber")
    eq.add_memories(tuple(IMPOSED_PORTS))
    eq.add_sensors(SCALES)
    eq.add_event("turning", eq["velocity"], TURNING_M, turning=True)
    # No rate depends on a memory of the way, which is exact over any step that does not turn.
    eq.path_breakpoints.clear()


def solve_equilibrium(problem: EquilibriumProblem) -> None:
    """Set the states to their steady values at the first commands."""
    problem.relax("pressure")
    problem["velocity"] = 0.0
    problem.relax("contraction", of="velocity")


IMPOSED = Rig(
    name="imposed",
    signals=signals("contraction", "force", "pressure"),
    ports=IMPOSED_PORTS,
    parts=(),
    position_tolerances={"contraction": 0.001, "velocity": 0.01},
    write_equations=write_equations,
    solve_equilibrium=solve_equilibrium,
    refused_effects=REFUSED_EFFECTS,
    absent_signals=(
        "the motion is imposed, so force is what is compared; a measured motion is read by "
        "[columns] as contraction_command_mm, a measured force as force_n"
    ),
    has_muscle=False,
    is_diagnosable=True,
    imposes_motion=True,
    modifying_ports=("lost_motion",),
    needed_ports={
        "muscle_force": "muscle_force",
        **dict.fromkeys(
            ("regulator_delay", "regulator_lag", "regulator_pace", "chamber"), "regulator_line"
        ),
    },
    direct_commands={"imposed_motion": "contraction_command"},
)
