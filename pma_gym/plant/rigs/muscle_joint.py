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
from pma_gym.effects.regulator.valve import drawn_flow
from pma_gym.effects.rig_ports import MUSCLE_JOINT_PORTS, MUSCLE_PAIR_PORTS
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.equilibrium.force_balance import roots
from pma_gym.plant.equilibrium.problem import EquilibriumProblem
from pma_gym.plant.rigs.rig import Rig, TakenCommand
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
    nothing = eq.graph.constant(0.0)
    eq.let("supply_pressure", eq.one("supply") if eq.at("supply") else nothing)
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
    eq.let("friction_factor", eq.product("joint_dry_friction"))
    torque = torque + eq["carried_force"] + eq.total("joint_drive_loss") + eq.total("joint_torque")
    measured = [f"{prefix}{name}" for prefix in muscles for name in ("load", "pressure")]
    eq.outputs = {name: eq[name] for name in ("angle", *measured)}
    drawn = nothing
    eq.add_state("angle", eq["spin"], SCALES["angle"])
    eq.add_state("spin", torque / eq.parameters["inertia"].inertia, SCALES["spin"])
    for prefix in muscles:
        name, rate = f"{prefix}pressure", eq.one(f"{prefix}regulator_lag")
        eq.add_decaying(name, rate, SCALES[name], f"{prefix}chamber")
        air = eq.views[f"{prefix}air_flow"]
        drawn = drawn + trace(drawn_flow, air["opening"], air["air_flow"])
    eq.let("supply_flow", drawn)
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
    """The command on its way to the muscle, and the air that a valve lets in."""

    def let(name: str, value: Value) -> None:
        view[name] = eq.let(f"{prefix}{name}", value)

    def passed(port: str, name: str) -> Value:
        return eq.one(f"{prefix}{port}") if eq.at(f"{prefix}{port}") else view[name]

    nothing = eq.graph.constant(0.0)
    view["pressure"] = eq[f"{prefix}pressure"]
    view["regulator_voltage"] = eq["motor_voltage" if prefix else "regulator_voltage"]
    view["valve_voltage"] = view["regulator_voltage"]
    view["none"] = nothing
    asked = passed("regulator_line", "none")
    if eq.at("co_contraction"):
        # The first muscle's line gives the mean.
        mixed = {
            "pressure_asked": eq.one("regulator_line"),
            "difference_voltage": eq["motor_voltage"],
        }
        asked = eq.one("co_contraction", **mixed)[1 if prefix else 0]
    let("pressure_asked", asked)
    let("pressure_command", passed("regulator_delay", "pressure_asked"))
    (lag,) = eq.at(f"{prefix}regulator_lag")
    view["regulator_time_constant"] = getattr(eq.parameters[lag.name], "time_constant", nothing)
    view["regulator_pace"] = eq.product(f"{prefix}regulator_pace")
    let("opening_asked", passed("valve_drive", "none"))
    let(
        "opening",
        eq.chain(f"{prefix}valve_shape", "opening", passed("valve_delay", "opening_asked")),
    )
    view["supply_pressure"] = eq["supply_pressure"]
    let("air_flow", eq.total(f"{prefix}air_flow"))


def solve_equilibrium(problem: EquilibriumProblem) -> None:
    """Set the pressures to what is asked for, and the arm to where its torques balance."""
    joint = problem.parameters("joint_range")
    for prefix in ("", ANTAGONIST):
        if f"{prefix}pressure" in problem.names:
            problem.relax_memory(f"{prefix}regulator_delay")
            _settle_pressure(problem, prefix)
            problem.relax_memory(f"{prefix}valve_delay")
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


_HIGHEST = 1e7
"""Pressure (Pa) up to which a rest is looked for."""


def _settle_pressure(problem: EquilibriumProblem, prefix: str) -> None:
    """Set a pressure to where nothing flows, or what is shut in to its pressure at the start."""
    name, effects = f"{prefix}pressure", problem.plant.effects.values()
    (lag,) = (each for each in effects if each.port == f"{prefix}regulator_lag")
    driven = lag.memory_names[0] if lag.rate else name
    at_start = problem.parameters(lag.name).get("pressure_at_start")

    def rate(pressures: np.ndarray) -> np.ndarray:
        problem[name] = pressures
        problem.relax_memory(f"{prefix}valve_delay")
        return problem.rate(driven)

    low, high = np.zeros(len(problem.state)), np.full(len(problem.state), _HIGHEST)
    if at_start is None:
        problem[name] = roots(rate, low, high)
        return
    # A leak alone would empty it before a trial begins.
    shut = (rate(low) == 0.0) & (rate(high) == 0.0)
    shut |= all(each.port != f"{prefix}valve_drive" for each in effects)
    problem[name] = np.where(shut, at_start, roots(rate, low, high))


def _companions(prefix: str, *mixed: str) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Effects of a muscle that need others of it, and what gives the pressure asked of it."""
    asking = (f"{prefix}regulator_line", *mixed)
    return (
        *((f"{prefix}{name}", asking) for name in _ASKED),
        (f"{prefix}valve", ("supply",)),
        (f"{prefix}valve", (f"{prefix}air_chamber",)),
        (f"{prefix}valve_spool", (f"{prefix}valve",)),
        (f"{prefix}pressure_loop", (f"{prefix}valve",)),
    )


_ASKED = ("regulator_lag", "regulator_second_order", "pressure_loop")
"""Effects that follow a pressure that is asked for."""

MUSCLE_JOINT = Rig(
    name="muscle_joint",
    signals=signals("angle", "load", "pressure"),
    push_port="joint_torque",
    ports=MUSCLE_JOINT_PORTS,
    parts=("inertia", "joint_range"),
    position_tolerances={"angle": 0.001},
    write_equations=write_equations,
    solve_equilibrium=solve_equilibrium,
    absent_signals="it has an angle and pressures; an angle is read by [columns] as angle_deg",
    shipped_example="muscle_pair",
    has_muscle=False,
    is_diagnosable=True,
    inertia=("inertia", "inertia"),
    companions=_companions(""),
    commands=(
        TakenCommand("regulator_line", 1, "regulator_voltage", "pressure_command"),
        TakenCommand("valve_spool", 1, "valve_voltage"),
        TakenCommand("torque_drive", 0, "torque_command"),
        TakenCommand("dc_motor", 0, "winding_voltage"),
    ),
)

MUSCLE_PAIR = replace(
    MUSCLE_JOINT,
    name="muscle_pair",
    signals=signals("angle", "load", "pressure", "antagonist_load", "antagonist_pressure"),
    ports=MUSCLE_PAIR_PORTS,
    companions=(
        *_companions(""),
        *_companions(ANTAGONIST, "co_contraction"),
        ("co_contraction", ("regulator_line",)),
    ),
    commands=(
        *MUSCLE_JOINT.commands,
        TakenCommand(
            f"{ANTAGONIST}regulator_line", 0, "antagonist_voltage", "antagonist_pressure_command"
        ),
        TakenCommand(f"{ANTAGONIST}valve_spool", 0, "antagonist_valve_voltage"),
        TakenCommand(
            "co_contraction", 0, "difference_voltage", "pressure_difference_command", True
        ),
    ),
)
