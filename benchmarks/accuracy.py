"""How exact the simulation is, and at what price: the integrator against scipy, and limits.

A demanding trial runs on each model: a ramp of the motor with a controller's jitter, a sudden drop
by 30 %, a step of the pressure; the reference is DOP853 at rtol 1e-11, started anew at every
command. Errors are shares of each state's range in the trial.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp

from benchmarks.convergence import orders
from benchmarks.files import write_text
from pma_gym.effects import CATALOGUE
from pma_gym.effects.stiffness import spring_stiffness
from pma_gym.plant.integrate import DEFAULT_STEP_S
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Condition, Plant

MODELS = ("serres2008", "station", "cascade")
PRESSURES = (200e3, 350e3, 550e3)
STEPS_S = (4e-4, 2e-4, DEFAULT_STEP_S, 5e-5, 2.5e-5)
STATE_LIMIT, POSITION_LIMIT = 1e-4, 1e-6
"""Largest errors at the default step, as shares of the range: any state, and the positions."""

POSITIONS = ("contraction", "angle", "extension", "servo")
CONTROL_PERIOD = 0.01
"""Time from one command to the next (s)."""

JITTER = 0.1
"""Standard deviation of the motor voltage around its ramp (V): a derivative's on a noisy sensor."""


@dataclass(frozen=True)
class Commands:
    """What a plant is told, held from each time to the next.

    Attributes:
        time: times (s), shape (n,).
        motor: motor voltage (V), shape (n,).
        regulator: regulator voltage (V), shape (n,).
    """

    time: NDArray[np.float64]
    motor: NDArray[np.float64]
    regulator: NDArray[np.float64]


@dataclass(frozen=True)
class Error:
    """What a step size costs.

    Attributes:
        step: largest internal step (s).
        states: largest error of each state over all trials, as a share of its range.
        cost: time of a control step of 10 ms (s).
    """

    step: float
    states: dict[str, float]
    cost: float

    @property
    def worst_state(self) -> str:
        """Name of the state with the largest error."""
        return max(self.states, key=lambda name: self.states[name])

    @property
    def position(self) -> float:
        """Largest error of a position."""
        return max(error for name, error in self.states.items() if name in POSITIONS)

    @property
    def met(self) -> bool:
        """Whether both limits are kept."""
        return self.states[self.worst_state] <= STATE_LIMIT and self.position <= POSITION_LIMIT


def demanding_commands(plant: Plant, pressure: float, seed: int = 0, steps: int = 100) -> Commands:
    """A ramp of the motor with jitter, a drop by 30 %, a pressure step of 0.3 V; 100 Hz."""
    generator = np.random.default_rng(seed)
    when = CONTROL_PERIOD * np.arange(steps + 1, dtype=np.float64)
    motor = np.clip(0.5 + 2.2 * when + JITTER * generator.standard_normal(steps + 1), 0.0, 10.0)
    motor[6 * steps // 10 : 3 * steps // 4] *= 0.7
    regulator = np.full(steps + 1, plant.regulator_voltage(pressure))
    regulator[steps // 2 :] += 0.3
    return Commands(when, motor, regulator)


def reference(plant: Plant, start: Condition, commands: Commands) -> NDArray[np.float64]:
    """States at every command, shape (n, states), by DOP853 at rtol 1e-11."""
    states = [start.state]
    spans = zip(np.diff(commands.time), commands.motor, commands.regulator, strict=False)
    for duration, motor, regulator in spans:

        def rate(
            _: float, state: NDArray, motor: float = motor, regulator: float = regulator
        ) -> NDArray:
            return plant.derivative(state, motor, regulator, start.zero_contraction)

        span = solve_ivp(rate, (0.0, duration), states[-1], "DOP853", rtol=1e-11, atol=1e-13)
        states.append(span.y[:, -1])
    return np.array(states)


def simulated(plant: Plant, start: Condition, commands: Commands) -> NDArray[np.float64]:
    """The same by the plant's own integrator."""
    when, motor, regulator = commands.time, commands.motor, commands.regulator
    return plant.run(when, motor, regulator, joined=False, condition=start)[0]


def shares(states: NDArray[np.float64], truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest error of each state as a share of its range, shape (states,)."""
    return np.abs(states - truth).max(axis=0) / np.ptp(truth, axis=0)


def error_ladder(model: str | Model, steps: tuple[float, ...] = STEPS_S) -> list[Error]:
    """Errors of a model over the demanding trials, one entry a step size."""
    plants = [Plant(model, step) for step in steps]
    worst = np.zeros((len(steps), len(plants[0].states)))
    costs = np.full(len(steps), np.inf)
    for pressure in PRESSURES:
        start = plants[0].settle(0.0, pressure)
        commands = demanding_commands(plants[0], pressure)
        truth = reference(plants[0], start, commands)
        for row, plant in enumerate(plants):
            worst[row] = np.maximum(worst[row], shares(simulated(plant, start, commands), truth))
            cost = _best_time(lambda p=plant, s=start, c=commands: simulated(p, s, c))
            costs[row] = min(costs[row], cost / (len(commands.time) - 1))
    return [
        Error(step, dict(zip(plants[0].states, map(float, row), strict=True)), float(cost))
        for step, row, cost in zip(steps, worst, costs, strict=True)
    ]


def _best_time(call: Callable[[], object], repeats: int = 5) -> float:
    """Shortest of some runs (s): what else the machine does only ever adds to it."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return min(times)


FRICTIONLESS = {
    "damping.contracting_n_s_per_mm": 0.0,
    "damping.relaxing_n_s_per_mm": 0.0,
    "damping.high_intercept_n_s_per_mm": 0.0,
    "damping.high_slope_n_s_per_mm_per_kpa": 0.0,
    "coulomb_friction.static_n": 0.0,
    "coulomb_friction.dynamic_n": 0.0,
    "cable.damping_n_s_per_mm": 0.0,
    "rotor.damping_n_m_s": 0.0,
}
"""`serres2008` without anything that loses energy."""


def energy_drift(step: float, duration: float = 1.0) -> float:
    """Largest change of energy after a load step, friction off, as a share of what moves about."""
    plant = Plant(load_model("serres2008").replace(FRICTIONLESS), step)
    start = plant.settle(3.0, 300e3)
    count = round(duration / 1e-3) + 1
    constant = np.full(count, 1.0)
    regulator = plant.regulator_voltage(300e3)
    states, zero = plant.run(
        1e-3 * np.arange(count), 4.0 * constant, regulator * constant, condition=start
    )
    kinetic, total = energies(plant, states, zero, 4.0)
    return float(np.ptp(total) / kinetic.max())


def energies(
    plant: Plant, states: NDArray[np.float64], zero: float, motor_voltage: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Kinetic and total energy (J) of `serres2008` over time, the drive's work included.

    Args:
        plant: a plant of that model, whatever its parameters.
        states: shape (n, states), at constant pressure.
        zero: contraction that the stretch of the cable counts from (m).
        motor_voltage: held over the whole time (V).
    """
    part = plant.model.parameters
    x, velocity, angle, spin, pressure = states[:, :5].T
    stiffness = spring_stiffness(pressure[0], part["stiffness"])
    force = part["contractile_force"].slope * pressure[0] + part["contractile_force"].intercept
    load = part["drive"].gain * motor_voltage + part["drive"].offset
    stretch = part["rotor"].radius * angle + x - zero - part["cable"].slack
    kinetic = 0.5 * part["slide"].mass * velocity**2 + 0.5 * part["rotor"].inertia * spin**2
    springs = 0.5 * stiffness * x**2 + 0.5 * part["cable"].stiffness * np.maximum(stretch, 0) ** 2
    return kinetic, kinetic + springs - force * x - load * part["rotor"].radius * angle


def one_mass_error(cable_n_per_mm: float, duration: float = 0.1) -> float:
    """Largest difference of contraction (m) from the one-mass form with a rigid cable.

        (m + J / r^2) x'' + (B + B_M / r^2) x' = F - L

    The cable's damping keeps its share of the critical one; the load steps by 1 V.
    """
    damping = 0.0194 * np.sqrt(cable_n_per_mm / 550.0)
    plant = Plant(
        load_model("serres2008").replace(
            {
                "cable.stiffness_n_per_mm": cable_n_per_mm,
                "cable.damping_n_s_per_mm": damping,
                "coulomb_friction.static_n": 0.0,
                "coulomb_friction.dynamic_n": 0.0,
            }
        ),
        step=0.05 / np.sqrt(cable_n_per_mm * 1e3 * 2.32),
    )
    start, voltage = plant.settle(3.0, 300e3), 4.0
    part, x = plant.model.parameters, plant.states.index("contraction")
    mass = part["slide"].mass + part["rotor"].inertia / part["rotor"].radius ** 2
    load = part["drive"].gain * voltage + part["drive"].offset
    probe = start.state.copy()

    def rate(_: float, state: NDArray) -> list[float]:
        # With the zero at the contraction itself the cable is slack: this is the muscle alone.
        probe[x : x + 2] = state
        regulator = plant.regulator_voltage(300e3)
        alone = plant.derivative(probe, 0.0, regulator, state[0] + 1.0)[x + 1]
        drag = part["rotor"].damping / part["rotor"].radius ** 2 * state[1]
        return [state[1], (part["slide"].mass * alone - drag - load) / mass]

    when = np.linspace(0.0, duration, 101)
    rigid = solve_ivp(rate, (0.0, duration), start.state[x : x + 2], "DOP853", when, rtol=1e-11)
    regulator = np.full(101, plant.regulator_voltage(300e3))
    states, _ = plant.run(when, np.full(101, voltage), regulator, condition=start)
    return float(np.abs(states[:, x] - rigid.y[0]).max())


def mass_effect(mass: float = 0.5, pressure: float = 400e3) -> float:
    """Figure 16: how much the moving mass changes the muscle's free contraction.

    Args:
        mass: moving mass (kg).
        pressure: gauge pressure at which the muscle is let go from its resting length (Pa).
    Returns:
        Largest difference from F_ce / K (1 - exp(-K t / B)), as a share of the contraction.
    """
    model = load_model("serres2008").replace(
        {
            "slide.mass_kg": mass,
            "coulomb_friction.static_n": 0.0,
            "coulomb_friction.dynamic_n": 0.0,
        }
    )
    plant = Plant(model)
    rest = plant.settle(0.0, pressure).zero_contraction
    start = _released(plant, pressure)
    when = np.linspace(0.0, 1.0, 1001)
    regulator = np.full(1001, plant.regulator_voltage(pressure))
    states, _ = plant.run(when, np.zeros(1001), regulator, condition=start)
    part = model.parameters
    stiffness = (
        part["contractile_force"].slope * pressure + part["contractile_force"].intercept
    ) / rest
    massless = rest * (1.0 - np.exp(-stiffness / part["damping"].contracting * when))
    contraction = states[:, plant.states.index("contraction")]
    return float(np.abs(contraction - massless).max() / rest)


def _released(plant: Plant, pressure: float) -> Condition:
    """The muscle under pressure at its resting length, about to be let go, with a slack cable."""
    start = plant.settle(0.0, pressure)
    state = start.state.copy()
    state[plant.states.index("contraction")] = 0.0
    return Condition(state, zero_contraction=1.0)


def motor_inertia_effect(inertia: float, pressure: float = 400e3) -> float:
    """How much the motor's inertia changes the cascade's step response.

    Args:
        inertia: of the motor (kg m^2), at a damping ratio of 0.7.
        pressure: gauge pressure (Pa).
    Returns:
        Largest difference from the response without inertia, as a share of the step.
    """
    inertial = {"inertia_kg_m2": inertia, "damping_ratio": 0.7}
    return _largest_change(
        load_model("cascade"),
        with_effect(load_model("cascade"), "servo_inertia", inertial),
        pressure,
    )


def rotor_inertia_effect(factor: float, model: str = "station", pressure: float = 400e3) -> float:
    """How much another inertia of the rotor changes the station's response to a step of 1 V.

    Args:
        factor: on the model's own inertia, itself an assumption.
        model: name of the model.
        pressure: gauge pressure (Pa).
    Returns:
        Largest difference of contraction, as a share of the step.
    """
    nominal = load_model(model)
    inertia = nominal.at_the_door("rotor")["inertia_kg_m2"]
    assert isinstance(inertia, float)
    changed = nominal.replace({"rotor.inertia_kg_m2": factor * inertia})
    return _largest_change(nominal, changed, pressure)


def with_effect(model: Model, effect: str, values: dict[str, float]) -> Model:
    """The model with one more effect, given at the door."""
    parameters = {**model.parameters, effect: CATALOGUE[effect].parse(values)}
    return Model(model.name, model.title, model.plant, parameters, model.notes)


def _largest_change(one: Model, other: Model, pressure: float) -> float:
    responses = []
    for model in (one, other):
        plant = Plant(model)
        start = plant.settle(3.0, pressure)
        when = np.linspace(0.0, 1.0, 1001)
        regulator = np.full(1001, plant.regulator_voltage(pressure))
        states, zero = plant.run(when, np.full(1001, 4.0), regulator, condition=start)
        responses.append(plant.observe(states, zero)["contraction"])
    return float(np.abs(responses[1] - responses[0]).max() / np.ptp(responses[0]))


def run_accuracy(console: Console | None = None, out: Path | None = None) -> bool:
    """Print the error of every state over step size, the limits, and what inertia changes.

    Args:
        console: where to print; the terminal if not given.
        out: text file to write the same to, if given.
    Returns:
        Whether the default step keeps both limits on every model.
    """
    console = console or Console()
    text = StringIO()
    page = Console(file=text, width=120)
    kept = True
    for name in MODELS:
        ladder = error_ladder(name)
        kept &= all(error.met for error in ladder if error.step == DEFAULT_STEP_S)
        for place in (console, page):
            place.print(_ladder_table(name, ladder))
    checks = _checks_table()
    for place in (console, page):
        place.print(checks)
        place.print(f"Default step {_milli(DEFAULT_STEP_S)}: limits {_verdict(kept)}")
    if out:
        write_text(out, text.getvalue())
    return kept


def _ladder_table(name: str, ladder: list[Error]) -> Table:
    table = Table(title=f"{name}: error as a share of the range, {len(PRESSURES)} trials")
    table.add_column("step")
    for error in ladder:
        style = "bold" if error.step == DEFAULT_STEP_S else ""
        table.add_column(_milli(error.step), justify="right", style=style)
    for state in ladder[0].states:
        table.add_row(state, *(f"{error.states[state]:.1e}" for error in ladder))
    table.add_section()
    table.add_row("us per 10 ms", *(f"{error.cost * 1e6:.1f}" for error in ladder))
    table.add_row("limits", *(_verdict(error.met) for error in ladder))
    return table


def _checks_table() -> Table:
    table = Table(title="Limits and inertia", show_header=False)
    # With little damping, finer steps than these reach the reference's floor.
    for damping, steps in ((0.05, (8e-4, 4e-4, 2e-4)), (2.9, (2e-4, 1e-4, 5e-5))):
        found = orders(damping, np.array(steps))[1].min(axis=1)
        words = ", ".join(f"{order:.2f}" for order in found)
        table.add_row(
            f"order of convergence, damping {damping:g} N s/mm, {_milli(steps[0])} halved", words
        )
    for stiffness in (1e4, 1e5, 1e6):
        error = f"{one_mass_error(stiffness) * 1e6:.2g} um"
        table.add_row(f"one-mass form, cable {stiffness:.0e} N/mm: contraction differs by", error)
    for step in (DEFAULT_STEP_S, 1e-5):
        table.add_row(f"energy drift in 1 s, step {_milli(step)}", f"{energy_drift(step):.1e}")
    mass = f"{mass_effect():.2%} (under 1 % in figure 16)"
    table.add_row("moving mass 0.5 kg, free contraction at 400 kPa", mass)
    for inertia in (2e-3, 2e-5):
        change = f"{motor_inertia_effect(inertia):.2%}"
        table.add_row(f"cascade, motor inertia {inertia:g} kg m^2, damping ratio 0.7", change)
    for factor in (0.5, 2.0):
        change = f"{rotor_inertia_effect(factor):.2%}"
        table.add_row(f"station, rotor inertia times {factor:g}, load step at 400 kPa", change)
    return table


def _milli(step: float) -> str:
    return f"{step * 1e3:g} ms"


def _verdict(met: bool) -> str:
    return "met" if met else "missed"
