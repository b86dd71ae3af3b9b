"""The catalogue of effects: laws, parameters, sources."""

import inspect
import sys
from collections.abc import Callable

from generators.text import code, number, sections, summary, table
from pma_gym.effects import CATALOGUE, Effect
from pma_gym.plant.model import load_model, shipped_models
from pma_gym.units import Quantity


def overview() -> str:
    """One row an effect: port, what it is, which shipped models have it."""
    rows = [
        [
            f"[{name}](#{_anchor(name)})",
            code(effect.port),
            summary(effect.law or effect.parameters),
            _models_with(name),
        ]
        for name, effect in CATALOGUE.items()
    ]
    return table(["Effect", "Port", "What", "In the shipped models"], rows)


def effects() -> str:
    """Every effect with its laws, signature and parameters.

    What a file says of its laws together stands with the first of them.
    """
    first: dict[str, str] = {}
    parts = []
    for effect in CATALOGUE.values():
        module = effect.parameters.__module__
        common = sections(sys.modules[module])[""].partition("\n\n")[2]
        if common and module in first:
            common = f"Shared with [{first[module]}](#{_anchor(first[module])}): see there."
        first.setdefault(module, effect.name)
        parts.append(_effect(effect, common))
    return "\n\n".join(parts)


def _effect(effect: Effect, common: str) -> str:
    parts = [f"## {effect.name} {{ #{_anchor(effect.name)} }}", f"Port: {code(effect.port)}."]
    parts += [common] if common else []
    parts += [_law(effect.law)] if effect.law else [sections(effect.parameters)[""]]
    if effect.rate:
        label = "Its memory" if effect.law else "Its lag"
        parts.append(f"{label}: {_law(effect.rate)}")
    if effect.rate_independent_law:
        parts.append(f"Its memory, by the way travelled: {_law(effect.rate_independent_law)}")
    if effect.event:
        parts.append(f"Steps end where this is 0: {_law(effect.event)}")
    if effect.breakpoint:
        parts.append(f"Steps end about where this is 0: {_law(effect.breakpoint)}")
    if effect.path_breakpoint:
        parts.append(f"Steps end about this far on: {_law(effect.path_breakpoint)}")
    if effect.release_path:
        parts.append(f"Backlash opens this far on: {_law(effect.release_path)}")
    if effect.signature:
        parts.append(f"Signature in data: {effect.signature}.")
    rows = [_parameter(name, quantity) for name, quantity in effect.quantities.items()]
    header = [
        "Parameter in a model file",
        "Unit",
        "Bounds",
        "Neutral",
        "Usual",
        "Where the usual value comes from",
    ]
    parts.append(table(header, rows))
    if effect.held:
        names = ", ".join(code(effect.quantities[stem].name(stem)) for stem in effect.held)
        parts.append(f"A diagnosis that fits this effect leaves {names} at the usual value.")
    if effect.defaults:
        meant = ", ".join(
            f"{code(name)} {number(value)}" for name, value in effect.defaults.items()
        )
        parts.append(f"A model file that does not name them means {meant}.")
    return "\n\n".join(parts)


def _law(law: Callable) -> str:
    """What a law's docstring says and where it comes from."""
    described = {law.__name__: sections(law)}
    described |= {called.__name__: sections(called) for called in _called_by(law)}
    own, *others = described
    parts = [described[own][""], *(f"`{name}`: {described[name]['']}" for name in others)]
    sources = [said["Source"] for said in described.values() if "Source" in said]
    return "\n\n".join([*parts, "Source:", *sources] if sources else parts)


def _called_by(law: Callable) -> list[Callable]:
    """Functions of the law's own file that it calls: they hold part of its equation."""
    text = inspect.getsource(law)
    beside = vars(inspect.getmodule(law)).items()
    return [
        function
        for name, function in beside
        if inspect.isfunction(function) and function.__module__ == law.__module__
        if function is not law and f"{name}(" in text
    ]


def _parameter(stem: str, quantity: Quantity) -> list[str]:
    bounds = f"{number(quantity.lower)} to {number(quantity.upper)}"
    neutral = "" if quantity.neutral is None else number(quantity.neutral)
    usual = "" if quantity.usual is None else number(quantity.usual)
    return [code(quantity.name(stem)), quantity.unit, bounds, neutral, usual, quantity.source]


def _models_with(effect: str) -> str:
    """Which shipped models have an effect, in few words."""
    known = {name: effect in load_model(name).parameters for name in shipped_models()}
    having, lacking = ([n for n, has in known.items() if has is state] for state in (True, False))
    if not lacking:
        return "all"
    if len(lacking) < len(having):
        return f"all but {', '.join(lacking)}"
    return ", ".join(having) or "none; name it in a model file"


def _anchor(name: str) -> str:
    return name.replace("_", "-")
