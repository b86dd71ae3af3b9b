"""Effects with their sizes in words: `Coulomb friction (dynamic 12 N), or hysteresis`."""

from collections.abc import Sequence

from pma_gym.discovery.report.effect_text import effect_name, effect_names
from pma_gym.discovery.report.figure_text import at_its_limit, figure, undetermined_text
from pma_gym.discovery.result.estimates import NamedEffect
from pma_gym.units import suffix, with_unit


def sized_effects(effects: Sequence[NamedEffect]) -> str:
    """Effects, each with its sizes and what it could as well be."""
    text, joint = "", ""
    for effect in effects:
        sizes = effect_sizes(effect)
        others = effect_names(list(effect.confused_with), "or")
        doubt = f", or {others}" if others else ""
        text += f"{joint}{effect_name(effect.name)} ({sizes}){doubt}"
        joint = ", and " if others else " and "
    return text


def effect_sizes(effect: NamedEffect) -> str:
    """Sizes of an effect and what is not determined of it: `force 8.2 N, distance 1.1 mm`."""
    known = [
        f"{_stem(parameter, each.unit)} {with_unit(figure(each.value), each.unit)}"
        f"{at_its_limit(each)}"
        for parameter, each in effect.parameters.items()
    ]
    left = [
        f"{_stem(parameter, each.unit)} {undetermined_text(each)}"
        for parameter, each in effect.undetermined.items()
    ]
    return ", ".join([*known, *left])


def _stem(parameter: str, unit_: str) -> str:
    """A parameter's name without its unit: `force` of `force_n`."""
    ending = suffix(unit_)
    stem = parameter.removesuffix(f"_{ending}") if ending else parameter
    return stem.replace("_", " ").replace("stribeck", "Stribeck")
