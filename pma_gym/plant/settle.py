"""A plant at rest: the state in which it stands still at constant commands."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import root_scalar

if TYPE_CHECKING:
    from pma_gym.plant.plant import Plant


def at_rest(
    plant: "Plant", motor_voltage: float, regulator_voltage: float
) -> tuple[np.ndarray, float]:
    """State at rest and the contraction at no load.

    Args:
        plant: the plant.
        motor_voltage: motor command (V).
        regulator_voltage: regulator command (V).
    Returns:
        State vector (SI) with memories at zero, and the contraction x0 (m) that the muscle would
        have with no load at this pressure.
    Raises:
        ValueError: no contraction within twice the limits balances the load.
    """
    search = _Search(plant, (motor_voltage, regulator_voltage))
    search.relax("pressure")
    find = _station if plant.model.plant == "station" else _cascade
    find(search)
    for name in plant.states:
        if name.startswith("lag_"):
            search.relax(name)
    return search.state, search.zero


class _Search:
    """A state on its way to rest; x0 is 0 until it is known."""

    def __init__(self, plant: "Plant", commands: tuple[float, float]) -> None:
        self.plant, self.commands = plant, commands
        self.state, self.zero = np.zeros(len(plant.states)), 0.0

    def __getitem__(self, name: str) -> float:
        return float(self.state[self.plant.states.index(name)])

    def __setitem__(self, name: str, value: float) -> None:
        self.state[self.plant.states.index(name)] = value

    def rate(self, name: str, zero: float | None = None) -> float:
        """Rate of a state."""
        zero = self.zero if zero is None else zero
        rates = self.plant.derivative(self.state, *self.commands, zero)
        return float(rates[self.plant.states.index(name)])

    def relax(self, name: str, of: str = "") -> None:
        """Put a state where a rate vanishes that is linear in it: its own, or that `of` another."""
        rates = []
        for value in (0.0, 1.0):
            self[name] = value
            rates.append(self.rate(of or name))
        slope = rates[1] - rates[0]
        self[name] = -rates[0] / slope
        # From there again: the difference above has lost digits, and a rate may have a kink.
        for _ in range(3):
            self[name] -= self.rate(of or name) / slope


def _cascade(search: _Search) -> None:
    search.relax("servo", of="servo_rate" if "servo_rate" in search.plant.states else "servo")
    search["extension"] = search["servo"]
    truth = search.plant.observe(search.state[None, :], 0.0)
    search.zero = float(truth["contraction"][0]) + search["extension"]


def _station(search: _Search) -> None:
    plant = search.plant
    force = static_force(plant, search.state)
    search.zero = _balance(plant, force, 0.0)
    # With the zero at the contraction itself the cable is slack: the rotor shows the drive's load.
    rotor = plant.model.parameters["rotor"]
    load = search.rate("spin", zero=search["contraction"]) * rotor.inertia / rotor.radius
    search["contraction"] = _balance(plant, force, load) if load > 0.0 else search.zero
    if load > 0.0:
        search["angle"] = _taut_angle(search, load)


def static_force(plant: "Plant", state: np.ndarray) -> Callable[[float], float]:
    """Force of the muscle (N) over contraction (m), at the state's pressure, without the cable."""
    mass = plant.model.parameters["slide"].mass
    probe = state.copy()
    x, velocity = plant.states.index("contraction"), plant.states.index("velocity")

    def force(contraction: float) -> float:
        # With the zero at the contraction itself the cable is slack.
        probe[x] = contraction
        return float(mass * plant.derivative(probe, 0.0, 0.0, contraction)[velocity])

    return force


def _balance(plant: "Plant", force: Callable[[float], float], load: float) -> float:
    """Contraction (m) at which the muscle balances a load (N)."""
    limits = plant.model.parameters["limits"]
    low, high = -2.0 * limits.stretch, 2.0 * limits.contraction
    if load == 0.0 and force(low) == force(high) == 0.0:
        return 0.0
    if (force(low) - load) * (force(high) - load) > 0.0:
        raise ValueError(
            f"model {plant.model.name}: no contraction between {low * 1e3:g} and {high * 1e3:g} mm "
            f"balances a load of {load:.4g} N (the muscle gives {force(low):.4g} to "
            f"{force(high):.4g} N there); lower the first motor voltage or raise the pressure"
        )
    return _root(lambda contraction: force(contraction) - load, low, high)


def _taut_angle(search: _Search, load: float) -> float:
    """Angle at which the cable carries the load (N) that the drive asks for."""
    rotor, cable = (search.plant.model.parameters[name] for name in ("rotor", "cable"))
    extension = search.zero - search["contraction"]

    def torque(angle: float) -> float:
        search["angle"] = angle
        return search.rate("spin")

    furthest = extension + cable.slack + 2.0 * load / cable.stiffness
    return _root(torque, extension / rotor.radius, furthest / rotor.radius)


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    found = root_scalar(function, method="brentq", bracket=(low, high), xtol=1e-15, rtol=1e-14)
    return float(found.root)
