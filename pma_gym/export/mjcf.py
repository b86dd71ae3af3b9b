"""A slide or joint as a MuJoCo model, what MuJoCo has no word for, and how much that is.

MuJoCo's joint has mass or inertia, damping (with a term in the square of speed), friction loss and
a spring (with a cubic term); its actuator a gain, a constant force, limits, a lag and a delay; a
weight is a body in gravity. `WORDS` says which effects these are. The model steps by fourth-order
Runge-Kutta; friction loss is as hard as MuJoCo has it.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from pma_gym.data.trial import Trial
from pma_gym.effects.effect import Effect, Parameters
from pma_gym.effects.ports import measured_output
from pma_gym.export.c_plant import ExportError, template
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.plant.sensors import deviations, direct_command, voltages

STEP_S = 1e-4
"""Step of the exported model (s); dry friction turns within some of them, an error of order 1."""

GRAVITY = 9.81
"""Of the exported model (m/s^2); a weight's body is made for it."""

Words = Mapping[str, float]

WORDS: dict[str, Callable[[Parameters], Words]] = {
    "slide": lambda p: {"inertia": p.mass},
    "inertia": lambda p: {"inertia": p.inertia},
    "start": lambda p: {"position": p.contraction, "speed": p.velocity},
    "joint_start": lambda p: {"position": p.angle, "speed": p.spin},
    "two_way_drive": lambda p: {"gain": -p.gain, "constant": p.gain * p.middle, "highest": 10.0},
    "torque_drive": lambda p: {"gain": p.gain},
    # The back-EMF is a damping.
    "dc_motor": lambda p: {
        "gain": p.torque_constant / p.resistance,
        "damping": p.torque_constant**2 / p.resistance,
    },
    "symmetric_damping": lambda p: {"damping": max(0.0, p.intercept)},
    "joint_damping": lambda p: {"damping": p.coefficient},
    "quadratic_drag": lambda p: {"drag": p.coefficient},
    "joint_drag": lambda p: {"drag": p.coefficient},
    "coulomb_friction": lambda p: {"friction": p.dynamic},
    "joint_friction": lambda p: {"friction": p.dynamic},
    "joint_spring": lambda p: {"stiffness": p.stiffness, "rest": p.rest},
    "joint_hardening_spring": lambda p: {"cubic": p.cubic},
    "joint_weight": lambda p: {"moment": p.moment, "offset": p.offset},
    "constant_force": lambda p: {"constant": p.force},
    "constant_torque": lambda p: {"constant": p.torque},
    "drive_lag": lambda p: {"lag": p.time_constant if p.share > 0.0 else 0.0},
    "drive_delay": lambda p: {"delay": p.delay if p.share > 0.0 else 0.0},
}
"""What an effect is in MuJoCo, by its name: amounts (SI), which are added."""

_FRICTION = "its rise at rest (Stribeck) and what moves before it slips (presliding)"

PARTS: dict[str, tuple[Callable[[Parameters], Parameters], str]] = {
    "coulomb_friction": (lambda p: p._replace(static=p.dynamic, presliding=1e-8), _FRICTION),
    "joint_friction": (lambda p: p._replace(static=p.dynamic, presliding=1e-9), _FRICTION),
    "drive_lag": (lambda p: p._replace(share=1.0), "the share that is not late"),
    "drive_delay": (lambda p: p._replace(share=1.0), "the share that is not late"),
}
"""Effects that are there in part: parameters (SI) of what MuJoCo has, and what it lacks."""


@dataclass(frozen=True)
class Lost:
    """An effect that MuJoCo cannot carry.

    Attributes:
        effect: its name.
        reason: what MuJoCo lacks.
        without: the model without it.
    """

    effect: str
    reason: str
    without: Model


def lost_effects(model: Model) -> Iterator[Lost]:
    """Effects of a model that MuJoCo cannot carry, or not all of."""
    for name, p in model.parameters.items():
        effect, kept = model.effects[name], dict(model.parameters)
        if _is_absent(effect, p) or (name in WORDS and name not in PARTS):
            continue
        if name in PARTS:
            in_part, reason = PARTS[name]
            kept[name] = in_part(p)
        elif effect.port.startswith("sensor"):
            reason = "a sensor that is late or wrong"
            # No sensor has errors without its own table.
            gone = [name] if effect.law else _of_sensor(model, effect)
            kept = {name: p for name, p in kept.items() if name not in gone}
        else:
            reason = "such a law of a joint or an actuator"
            del kept[name]
        if kept.get(name) != p:
            yield Lost(name, reason, replace(model, parameters=kept))


def _is_absent(effect: Effect, p: Parameters) -> bool:
    """Whether a law is exactly absent."""
    neutral = {n: q.to_si(q.neutral) for n, q in effect.quantities.items() if q.neutral is not None}
    switches = neutral.items() if effect.law else ()
    return bool(switches) and all(getattr(p, name) == value for name, value in switches)


def _of_sensor(model: Model, sensor: Effect) -> list[str]:
    """Names of a sensor and of all that is between it and the truth."""
    output = measured_output(sensor.port)
    return [name for name, each in model.effects.items() if measured_output(each.port) == output]


def carried(model: Model) -> Model:
    """The model without what MuJoCo cannot carry."""
    kept = dict(model.parameters)
    for lost in lost_effects(model):
        left = lost.without.parameters
        kept = {n: left[n] if n == lost.effect else p for n, p in kept.items() if n in left}
    return replace(model, parameters=kept)


def mjcf(model: Model) -> str:
    """Write a slide or joint as a MuJoCo model.

    Args:
        model: the model; what MuJoCo cannot carry is left out and named in a comment.
    Raises:
        ExportError: another rig.
    """
    if not model.rig.is_free or model.rig.has_muscle:
        raise ExportError(
            f"--to mjcf takes a slide or a joint, model {model.name} is of a {model.plant}; take "
            "--to fmu or --to c"
        )
    amounts: defaultdict[str, float] = defaultdict(float)
    for name in filter(WORDS.__contains__, model.parameters):
        for word, amount in WORDS[name](model.parameters[name]).items():
            amounts[word] += amount
    lost = [f"{each.effect}: {each.reason}" for each in lost_effects(model)]
    sensors = [
        f'\n    <joint{"pos" if signal.is_position else "vel"} name="{signal.name}" joint="axis" '
        f'noise="{float(noise)!r}"/>'
        for signal, noise in zip(model.rig.signals, deviations(model), strict=True)
        if signal.sensor in model.parameters
    ]
    return template("axis.xml").substitute(
        name=quoteattr(model.name),
        title=escape(model.title.replace("--", "-")),
        lost="".join(f"\n       {line}" for line in lost) or " nothing",
        step=STEP_S,
        gravity=GRAVITY,
        sensors="".join(sensors),
        command=direct_command(model) or "motor_voltage",
        **_texts(amounts, turns=not model.rig.signals[0].is_travel),
    )


def _texts(a: Mapping[str, float], turns: bool) -> dict[str, str]:
    """Attributes of body, joint and actuator; `a` has the amounts by their words."""
    # About the place where the linear spring is relaxed.
    rest, cubic = a["rest"], a["cubic"]
    stiffness = a["stiffness"] + 3.0 * cubic * rest**2, 3.0 * cubic * rest, cubic
    bias = a["constant"] - cubic * rest**3
    mass, at, own = a["inertia"], (0.0, 0.0, 0.0), a["inertia"]
    if turns and a["moment"]:
        # Half of the inertia is that of a point mass.
        arm = 0.5 * a["inertia"] * GRAVITY / a["moment"]
        mass, own = a["moment"] / GRAVITY / arm, 0.5 * a["inertia"]
        at = -arm * math.sin(a["offset"]), 0.0, -arm * math.cos(a["offset"])
    actuator = f'gainprm="{a["gain"]!r}" biastype="affine" biasprm="{bias!r} 0 0"'
    if a["highest"]:
        actuator += f' ctrllimited="true" ctrlrange="0 {a["highest"]!r}"'
    if a["lag"]:
        actuator += f' dyntype="filter" dynprm="{a["lag"]!r}"'
    if a["delay"]:
        samples = math.ceil(a["delay"] / STEP_S) + 2
        actuator += f' delay="{a["delay"]!r}" nsample="{samples}" interp="linear"'
    return {
        "kind": "hinge" if turns else "slide",
        "axis": "0 1 0" if turns else "1 0 0",
        "body": f'pos="{_row(at)}" mass="{mass!r}" diaginertia="{_row((own, own, own))}"',
        "damping": _row((a["damping"], a["drag"]) if a["drag"] else (a["damping"],)),
        "friction": repr(a["friction"]),
        "stiffness": _row(stiffness if cubic else stiffness[:1]),
        "rest": repr(rest),
        "hard": f'solreffriction="{2.0 * STEP_S!r} 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"',
        "actuator": actuator,
        "start": f'qpos="{a["position"]!r}" qvel="{a["speed"]!r}"',
    }


def _row(numbers: Sequence[float]) -> str:
    return " ".join(map(repr, numbers))


def mujoco() -> ModuleType:
    """The library.

    Raises:
        ExportError: it is not installed.
    """
    try:
        import mujoco as library
    except ImportError:
        raise ExportError(
            "a replay of logs needs MuJoCo, which is not installed: pip install 'pma-gym[foreign]'"
        ) from None
    return library


def run(text: str, time: np.ndarray, command: np.ndarray) -> np.ndarray:
    """Run an exported model under commands that are joined linearly.

    Args:
        text: of `mjcf`.
        time: increasing times (s), shape (rows,).
        command: of the actuator at them, shape (rows,).
    Returns:
        Position and speed (SI), shape (rows, 2), from the model's start, settled at the first
        command.
    """
    library = mujoco()
    model = library.MjModel.from_xml_string(text)
    data: Any = library.MjData(model)
    library.mj_resetDataKeyframe(model, data, 0)
    data.ctrl[:] = data.act[:] = command[0]
    if model.actuator_delay[0] > 0.0:
        past = -STEP_S * np.arange(model.actuator_history[0, 0], 0, -1.0)
        library.mj_initCtrlHistory(model, data, 0, past, np.full(len(past), command[0]))
    steps = math.ceil((time[-1] - time[0]) / STEP_S)
    grid = STEP_S * np.arange(steps + 1)
    states = np.empty((steps + 1, 2))
    # A command is held for a step, but a delayed one is interpolated.
    ahead = 0.0 if model.actuator_delay[0] > 0.0 else 0.5 * STEP_S
    commands = np.interp(time[0] + grid + ahead, time, command)
    states[0] = data.qpos[0], data.qvel[0]
    for k in range(steps):
        data.ctrl[0] = commands[k]
        library.mj_step(model, data)
        states[k + 1] = data.qpos[0], data.qvel[0]
    columns = [np.interp(time - time[0], grid, column) for column in states.T]
    return np.stack(columns, axis=1)


def replay(runs: Sequence[tuple[Model, Trial]]) -> dict[str, np.ndarray]:
    """Compare MuJoCo with the model's own simulation, in standard deviations of its sensors.

    Args:
        runs: a slide or joint, with the start of a trial, and the trial, whose commands count.
    Returns:
        Root mean square of the difference over all rows, of position and speed, shape (2,), by what
        is compared. `IN_MUJOCO`: the true motion. `THE_REST`: the same without what MuJoCo cannot
        carry. By effect that it cannot carry: what the sensors read with and without it. A signal
        without a sensor is in SI.
    """
    squares: dict[str, np.ndarray] = {}
    for model, trial in runs:
        noise = deviations(model)
        theirs = run(mjcf(model), trial.time, voltages(model, trial)[0])
        whole = Plant(model).simulate(trial, noise=False)
        rest = Plant(carried(model), EXACT).simulate(trial, noise=False)
        off = {IN_MUJOCO: theirs - _columns(whole.truth, model)}
        off[THE_REST] = theirs - _columns(rest.truth, model)
        read = _columns(whole.measurements, model)
        for lost in lost_effects(model):
            without = Plant(lost.without).simulate(trial, noise=False)
            off[lost.effect] = read - _columns(without.measurements, model)
        for name, each in off.items():
            squares[name] = squares.get(name, 0.0) + np.sum((each / noise) ** 2, axis=0)
    rows = sum(len(trial) for _, trial in runs)
    return {name: np.sqrt(square / rows) for name, square in squares.items()}


EXACT = 1e-7
"""Tolerance of the model without what MuJoCo cannot carry, whose dry friction turns at once."""

IN_MUJOCO, THE_REST = "MuJoCo", "MuJoCo, without what it cannot carry"


def _columns(values: Mapping[str, np.ndarray], model: Model) -> np.ndarray:
    return np.stack([values[name] for name in model.rig.outputs], axis=1)
