"""A plant written as equations, from the very text that is simulated."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pma_gym.effects.effect import Parameters
from pma_gym.plant.lanes import rebind
from pma_gym.plant.plant import Plant

if TYPE_CHECKING:
    import sympy

INPUTS = ("motor_voltage", "regulator_voltage", "zero_contraction")


def symbolic(plant: Plant) -> "dict[str, sympy.Expr]":
    """The plant's equations of motion.

    Needs SymPy (`pip install "pma-gym[symbolic]"`).

    Args:
        plant: the plant.
    Returns:
        SymPy expression of every state's rate, by the state's name. Symbols are the states, the
        commands, zero_contraction, and parameters as effect.name (SI). A row that is interpolated
        is a function effect_name of what it is interpolated at.
    """
    import sympy

    rate = rebind(plant.plain.rate, _arithmetic())
    states = [sympy.Symbol(name, real=True) for name in plant.states]
    inputs = [sympy.Symbol(name, real=True) for name in INPUTS]
    parameters = [_symbols(name, values) for name, values in plant.model.parameters.items()]
    parts = iter(rate(*states, *inputs, *parameters))
    rates = {}
    for state in states:
        source = next(parts)
        rates[state.name] = source - next(parts) * state if state.name in plant.decaying else source
    return rates


def _arithmetic() -> dict:
    """What the functions of `pma_gym.effects.arithmetic` are for SymPy."""
    import sympy

    def interpolate(
        value: sympy.Expr, knots: Sequence[sympy.Symbol], heights: Sequence[sympy.Symbol]
    ) -> sympy.Expr:
        row = heights[0].name.partition("[")[0].replace(".", "_")
        return sympy.Function(row, real=True)(value)

    return {
        "where": lambda condition, yes, no: sympy.Piecewise((yes, condition), (no, True)),
        "positive": lambda value: sympy.Max(0, value),
        "clip": lambda value, lower, upper: sympy.Min(sympy.Max(value, lower), upper),
        "exponential": sympy.exp,
        "interpolate": interpolate,
    }


def _symbols(effect: str, values: Parameters) -> Parameters:
    """The parameters of an effect, with a symbol for each number."""
    import sympy

    symbols = {}
    for name, value in values._asdict().items():
        path = f"{effect}.{name}"
        if isinstance(value, tuple):
            row = (sympy.Symbol(f"{path}[{i}]", real=True) for i in range(len(value)))
            symbols[name] = tuple(row)
        else:
            symbols[name] = sympy.Symbol(path, real=True)
    return values._replace(**symbols)
