"""The slide: a rig without a muscle and with a rigid drive that pushes and pulls.

    m x'' + B x' = F(x, x', memories) - L       x contraction, L the load of the drive

The slide is free and has no equilibrium: [start] gives the initial position and speed of a trial.
There is no pulley and no pressure. L is a command, so a load cell in the link would add no
information.
"""

from pma_gym.data.signals import signals
from pma_gym.effects.rig_ports import SLIDE_PORTS
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.equilibrium.problem import EquilibriumProblem
from pma_gym.plant.rigs.rig import Rig
from pma_gym.plant.rigs.station import TURNING_M

_PLACE = (
    "the zero of a slide's position is free in every trial, so a spring has none; "
    "take plant = 'joint'"
)

REFUSED_EFFECTS: dict[str, str] = {
    **dict.fromkeys(("spring", "hardening_spring"), _PLACE),
    "hand_push": "nobody settles a slide that nothing holds; take plant = 'station'",
    "residual_force_of_pressure": "it has no pressure; take plant = 'station'",
}
"""Effects without a meaning at their port on this rig, with the reason."""

PARTS: tuple[str, ...] = ("slide", "start")
"""Required effects of port `part`, which the slide reads directly."""

POSITION_TOLERANCES: dict[str, float] = {"contraction": 0.001}
"""States with a smaller tolerance than the others, and its ratio to theirs."""

SCALES: dict[str, float] = {"contraction": 1e-3, "velocity": 16e-3}
"""Error scales of the states (SI): those of a station moved by 1 mm.

Nothing brings a slide back, so an error of force leads it away until a trial ends, and slides of
1 mm are read to 0.1 um. With the scales of a station, three such slides with friction by load were
simulated up to 1.2, 19 and 1.5 standard deviations of their noise off, against the integrator at a
tolerance of 1e-10; with these up to 0.3, 0.8 and 0.2, in no more time.
"""


def write_equations(equations: PlantEquations) -> None:
    """Write the equation of motion of the slide, with the model's effects at its ports."""
    eq = equations
    slide = eq.parameters["slide"]
    eq.travelled = (eq["contraction"], eq["velocity"])
    eq.let("pressure", eq.graph.constant(0.0))
    eq.let("load_asked", eq.one("two_way_drive"))
    eq.let("load_command", eq.passed("drive_delay", "load_asked"))
    eq.let("load_arriving", eq.passed("drive_lag", "load_command"))
    eq.let("position", eq["contraction"])
    # What pulls the slide out counts as backwards.
    eq.let("load", -eq["load_arriving"])
    eq.let("drive_force", eq.chain("two_way_shape", "load", eq["load"]))
    eq.let("drive_force", eq["drive_force"] + eq.total("drive_gain"))
    eq.let("carried_force", eq.total("contact_force"))
    eq.let("friction_factor", eq.product("dry_friction"))
    eq.let("slide_force", eq.total("slide_force") + eq["carried_force"])
    eq.let("resistance", eq.total("muscle_damping"))
    eq.outputs = {"contraction": eq["contraction"], "velocity": eq["velocity"]}
    pushed = eq["drive_force"] + eq.total("drive_loss")
    force = eq["slide_force"] + pushed - eq["resistance"] * eq["velocity"]
    eq.add_state("contraction", eq["velocity"], SCALES["contraction"])
    eq.let("acceleration", force / slide.mass)
    eq.add_state("velocity", eq.passed("coupling", "acceleration"), SCALES["velocity"])
    eq.add_memories(tuple(SLIDE_PORTS))
    eq.add_sensors(SCALES)
    eq.add_event("turning", eq["velocity"], TURNING_M, turning=True)
    eq.add_breakpoints()


def solve_equilibrium(problem: EquilibriumProblem) -> None:
    """Set the slide to the model's initial state, with relaxed bristles."""
    start = problem.parameters("start")
    problem.zero[:] = problem["contraction"] = start["contraction"]
    problem["velocity"] = start["velocity"]


SLIDE = Rig(
    name="slide",
    signals=signals("contraction", "velocity"),
    ports=SLIDE_PORTS,
    parts=PARTS,
    position_tolerances=POSITION_TOLERANCES,
    write_equations=write_equations,
    solve_equilibrium=solve_equilibrium,
    refused_effects=REFUSED_EFFECTS,
    absent_signals=(
        "a slide has neither pulley nor pressure, and its load is its command; a measured load "
        "that drives it is read by [columns] as load_command_n"
    ),
    is_free=True,
    start_paths={
        "contraction": "start.contraction_mm",
        "velocity": "start.velocity_mm_per_s",
    },
    has_muscle=False,
    is_diagnosable=True,
    drive_port="two_way_drive",
    inertia=("slide", "mass"),
    moving_lags={"lag_lvdt": "velocity"},
    push_port="slide_force",
)
