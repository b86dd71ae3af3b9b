"""A plant's equations of motion as SymPy expressions, from the same source as the simulation."""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from pma_gym.codegen import elementary
from pma_gym.codegen.rebinding import rebind
from pma_gym.plant.compiled_model import CompiledModel
from pma_gym.plant.forms.notation import Names, Notation

if TYPE_CHECKING:
    import sympy


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
