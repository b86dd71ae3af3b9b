"""A plant at rest: the state in which it stands still at constant commands."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

if TYPE_CHECKING:
    from pma_gym.plant.plant import Plant

_PASSES = 6
"""Passes over the chain regulator, servo, muscle, sensor: its longest path is four."""


def at_rest(plant: "Plant", motor_voltage: float, regulator_voltage: float) -> tuple[np.ndarray, float]:
    """State at rest and the contraction at no load.

    Args:
        plant: the plant.
        motor_voltage: motor command (V).
        regulator_voltage: regulator command (V).
    Returns:
        State vector (SI) with memories at zero, and the contraction x0 (m) that the muscle would
        have with no load at this pressure.
    Raises:
        ValueError: if the muscle finds no balance, or the load stretches it beyond all bounds.
    """
    find = _station if plant.model.plant == "station" else _cascade
    return find(plant, motor_voltage, regulator_voltage)


def _relax(plant: "Plant", state: np.ndarray, commands: tuple[float, float], zero: float,
           names: list[str]) -> None:
    """Put states that decay towards something onto it: s = source / decay."""
    arguments = [plant.states.index(name) for name in names]
    for _ in range(_PASSES):
        for at in arguments:
            # The rate is source - decay * s: linear in s, so two evaluations give its root.
            state[at] = 0.0
            source = plant.derivative(state, *commands, zero)[at]
            state[at] = 1.0
            slope = plant.derivative(state, *commands, zero)[at] - source
            state[at] = -source / slope


def _cascade(plant: "Plant", *commands: float) -> tuple[np.ndarray, float]:
    motor_voltage, regulator_voltage = commands
    given = (motor_voltage, regulator_voltage)
    state = np.zeros(len(plant.states))
    servo, extension = plant.states.index("servo"), plant.states.index("extension")
    _relax(plant, state, given, 0.0, ["pressure"])
    if "servo_rate" in plant.states:
        state[servo] = _servo_root(plant, state, commands)
    else:
        _relax(plant, state, given, 0.0, ["servo"])
    state[extension] = state[servo]
    _relax(plant, state, given, 0.0, [name for name in plant.states if name.startswith("lag_")])
    truth = plant.observe(state[None, :], 0.0)
    return state, float(truth["contraction"][0] + state[extension])


def _servo_root(plant: "Plant", state: np.ndarray, commands: tuple[float, ...]) -> float:
    """Servo displacement at which its acceleration, linear in it, vanishes."""
    servo, rate = plant.states.index("servo"), plant.states.index("servo_rate")
    trial = state.copy()
    rates = []
    for value in (0.0, 1.0):
        trial[servo] = value
        rates.append(plant.derivative(trial, commands[0], commands[1], 0.0)[rate])
    return -rates[0] / (rates[1] - rates[0])


def _station(plant: "Plant", *commands: float) -> tuple[np.ndarray, float]:
    motor_voltage, regulator_voltage = commands
    given = (motor_voltage, regulator_voltage)
    state = np.zeros(len(plant.states))
    _relax(plant, state, given, 0.0, ["pressure"])
    x, _, angle = (plant.states.index(name) for name in ("contraction", "velocity", "angle"))

    force = static_force(plant, state)
    load = _drive_load(plant, state, given)
    zero = _balance(force, 0.0, plant)
    state[x] = _balance(force, load, plant) if load > 0.0 else zero
    if load > 0.0:
        state[angle] = _taut_angle(plant, state, given, zero)
    lags = [name for name in plant.states if name.startswith("lag_")]
    _relax(plant, state, given, zero, lags)
    return state, zero


def static_force(plant: "Plant", state: np.ndarray) -> Callable[[float], float]:
    """Force of the muscle (N) as a function of contraction (m), at the state's pressure, no cable."""
    mass = plant.model.parameters["slide"].mass
    probe = state.copy()
    x, velocity = plant.states.index("contraction"), plant.states.index("velocity")

    def force(contraction: float) -> float:
        # With the zero at the contraction itself the cable is exactly untensioned.
        probe[x] = contraction
        return float(mass * plant.derivative(probe, 0.0, 0.0, contraction)[velocity])

    return force


def _balance(force: Callable[[float], float], load: float, plant: "Plant") -> float:
    limits = plant.model.parameters["limits"]
    low, high = -2.0 * limits.stretch, 2.0 * limits.contraction
    if abs(force(low)) == 0.0 and abs(force(high)) == 0.0 and load == 0.0:
        return 0.0
    if (force(low) - load) * (force(high) - load) > 0.0:
        raise ValueError(
            f"model {plant.model.name}: no contraction between {low * 1e3:g} and {high * 1e3:g} mm "
            f"balances a load of {load:.4g} N (the muscle gives {force(low):.4g} to "
            f"{force(high):.4g} N there); lower the first motor voltage or raise the pressure"
        )
    return float(brentq(lambda x: force(x) - load, low, high, xtol=1e-15, rtol=1e-14))


def _drive_load(plant: "Plant", state: np.ndarray, given: tuple[float, float]) -> float:
    """Load that the drive asks for, read off the rotor's acceleration with the cable slack."""
    rotor = plant.model.parameters["rotor"]
    spin = plant.states.index("spin")
    rate = plant.derivative(state, *given, float(state[plant.states.index("contraction")]))[spin]
    return float(rate * rotor.inertia / rotor.radius)


def _taut_angle(plant: "Plant", state: np.ndarray, given: tuple[float, float], zero: float) -> float:
    """Angle at which the cable carries what the drive asks for."""
    angle, spin = plant.states.index("angle"), plant.states.index("spin")
    rotor, cable = plant.model.parameters["rotor"], plant.model.parameters["cable"]
    extension = zero - state[plant.states.index("contraction")]
    load = _drive_load(plant, state, given)
    reach = (extension + cable.slack + 2.0 * load / cable.stiffness) / rotor.radius
    probe = state.copy()

    def torque(value: float) -> float:
        probe[angle] = value
        return float(plant.derivative(probe, *given, zero)[spin])

    return float(brentq(torque, extension / rotor.radius, reach, xtol=1e-15, rtol=1e-14))
