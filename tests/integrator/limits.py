"""Limits that the equations approach: energy, one mass, figure 16, and what inertia changes."""

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from pma_gym.effects.muscle.stiffness import spring_stiffness
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.statics import Condition

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


def energy_drift(tolerance: float, duration: float = 1.0) -> float:
    """Largest change of energy after a load step, friction off, as a share of what moves about."""
    plant = Plant(load_model("serres2008").replace(FRICTIONLESS), tolerance)
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
        tolerance=1e-8,
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
