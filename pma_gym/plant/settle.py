"""A plant at rest: the state in which it stands still at constant commands."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pma_gym.effects.effect import signals
from pma_gym.effects.hanging_load import GRAVITY

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
        State vector (SI) with memories at zero, but for a load that has long arrived, and the
        contraction x0 (m) that the muscle would have with no load at this pressure.
    Raises:
        ValueError: no contraction within twice the limits balances the load.
    """
    commands = np.array([motor_voltage], float), np.array([regulator_voltage], float)
    search = _search(plant, *commands, None)
    if search.unbalanced:
        raise ValueError(f"model {plant.model.name}: {search.unbalanced}")
    return search.state[0], float(search.zero[0])


def all_at_rest(
    plant: "Plant",
    motor_voltages: np.ndarray,
    regulator_voltages: np.ndarray,
    vectors: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Many plants of one structure at rest, as `at_rest` one; none depends on the others.

    Args:
        plant: one of them.
        motor_voltages: motor commands (V), shape (n,).
        regulator_voltages: regulator commands (V), shape (n,).
        vectors: parameters of each (`program.vector`), shape (n, numbers); the plant's own if not
            given.
    Returns:
        State vectors, shape (n, states), and contractions x0 (m), shape (n,); NaN where no
        contraction balances the load.
    """
    search = _search(plant, motor_voltages, regulator_voltages, vectors)
    return search.state, search.zero


def _search(
    plant: "Plant",
    motor_voltages: np.ndarray,
    regulator_voltages: np.ndarray,
    vectors: np.ndarray | None,
) -> "_Search":
    search = _Search(plant, motor_voltages, regulator_voltages, vectors)
    search.relax_memory("regulator_delay")
    if "pressure" in search.names:
        _settle_pressure(search)
    for port in ("drive_delay", "drive_lag"):
        search.relax_memory(port)
    {"station": _station, "cascade": _cascade, "slide": _slide}[plant.model.plant](search)
    for name in plant.states:
        if name.startswith("lag_"):
            search.relax(name)
    if plant.model.plant == "slide" and "lag_lvdt" in plant.states:
        search.follow("lag_lvdt", search["velocity"])
    return search


class _Search:
    """States on their way to rest, shape (n, states); x0 of shape (n,) is 0 until it is known."""

    def __init__(
        self,
        plant: "Plant",
        motor: np.ndarray,
        regulator: np.ndarray,
        vectors: np.ndarray | None,
    ) -> None:
        self.plant = plant
        self.names = {name: i for i, name in enumerate(plant.states)}
        self.vectors = None if vectors is None else np.ascontiguousarray(vectors, float)
        # Motor and regulator command, x0.
        self.inputs = np.stack([motor, regulator, np.zeros(len(motor))], axis=1).astype(float)
        self.state = np.zeros((len(motor), len(self.names)))
        numbers = plant.vector if self.vectors is None else self.vectors
        self._stride = 0 if self.vectors is None else self.vectors.shape[1]
        # A search asks for thousands of rates: looking its addresses up takes as long as they do.
        self._state_at, self._numbers_at = self.state.ctypes.data, numbers.ctypes.data
        self._numbers = numbers
        self._columns: dict[str, dict[str, np.ndarray]] = {}
        self.unbalanced = ""

    @property
    def zero(self) -> np.ndarray:
        return self.inputs[:, 2]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.state[:, self.names[name]]

    def __setitem__(self, name: str, value: np.ndarray | float) -> None:
        self.state[:, self.names[name]] = value

    def rate(self, name: str, zero: np.ndarray | None = None) -> np.ndarray:
        """Rate of a state, shape (n,)."""
        inputs = self.inputs
        if zero is not None:
            inputs = inputs.copy()
            inputs[:, 2] = zero
        out = np.empty_like(self.state)
        commands, at = inputs.ctypes.data, out.ctypes.data
        given = self._state_at, commands, self._numbers_at, self._stride
        self.plant.program.derivative(len(out), *given, at)
        return out[:, self.names[name]]

    def relax(self, name: str, of: str = "", about: np.ndarray | float = 0.0) -> None:
        """Put a state where a rate vanishes that is linear in it `about` a value.

        The rate is its own, or that `of` another.
        """
        rates = []
        for value in (0.0, 1.0):
            self[name] = about + value
            rates.append(self.rate(of or name))
        slope = rates[1] - rates[0]
        self[name] = about - rates[0] / slope
        # From there again: the difference above has lost digits, and a rate may have a kink.
        for _ in range(3):
            self[name] -= self.rate(of or name) / slope

    def follow(self, name: str, rate: np.ndarray) -> None:
        """Put a state, which rests, where it changes at a rate; its own is linear in it."""
        still, rest = self.rate(name), self[name].copy()
        self[name] = rest + 1.0
        self[name] = rest + rate / (self.rate(name) - still)

    def relax_memory(self, port: str) -> None:
        """Put the memory of the effect at a port that follows a command where it rests."""
        for effect in self.plant.model.effects.values():
            if effect.port == port and effect.memories > 1:
                self._relax_together(effect.memory_names)
            elif effect.port == port and effect.rate:
                self.relax(effect.memory_names[0])

    def _relax_together(self, names: Sequence[str]) -> None:
        """Put states where their rates vanish, which are linear in them."""
        for name in names:
            self[name] = 0.0
        still = self._rates(names)
        slopes = np.empty((len(still), len(names), len(names)))
        for i, name in enumerate(names):
            self[name] = 1.0
            slopes[:, :, i] = self._rates(names) - still
            self[name] = 0.0
        # From there again: the differences above have lost digits.
        for _ in range(4):
            change = np.linalg.solve(slopes, self._rates(names)[..., None])[..., 0]
            for i, name in enumerate(names):
                self[name] -= change[:, i]

    def _rates(self, names: Sequence[str]) -> np.ndarray:
        return np.stack([self.rate(name) for name in names], axis=1)

    def parameters(self, effect: str) -> dict[str, np.ndarray]:
        """An effect's parameters, one each or one for all."""
        if effect not in self._columns:
            self._columns[effect] = _columns(self.plant, self.vectors, effect)
        return self._columns[effect]

    def force(self, contraction: np.ndarray) -> np.ndarray:
        """Force of the muscle (N) at a contraction (m), without the cable, shape (n,)."""
        # With the zero at the contraction itself the cable is slack.
        self["contraction"] = contraction
        return self.parameters("slide")["mass"] * self.rate("velocity", zero=contraction)


_STEADY = 1.0
"""Rate (Pa/s) under which a pressure has settled."""


def _settle_pressure(search: _Search) -> None:
    """Pressures at which the regulators rest.

    A limit on their rate has them searched for where they are asked to be, and a deadband, in which
    they rest anywhere, has them begin there.
    """
    if not {"regulator_rate_limit", "regulator_deadband"} & search.plant.model.effects.keys():
        search.relax("pressure")
        return
    with np.errstate(divide="ignore", invalid="ignore"):
        search.relax("pressure")
        found, line = search["pressure"].copy(), search.parameters("regulator_line")
        settled = np.abs(search.rate("pressure")) <= _STEADY
        asked = np.maximum(line["gain"] * search.inputs[:, 1] + line["offset"], 0.0)
        search.relax("pressure", about=asked)
    found = np.where(settled, found, search["pressure"])
    if "regulator_deadband" in search.plant.model.effects:
        found = np.where(search.parameters("regulator_deadband")["width"] > 0.0, asked, found)
    search["pressure"] = found


def _cascade(search: _Search) -> None:
    plant = search.plant
    search.relax("servo", of="servo_rate" if "servo_rate" in search.names else "servo")
    search["extension"] = search["servo"]
    truth = np.empty((len(search.state), len(plant.outputs)))
    for i, (state, out) in enumerate(zip(search.state, truth, strict=True)):
        numbers = plant.vector if search.vectors is None else search.vectors[i]
        addresses = (a.ctypes.data for a in (numbers, out))
        plant.program.observe(1, state.ctypes.data, 0.0, *addresses)
    search.zero[:] = truth[:, plant.outputs.index("contraction")] + search["extension"]


def _slide(search: _Search) -> None:
    """A slide that nothing holds begins as its model says; its bristles are relaxed."""
    start = search.parameters("start")
    search.zero[:] = search["contraction"] = start["contraction"]
    search["velocity"] = start["velocity"]


def _drive_load(search: _Search) -> np.ndarray:
    """Load of the drive (N), which the pulley shows while the cable hangs slack."""
    rotor, pull = search.parameters("rotor"), search.rate("spin")
    effects, inertia = search.plant.model.effects, rotor["inertia"]
    if "leg" in effects:
        inertia = inertia + search.parameters("leg")["inertia"]
    if "hanging_load" not in effects:
        return pull * inertia / rotor["radius"]
    # The load is what accelerates rotor and weights, whose mass is the load's: L - M a = J a / r^2.
    share = search.parameters("hanging_load")["share"] * rotor["radius"] * pull / GRAVITY
    return pull * inertia / (rotor["radius"] * (1.0 - share))


def _station(search: _Search) -> None:
    search.zero[:] = _balance(search, np.zeros(len(search.state)))
    search["contraction"] = search.zero
    # With the zero at the contraction itself the cable is slack: the rotor shows the drive's load.
    load = _drive_load(search)
    search["contraction"] = _balance(search, np.maximum(load, 0.0))
    search["angle"] = np.where(load > 0.0, _taut_angles(search, load), 0.0)
    ripples = [e for e in search.plant.model.effects.values() if e.port == RIPPLE and e.law]
    angles = {"angle", "motor_angle"}
    if any(angles & set(signals(effect.law)) for effect in ripples if effect.law):
        _settle_by_angle(search)


RIPPLE = "drive_ripple"
"""Port whose effects make the load depend on where the motor stands."""

_CLEAR_M, _NEAR_RAD, _MOST_APPROACHES = 1e-3, 1e-13, 100
"""Slack (m) that shows a drive's load without the cable; by how much an angle may still miss, and
how often it is tried anew."""


def _settle_by_angle(search: _Search) -> None:
    """Bring contractions and angles to where the loads at those angles hold them.

    How far to go towards the angle that the load asks for is told by how that changed the last time
    (Wegstein 1958). Each row stops by itself.
    """
    rotor = search.parameters("rotor")
    angle, contraction = search["angle"].copy(), search["contraction"].copy()
    done = np.zeros(angle.shape, bool)
    before, asked = np.full((2, *angle.shape), np.nan)
    for _ in range(_MOST_APPROACHES):
        search["angle"] = angle
        search["contraction"] = search.zero - rotor["radius"] * angle - _CLEAR_M
        load = _drive_load(search)
        search["angle"] = 0.0
        search["contraction"] = _balance(search, np.maximum(load, 0.0))
        found = np.where(load > 0.0, _taut_angles(search, load), 0.0)
        near = ~(np.abs(found - angle) > _NEAR_RAD)
        contraction = np.where(done, contraction, search["contraction"])
        with np.errstate(invalid="ignore", divide="ignore"):
            share = (angle - before) / (angle - before - (found - asked))
        share = np.where(np.isfinite(share), np.clip(share, 0.2, 2.0), 0.5)
        before, asked = angle, found
        angle = np.where(done, angle, np.where(near, found, angle + share * (found - angle)))
        done = done | near
        if np.all(done):
            break
    if not np.all(done):
        search.unbalanced = search.unbalanced or (
            "a ripple of the motor changes the load faster with its angle than the muscle can "
            "hold, so that no rest is found; make the ripple's amplitude or periods a turn smaller"
        )
        contraction = np.where(done, contraction, np.nan)
    search["angle"], search["contraction"] = angle, contraction


def _balance(search: _Search, loads: np.ndarray) -> np.ndarray:
    """Contractions (m) at which the muscles balance loads (N); NaN where none does."""
    limits = search.parameters("limits")
    low, high = -2.0 * limits["stretch"], 2.0 * limits["contraction"]
    at_low, at_high = search.force(low), search.force(high)
    found = balances(search.plant, search["pressure"], loads, search.vectors)
    found = np.where((loads == 0.0) & (at_low == 0.0) & (at_high == 0.0), 0.0, found)
    outside = ~((at_low - loads) * (at_high - loads) <= 0.0)
    if np.any(outside):
        ends = np.broadcast_to(1e3 * low, outside.shape), np.broadcast_to(1e3 * high, outside.shape)
        numbers = [column[outside][0] for column in (*ends, loads, at_low, at_high)]
        search.unbalanced = search.unbalanced or (
            "no contraction between {:g} and {:g} mm balances a load of {:.4g} N (the muscle gives "
            "{:.4g} to {:.4g} N there); lower the first motor voltage or raise the pressure"
        ).format(*numbers)
    return np.where(outside, np.nan, found)


def _taut_angles(search: _Search, loads: np.ndarray) -> np.ndarray:
    """Angles at which the cables carry the loads (N) that the drives ask for."""
    rotor, cable = search.parameters("rotor"), search.parameters("cable")
    extension = search.zero - search["contraction"]

    def torque(angles: np.ndarray) -> np.ndarray:
        search["angle"] = angles
        return search.rate("spin")

    furthest = extension + cable["slack"] + 2.0 * loads / cable["stiffness"]
    return _roots(torque, extension / rotor["radius"], furthest / rotor["radius"])


def _roots(
    function: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Zeros of a function that falls between two ends: regula falsi that halves what stands still.

    Each row stops by itself, so that its bits do not depend on the others.
    """
    at_low, at_high = function(low), function(high)
    found, done = high, np.zeros(low.shape, bool)
    for _ in range(_MOST_SECANTS):
        with np.errstate(invalid="ignore", divide="ignore"):
            middle = high - at_high * (high - low) / (at_high - at_low)
        middle = np.where((middle >= low) & (middle <= high), middle, 0.5 * (low + high))
        value = function(middle)
        near = np.abs(middle - found) <= 1e-15 + 1e-14 * np.abs(middle)
        found = np.where(done, found, middle)
        done = done | near | ~(value != 0.0) | np.isnan(value)
        if np.all(done):
            break
        above = value > 0.0
        # An end that stays where it is counts half the next time.
        at_high = np.where(above, 0.5 * at_high, value)
        at_low = np.where(above, value, 0.5 * at_low)
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return found


_MOST_SECANTS = 200


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


def balances(
    plant: "Plant", pressures: np.ndarray, loads: np.ndarray, vectors: np.ndarray | None = None
) -> np.ndarray:
    """Contraction (m) at which the muscle balances each load (N) at each pressure (Pa).

    Args:
        plant: a station.
        pressures: shape (n,).
        loads: shape (n,).
        vectors: parameters of each, shape (n, numbers); the plant's own if not given.
    Returns:
        Shape (n,); an end of the bracket of twice the limits where nothing balances.
    """
    pressures, loads = (np.ascontiguousarray(a, float) for a in (pressures, loads))
    numbers = plant.vector if vectors is None else np.ascontiguousarray(vectors, float)
    stride = 0 if vectors is None else numbers.shape[1]
    out = np.empty(len(pressures))
    addresses = (a.ctypes.data for a in (pressures, loads, numbers))
    plant.program.balance(len(out), *addresses, stride, out.ctypes.data)
    return out


def at_no_load(
    plant: "Plant", pressures: np.ndarray, vectors: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray] | None:
    """Stations at rest with 0 V on the motor, many at once.

    Args:
        plant: a plant of their structure.
        pressures: gauge pressures (Pa), shape (n,).
        vectors: parameters of each, shape (n, numbers); the plant's own if not given.
    Returns:
        State vectors, shape (n, states), and contractions x0 (m), shape (n,); None where the cable
        does not hang slack at 0 V, a muscle finds no balance, sensors do not rest at the truth, or
        the regulator's command has a memory: `Plant.settle` knows those.
    """
    if plant.model.plant != "station":
        return None
    effects = plant.model.effects.values()
    if any(effect.port.startswith("sensor:") and effect.law for effect in effects):
        return None
    if any(effect.port == "regulator_delay" for effect in effects):
        return None
    limits, drive = (_columns(plant, vectors, effect) for effect in ("limits", "drive"))
    zero = balances(plant, pressures, np.zeros(len(pressures)), vectors)
    low, high = -2.0 * limits["stretch"], 2.0 * limits["contraction"]
    inside = (zero > low + 1e-6) & (zero < high - 1e-6)
    if not (np.all(inside) and np.all(drive["offset"] <= 0.0)):
        return None
    states = np.zeros((len(pressures), len(plant.states)))
    for name, value in {
        "contraction": zero,
        "pressure": pressures,
        "lag_lvdt": zero,
        "lag_pressure_transducer": pressures,
    }.items():
        if name in plant.states:
            states[:, plant.states.index(name)] = value
    return states, zero


def _columns(plant: "Plant", vectors: np.ndarray | None, effect: str) -> dict[str, np.ndarray]:
    """An effect's parameters, one each or one for all."""
    numbers = plant.vector[None, :] if vectors is None else vectors
    fields, places = plant.model.parameters[effect]._fields, plant.program.places
    return {field: numbers[:, places[f"{effect}.{field}"]] for field in fields}
