"""The muscle joint: an arm that pressure turns, by one muscle or by two against each other.

    J q'' = r_1 F_1 - r_2 F_2 + T(q, q', memories)     arm, r the muscles' moment arms
    F = max(0, F(P, x, memories) - B x')               muscle, which pulls and cannot push
    x_1 = x_1(q),  x_2 = x_2(-q),  r = dx/dq           pulley or lever
    P' from the regulator's lag, or from the air       each muscle's own

The angle grows as the first muscle shortens. Its antagonist has the same laws with parameters of
its own; without one, a spring or a weight pulls back. A drive may turn the arm too.
"""

from dataclasses import replace

import numpy as np

from pma_gym.codegen.graph import Value
from pma_gym.codegen.trace import trace
from pma_gym.data.signals import signals
from pma_gym.effects.arithmetic import positive
from pma_gym.effects.effect import ANTAGONIST
from pma_gym.effects.rig_ports import MUSCLE_JOINT_PORTS, MUSCLE_PAIR_PORTS
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.equilibrium.force_balance import roots
from pma_gym.plant.equilibrium.problem import EquilibriumProblem
from pma_gym.plant.rigs.rig import Command, Rig
from pma_gym.plant.rigs.station import TIGHTENING_M

SCALES: dict[str, float] = {
    "angle": 1.0,
    "spin": 4.0,
    "load": 500.0,
    "antagonist_load": 500.0,
    "pressure": 500e3,
    "antagonist_pressure": 500e3,
}
"""Error scales of the states (SI): roughly the range of each quantity in a trial."""

TURNING_RAD, SLACKENING_N = 1e-8, 1e-3
"""Tolerances of the events: the arm reverses (rad), and a muscle slackens or tightens (N)."""


def write_equations(equations: PlantEquations) -> None:
    """Write the equations of motion of the arm, with the model's effects at its ports."""
    eq = equations
    eq.travelled = (eq["angle"], eq["spin"])
    # Laws of friction know the rate of what they act on as `velocity`.
    eq.let("velocity", eq["spin"])
    eq.let("position", eq["angle"])
    eq.let("command", eq["motor_voltage"])
    muscles = {"": 1.0}
    if eq.at(f"{ANTAGONIST}moment_arm"):
        muscles[ANTAGONIST] = -1.0
    pulls = {prefix: _pull(eq, prefix, side) for prefix, side in muscles.items()}
    torque = eq.total("joint_drive")
    for prefix, side in muscles.items():
        load = eq.let(f"{prefix}load", trace(positive, pulls[prefix]))
        torque = torque + side * eq.views[f"{prefix}muscle_force"]["arm"] * load
    eq.let("drive_force", torque)
    eq.let("carried_force", eq.total("joint_load"))
    torque = torque + eq["carried_force"] + eq.total("joint_drive_loss") + eq.total("joint_torque")
    measured = [f"{prefix}{name}" for prefix in muscles for name in ("load", "pressure")]
    eq.outputs = {name: eq[name] for name in ("angle", *measured)}
    eq.add_state("angle", eq["spin"], SCALES["angle"])
    eq.add_state("spin", torque / eq.parameters["inertia"].inertia, SCALES["spin"])
    for prefix in muscles:
        name, rate = f"{prefix}pressure", eq.one(f"{prefix}regulator_lag")
        eq.add_decaying(name, rate, SCALES[name], f"{prefix}chamber")
    eq.add_memories(tuple(MUSCLE_PAIR_PORTS))
    eq.add_sensors(SCALES)
    eq.add_event("turning", eq["spin"], TURNING_RAD, turning=True)
    for prefix, pull in pulls.items():
        eq.add_event(f"{prefix}slackening", pull, SLACKENING_N)
    for effect in eq.effects.values():
        if effect.event and effect.port in eq.views:
            eq.add_event(effect.name, eq.call(effect, effect.event), TIGHTENING_M)
    eq.add_breakpoints()


def _pull(eq: PlantEquations, prefix: str, side: float) -> Value:
    """Pull of a muscle (N), below 0 where it is slack; its laws read what `prefix` names."""
    view: dict[str, Value] = {}
    ports = MUSCLE_JOINT_PORTS if prefix == "" else MUSCLE_PAIR_PORTS
    for port in ports:
        if port.startswith(prefix) and not port.startswith("joint_"):
            eq.views[port] = view

    angle, start = side * eq["angle"], side * eq["origin"]
    contraction, view["arm"] = eq.one(f"{prefix}moment_arm", angle=angle)
    before, _ = eq.one(f"{prefix}moment_arm", angle=start)
    view["contraction"] = eq.let(f"{prefix}contraction", contraction)
    view["velocity"] = side * view["arm"] * eq["spin"]
    view["travel"], view["direction"] = contraction - before, side * eq["direction"]
    _write_air(eq, prefix, view)
    force = eq.let(f"{prefix}muscle_force", eq.total(f"{prefix}muscle_force"))
    return force - eq.total(f"{prefix}muscle_damping") * view["velocity"]


def _write_air(eq: PlantEquations, prefix: str, view: dict[str, Value]) -> None:
    """The command on its way to the muscle."""
    view["pressure"] = eq[f"{prefix}pressure"]
    view["regulator_voltage"] = eq["motor_voltage" if prefix else "regulator_voltage"]
    view["pressure_asked"] = eq.let(f"{prefix}pressure_asked", eq.one(f"{prefix}regulator_line"))
    delay = f"{prefix}regulator_delay"
    view["pressure_command"] = eq.let(
        f"{prefix}pressure_command", eq.passed(delay, f"{prefix}pressure_asked")
    )
    (lag,) = eq.at(f"{prefix}regulator_lag")
    view["regulator_time_constant"] = eq.parameters[lag.name].time_constant
    view["regulator_pace"] = eq.product(f"{prefix}regulator_pace")


def solve_equilibrium(problem: EquilibriumProblem) -> None:
    """Set the pressures to what is asked for, and the arm to where its torques balance."""
    joint = problem.parameters("joint_range")
    for prefix, slot in (("", 1), (ANTAGONIST, 0)):
        if f"{prefix}pressure" in problem.names:
            problem.relax_memory(f"{prefix}regulator_delay")
            _settle_pressure(problem, prefix, problem.inputs[:, slot])
    for effect in problem.plant.effects.values():
        if effect.rate_independent_law and effect.port.startswith("joint_"):
            problem[effect.memory_names[0]] = joint["arrival"]

    def torque(angles: np.ndarray) -> np.ndarray:
        problem["angle"] = angles
        return problem.rate("spin", zero=angles)

    low, high = (joint[end] + np.zeros(len(problem.state)) for end in ("lowest", "highest"))
    at_low, at_high = torque(low), torque(high)
    angle = roots(torque, low, high)
    outside = ~((at_low >= 0.0) & (at_high <= 0.0))
    if np.any(outside):
        inertia = problem.parameters("inertia")["inertia"]
        ends = [np.degrees(low), np.degrees(high), inertia * at_low, inertia * at_high]
        problem.unbalanced = (
            "no angle between {:g} and {:g} deg balances the first commands (the torque is {:.4g} "
            "and {:.4g} N m there, and must push inwards); begin at other pressures, or change "
            "[joint_range]"
        ).format(*(np.broadcast_to(end, outside.shape)[outside][0] for end in ends))
    problem.zero[:] = problem["angle"] = np.where(outside, np.nan, angle)


_STEADY = 1.0
"""Rate (Pa/s) below which a pressure counts as settled."""


def _settle_pressure(problem: EquilibriumProblem, prefix: str, volts: np.ndarray) -> None:
    """Set a pressure to what is asked for, or to where effects at the chamber let it rest."""
    name, line = f"{prefix}pressure", problem.parameters(f"{prefix}regulator_line")
    asked = np.maximum(line["gain"] * volts + line["offset"], 0.0)
    problem[name] = asked
    if np.any(np.abs(problem.rate(name)) > _STEADY):
        problem.relax(name, about=asked)


MUSCLE_JOINT = Rig(
    name="muscle_joint",
    signals=signals("angle", "load", "pressure"),
    ports=MUSCLE_JOINT_PORTS,
    parts=("inertia", "joint_range"),
    position_tolerances={"angle": 0.001},
    write_equations=write_equations,
    solve_equilibrium=solve_equilibrium,
    absent_signals="it has an angle and pressures; an angle is read by [columns] as angle_deg",
    shipped_example="muscle_pair",
    has_muscle=False,
    inertia=("inertia", "inertia"),
    commands=(
        Command("regulator_line", 1, "regulator_voltage", "pressure_command"),
        Command("torque_drive", 0, "torque_command"),
        Command("dc_motor", 0, "winding_voltage"),
    ),
)

MUSCLE_PAIR = replace(
    MUSCLE_JOINT,
    name="muscle_pair",
    signals=signals("angle", "load", "pressure", "antagonist_load", "antagonist_pressure"),
    ports=MUSCLE_PAIR_PORTS,
    commands=(
        *MUSCLE_JOINT.commands,
        Command(
            f"{ANTAGONIST}regulator_line", 0, "antagonist_voltage", "antagonist_pressure_command"
        ),
    ),
)
