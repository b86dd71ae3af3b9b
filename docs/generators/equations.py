"""The plants' balances, and the equations that a model makes of them."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from generators.text import code, sections, table
from pma_gym.effects.effect import Effect, signals
from pma_gym.plant.forms.symbolic import Names, Notation
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.rigs import RIGS


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
