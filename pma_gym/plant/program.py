"""Compiled functions of a plant: rates, outputs, balances, whole trials.

They depend only on the structure of a model, that is its effects and the lengths of its rows. The
parameters are a vector at run time, so that other parameter values need no compilation.

A model's equations with the arithmetic of one step, and its muscle's static force.
"""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np

from pma_gym.codegen.graph import FIXED, Value
from pma_gym.codegen.machine.control import (
    DOUBLE,
    INTEGER,
    POINTER,
    Builder,
    Module,
    Operand,
    function,
    integer,
    loop,
    offset,
    real,
)
from pma_gym.codegen.machine.native import compiled, simd_lanes
from pma_gym.codegen.machine.simd import SimdEmitter
from pma_gym.codegen.trace import live_inputs, substitute
from pma_gym.effects.user_effects import source_of
from pma_gym.integrator.equations import COMMANDS, ZERO, Interpolation
from pma_gym.integrator.integration import Layout, System, memory, rates, step_start_values
from pma_gym.integrator.step_attempt import step_attempt
from pma_gym.integrator.trial_kernel import write_simulate
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.model import Model


def system(model: Model, interpolation: Interpolation) -> System:
    """Build a model's equations and step, with first- or zero-order hold of the commands."""
    equations = PlantEquations(model.effects, model.parameters, interpolation)
    model.rig.write_equations(equations)
    equations.finish()
    made = step_attempt(equations, model.rig.position_tolerances)
    return System(equations, made, Layout.of(made))


def memories_at_start(eq: PlantEquations) -> dict[str, Value]:
    """Initial values of effects' states that do not begin at 0, from the parameters, by state."""
    return {
        name: getattr(eq.parameters[effect.name], effect.memory_start)
        for effect in eq.effects.values()
        if effect.memory_start
        for name in effect.memory_names
    }


def static_force(eq: PlantEquations) -> Value:
    """Force of the muscle on the slide at rest, without the cable, at the initial effect states."""
    force = eq["muscle_force"] + eq["slide_force"]
    nothing = eq.graph.constant(0.0)
    start_values = memories_at_start(eq)
    memories = {
        entry.value.id: start_values.get(entry.name, nothing)
        for entry in eq.remembered
        if "memory_" in entry.name
    }
    here = step_start_values(eq) | {eq["velocity"].id: nothing}
    (first,) = substitute([force], here)
    return substitute([first], memories | {eq["velocity"].id: nothing})[0]


FIRST_S = 7e-4
"""Size of the first step attempt from rest (s)."""

_POINTER, _INTEGER, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


def parameter_names(model: Model) -> list[str]:
    """Names of the parameters in a model's vector, in order."""
    names = []
    for effect, lengths in model.lengths().items():
        fields = model.parameters[effect]._fields
        for field, length in zip(fields, lengths, strict=True):
            whole = f"{effect}.{field}"
            names += [f"{whole}[{i}]" for i in range(length)] if length else [whole]
    return names


def structure(model: Model) -> list[str]:
    """Key of a model's compiled functions, apart from this package's source."""
    return [
        model.plant,
        *(f"{name} {lengths} {source_of(name)}" for name, lengths in model.lengths().items()),
    ]


class Program:
    """The compiled functions of all models of one structure.

    Args:
        model: one of the models.

    Attributes:
        model: the model given.
        states: names of all states, in the order of the state vector.
        outputs: names of the true outputs.
        offsets: position of every number in a model's vector; the tolerance is the first.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        names = ["tolerance", *parameter_names(model)]
        self.offsets: Mapping[str, int] = {name: i for i, name in enumerate(names)}
        # Briefly: a candidate of a diagnosis is compiled for a second or two of simulation.
        key = ["plant", *self.key()]
        self.library = compiled(key, self._build, f"plant {model.name}", brief=True)
        self._functions()

    def __reduce__(self) -> "tuple[Callable[[Model], Program], tuple[Model]]":
        """Copy and pickle by structure, because compiled functions belong to one process."""
        return program, (self.model,)

    def key(self) -> list[str]:
        """Key of the compiled functions, apart from this package's source."""
        return structure(self.model)

    @cached_property
    def zero_order_hold(self) -> System:
        """The equations with a zero-order hold of the commands."""
        return system(self.model, "zoh")

    @cached_property
    def first_order_hold(self) -> System:
        """The equations with a first-order hold of the commands."""
        return system(self.model, "foh")

    @cached_property
    def equations(self) -> PlantEquations:
        """The equations with constant commands, without the arithmetic of a step."""
        equations = PlantEquations(self.model.effects, self.model.parameters)
        self.model.rig.write_equations(equations)
        return equations

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Names of all states, in the order of the state vector."""
        return tuple(state.name for state in self.equations.remembered)

    def _functions(self) -> None:
        pointer, whole, real = _POINTER, _INTEGER, _REAL
        get = self.library.function
        self.table = get("table", [pointer, pointer])
        self.derivative = get("derivative", [whole, *[pointer] * 3, whole, pointer])
        self.observe = get("observe", [whole, pointer, real, pointer, pointer])
        if self.model.rig.balances_loads:
            self.balance = get("balance", [whole, pointer, pointer, pointer, whole, pointer])
        self.table_size = int(get("table_size", [], whole)())

    def _build(self) -> Module:
        module = Module()
        self._table(module)
        self._derivative(module)
        self._observe(module)
        if self.model.rig.balances_loads:
            self._balance(module)
        return module

    @cached_property
    def simulate_one(self) -> Callable:
        """Compiled function that simulates trials one after the other; see `write_simulate`."""
        return self._simulate(1)

    @cached_property
    def simulate_many(self) -> Callable:
        """Compiled function that simulates one trial per SIMD lane; see `write_simulate`."""
        return self._simulate(simd_lanes())

    def _simulate(self, width: int) -> Callable:
        """Build a separate library, because few users need both the scalar and SIMD simulation."""

        def build() -> Module:
            module = Module()
            write_simulate(module, self.first_order_hold, width)
            return module

        key = [f"trials {width}", *self.key()]
        library = compiled(key, build, f"trials of {self.model.name}", brief=True)
        return library.function(f"simulate_{width}", [_INTEGER, *[_POINTER] * 3])

    def parameters(self, builder: Builder, vector: Operand, values: list[Value]) -> dict:
        """Load the inputs of level FIXED that values depend on from a vector.

        The vector begins with the tolerance.
        """
        return {
            value.id: builder.load(offset(builder, vector, self.offsets[value.data]), typ=DOUBLE)
            for value in live_inputs(values)
            if value.level == FIXED
        }

    def _table(self, module: Module) -> None:
        """Compute the constants of a model from its vector."""
        fixed = self.first_order_hold.layout.fixed
        b, (vector, out) = function(module, "table", [("vector", POINTER), ("out", POINTER)])
        # Without fused products: the table may be made in other ways, of the same bits.
        emitted = SimdEmitter(1).emit(b, fixed, self.parameters(b, vector, fixed))
        for i, value in enumerate(fixed):
            b.store(emitted[value.id], offset(b, out, i))
        b.ret_void()
        b, _ = function(module, "table_size", [], INTEGER)
        b.ret(integer(len(fixed)))

    def _derivative(self, module: Module) -> None:
        """Rates of many states at once, each with its commands and x0, and its own vector."""
        eq = self.equations
        b, (count, states, inputs, vectors, stride, out) = function(
            module,
            "derivative",
            [("count", INTEGER), ("states", POINTER), ("inputs", POINTER)]
            + [("vectors", POINTER), ("stride", INTEGER), ("out", POINTER)],
        )
        rates, input_names = self.rates(), (*COMMANDS, ZERO)
        with loop(b, count) as row:
            known = self.parameters(b, offset(b, vectors, b.mul(row, stride)), rates)
            for i, entry in enumerate(eq.remembered):
                where = b.add(b.mul(row, integer(len(eq.remembered))), integer(i))
                known[entry.value.id] = b.load(offset(b, states, where), typ=DOUBLE)
            for i, name in enumerate(input_names):
                where = b.add(b.mul(row, integer(len(input_names))), integer(i))
                known[eq[name].id] = b.load(offset(b, inputs, where), typ=DOUBLE)
            emitted = SimdEmitter(1).emit(b, rates, known)
            for i, rate in enumerate(rates):
                where = b.add(b.mul(row, integer(len(rates))), integer(i))
                b.store(emitted[rate.id], offset(b, out, where))
        b.ret_void()

    def rates(self) -> list[Value]:
        """Rates of all states at the start of a step."""
        return rates(self.equations)

    def _observe(self, module: Module) -> None:
        eq = self.equations
        outputs = substitute(list(eq.outputs.values()), step_start_values(eq))
        b, (count, states, zero, vector, out) = function(
            module,
            "observe",
            [("count", INTEGER), ("states", POINTER), ("zero", DOUBLE)]
            + [("vector", POINTER), ("out", POINTER)],
        )
        known = self.parameters(b, vector, outputs) | {eq[ZERO].id: zero}
        n = len(eq.remembered)
        with loop(b, count) as row:
            for i, entry in enumerate(eq.remembered):
                where = b.add(b.mul(row, integer(n)), integer(i))
                known[entry.value.id] = b.load(offset(b, states, where), typ=DOUBLE)
            emitted = SimdEmitter(1).emit(b, outputs, known)
            for i, value in enumerate(outputs):
                where = b.add(b.mul(row, integer(len(outputs))), integer(i))
                b.store(emitted[value.id], offset(b, out, where))
        b.ret_void()

    def _balance(self, module: Module) -> None:
        """Contraction at which the muscle balances a load, by halving, as trials begin."""
        eq = self.equations
        (force,) = substitute([static_force(eq)], {})
        b, (count, pressures, loads, vectors, stride, out) = function(
            module,
            "balance",
            [("count", INTEGER), ("pressures", POINTER), ("loads", POINTER)]
            + [("vectors", POINTER), ("stride", INTEGER), ("out", POINTER)],
        )
        stretch, contraction = (
            self.offsets[f"limits.{name}"] for name in ("stretch", "contraction")
        )
        with loop(b, count) as row:
            vector = offset(b, vectors, b.mul(row, stride))
            known = self.parameters(b, vector, [force])
            known[eq["pressure"].id] = b.load(offset(b, pressures, row), typ=DOUBLE)
            load = b.load(offset(b, loads, row), typ=DOUBLE)
            reach = [b.load(offset(b, vector, i), typ=DOUBLE) for i in (stretch, contraction)]
            balancing = balanced(b, eq, force, known, load, reach)
            b.store(balancing, offset(b, out, row))
        b.ret_void()


HALVINGS = 60
"""Bisections of a bracket of about 160 mm, down to the last bit."""


def balanced(
    b: Builder,
    eq: PlantEquations,
    force: Value,
    known: dict[int, Operand],
    load: Operand,
    reach: Sequence[Operand],
) -> Operand:
    """Write code that finds the contraction at which the muscle's force equals a load.

    Args:
        b: code builder.
        eq: the equations.
        force: the muscle's force, which falls with contraction (N).
        known: the other inputs of the force, by id.
        load: the load (N).
        reach: greatest stretch and contraction (m); the search covers twice this range.
    """
    low, high = memory(b, DOUBLE), memory(b, DOUBLE)
    b.store(b.fmul(real(-2.0), reach[0]), low)
    b.store(b.fmul(real(2.0), reach[1]), high)
    with loop(b, HALVINGS):
        a, c = b.load(low, typ=DOUBLE), b.load(high, typ=DOUBLE)
        middle = b.fmul(real(0.5), b.fadd(a, c))
        there = {**known, eq["contraction"].id: middle}
        emitted = SimdEmitter(1).emit(b, [force], there)
        pulls = b.fcmp_ordered(">", emitted[force.id], load)
        b.store(b.select(pulls, middle, a), low)
        b.store(b.select(pulls, c, middle), high)
    half = b.fadd(b.load(low, typ=DOUBLE), b.load(high, typ=DOUBLE))
    return b.fmul(real(0.5), half)


_programs: dict[tuple[str, ...], Program] = {}


def program(model: Model) -> Program:
    """Return the compiled functions of a model's structure, compiled once."""
    key = tuple(structure(model))
    if key not in _programs:
        _programs[key] = Program(model)
    return _programs[key]


def vector(model: Model, tolerance: float) -> np.ndarray:
    """Return a model's vector for compiled functions: the tolerance, then all parameters."""
    return np.concatenate([[tolerance], model.vector()])


def table(made: Program, numbers: np.ndarray) -> np.ndarray:
    """Compute the constants of a model from its vector."""
    out = np.empty(made.table_size)
    made.table(numbers.ctypes.data, out.ctypes.data)
    return out
