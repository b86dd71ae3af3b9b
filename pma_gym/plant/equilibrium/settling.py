"""A plant at rest: the state in which it stands still at constant commands."""

from typing import TYPE_CHECKING

import numpy as np

from pma_gym.plant.equilibrium.force_balance import balances, settle_station
from pma_gym.plant.equilibrium.search import Search, effect_parameters
from pma_gym.plant.model import Model

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


def hangs_by_itself(model: Model) -> bool:
    """Whether a model at rest with a slack cable is known by its muscle's balance alone.

    It is where sensors rest at the truth, and the regulator's command has no memory.
    """
    effects = model.effects.values()
    sensed = any(effect.port.startswith("sensor:") and effect.law for effect in effects)
    delayed = any(effect.port == "regulator_delay" for effect in effects)
    return model.plant == "station" and not sensed and not delayed


class NoLoad:
    """Stations at rest with 0 V on the motor, many at once.

    Args:
        plant: a plant of their structure.

    Attributes:
        plant: the same.
    """

    def __init__(self, plant: "Plant") -> None:
        self.plant = plant
        self._common = self._ends(None) if hangs_by_itself(plant.model) else None
        self._contractions, self._pressures = (
            [i for i, name in enumerate(plant.states) if name in names]
            for names in (("contraction", "lag_lvdt"), ("pressure", "lag_pressure_transducer"))
        )

    def _ends(self, vectors: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, bool]:
        """Contractions between which a balance counts (m), and whether no drive pulls at 0 V."""
        plant = self.plant
        limits, drive = (
            effect_parameters(plant, vectors, effect) for effect in ("limits", "drive")
        )
        low, high = -2.0 * limits["stretch"] + 1e-6, 2.0 * limits["contraction"] - 1e-6
        return low, high, bool((drive["offset"] <= 0.0).all())

    def __call__(
        self, pressures: np.ndarray, vectors: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Their states.

        Args:
            pressures: gauge pressures (Pa), shape (n,).
            vectors: parameters of each, shape (n, numbers); the plant's own if not given.
        Returns:
            State vectors, shape (n, states), and contractions x0 (m), shape (n,); None where the
            cable does not hang slack at 0 V, a muscle finds no balance, sensors do not rest at the
            truth, or the regulator's command has a memory: `Plant.settle` knows those.
        """
        if self._common is None:
            return None
        low, high, slack = self._common if vectors is None else self._ends(vectors)
        zero = balances(self.plant, pressures, np.zeros(len(pressures)), vectors)
        if not slack or not ((zero > low) & (zero < high)).all():
            return None
        states = np.zeros((len(pressures), len(self.plant.states)))
        for i in self._contractions:
            states[:, i] = zero
        for i in self._pressures:
            states[:, i] = pressures
        return states, zero


def _search(
    plant: "Plant",
    motor_voltages: np.ndarray,
    regulator_voltages: np.ndarray,
    vectors: np.ndarray | None,
) -> Search:
    search = Search(plant, motor_voltages, regulator_voltages, vectors)
    search.relax_memory("regulator_delay")
    if "pressure" in search.names:
        _settle_pressure(search)
    for port in ("drive_delay", "drive_lag"):
        search.relax_memory(port)
    {"station": settle_station, "cascade": _cascade, "slide": _slide}[plant.model.plant](search)
    for name in plant.states:
        if name.startswith("lag_"):
            search.relax(name)
    if plant.model.plant == "slide" and "lag_lvdt" in plant.states:
        search.follow("lag_lvdt", search["velocity"])
    return search


_STEADY = 1.0
"""Rate (Pa/s) under which a pressure has settled."""


def _settle_pressure(search: Search) -> None:
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


def _cascade(search: Search) -> None:
    plant = search.plant
    search.relax("servo", of="servo_rate" if "servo_rate" in search.names else "servo")
    search["extension"] = search["servo"]
    truth = np.empty((len(search.state), len(plant.outputs)))
    for i, (state, out) in enumerate(zip(search.state, truth, strict=True)):
        numbers = plant.vector if search.vectors is None else search.vectors[i]
        addresses = (a.ctypes.data for a in (numbers, out))
        plant.program.observe(1, state.ctypes.data, 0.0, *addresses)
    search.zero[:] = truth[:, plant.outputs.index("contraction")] + search["extension"]


def _slide(search: Search) -> None:
    """A slide that nothing holds begins as its model says; its bristles are relaxed."""
    start = search.parameters("start")
    search.zero[:] = search["contraction"] = start["contraction"]
    search["velocity"] = start["velocity"]
