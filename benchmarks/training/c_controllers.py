"""Controllers as C99, for rigs that run no Python: a PID's law, a policy's network."""

from importlib import resources
from string import Template

import numpy as np

from benchmarks.training.onnx_file import ExportError
from controllers.design.designs import scheduled_gains
from controllers.models.voltage import VOLTAGE_LIMIT, nominal_offset
from controllers.pid import pid_law
from controllers.policies.network import Weights
from controllers.policies.policy_file import PolicyFile
from pma_gym.codegen.elementary import clip
from pma_gym.codegen.graph import CHANGING, Graph
from pma_gym.codegen.text import c_text
from pma_gym.envs import StationInfo
from pma_gym.export.c_plant import comment, identifier


def pid_source(name: str, station: StationInfo) -> list[bytes]:
    """Header and source of the scheduled PID for a station and task."""
    graph, gains = Graph(), scheduled_gains("pid", station)
    places = {name: name for name in ("reference", "error", "change")}
    places |= {name: f"state->{name}" for name in ("integral", "derivative")}
    value = {name: graph.input(name, CHANGING) for name in places}
    scaled = gains.scaled(value["reference"] * (1.0 / station.task.schedule.span))
    errors, memories = (
        (value[a], value[b]) for a, b in (("error", "change"), ("integral", "derivative"))
    )
    voltage, after = pid_law(scaled, errors, nominal_offset(station), memories, station.period)
    targets = ("voltage", "state->integral", "state->derivative")
    law = c_text(
        dict(zip(targets, (voltage, *after), strict=True)),
        {value[name].id: place for name, place in places.items()},
    )
    words = {
        "station": f"{comment(station.model.name)}, {station.task.name}",
        "pressure": f"{station.pressure / 1e3:g}",
        "period": f"{station.period:g}",
        "ahead": f"{gains.lead - station.observation_delay:.6g}",
        "actuator": station.task.actuator,
        "unit": "rad" if station.task.schedule.followed.is_angle else "m",
    }
    return _source("pid", name, words | {"law": law})


def policy_source(name: str, policy: PolicyFile) -> list[bytes]:
    """Header and source of a policy's network and of its action's voltage.

    Raises:
        ExportError: a network of more than one action.
    """
    weights, graph = policy.weights, Graph()
    if weights.sizes[-1] != 1:
        raise ExportError(f"a policy in C must have one action, {policy.name} has {weights.sizes}")
    names = ("action", "before", "base")
    action, before, base = (graph.input(name, CHANGING) for name in names)
    asked = graph.value(policy.form.unclipped_voltage(action, before, base))
    words = {
        "title": comment(policy.title),
        "observation": "\n".join(
            f" *   {comment(f'{entry}: {unit}')}" for entry, unit in policy.observation
        ),
        "base": comment(policy.form.base or "none"),
        "inputs": str(weights.sizes[0]),
        "widest": str(max(weights.sizes)),
        "scaled": "observation[i]",
        "volts": c_text(
            {"voltage": clip(asked, 0.0, VOLTAGE_LIMIT)},
            {value.id: name for name, value in zip(names, (action, before, base), strict=True)},
        ),
        "weights": "\n".join(_arrays(weights)),
        "layers": "\n".join(_layers(weights)),
    }
    if weights.scaling is not None:
        limit = f"{weights.scaling.clip!r}"
        share = "(observation[i] - mean[i]) / deviation[i]"
        words["scaled"] = f"(float)fmin(fmax({share}, -{limit}), {limit})"
    return _source("policy", name, words)


def _arrays(weights: Weights) -> list[str]:
    arrays = [
        _array("float", f"{what}_{k}", numbers)
        for k, layer in enumerate(weights.layers)
        for what, numbers in zip(("weight", "bias"), layer, strict=True)
    ]
    if weights.scaling is not None:
        deviation = np.sqrt(weights.scaling.variance + weights.scaling.epsilon)
        arrays += [_array("double", "mean", weights.scaling.mean)]
        arrays += [_array("double", "deviation", deviation)]
    return arrays


def _array(kind: str, name: str, numbers: np.ndarray) -> str:
    listed = ", ".join(repr(float(number)) for number in numbers.ravel())
    return f"static const {kind} {name}[] = {{{listed}}};"


def _layers(weights: Weights) -> list[str]:
    """Statements of the layers, each followed by what keeps its sums in range."""
    lines, after = [], {"tanh": "tanh(sums[i])", "relu": "fmax(sums[i], 0.0)"}
    after["clip"] = "fmin(fmax(sums[i], -1.0), 1.0)"
    last = len(weights.layers) - 1
    for k, (inputs, outputs) in enumerate(zip(weights.sizes[:-1], weights.sizes[1:], strict=True)):
        held = after[weights.output if k == last else weights.activation]
        lines.append(f"    layer(weight_{k}, bias_{k}, {inputs}, {outputs}, values, sums);")
        target = "sums" if k == last else "values"
        lines.append(f"    for (int i = 0; i < {outputs}; i++) {target}[i] = {held};")
    return lines


def _source(kind: str, name: str, words: dict[str, str]) -> list[bytes]:
    common = {"name": identifier(name), **words}
    folder = resources.files(__name__.rpartition(".")[0]) / "templates"
    texts = (Template((folder / f"{kind}.{end}").read_text("utf-8")) for end in ("h", "c"))
    return [text.substitute(common).encode() for text in texts]
