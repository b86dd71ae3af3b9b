"""A plant's equations of motion as SymPy expressions, from the same source as the simulation."""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from pma_gym.codegen import elementary
from pma_gym.codegen.trace import rebind
from pma_gym.plant.compiled_model import CompiledModel

if TYPE_CHECKING:
    import sympy
from abc import abstractmethod

from pma_gym.codegen.graph import HELD, Graph
from pma_gym.effects.effect import Effect, Parameters
from pma_gym.integrator.equations import COMMANDS, ZERO
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.model import Model


class Names:
    """Replacement of the graph that makes inputs by name.

    Args:
        make: makes an input from a name.
        constant: makes a constant from a number; returns other values unchanged.
    """

    inputs = Graph.inputs

    def __init__(self, make: Callable[[str], Any], constant: Callable[[Any], Any]) -> None:
        self._make, self.constant, self.value = make, constant, constant

    def input(self, name: str, level: int = HELD) -> Any:  # noqa: ANN401
        """Return the input with a name."""
        return self._make(name)


class Notation(PlantEquations):
    """A plant's equations with values of another notation.

    Args:
        model: the model.
        names: makes inputs and constants.

    Attributes:
        roads: effects with a rate-independent state, keyed by the state.
    """

    def __init__(self, model: Model, names: Names) -> None:
        self.graph: Any = names
        self.effects, self.views = model.effects, {}
        inputs: Any = names.inputs
        self.parameters: dict[str, Parameters] = {
            name: inputs(name, values) for name, values in model.parameters.items()
        }
        self.interpolation = "zoh"
        self.named: Any = {name: names.input(name) for name in (*COMMANDS, ZERO)}
        self.states, self.rate_independent_states, self.events = [], [], []
        self.outputs: Any = {}
        self.travelled: Any = None
        self.roads: dict[str, Effect] = {}
        rebind(model.rig.write_equations, {"trace": self.apply})(self)

    @abstractmethod
    def apply(self, law: Callable, *arguments: Any) -> Any:  # noqa: ANN401
        """Return a law's value for its arguments, in this notation."""

    def call(self, effect: Effect, law: Callable, **other: Any) -> Any:  # noqa: ANN401
        """Return the value of an effect's law, as in the compiled equations."""
        return rebind(PlantEquations.call, {"trace": self.apply})(self, effect, law, **other)

    def memory(self, effect: Effect) -> Any:  # noqa: ANN401
        """Return the present state of an effect."""
        if effect.rate_independent_law is None:
            return super().memory(effect)
        (name,) = effect.memory_names
        self.roads[name] = effect
        return self[name]

    def add_event(self, *_: Any, **__: Any) -> None:
        """Do nothing: the ends of steps are not part of the equations."""

    def add_breakpoints(self) -> None:
        """Do nothing, as for events."""


def symbolic(plant: CompiledModel) -> "dict[str, sympy.Expr]":
    """Return the plant's equations of motion as SymPy expressions.

    Needs SymPy (`pip install "pma-gym[symbolic]"`).

    Args:
        plant: the plant.
    Returns:
        SymPy expression of every state's rate, by the state's name. Symbols are the states, the
        commands, zero_contraction, and parameters as effect.name (SI). An interpolated row
        is a function effect_name of its argument. The rate of a rate-independent state is its slope
        over distance times the velocity.
    """
    import sympy

    names = Names(lambda name: sympy.Symbol(name, real=True), sympy.sympify)
    written = _Expressions(plant.model, names)
    rates = {state.name: state.rate for state in written.states} | written.memory_rates()
    return {name: rates[name] for name in plant.states}  # pyright: ignore[reportReturnType]


class _Expressions(Notation):
    """Equations whose values are SymPy's."""

    @cached_property
    def _arithmetic(self) -> dict[str, Callable]:
        """What the functions of `pma_gym.effects.arithmetic` are for SymPy."""
        import sympy

        def interp(x: "sympy.Expr", xp: Sequence[Any], fp: Sequence[Any]) -> "sympy.Expr":
            if not isinstance(fp[0], sympy.Symbol):
                return rebind(elementary.interp, self._arithmetic)(x, xp, fp)
            row = fp[0].name.partition("[")[0].replace(".", "_")
            return sympy.Function(row, real=True)(x)

        return {
            "where": lambda condition, yes, no: sympy.Piecewise((yes, condition), (no, True)),
            "positive": lambda value: sympy.Max(0, value),
            "clip": lambda value, lower, upper: sympy.Min(sympy.Max(value, lower), upper),
            **{name: getattr(sympy, name) for name in ("exp", "log", "tanh", "sin", "cos", "sqrt")},
            **{"minimum": sympy.Min, "maximum": sympy.Max, "sign": sympy.sign, "abs": sympy.Abs},
            **{"absolute": sympy.Abs, "power": sympy.Pow, "square": lambda x: x * x},
            "exponential": sympy.exp,
            "cosine": sympy.cos,
            "interp": interp,
        }

    def apply(self, law: Callable, *arguments: Any) -> Any:  # noqa: ANN401
        """The law's expression."""
        return rebind(law, self._arithmetic)(*arguments)

    def memory_rates(self) -> dict[str, Any]:
        """Rates of the memories of the way travelled."""
        import sympy

        if not self.roads:
            return {}
        speed, travel = self.travelled[1], sympy.Symbol("travel", real=True)
        direction = sympy.Piecewise((-1, speed < 0), (1, True))
        # Choices as such: the derivative of Max or Min is a step function.
        choices = {name: self._arithmetic[name] for name in ("where", "exponential")}
        rates = {}
        for name, effect in self.roads.items():
            path = rebind(effect.rate_independent_law, choices)  # pyright: ignore[reportArgumentType]
            after = path(self[name], travel, direction, self.parameters[effect.name])
            rates[name] = sympy.diff(after, travel).subs(travel, 0) * speed
        return rates
