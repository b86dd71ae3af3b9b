"""The catalogue of effects, the plants' balances, and the equations that a model makes of them."""

import inspect
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from generators.text import code, number, sections, summary, table
from pma_gym.effects import CATALOGUE
from pma_gym.effects.effect import Effect, signals
from pma_gym.plant.forms.symbolic import Names, Notation
from pma_gym.plant.model import Model, load_model, shipped_models
from pma_gym.plant.rigs import RIGS
from pma_gym.units import Quantity


def overview() -> str:
    """One row an effect: port, what it is, which shipped models have it; no second muscle's."""
    rows = [
        [
            f"[{name}](#{_anchor(name)})",
            code(effect.port),
            summary(effect.law or effect.parameters),
            _models_with(name),
        ]
        for name, effect in CATALOGUE.items()
        if not effect.of
    ]
    return table(["Effect", "Port", "What", "In the shipped models"], rows)


def effects() -> str:
    """Every effect with its laws, signature and parameters.

    What a file says of its laws together stands with the first of them.
    """
    first: dict[str, str] = {}
    parts = []
    for effect in CATALOGUE.values():
        if effect.of:
            continue
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
    parts.append(
        table(
            [
                "Parameter in a model file",
                "Unit",
                "Bounds",
                "Neutral",
                "Usual",
                "Where the usual value comes from",
            ],
            rows,
        )
    )
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


def equations(plant: str) -> str:
    """What a plant's module says of its balances."""
    return sections(import_module(RIGS[plant].write_equations.__module__))[""].partition("\n\n")[2]


def ports(plant: str) -> str:
    """The plant's ports and what becomes of the effects there."""
    rows = [[code(name), port.takes, port.result] for name, port in RIGS[plant].ports.items()]
    return table(["Port", "Takes", "What the effects there give"], rows)


def written(model: str) -> str:
    """A model's right-hand side, as it is compiled: assignments, then the rate of each state."""
    words = _Words(load_model(model))
    paths = [words.path(name, effect) for name, effect in words.roads.items()]
    lines = [*words.lines, "", *words.rates, *([""] if paths else []), *paths]
    return "```text\n" + "\n".join(lines) + "\n```"


@dataclass(frozen=True)
class _Text:
    """A piece of text that can be calculated with.

    Attributes:
        text: the text.
        binds: how strongly it holds together: 1 a sum, 2 a product, 3 a name.
    """

    text: str
    binds: int = 3

    def within(self, binds: int) -> str:
        """The text as a part of what binds so strongly."""
        return self.text if self.binds >= binds else f"({self.text})"

    def __add__(self, other: Any) -> "_Text":  # noqa: ANN401
        if _text(other).text == "0.0":
            return self
        return _Text(f"{self.text} + {_text(other).within(1)}", 1)

    def __sub__(self, other: Any) -> "_Text":  # noqa: ANN401
        return _Text(f"{self.text} - {_text(other).within(2)}", 1)

    def __mul__(self, other: Any) -> "_Text":  # noqa: ANN401
        if _text(other).text == "1.0":
            return self
        return _Text(f"{self.within(2)} * {_text(other).within(2)}", 2)

    def __truediv__(self, other: Any) -> "_Text":  # noqa: ANN401
        return _Text(f"{self.within(2)} / {_text(other).within(3)}", 2)


def _text(value: Any) -> _Text:  # noqa: ANN401
    return value if isinstance(value, _Text) else _Text(repr(value))


class _Words(Notation):
    """A model's equations as lines of text."""

    def __init__(self, model: Model) -> None:
        self.lines: list[str] = []
        self.rates: list[str] = []
        super().__init__(model, Names(_Text, _text))

    def apply(self, law: Callable, *arguments: Any) -> _Text:  # noqa: ANN401
        """The law's call."""
        return _Text(f"{law.__name__}({', '.join(map(_argument, arguments))})")

    def product(self, port: str) -> _Text:
        """The product over the effects at a port, without a factor 1 before it."""
        factors = [self.call(effect, effect.law) for effect in self.at(port) if effect.law]
        return _Text(" * ".join(factor.text for factor in factors) or "1.0", 2)

    def let(self, name: str, value: Any) -> _Text:  # noqa: ANN401
        """An assignment."""
        self.lines.append(f"{name} = {_text(value).text}")
        self.named[name] = _Text(name)
        return self.named[name]

    def add_state(self, name: str, rate: Any, scale: float | None) -> None:  # noqa: ANN401
        """The rate of a state."""
        self.rates.append(f"d({name})/dt = {_text(rate).text}")

    def add_decaying(
        self,
        name: str,
        rate: Any,  # noqa: ANN401
        scale: float | None,
        beside: str = "",
    ) -> None:
        """The rate of a state whose law gives its source and its decay."""
        self.lines.append(f"source_{name}, decay_{name} = {_text(rate).text}")
        own = _Text(f"source_{name} - decay_{name} * {name}", 1)
        self.rates.append(f"d({name})/dt = {(own + self.total(beside)).text}")

    def path(self, name: str, effect: Effect) -> str:
        """A memory of the way travelled, from where a step began."""
        law = effect.rate_independent_law
        assert law is not None
        way = self.travelled[0].text
        start = {"memory": f"{name}_0", "travel": f"{way} - {way}_0", "p": effect.name}
        names = ", ".join(start.get(signal, signal) for signal in signals(law))
        return f"{name} = {law.__name__}({names})"


def _argument(argument: Any) -> str:  # noqa: ANN401
    """An argument of a law: a text, or an effect's parameters by the effect's name."""
    if isinstance(argument, _Text):
        return argument.text
    first = argument[0]
    while isinstance(first, tuple):
        first = first[0]
    return first.text.partition(".")[0]
