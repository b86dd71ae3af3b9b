"""What is measured, in one table, and the environments that the others live in.

What other simulators need has an environment of its own, `.peers/NAME`, which `make peers` makes
from the pins in `requirements/NAME.txt`.
"""

import os
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / ".peers"
"""Where the environments are; ignored by git."""


class Peer(NamedTuple):
    """The packages that some rows need; without pins those of this interpreter.

    Attributes:
        name: of its environment's folder.
        title: its name for readers.
    """

    name: str
    title: str

    @property
    def pins(self) -> Path:
        """The file of its pins."""
        return Path(__file__).resolve().parent / "requirements" / f"{self.name}.txt"

    @property
    def home(self) -> Path:
        """Folder of its environment."""
        return FOLDER / self.name

    @property
    def stamp(self) -> Path:
        """The pins that were installed, written last."""
        return self.home / "installed.txt"

    @property
    def interpreter(self) -> Path:
        """The interpreter of its environment, installed or not."""
        return self.home / ("Scripts/python.exe" if os.name == "nt" else "bin/python")

    @property
    def python(self) -> Path | None:
        """The interpreter that measures its rows; None if it is not installed with these pins."""
        if not self.pins.is_file():
            return Path(sys.executable)
        ready = self.stamp.is_file() and self.stamp.read_bytes() == self.pins.read_bytes()
        return self.interpreter if ready else None


OWN = Peer("own", "pma-gym")
MUJOCO, DM_CONTROL = Peer("mujoco", "MuJoCo"), Peer("dm_control", "dm_control")
ENVPOOL, GYMNAX = Peer("envpool", "EnvPool"), Peer("gymnax", "gymnax")
MOTOR, PCGYM = Peer("electric_motor", "gym-electric-motor"), Peer("pcgym", "PC-gym")

PEERS = (MUJOCO, DM_CONTROL, ENVPOOL, GYMNAX, MOTOR, PCGYM)
"""Those that `make peers` installs."""


@dataclass(frozen=True)
class Row:
    """One thing to measure.

    Attributes:
        key: group/contender, or group/contender/number.
        title: the contender and its step, for readers.
        peer: who has the packages.
        make: the function of `worker` that prepares it.
        settings: keyword arguments of that function.
    """

    key: str
    title: str
    peer: Peer
    make: str
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def cores(self) -> int:
        """Cores that it needs."""
        return self.settings.get("threads", 1)


DISPLACEMENT, ROTATION = "pma_gym/IsokineticDisplacement-v0", "pma_gym/IsokineticRotation-v0"
RIG = "pma_gym/Rig-v0"
_MODELS, _VOLTS = "benchmarks/speed/models", {"winding_voltage": [-7.4, 7.4]}
_PULSES = {"frequency_hz": 50.0, "opening_time_ms": 2.0, "closing_time_ms": 1.0}
RIGS: dict[str, tuple[str, dict[str, Any]]] = {
    "joint": ("5 states, friction, noise", {"model": f"{_MODELS}/joint.toml", "limits": _VOLTS}),
    "slide": ("4 states, friction, noise", {"model": f"{_MODELS}/slide.toml"}),
    "muscle_pair": ("10 states, two regulators", {"model": "muscle_pair"}),
    "valve_pair": (
        "11 states, two valves by averaged pulse width",
        {
            "model": "valve_pair",
            "effects": {"pulse_width": _PULSES, "antagonist_pulse_width": _PULSES},
        },
    ),
}
"""What is in a rig, and options of its environment, by the keys of rows; models without a row."""
COUNTS, ENVPOOL_COUNTS, SYNC_COUNTS = (1, 64, 1024, 16384, 262144), (64, 1024, 16384), (64, 1024)
"""Numbers of environments; EnvPool holds each as an object of its own, and copies in a Python loop
are no cheaper by the dozen."""


def all_rows() -> list[Row]:
    """Every row, in the order of the table."""
    return [*_single(), *_batches(), *_rollouts()]


def _single() -> Iterator[Row]:
    step = "10 ms; 11 states, sensors, noise, reward"
    yield Row("single/own", f"pma-gym, displacement: {step}", OWN, "one", {"name": DISPLACEMENT})
    yield Row("single/own_rotation", f"pma-gym, rotation: {step}", OWN, "one", {"name": ROTATION})
    for rig, (step, options) in RIGS.items():
        yield Row(f"single/{rig}", f"{rig}: 10 ms; {step}", OWN, "one", {"name": RIG, **options})
    for key, peer, name, step in (
        ("CartPole", OWN, "CartPole-v1", "20 ms; 4 states, one Euler step"),
        ("Pendulum", OWN, "Pendulum-v1", "50 ms; 2 states, one Euler step"),
        ("InvertedPendulum", MUJOCO, "InvertedPendulum-v5", "40 ms; two Runge-Kutta steps"),
    ):
        yield Row(f"single/{key}", f"{name}: {step}", peer, "one", {"name": name})
    step = "20 ms; 2 states, one Euler step"
    yield Row("single/dm_control", f"dm_control pendulum: {step}", DM_CONTROL, "dm_control")
    for drive in ("Cont-CC-PMSM", "Finite-CC-PMSM", "Cont-CC-PermExDc", "Cont-CC-SeriesDc"):
        title, settings = f"gym-electric-motor {drive}: 0.1 ms of a drive", {"name": f"{drive}-v0"}
        settings["library"] = "gym_electric_motor"
        yield Row(f"single/gem_{drive}", title, MOTOR, "one", settings)
    yield Row("single/pcgym", "PC-gym reactor: 13 s; 2 states, CVODES", PCGYM, "reactor")
    step = "10 ms of pma-gym's plant alone"
    for method, rtol in (("LSODA", 1e-5), ("RK45", 1e-4)):
        title, settings = (
            f"solve_ivp, {method} at {rtol:g}: {step}",
            {"method": method, "rtol": rtol},
        )
        yield Row(f"plant/{method}", title, OWN, "solve_ivp", settings)


def _batches() -> Iterator[Row]:
    own, two, classic = {"name": DISPLACEMENT}, {"name": DISPLACEMENT, "threads": 2}, "CartPole-v1"
    yield from _sizes("own", "pma-gym, 1 thread", OWN, "vector", own, COUNTS)
    yield from _sizes("own_two", "pma-gym, 2 threads", OWN, "vector", two, ENVPOOL_COUNTS)
    for rig, (_, options) in RIGS.items():
        yield from _sizes(rig, rig, OWN, "vector", {"name": RIG, **options}, SYNC_COUNTS)
    for toy in ("CartPole", "Pendulum"):
        named = {"name": f"{toy}-v1"}
        looped, title = named | {"mode": "sync"}, f"SyncVectorEnv {toy}"
        yield from _sizes(f"sync_{toy}", title, OWN, "vector", looped, SYNC_COUNTS)
        title = f"EnvPool {toy}"
        yield from _sizes(f"envpool_{toy}", title, ENVPOOL, "envpool", named, ENVPOOL_COUNTS)
        yield from _sizes(f"gymnax_{toy}", f"gymnax {toy}", GYMNAX, "gymnax", named, COUNTS)
    title = f"Gymnasium's array of {classic}"
    yield from _sizes("vector_CartPole", title, OWN, "vector", {"name": classic}, COUNTS)


def _sizes(
    key: str,
    title: str,
    peer: Peer,
    make: str,
    settings: Mapping[str, Any],
    counts: tuple[int, ...],
) -> Iterator[Row]:
    for count in counts:
        each = {**settings, "count": count}
        yield Row(f"batch/{key}/{count}", f"{title}, {count}", peer, make, each)


def _rollouts() -> Iterator[Row]:
    yield Row(
        "rollouts/Pendulum/8",
        "PPO rollouts, 8 copies of Pendulum-v1",
        OWN,
        "rollouts",
        {"name": "Pendulum-v1", "count": 8},
    )
    for count in (64, 256):
        yield Row(
            f"rollouts/own/{count}",
            f"PPO rollouts, pma-gym, batch of {count}",
            OWN,
            "rollouts",
            {"name": DISPLACEMENT, "count": count, "n_steps": 128},
        )
