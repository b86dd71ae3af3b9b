"""What the smoothed latent force goes with, in which trial it acts most, and a draft of its law."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial_columns import BY_QUANTITY, Column
from pma_gym.discovery.grey_box.hypothesis import FREE_LAWS, Hypothesis
from pma_gym.discovery.report.figure_text import capitalised, percent, signal_name
from pma_gym.discovery.result.misfit import LatentForce, ResidualLaw
from pma_gym.discovery.thresholds import CONFIDENCE, LEFT, RIPPLE_PERIODS
from pma_gym.effects import CATALOGUE
from pma_gym.effects.residual_law import between_heights
from pma_gym.estimation.innovations import PORTS, SPEEDS
from pma_gym.estimation.smoother import Smoothed
from pma_gym.plant.model import Model
from pma_gym.plant.rigs.rig import Rig
from pma_gym.plant.sensors import direct_command
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]

FORCES = {"slide": ("force on the slide", "N"), "joint": ("torque on the joint", "N m")}
"""What a latent force is, and its unit, by rig."""

DAMPING = "damping"
"""In the names of laws of free shape that give a damping, not a force."""

PERIODS, FINER, CUBIC = 3.0, 4, 3
"""Of a line in the shortest trial at least; points of its spectrum within its width; and the
degree of what goes with the position smoothly, which the linear and cubic springs have."""


def fitted_law(made: Hypothesis, explained: float, rig: Rig) -> ResidualLaw:
    """The law of free shape of a hypothesis, which explains so much of the latent force.

    With the band of its shape: an offset of the drive makes up for a constant.
    """
    assert made.free_law is not None
    effect, fitted = CATALOGUE[made.free_law.effect], made.fit
    own = {i: c for i, c in enumerate(fitted.coordinates) if c.name.startswith(f"{effect.name}.")}
    ends = made.free_law.model.parameters[effect.name]
    at = np.linspace(ends.first, ends.first + ends.reach, len(own))
    # It is linear in its values.
    stems = [c.name.partition(".")[2] for c in own.values()]
    basis = np.array([[between_heights(x, ends._replace(**{s: 1.0})) for s in stems] for x in at])
    height = effect.quantities["h0"]
    scaled = basis * np.array([height.from_si(c.scale) for c in own.values()])
    law = scaled @ np.array([c.of(fitted.point) for c in own.values()])
    shape = scaled - scaled.mean(axis=0)
    wide = CONFIDENCE * np.sqrt(
        np.diag(shape @ fitted.curvature[np.ix_(list(own), list(own))] @ shape.T)
    )
    over_speed, damps = FREE_LAWS[rig.name].index(effect.name) == 1, DAMPING in effect.name
    column = BY_QUANTITY[rig.signals[int(over_speed)].name]
    what = f"{DAMPING} of the {rig.name}" if damps else FORCES[rig.name][0]
    goes = f"{'is a damping that ' if damps else ''}goes with {signal_name(column.name)}"
    return ResidualLaw(
        f"{what} ({height.unit})",
        _label(column),
        at / SI_FACTORS[column.unit],
        law,
        law - wide,
        law + wide,
        f"{goes}: that explains {percent(explained)} of its mean square",
    )


def latent_force(model: Model, before: Smoothed, after: Smoothed | None) -> LatentForce:
    """One trial's latent force, over all that it may go with.

    Args:
        model: of a slide or a joint.
        before: with parameters refitted and nothing added.
        after: with the proposed model; None where that adds nothing.
    """
    names = [signal.name for signal in model.rig.signals[:2]]
    columns = [BY_QUANTITY[n] for n in (*names, direct_command(model) or "motor_voltage")]
    values = (before.position, before.speed, before.command)
    over = {_label(c): v / SI_FACTORS[c.unit] for c, v in zip(columns, values, strict=True)}
    what, unit = FORCES[model.rig.name]
    return LatentForce(f"{what} ({unit})", before.force, after and after.force, over)


def _label(column: Column) -> str:
    """Of an axis."""
    return f"{signal_name(column.name).replace('_', ' ')} ({column.unit})"


def largest_share(trials: Sequence[Smoothed]) -> tuple[int, float]:
    """The trial with most of the latent force (mean square), and its share."""
    squares = np.array([float(np.sum(each.force**2)) for each in trials])
    largest = int(np.argmax(squares))
    return largest, float(squares[largest] / max(float(squares.sum()), 1e-300))


def latent_line(trials: Sequence[Smoothed]) -> tuple[float, float] | None:
    """Frequency (Hz) of the line that carries most of the force's variance, and its share.

    None where no line does, or where the rig itself moves at that frequency: then it goes with the
    motion.
    """
    shortest = min(float(each.time[-1] - each.time[0]) for each in trials)

    def peak(rows: Sequence[Array]) -> tuple[float, float]:
        hertz, power, total = line_power([each.time for each in trials], rows)
        at = int(np.argmax(power))
        return float(hertz[at]), float(power[at]) / max(total, 1e-300)

    line, share = peak([each.force for each in trials])
    motion, moved = peak([each.position for each in trials])
    if share < LEFT or moved > LEFT and abs(line - motion) < 1.0 / shortest:
        return None
    return line, share


def line_power(times: Sequence[Array], rows: Sequence[Array]) -> tuple[Array, Array, float]:
    """Frequencies (Hz), sums of squares that waves of each explain, and the whole sum of squares.

    Of fewer than some periods in the shortest trial a wave is no line: it explains nothing.
    """
    step = float(np.median(np.concatenate([np.diff(time) for time in times])))
    padded = FINER * max(map(len, times))
    shortest = min(float(time[-1] - time[0]) for time in times)
    hertz = np.asarray(np.fft.rfftfreq(padded, step), float)
    power, total = np.zeros(len(hertz)), 0.0
    for time, row in zip(times, rows, strict=True):
        even = np.interp(np.arange(time[0], time[-1], step), time, row)
        even -= even.mean()
        power += 2.0 / len(even) * np.abs(np.fft.rfft(even, padded)) ** 2
        total += float(even @ even)
    return hertz, power * (hertz > PERIODS / shortest), total


def line_over_position(trials: Sequence[Smoothed]) -> float:
    """Periods in a unit of the position (1/m, 1/rad) of the force's strongest line over it.

    Of those that are seen to repeat, beside a cubic: a smooth law has no line.
    """
    force, position = (
        np.concatenate([getattr(each, name) for each in trials]) for name in ("force", "position")
    )
    way, cells = float(np.ptp(position)), len(position)
    of = ((position - position.min()) / way * (cells - 1)).astype(int)
    force = force - np.polynomial.Polynomial.fit(position, force, CUBIC)(position)
    power = np.abs(np.fft.rfft(np.bincount(of, force, cells), FINER * cells))
    often = np.fft.rfftfreq(FINER * cells, way / (cells - 1))
    return float(often[np.argmax(power * (often > RIPPLE_PERIODS / way))])


def drafted_effect(law: ResidualLaw, rig: Rig) -> str:
    """A Python file with a law as a user effect, whose share is fitted."""
    states = (rig.signals[0].name, SPEEDS[rig.name])
    columns = [BY_QUANTITY[each.name] for each in rig.signals[:2]]
    of = {_label(column): (column, state) for column, state in zip(columns, states, strict=True)}
    column, signal = of[law.variable]
    title = f"{capitalised(law.quantity)} over {law.variable}"
    damps, unit = law.quantity.startswith(DAMPING), law.quantity.partition(" (")[2][:-1]
    arguments, times = (f"{signal}, {states[1]}", f"-{states[1]} * ") if damps else (signal, "")
    at = tuple(float(f"{x * SI_FACTORS[column.unit]:.6g}") for x in law.at)
    values = tuple(float(f"{y * SI_FACTORS[unit]:.6g}") for y in law.law)
    return f'''"""{title}, as a diagnosis fitted it."""

from typing import Annotated, NamedTuple

from pma_gym.effects import Effect
from pma_gym.effects.arithmetic import interp
from pma_gym.units import Quantity

AT = {at}
LAW = {values}


class Drafted(NamedTuple):
    share: Annotated[float, Quantity("%", 0, 1000, "100: as drafted", neutral=0.0, usual=100.0)]


def drafted({arguments}, p):
    return {times}p.share * interp({signal}, AT, LAW)


DRAFTED = Effect("drafted", "{PORTS[rig.name]}", Drafted, drafted, signature="{law.words}")
'''
