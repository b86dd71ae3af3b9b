"""The station: muscle and slide, cable, rotor, regulator and sensors, as a balance of forces.

    m x'' + B x' = F(P, x, memories) - T              muscle and slide, x contraction
    J theta'' + B_M theta' = r (L - T)                 rotor, L the load of the drive
    T = tension(s, s'),  s = r theta - (x0 - x)        cable, x0 the contraction at no load
    P' from the regulator's lag                        regulator

The load cell measures the tension T. Effects add to these balances at their ports.
"""

from pma_gym.codegen.graph import Value
from pma_gym.codegen.trace import trace
from pma_gym.data.signals import signals
from pma_gym.effects.cable.hanging_load import hanging_inertia
from pma_gym.effects.cable.leg import leg_torque
from pma_gym.effects.ports import STATION_PORTS
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.equilibrium.force_balance import solve_station
from pma_gym.plant.rigs.rig import REFUSED_AIR, Rig

PARTS: tuple[str, ...] = ("rotor", "slide", "limits", "validity")
"""Required effects of port `part`, which the station reads directly."""

POSITION_TOLERANCES: dict[str, float] = {"contraction": 0.001, "angle": 0.001}
"""States with a smaller tolerance than the others, and its ratio to theirs: with dry friction, an
error of 1 nm causes an error of a ten-thousandth of the friction force."""

SCALES: dict[str, float] = {
    "contraction": 25e-3,
    "velocity": 0.4,
    "angle": 1.0,
    "spin": 4.0,
    "pressure": 500e3,
    "rotation": 1.0,
    "load": 500.0,
}
"""Error scales of the states (SI): roughly the range of each quantity in a trial."""


TURNING_M, TIGHTENING_M = 2e-10, 1e-8
"""Tolerances (m) of the events: the slide reverses, and cable or muscle tighten."""


def write_equations(equations: PlantEquations) -> None:
    """Write the equations of motion of the station, with the model's effects at its ports."""
    eq = equations
    rotor = eq.parameters["rotor"]
    eq.travelled = (eq["contraction"], eq["velocity"])
    _write_drive(eq)
    eq.let("pressure_asked", eq.one("regulator_line"))
    eq.let("pressure_command", eq.passed("regulator_delay", "pressure_asked"))
    eq.let("regulator_time_constant", eq.parameters["regulator_lag"].time_constant)
    eq.let("regulator_pace", eq.product("regulator_pace"))
    eq.let("stretch", rotor.radius * eq["angle"] + (eq["contraction"] - eq["zero_contraction"]))
    eq.let("motor_angle", eq["angle"] - eq["zero_contraction"] / rotor.radius)
    eq.let("stretch_rate", rotor.radius * eq["spin"] + eq["velocity"])
    eq.let("cable_tension", eq.one("cable"))
    eq.let("muscle_force", eq.total("muscle_force"))
    eq.let("friction_factor", eq.graph.constant(1.0))
    eq.let("slide_force", eq.total("slide_force"))
    eq.let("resistance", eq.total("muscle_damping") * eq.product("damping_factor"))
    eq.outputs = {
        "contraction": eq["contraction"],
        "rotation": eq["angle"],
        "load": eq["cable_tension"],
        "pressure": eq["pressure"],
    }
    _write_states(eq)


def _write_drive(eq: PlantEquations) -> None:
    """The load on its way from the command to the pulley."""
    eq.let("load_asked", eq.chain("drive_shape", "load", eq.one("drive")))
    eq.let("load_command", eq.passed("drive_delay", "load_asked"))
    eq.let("load_arriving", eq.passed("drive_lag", "load_command"))


def _inertia(eq: PlantEquations) -> Value:
    """Inertia at the pulley (kg m^2): the rotor's, of what hangs on the cable, of a leg."""
    rotor = eq.parameters["rotor"]
    inertia = rotor.inertia
    if "hanging_load" in eq.parameters:
        hanging = eq.parameters["hanging_load"]
        inertia = inertia + trace(hanging_inertia, eq["load_asked"], rotor.radius, hanging)
    return inertia + eq.parameters["leg"].inertia if "leg" in eq.parameters else inertia


def _drag(eq: PlantEquations) -> Value:
    """Torque that turning costs (N m): the rotor's damping, and a knee's."""
    drag = eq.parameters["rotor"].damping * eq["spin"]
    if "leg" not in eq.parameters:
        return drag
    return drag + trace(leg_torque, eq["spin"], eq.parameters["leg"])


def _write_states(eq: PlantEquations) -> None:
    rotor, slide = eq.parameters["rotor"], eq.parameters["slide"]
    force = eq["muscle_force"] + eq["slide_force"] - eq["cable_tension"]
    load = eq["load_arriving"] + eq.total("drive_ripple")
    torque = rotor.radius * (load - eq["cable_tension"])
    eq.add_state("contraction", eq["velocity"], SCALES["contraction"])
    eq.add_state(
        "velocity", (force - eq["resistance"] * eq["velocity"]) / slide.mass, SCALES["velocity"]
    )
    eq.add_state("angle", eq["spin"], SCALES["angle"])
    eq.add_state("spin", (torque - _drag(eq)) / _inertia(eq), SCALES["spin"])
    eq.add_decaying("pressure", eq.one("regulator_lag"), SCALES["pressure"], "chamber")
    eq.add_memories(tuple(STATION_PORTS))
    eq.add_sensors(SCALES)
    eq.add_event("turning", eq["velocity"], TURNING_M, turning=True)
    for effect in (*eq.at("cable"), *eq.at("muscle_force")):
        if effect.event:
            name = effect.event.__name__
            eq.add_event(name, eq.call(effect, effect.event), TIGHTENING_M)
    eq.add_breakpoints()


STATION = Rig(
    name="station",
    signals=signals("contraction", "rotation", "load", "pressure"),
    ports=STATION_PORTS,
    parts=PARTS,
    position_tolerances=POSITION_TOLERANCES,
    write_equations=write_equations,
    solve_equilibrium=solve_station,
    refused_effects=REFUSED_AIR,
    shipped_example="serres2008",
    balances_loads=True,
    is_diagnosable=True,
    push_port="slide_force",
)
