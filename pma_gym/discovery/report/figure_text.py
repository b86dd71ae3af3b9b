"""Numbers, units, signals and lists, as sentences and tables have them."""

import math

from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial_columns import BY_NAME
from pma_gym.discovery.result.estimates import Estimate, Undetermined
from pma_gym.discovery.result.misfit import Gap
from pma_gym.units import with_unit


def listed(words: list[str], joint: str = "and") -> str:
    """Words in a row: `a, b and c`.

    >>> listed(["a", "b", "c"]), listed(["a"]), listed([])
    ('a, b and c', 'a', '')
    """
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {joint} {words[-1]}"


def capitalised(text: str) -> str:
    """With a large first letter; the others as they are."""
    return text[:1].upper() + text[1:]


def signal_name(signal: str) -> str:
    """`contraction_mm` as `contraction`."""
    known = SIGNALS.get(BY_NAME[signal].quantity) if signal in BY_NAME else None
    return signal if known is None else known.called or known.name


def signal_unit(signal: str) -> str:
    """`contraction_mm` is in mm."""
    return BY_NAME[signal].unit


def unit_cell(unit: str) -> str:
    """A unit in a column of units, which a pure number leaves blank.

    >>> unit_cell("N/mm"), unit_cell("1")
    ('N/mm', '')
    """
    return "" if unit == "1" else unit


def figure(value: float | None, digits: int = 3) -> str:
    """A number with three significant digits, without an exponent where people write none.

    >>> figure(0.8391), figure(1234.5), figure(4.5e-5), figure(None), figure(12.0)
    ('0.839', '1230', '4.5e-05', '–', '12')
    """
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(value) < 1e6 else text


def distinct(one: float, other: float) -> tuple[str, str]:
    """Two numbers with four significant digits, or as many more as it takes to differ.

    >>> distinct(1.2013, 1.175), distinct(4.99997, 5.0), distinct(5.0, 5.0)
    (('1.201', '1.175'), ('4.99997', '5'), ('5', '5'))
    """
    digits = next((n for n in range(4, 17) if f"{one:.{n}g}" != f"{other:.{n}g}"), 4)
    return f"{one:.{digits}g}", f"{other:.{digits}g}"


def estimate(value: float, low: float | None, high: float | None) -> str:
    """A value with as many decimals as its interval deserves.

    >>> estimate(14.2371, 13.12, 15.38), estimate(0.021, 0.0187, 0.0233), estimate(14.2371, None, 3)
    ('14.2', '0.0210', '14.2')
    """
    if low is None or high is None or not 0.0 < high - low < math.inf:
        return figure(value)
    decimals = 1 - math.floor(math.log10(0.5 * (high - low)))
    return f"{value:.{max(decimals, 0)}f}" if decimals <= 8 else figure(value)


def interval(known: Estimate) -> str:
    """The 95 % interval of an estimate: `13.1 to 15.4`."""
    low, high = known.low, known.high
    if low is None and high is None:
        return "not bounded by these data"
    if low is None or high is None:
        return f"above {figure(low)}" if high is None else f"below {figure(high)}"
    return f"{estimate(low, low, high)} to {estimate(high, low, high)}"


def estimate_text(known: Estimate) -> str:
    """`14.2 N (95 %: 13.1 to 15.4)`."""
    value = with_unit(estimate(known.value, known.low, known.high), known.unit)
    return f"{value}{at_its_limit(known)} (95 %: {interval(known)})"


def undetermined_text(known: Undetermined) -> str:
    """`not determined, above 20 mm/s`."""
    if known.above is None and known.below is None:
        return "not determined"
    side = "below" if known.above is None else "above"
    bound = known.below if known.above is None else known.above
    return f"not determined, {side} {with_unit(figure(bound, 2), known.unit)}"


def at_its_limit(known: Estimate) -> str:
    """That a value is at an end of what the fit allows; empty where it is not."""
    return f" (at its {known.limit} limit)" if known.limit else ""


def chance(p_value: float) -> str:
    """A p-value: `p < 0.001`."""
    return "p < 0.001" if p_value < 0.001 else f"p = {p_value:.2g}"


def percent(share: float | None) -> str:
    """A share: `71 %`.

    >>> percent(0.714), percent(0.9991), percent(0.001), percent(None)
    ('71 %', '99.9 %', '< 1 %', '–')
    """
    if share is None:
        return "–"
    if 0.0 < share < 0.005:
        return "< 1 %"
    return f"{100 * share:.1f} %" if 0.99 < share < 1.0 else f"{100 * share:.0f} %"


_WORTH_CLOSING = 1.1
"""Misfit over noise from which there is a gap to speak of."""


def gap_closed(gap: Gap) -> float | None:
    """The share of a gap that was closed; None where noise hides what there was to close."""
    return gap.closed if gap.before > _WORTH_CLOSING * gap.floor else None


def odds(ratio: float) -> str:
    """Expected odds, which only their size says anything about."""
    return "over 1000 to 1" if ratio > 1000 else f"about {ratio:.2g} to 1"


def duration(minutes: float) -> str:
    """How long an experiment takes.

    >>> duration(0.17), duration(2.5)
    ('10 s', '2.5 min')
    """
    return f"{60 * minutes:.0f} s" if minutes < 2.0 else f"{minutes:.2g} min"
