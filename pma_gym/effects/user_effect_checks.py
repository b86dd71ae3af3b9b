"""Checks of users' effects: rules that let a station include one and a diagnosis leave it out.

Each rule returns the error with its fix, or an empty string.
"""

from collections.abc import Callable, Iterator
from types import CodeType, FunctionType, ModuleType

import numpy as np

from pma_gym.codegen.graph import CHANGING, FIXED, Graph
from pma_gym.codegen.trace import trace
from pma_gym.effects.effect import Effect, signals
from pma_gym.effects.ports import example
from pma_gym.effects.rig_ports import OPEN_PORTS, rigs_of, unknown_signal
from pma_gym.units import with_unit


def broken_rule(effect: Effect, module: ModuleType) -> str:
    """Return the message of the first rule that an effect of a module breaks; empty if none."""
    rules = (_port, _parameters, _functions, _arguments, _arithmetic, _absence)
    return next((wrong for rule in rules if (wrong := rule(effect, module))), "")


def numbers(law: Callable) -> Iterator[tuple[str, object]]:
    """Global numbers, and rows of numbers, that a law and the functions it calls use."""
    for function in (law, *_called(law)):
        for name, value in _globals(function).items():
            if isinstance(value, int | float | tuple):
                yield name, value


def _port(effect: Effect, _module: ModuleType) -> str:
    if rigs_of(effect.port):
        return ""
    ports = "; ".join(f"of a {rig}: {', '.join(ports)}" for rig, ports in OPEN_PORTS.items())
    return f"acts at port {effect.port!r}; effects can be added at ports {ports}"


def _parameters(effect: Effect, _module: ModuleType) -> str:
    try:
        quantities = effect.quantities
        fields = effect.parameters._fields
    except (AttributeError, IndexError, TypeError, NameError) as error:
        return (
            f"has parameters that are no NamedTuple of annotated floats ({error}); write "
            'gain: Annotated[float, Quantity("N", 0, 10, "assumption: 2", 0.0, usual=2)]'
        )
    if set(fields) != set(quantities) or effect.rows:
        return "may only have parameters that are single floats, each with a Quantity"
    without = [name for name, quantity in quantities.items() if quantity.usual is None]
    if without:
        return f"gives no usual value to {', '.join(without)}; write Quantity(..., usual=...)"
    for name, default in effect.parameters._field_defaults.items():
        if default != getattr(effect.usual, name):
            return (
                f"gives {name} a default of {default!r} (SI) and another usual value, "
                f"{with_unit(f'{quantities[name].usual:g}', quantities[name].unit)}; write the same"
            )
    if effect.neutral is None:
        return "is never absent: give a parameter a neutral value, Quantity(..., neutral=0.0)"
    unknown = set(effect.held) - set(fields)
    if unknown:
        return f"holds {', '.join(sorted(unknown))}, which are none of {', '.join(fields)}"
    if all(getattr(effect.usual, n) == getattr(effect.neutral, n) for n in fields):
        return "is absent at its usual values; give one that is not neutral"
    return ""


def _functions(effect: Effect, module: ModuleType) -> str:
    if effect.law is None:
        return "has no law; give law=, a function"
    if effect.rate and effect.rate_independent_law:
        return "has a rate and a rate_independent_law; its memory can have one of them"
    for law in effect.laws():
        if not isinstance(law, FunctionType):
            return f"has {law!r} for a law; write a plain function with def"
        for called in _called(law):
            if called.__module__ != module.__name__ and not called.__module__.startswith(
                "pma_gym."
            ):
                return (
                    f"calls {called.__name__} of {called.__module__}; laws call functions of their "
                    "own file and of pma_gym.effects.arithmetic only"
                )
    return ""


def _arguments(effect: Effect, _module: ModuleType) -> str:
    """A law must suit one of the rigs that have its port; a model checks its own."""
    unknown = [unknown_signal(effect, rig) for rig in rigs_of(effect.port)]
    return unknown[0] if all(unknown) else ""


def _arithmetic(effect: Effect, _module: ModuleType) -> str:
    """Trace every law: a branch, or a function of `math`, fails there."""
    for law in effect.laws():
        graph = Graph()
        arguments = [
            graph.inputs("p", effect.usual, FIXED)
            if name == "p"
            else _memories(effect, lambda i, g=graph: g.input(f"memory_{i}", CHANGING))
            if name == "memory"
            else graph.input(name, CHANGING)
            for name in signals(law)
        ]
        try:
            traced = trace(law, *arguments)
            pairs = traced if effect.memories > 1 else (traced,)
            if law is effect.rate:
                if len(pairs) != effect.memories:
                    return f"has {effect.memories} memories, but {law.__name__} gives {len(pairs)}"
                for source, decay in pairs:
                    graph.value(source)
                    graph.value(decay)
            else:
                graph.value(traced)
        except Exception as error:
            form = "(source, decay)" if law is effect.rate else "one number"
            return (
                f"has a law that cannot be compiled: {law.__name__}: {error}; use + - * / ** abs() "
                f"and NumPy's functions (np.where, np.maximum, np.exp, ...) instead of if, max and "
                f"math, and return {form}"
            )
    return ""


def _memories(effect: Effect, make: Callable) -> object:
    values = tuple(make(i) for i in range(effect.memories))
    return values if effect.memories > 1 else values[0]


def _absence(effect: Effect, _module: ModuleType) -> str:
    law, absent = effect.law, OPEN_PORTS[rigs_of(effect.port)[0]][effect.port].absent
    assert law is not None
    for share in (1.0, -0.5):
        known = {name: share * example(name) for name in signals(law)}
        if effect.port.startswith(("drive_", "regulator_")):
            known = {name: abs(value) for name, value in known.items()}
        # NumPy's numbers have no complex powers.
        known = {name: np.float64(value) for name, value in known.items()}
        known |= {"p": effect.neutral, "memory": _memories(effect, lambda _: 0.0)}
        try:
            with np.errstate(all="ignore"):
                result = law(*(known[name] for name in signals(law)))
        except ZeroDivisionError:
            return f"divides by 0 at its neutral values, in {law.__name__}; change the formula"
        expected = known[absent] if isinstance(absent, str) else absent
        if result != expected:
            at = ", ".join(f"{n} {known[n]:g}" for n in signals(law) if n not in ("p", "memory"))
            return (
                f"is not absent at its neutral values: {law.__name__} gives {result:g} at {at} "
                f"(SI), and {expected:g} would change nothing at port {effect.port}"
                + ("; take powers and logarithms of abs(x)" if np.isnan(result) else "")
            )
    return ""


def _called(law: Callable) -> Iterator[FunctionType]:
    """Functions that a law calls, and those that they call."""
    waiting, seen = [law], {id(law)}
    while waiting:
        for value in _globals(waiting.pop()).values():
            if isinstance(value, FunctionType) and id(value) not in seen:
                seen.add(id(value))
                waiting.append(value)
                yield value


def _globals(function: Callable) -> dict[str, object]:
    assert isinstance(function, FunctionType)
    known = function.__globals__
    return {name: known[name] for name in _names(function.__code__) if name in known}


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)
