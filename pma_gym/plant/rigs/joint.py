"""The joint: one rotary axis with a torque-controlled drive or a DC motor at a voltage.

    J q'' = T_drive(command, q') + T(q, q', memories)

The joint is free: [joint_start] gives the initial angle and speed of a trial. Weight, spring,
damping and dry friction are effects at its port of torques.
"""

from pma_gym.data.signals import signals
from pma_gym.effects.rig_ports import JOINT_PORTS
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.equilibrium.problem import EquilibriumProblem
from pma_gym.plant.rigs.rig import Rig

SCALES: dict[str, float] = {"angle": 0.04, "spin": 0.16}
"""Error scales of angle and speed (rad, rad/s): a 25th of a station's, for the reason of a slide's
(`pma_gym.plant.rigs.slide`)."""

LEAST_COMMAND = 0.1
"""Error scales of delayed commands (N m, V): the range of a small drive."""

TURNING_RAD = 1e-8
"""Tolerance of the angle (rad) at which a step ends when the joint reverses."""


def write_equations(equations: PlantEquations) -> None:
    """Write the equation of motion of the joint, with the model's effects at its ports."""
    eq = equations
    eq.travelled = (eq["angle"], eq["spin"])
    # Laws of friction know the rate of what they act on as `velocity`.
    eq.let("velocity", eq["spin"])
    eq.let("position", eq["angle"])
    # A drive that is late is so whatever its command asks for.
    eq.let("load_asked", eq["motor_voltage"])
    eq.let("load_command", eq.passed("drive_delay", "load_asked"))
    eq.let("command", eq.passed("drive_lag", "load_command"))
    eq.let("load", eq.one("joint_drive"))
    eq.let("drive_force", eq.chain("two_way_shape", "load", eq["load"]))
    eq.let("drive_force", eq["drive_force"] + eq.total("drive_gain"))
    eq.let("carried_force", eq.total("joint_load"))
    eq.let("friction_factor", eq.product("joint_dry_friction"))
    torque = eq["drive_force"] + eq["carried_force"]
    torque = torque + eq.total("joint_drive_loss") + eq.total("joint_torque")
    eq.outputs = {"angle": eq["angle"], "speed": eq["spin"]}
    eq.add_state("angle", eq["spin"], SCALES["angle"])
    eq.let("acceleration", torque / eq.parameters["inertia"].inertia)
    eq.add_state("spin", eq.passed("coupling", "acceleration"), SCALES["spin"])
    late = dict.fromkeys(("drive_delay", "drive_lag"), LEAST_COMMAND)
    eq.add_memories(tuple(JOINT_PORTS), {**late, "coupling": SCALES["spin"]})
    eq.add_sensors({"angle": SCALES["angle"], "speed": SCALES["spin"]})
    eq.add_event("turning", eq["spin"], TURNING_RAD, turning=True)
    eq.add_breakpoints()


def solve_equilibrium(problem: EquilibriumProblem) -> None:
    """Set the joint to the model's initial state, with relaxed bristles."""
    start = problem.parameters("joint_start")
    problem.zero[:] = problem["angle"] = start["angle"]
    problem["spin"] = start["spin"]


JOINT = Rig(
    name="joint",
    signals=signals("angle", "speed"),
    ports=JOINT_PORTS,
    parts=("inertia", "joint_start"),
    position_tolerances={"angle": 0.001},
    write_equations=write_equations,
    solve_equilibrium=solve_equilibrium,
    absent_signals="a joint has neither muscle nor cable; take a torque as torque_command_n_m",
    is_free=True,
    start_paths={"angle": "joint_start.angle_deg", "spin": "joint_start.spin_deg_per_s"},
    has_muscle=False,
    is_diagnosable=True,
    drive_port="joint_drive",
    inertia=("inertia", "inertia"),
    moving_lags={"lag_encoder": "spin"},
    direct_commands={"torque_drive": "torque_command", "dc_motor": "winding_voltage"},
    push_port="joint_torque",
)
