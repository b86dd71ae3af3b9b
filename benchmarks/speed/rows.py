"""Rows to measure: each with its worker and settings."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any

DISPLACEMENT = "pma_gym/IsokineticDisplacement-v0"
ROTATION = "pma_gym/IsokineticRotation-v0"

COUNTS = tuple(4**power for power in range(10))
"""Numbers of environments: 1 to 262144."""

THREADED, EACH = (64, 1024, 16384), 1024
"""Sizes of the batches that are stepped by two threads, and at one voltage, too; and of those that
two processes have one each of."""

SYNC_COUNTS = (64, 1024)
"""The same for copies in a Python loop, which are no cheaper by the dozen."""

EVALUATIONS = 3
"""Evaluations of the right-hand side in an attempt at an internal step: where the step begins, with
its Jacobian as one more, and at the stage."""

CORE = {
    "multiply_add": "sums, products, multiply-adds",
    "divide": "quotients",
    "square_root": "square roots",
}
"""What a core is measured to do alone: operations in lanes, and what readers call them."""

ENVPOOL_MOST = 16384
"""EnvPool's largest batch here: it holds every environment as an object of its own."""

LEAN = {"lean": True, "policy_kwargs": {"optimizer_kwargs": {"fused": True, "eps": 1e-5}}}
"""How the documentation has PPO learn from batches: this package's LeanPPO, and PyTorch's Adam in
one pass (eps is Stable-Baselines3's own)."""


class RequestError(ValueError):
    """A request that cannot be met; the message names reason and alternatives."""


@dataclass(frozen=True)
class Row:
    """One thing to measure.

    Attributes:
        key: group/contender, or group/contender/number.
        title: the contender, for readers.
        worker: who measures it, a name in `peers.PEERS`.
        row: the function in the worker's module that prepares it.
        settings: keyword arguments of that function.
        unit: what is counted.
        right_hand_sides: evaluations of the right-hand side in a step; None if the worker tells
            them, or nobody does.
        cores: cores that it needs.
        step: what one step is.
    """

    key: str
    title: str
    worker: str
    row: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    unit: str = "steps"
    right_hand_sides: float | None = None
    cores: int = 1
    step: str = ""

    @property
    def group(self) -> str:
        """The first part of the key."""
        return self.key.partition("/")[0]

    @property
    def number(self) -> int | None:
        """The number that the key ends in, of environments or millionths."""
        last = self.key.rpartition("/")[2]
        return int(last) if last.isdigit() else None


def all_rows() -> list[Row]:
    """Every row, in the order of the tables."""
    parts = (_single(), _same_plant(), _batches(), _core(), _learning(), _once())
    return [row for part in parts for row in part]


def select(patterns: str, rows: list[Row]) -> list[Row]:
    """Rows whose key matches one of some patterns, by commas; all if empty.

    A pattern is a key with * for any text, or what keys begin with: `single`, `batch/own`.

    Raises:
        RequestError: a pattern that matches nothing; names the groups and contenders.
    """
    wanted = [part.strip().rstrip("/") for part in patterns.split(",") if part.strip()]
    for pattern in wanted:
        if not any(matches(row.key, pattern) for row in rows):
            raise RequestError(f"--only: no row {pattern!r}; there are {', '.join(_stems(rows))}")
    return [row for row in rows if not wanted or any(matches(row.key, p) for p in wanted)]


def matches(key: str, pattern: str) -> bool:
    """Whether a key is meant by a pattern: the same with * for any text, or what it begins with."""
    return fnmatchcase(key, pattern) or fnmatchcase(key, f"{pattern}/*")


def _stems(rows: list[Row]) -> list[str]:
    """Keys without their numbers, each once."""
    return list(dict.fromkeys("/".join(row.key.split("/")[:2]) for row in rows))


_OWN = "10 ms; 11 states, sensors, noise, reward"
_PLANT = "10 ms of the same plant alone"
_STEPS = {
    "CartPole": "20 ms; 4 states, one Euler step",
    "Pendulum": "50 ms; 2 states, one Euler step",
}


def _single() -> Iterator[Row]:
    own = {"name": DISPLACEMENT}
    named: dict[str, Any] = {"worker": "own", "row": "one", "step": _OWN}
    yield Row("single/own", "pma-gym, displacement", settings=own, **named)
    yield Row("single/own_rotation", "pma-gym, rotation", settings={"name": ROTATION}, **named)
    held = own | {"held": True}
    yield Row("single/own_held", "pma-gym, voltage held", settings=held, **named)
    named["row"] = "kernel"
    yield Row("single/own_kernel", "pma-gym, without Python", settings=own, **named)
    toys: dict[str, Any] = {"row": "one", "right_hand_sides": 1}
    for toy, step in _STEPS.items():
        name = f"{toy}-v1"
        yield Row(f"single/{toy}", name, "classic", settings={"name": name}, step=step, **toys)
    name = "InvertedPendulum-v5"
    step = "40 ms; 4 states, two Runge-Kutta steps"
    named = {"worker": "mujoco", "row": "one", "right_hand_sides": 8, "step": step}
    yield Row("single/InvertedPendulum", f"MuJoCo {name}", settings={"name": name}, **named)
    task = {"domain": "pendulum", "name": "swingup"}
    named = {"worker": "dm_control", "row": "task", "step": "20 ms; 2 states, one Euler step"}
    yield Row("single/dm_control", "dm_control pendulum", settings=task, **named)
    for drive in ("Cont-CC-PMSM", "Finite-CC-PMSM", "Cont-CC-PermExDc", "Cont-CC-SeriesDc"):
        named = {"worker": "electric_motor", "row": "one", "step": "0.1 ms of a drive"}
        name = {"name": f"{drive}-v0"}
        yield Row(f"single/gem_{drive}", f"gym-electric-motor {drive}", settings=name, **named)
    step = "13 s of a reactor; 2 states, CVODES"
    yield Row("single/pcgym", "PC-gym reactor", "pcgym", "reactor", step=step)


def _same_plant() -> Iterator[Row]:
    yield Row("plant/dompc", "do-mpc simulator (CVODES)", "dompc", "simulator", step=_PLANT)
    for method, rtol in (("LSODA", 1e-5), ("RK45", 1e-4)):
        title, settings = f"scipy solve_ivp, {method}", {"method": method, "rtol": rtol}
        yield Row(f"plant/{method}", title, "scipy", "held", settings, step=_PLANT)


def _batches() -> Iterator[Row]:
    own = {"name": DISPLACEMENT}
    title = "pma-gym"
    for count in COUNTS:
        one, two = (own | {"count": count, "threads": threads} for threads in (1, 2))
        yield _batch("own", f"{title}, 1 thread", "own", one, step=_OWN)
        if count in THREADED:
            yield _batch("own_two", f"{title}, 2 threads", "own", two, step=_OWN, cores=2)
            held = one | {"held": True}
            yield _batch("own_held", f"{title}, voltage held, 1 thread", "own", held, step=_OWN)
    pair: dict[str, Any] = {"row": "pair", "step": _OWN, "cores": 2}
    each = own | {"count": EACH}
    yield _batch("own_pair", f"{title}, 2 processes of so many", "own", each, **pair)
    for toy, step in _STEPS.items():
        settings: dict[str, Any] = {"right_hand_sides": 1, "step": step}
        for count in COUNTS:
            named = {"name": f"{toy}-v1", "count": count}
            if toy == "CartPole":
                array = named | {"mode": "vector_entry_point"}
                title = "Gymnasium vector CartPole"
                yield _batch("vector_CartPole", title, "classic", array, **settings)
            if count in SYNC_COUNTS:
                title, sync = f"SyncVectorEnv {toy}", named | {"mode": "sync"}
                yield _batch(f"sync_{toy}", title, "classic", sync, **settings)
            if count <= ENVPOOL_MOST:
                yield _batch(f"envpool_{toy}", f"EnvPool {toy}", "envpool", named, **settings)
            if count in SYNC_COUNTS:
                title, kept = f"EnvPool {toy}, on one processor", named | {"kept": True}
                yield _batch(f"envpool_{toy}_kept", title, "envpool", kept, **settings)
            title = f"gymnax {toy}"
            yield _batch(f"gymnax_{toy}", title, "gymnax", named, row="loop", **settings)


def _batch(
    name: str, title: str, worker: str, settings: Mapping[str, Any], row: str = "batch", **rest: Any
) -> Row:
    return Row(f"batch/{name}/{settings['count']}", title, worker, row, settings, **rest)


def _core() -> Iterator[Row]:
    for operation, title in CORE.items():
        settings = {"operation": operation}
        yield Row(f"core/{operation}", title, "own", "core", settings, unit="operations")


def _learning() -> Iterator[Row]:
    pendulum = {"name": "Pendulum-v1", "count": 8, "kind": "copies"}
    copies = {"name": DISPLACEMENT, "count": 8, "kind": "copies"}
    batch = {"name": DISPLACEMENT, "kind": "batch", "n_steps": 128}
    title = "PPO rollouts, 8 copies of"
    yield Row("rollouts/Pendulum/8", f"{title} Pendulum-v1", "sb3", "rollouts", pendulum)
    yield Row("rollouts/own_copies/8", f"{title} pma-gym", "sb3", "rollouts", copies)
    title = "PPO end to end, 8 copies of Pendulum-v1, default settings"
    yield Row("learning/Pendulum/8", title, "sb3", "learning", pendulum)
    learners = ("own", "LeanPPO", batch | LEAN), ("own_sb3", "Stable-Baselines3's PPO", batch)
    for key, learner, options in learners:
        for count in (64, 256):
            settings = options | {"count": count}
            title = f"PPO rollouts, pma-gym, batch of {count}, {learner}"
            yield Row(f"rollouts/{key}/{count}", title, "sb3", "rollouts", settings)
        settings = options | {"count": 256, "batch_size": 4096, "threads": 2}
        title = f"PPO end to end, pma-gym, batch of 256, minibatches of 4096, {learner}"
        yield Row(f"learning/{key}/256", title, "sb3", "learning", settings)


def _once() -> Iterator[Row]:
    for kind, said in (("warm", "compiled before"), ("cold", "compiled anew")):
        settings = {"name": DISPLACEMENT, "cold": kind == "cold"}
        title = f"from the start of Python to the first step, {said}"
        yield Row(f"start/{kind}", title, "own", "start", settings, unit="times")
    fits = {"candidates": 20, "trials": 60, "seconds": 10.0}
    title = "20 candidate models fitted to 60 trials of 10 s"
    yield Row("fits/own", title, "own", "fits", fits, unit="times", cores=2)
