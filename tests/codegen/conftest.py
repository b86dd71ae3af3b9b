import ctypes

import numpy as np
import pytest
from llvmlite import ir

from pma_gym.codegen.graph import CHANGING, FIXED, Graph
from pma_gym.codegen.machine.control import INTEGER, POINTER, function, integer, loop
from pma_gym.codegen.machine.native import Library
from pma_gym.codegen.machine.simd import SimdEmitter
from pma_gym.codegen.trace import live_inputs, trace
from pma_gym.effects import CATALOGUE
from pma_gym.effects.effect import signals

ROWS = {
    "pressure": (150e3, 300e3, 450e3, 600e3),
    "square": (-2e-4, -1e-4, -3e-4, 1e-4),
    "linear": (5e-3, 4e-3, 6e-3, 3e-3),
    "constant": (-1e-3, 1e-3, 5e-4, 2e-3),
}
SIGNALS = {
    "pressure": (0.0, 650e3),
    "pressure_asked": (0.0, 650e3),
    "pressure_command": (0.0, 650e3),
    "contraction": (-0.02, 0.07),
    "velocity": (-0.2, 0.2),
    "position": (-0.1, 0.1),
    "drive_force": (-50.0, 50.0),
    "carried_force": (-20.0, 20.0),
    "memory": (-1.0, 1.0),
    "friction_factor": (0.5, 2.0),
    "travel": (-2e-5, 2e-5),
    "direction": (-1.0, 1.0),
    "stretch": (-1e-3, 3e-3),
    "stretch_rate": (-0.1, 0.1),
    "motor_voltage": (0.0, 10.0),
    "regulator_voltage": (0.0, 10.0),
    "regulator_pace": (0.5, 2.0),
    "signal": (-1.0, 1.0),
    "displacement_input": (0.0, 0.05),
    "displacement": (0.0, 0.05),
    "displacement_rate": (-0.5, 0.5),
    "cable_tension": (0.0, 1000.0),
    "load": (0.0, 1000.0),
    "load_asked": (0.0, 1000.0),
    "load_command": (0.0, 1000.0),
    "load_arriving": (0.0, 1000.0),
    "angle": (-0.1, 2.5),
    "motor_angle": (-2.7, 0.5),
    "spin": (-4.0, 4.0),
    "acceleration": (-20.0, 20.0),
    "command": (-7.0, 7.0),
    "regulator_time_constant": (0.01, 0.2),
    "opening": (-1.0, 1.0),
    "opening_asked": (-1.0, 1.0),
    "valve_voltage": (-10.0, 10.0),
    "difference_voltage": (0.0, 10.0),
    "supply_pressure": (500e3, 700e3),
    "air_flow": (-1e-3, 1e-3),
    "supply_flow": (0.0, 1e-3),
}
FIRST = [effect for effect in CATALOGUE.values() if not effect.of]
LAWS = {f"{e.name}.{law.__name__}": (e, law) for e in FIRST for law in e.laws()}


class Case:
    """A law, traced, and numbers for its arguments."""

    def __init__(self, name, count=48):
        self.effect, self.law = LAWS[name]
        self.draw = np.random.default_rng(sum(map(ord, name)))
        self.count = count
        self.graph = Graph()
        self.given, arguments = {}, []
        for argument in signals(self.law):
            arguments.append(self.argument(argument))
        traced_values = trace(self.law, *arguments)
        self.outputs = flat(traced_values)
        self.inputs = live_inputs(self.outputs)
        self.given = {value.data: self.given[value.data] for value in self.inputs}
        self.arguments = arguments

    def argument(self, name):
        if name in ("p", "servo"):
            effect = self.effect if name == "p" else CATALOGUE["servo"]
            like = effect.parameters(**ROWS) if effect.rows else effect.start
            self.given |= self.parameters(effect, like, name)
            return self.graph.inputs(name, like, FIXED)
        if name == "memory" and self.effect.memories > 1:
            names = self.effect.memory_names
            self.given |= {n: self.draw.uniform(*SIGNALS[name], self.count) for n in names}
            return tuple(self.graph.input(n, CHANGING) for n in names)
        self.given[name] = self.draw.uniform(*SIGNALS[name], self.count)
        return self.graph.input(name, CHANGING)

    def parameters(self, effect, like, name):
        numbers = {}
        for field, value in like._asdict().items():
            if isinstance(value, tuple):
                numbers |= {
                    f"{name}.{field}[{i}]": np.full(self.count, v) for i, v in enumerate(value)
                }
            else:
                q = effect.quantities[field]
                ends = q.to_si(float(q.lower)), q.to_si(float(q.upper))
                near = np.geomspace(0.3, 3.0, self.count) * (value or 0.02 * ends[1])
                numbers[f"{name}.{field}"] = np.clip(self.draw.permutation(near), *ends)
        return numbers

    def plain(self, i):
        """What the law itself returns for the i-th numbers."""

        def number(value):
            if hasattr(value, "_fields"):
                return value._replace(**{n: number(v) for n, v in value._asdict().items()})
            if isinstance(value, tuple):
                return tuple(map(number, value))
            return float(self.given[value.data][i]) if value.data in self.given else 1.0

        return flat(self.law(*map(number, self.arguments)))


def flat(outputs):
    """What a law returns, as one list: a number, a pair, or pairs for several memories."""
    parts = outputs if isinstance(outputs, tuple) else (outputs,)
    return [number for part in parts for number in (part if isinstance(part, tuple) else (part,))]


@pytest.fixture(scope="session", params=LAWS)
def case(request):
    return Case(request.param)


@pytest.fixture(scope="session")
def build_columns():
    return columns_module


@pytest.fixture(scope="session")
def run_columns():
    return run


def columns_module(outputs, inputs, simd):
    """A module whose function `run` works on blocks of rows [slot, lane]."""
    module = ir.Module()
    arguments = [("blocks", INTEGER), ("given", POINTER), ("computed", POINTER)]
    builder, (blocks, given, into) = function(module, "run", arguments)
    with loop(builder, blocks) as block:
        row = simd.address(builder, given, builder.mul(block, integer(len(inputs))))
        known = {v.id: simd.load(builder, row, i, v.kind) for i, v in enumerate(inputs)}
        operands = simd.emit(builder, outputs, known)
        row = simd.address(builder, into, builder.mul(block, integer(len(outputs))))
        for i, value in enumerate(outputs):
            simd.store(builder, operands[value.id], row, i, value.kind)
    builder.ret_void()
    return module


def run(outputs, given, width=1, real="double", fused=False, paired=False):
    """Compiled outputs for arrays by name, of a length that the width divides."""
    inputs = live_inputs(outputs)
    simd = SimdEmitter(width, real, fused, paired)
    library = Library(columns_module(outputs, inputs, simd))
    call = library.function("run", [ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p])
    type_ = {"double": np.float64, "float": np.float32}[real]
    columns = [np.asarray(given[value.data]) for value in inputs]
    columns = [c.view(type_) if c.dtype == np.uint64 else c.astype(type_) for c in columns]
    blocks = len(columns[0]) // width
    packed = np.stack([c.reshape(blocks, width) for c in columns], axis=1)
    packed = np.repeat(packed, simd.elements // width, axis=2)
    computed = np.zeros((blocks, len(outputs), simd.elements), type_)
    call(blocks, packed.ctypes.data, computed.ctypes.data)
    results = [computed[:, i, :width].ravel() for i in range(len(outputs))]
    kinds = [value.kind for value in outputs]
    return [r.view(np.uint64) if k == "integer" else r for r, k in zip(results, kinds, strict=True)]


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PMA_GYM_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield
