"""List the candidates: every effect of the catalogue that a model lacks, ready to be fitted.

A candidate is a model that has the effect at its neutral values, the parameters of its size and
shape, and probes: parameters at which the effect would show. There are three kinds: effects that
the model lacks; parameters that it has at their neutral value, such as the slack of a taut cable;
and sensors that are slower than the model says.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.free_parameters import unit, values
from pma_gym.discovery.screening.usual_sizes import PERIODIC, Sizes, sizes
from pma_gym.effects import CATALOGUE, Effect
from pma_gym.effects.effect import signals
from pma_gym.effects.ports import MOUNT, measured_output
from pma_gym.plant import sensors
from pma_gym.plant.model import Model, ModelError
from pma_gym.units import Quantity

Array = NDArray[np.float64]

SCALES = (0.1, 0.3, 1.0, 3.0)
"""How many times its usual value an amplitude is probed at."""

SHAPES = (0.4, 1.0, 2.5)
"""The same for what gives an effect its shape."""

THRESHOLDS = tuple(1.13**k for k in range(-16, 9))
"""The same for a limit, which does nothing until it is reached."""

FAR = 20.0
"""A neutral value so many times the usual one is a limit that is never reached."""

DELAYS = (0.15, 0.4, 1.0, 2.5)
"""How many times its usual value a time is probed at, of an effect that has no other size."""

PERIODS = tuple(range(1, 21))
"""How many eighths of its usual number of periods a ripple is looked for at: a trial of a quarter
turn tells no finer."""

PRESLIDINGS = (0.1, 0.4, 1.0, 2.5, 10.0, 40.0)
"""How many times its usual value a presliding distance is looked for at: a seal's is a hundred
times that of a rolling guide."""

QUARTERS = (0.0, 90.0, 180.0, -90.0)
"""Where a weight may hang (deg) when the angle is 0: an arm may be level there."""

SLOWER = (0.5, 0.2, 0.08, 0.03)
"""Bandwidths of a sensor that are probed, as a share of what the model says."""


def candidate_effects(
    model: Model,
    orders: Sequence[float] | None = None,
    trials: Sequence[Trial] = (),
) -> list[CandidateEffect]:
    """Every effect that a model lacks, in the order of the catalogue.

    Args:
        model: the model.
        orders: which repeat each trial is, 0 for the first; None where that is not known.
        trials: the trials, by whose sizes effects of a free rig are looked for.
    """
    usual = sizes(model, trials) if trials else None
    candidates = [
        *(_lacking(model, effect, orders, usual) for effect in CATALOGUE.values()),
        *_at_neutral(model),
        *_slow_sensors(model),
    ]
    has_pressure = _has_pressure(model, trials)
    return [each for each in candidates if each is not None and _can_act(each, has_pressure)]


def _has_pressure(model: Model, trials: Sequence[Trial]) -> bool:
    """Whether anything is under pressure: a part on a testing machine may be under none."""
    if model.rig.imposes_motion and trials:
        return any(sensors.voltages(model, trial)[1].any() for trial in trials)
    return model.rig.has_muscle or any(signal.is_pressure for signal in model.rig.signals)


def _can_act(candidate: CandidateEffect, has_pressure: bool) -> bool:
    """Whether a rig has what an effect grows with: one without a pressure shows no part of it."""
    law = CATALOGUE[candidate.effect].law
    if has_pressure:
        return True
    grown = [path for path, size in zip(candidate.paths, candidate.amplitudes, strict=True) if size]
    units = [unit(path) for path in grown or candidate.fitted_paths]
    pressures = {(signal.measures, "p") for signal in SIGNALS.values() if signal.is_pressure}
    pressed = law is not None and signals(law) in pressures
    return not pressed and not all("kPa" in each or "bar" in each for each in units)


def _lacking(
    model: Model, effect: Effect, orders: Sequence[float] | None, sizes: Sizes | None
) -> "CandidateEffect | None":
    """An effect that the model has not."""
    if effect.name in model.parameters or effect.replaces or effect.neutral is None:
        return None
    counted = "repeat" in effect.quantities
    if counted and (orders is None or len(set(orders)) <= 1):
        return None
    output = measured_output(effect.port)
    if effect.port not in model.rig.ports and not output:
        return None
    mounted = model.rig.is_free and effect.port.startswith(MOUNT)
    if output and not (output in model.rig.outputs if mounted else _has_sensor(model, output)):
        return None
    needed = model.rig.needed_ports.get(effect.port)
    if needed and all(each.port != needed for each in model.effects.values()):
        return None
    file_keys = {stem: file_key for file_key, stem in effect.names_in_files().items()}
    quantities = {
        stem: quantity if sizes is None else _sized(effect, stem, quantity, sizes)
        for stem, quantity in effect.quantities.items()
    }
    shown = {
        stem: quantity
        for stem, quantity in quantities.items()
        if (stem not in effect.held or quantity.neutral is not None)
        and stem not in effect.rows
        # Free in every trial already, as `estimation.simulated_trials` has it.
        and stem not in ("repeat", effect.memory_start)
    }
    if any(quantity.usual is None for quantity in shown.values()):
        return None
    usual = {file_keys[stem]: q.usual for stem, q in quantities.items() if q.usual is not None}
    neutral = {
        file_keys[stem]: quantity.neutral
        for stem, quantity in shown.items()
        if quantity.neutral is not None
    }
    try:
        extended = model.with_effects({effect.name: {**usual, **neutral}})
    except ModelError:
        return None
    own = {f"{effect.name}.{file_keys['repeat']}": list(orders or ())} if counted else {}
    places = {stem: _places(stem, shown[stem], sizes) for stem in shown}
    candidate = _candidate(effect.name, effect, extended, file_keys, shown, own, places)
    return candidate if sizes is None else _overcome(_within_way(candidate, sizes), sizes)


def _within_way(candidate: CandidateEffect, sizes: Sizes) -> CandidateEffect:
    """A candidate that has as many periods in the trials' way as tell it from a slope."""
    law = CATALOGUE[candidate.effect]
    stems = law.names_in_files()
    lowest = {
        path: sizes.least_periods(quantity)
        for path in candidate.paths
        if (quantity := law.quantities[stems[path.partition(".")[2]]]).unit in PERIODIC
    }
    if not lowest:
        return candidate
    lower, upper = replace(candidate, lowest=lowest).bounds
    probes, first = np.unique(np.clip(candidate.probes, lower, upper), axis=0, return_index=True)
    order = np.argsort(first)
    kept = first[order]
    return replace(candidate, lowest=lowest, probes=probes[order], signs=candidate.signs[kept])


def _overcome(candidate: CandidateEffect, sizes: Sizes) -> CandidateEffect:
    """A candidate whose dry friction is no larger than what the trials tell from holding."""
    law = CATALOGUE[candidate.effect]
    stems = law.names_in_files()
    quantities = {path: stems[path.partition(".")[2]] for path in candidate.paths}
    # The static friction and the dynamic one, which is no larger.
    limited = {stem for tie in law.ties for stem in tie[:2]}
    highest = {
        path: sizes.most_friction(law.quantities[stem])
        for path, stem in quantities.items()
        if stem in limited
    }
    return replace(candidate, highest=highest) if highest else candidate


def _places(stem: str, quantity: Quantity, sizes: Sizes | None) -> tuple[float, ...]:
    """Where (file unit) an effect with a place of its own is looked for; none without one."""
    if stem == "offset" and quantity.turns:
        return QUARTERS
    return sizes.rests(quantity) if stem == "rest" and sizes is not None else ()


def _sized(effect: Effect, stem: str, quantity: Quantity, sizes: Sizes) -> Quantity:
    """A quantity with the usual value of these trials."""
    if stem in effect.scanned or (effect.port.startswith(MOUNT) and effect.path_breakpoint):
        return sizes.within_way(quantity)
    return quantity if stem in effect.held else sizes.scaled(quantity)


def _candidate(
    name: str,
    effect: Effect,
    model: Model,
    file_keys: Mapping[str, str],
    shown: Mapping[str, Quantity],
    own: Mapping[str, Sequence[float]],
    places: Mapping[str, Sequence[float]] | None = None,
) -> CandidateEffect:
    stems = list(shown)
    amplitudes = [stem for stem in stems if shown[stem].neutral is not None]
    switches = [stem for stem in amplitudes if stem in effect.held]
    shapes = [stem for stem in stems if shown[stem].neutral is None]
    absent = np.array([_neutral_or_usual(shown[stem]) for stem in stems])
    probes, signs = [], []
    for size in _sizes(amplitudes, switches, shown):
        for shape in _shapes(shapes, bool(switches), shown, places or {}):
            row = dict(zip(stems, absent, strict=True))
            row.update(size)
            row.update(shape)
            probes.append([float(np.clip(row[s], shown[s].lower, shown[s].upper)) for s in stems])
            signs.append(
                "phase" in shapes
                or all(shown[s].lower < _neutral_or_usual(shown[s]) < shown[s].upper for s in size)
                and not any(_is_limit(shown[s]) for s in size)
            )
    kept = [k for k, row in enumerate(probes) if row not in probes[:k]]
    times = [stem in shapes for stem in stems] if switches else [False] * len(stems)
    scaled = [stem in amplitudes and not _is_limit(shown[stem]) for stem in stems]
    return CandidateEffect(
        name,
        effect.name,
        model,
        tuple(f"{effect.name}.{file_keys[stem]}" for stem in stems),
        np.array([stem not in switches for stem in stems]),
        absent,
        np.array([probes[k] for k in kept]),
        np.array(times if switches else scaled),
        np.array([signs[k] for k in kept]),
        own,
    )


def _shapes(
    shapes: Sequence[str],
    timed: bool,
    shown: Mapping[str, Quantity],
    places: Mapping[str, Sequence[float]],
) -> Iterator[dict[str, float]]:
    """Shapes at which an effect is looked for: the first in some steps, the others as usual."""
    usual = {stem: _usual(shown[stem]) for stem in shapes}
    if "phase" in shapes:
        for periods, phase in product(PERIODS, (0.0, 90.0)):
            yield usual | {"periods": usual["periods"] * periods / 8.0, "phase": phase}
        return
    placed = next((stem for stem in shapes if places.get(stem)), None)
    if placed is not None:
        yield from (usual | {placed: place} for place in places[placed])
        return
    steps = PRESLIDINGS if "presliding" in shapes else DELAYS if timed else SHAPES
    for factor in steps if shapes else (1.0,):
        yield usual | {stem: factor * usual[stem] for stem in shapes[:1]}


def _sizes(
    amplitudes: Sequence[str], switches: Sequence[str], shown: Mapping[str, Quantity]
) -> Iterator[dict[str, float]]:
    """Sizes at which an effect is looked for: all amplitudes together, then each alone."""
    if switches:
        yield {stem: _usual(shown[stem]) for stem in switches}
        return
    limits = [stem for stem in amplitudes if _is_limit(shown[stem])]
    plain = [stem for stem in amplitudes if stem not in limits]
    for stem in limits:
        for factor in THRESHOLDS:
            yield {stem: _usual(shown[stem]) * factor}
    for scale in SCALES if plain else ():
        yield {stem: _scaled(shown[stem], scale) for stem in plain}
    if len(plain) > 1:
        for stem in plain:
            yield {stem: _scaled(shown[stem], 1.0)}


def _scaled(quantity: Quantity, scale: float) -> float:
    neutral = _neutral_or_usual(quantity)
    return neutral + scale * (_usual(quantity) - neutral)


def _at_neutral(model: Model) -> Iterator[CandidateEffect]:
    """Numbers that the model has at their neutral value."""
    for name, effect in model.effects.items():
        if name in sensors.SENSORS or name in ("limits", "validity", "hand_push"):
            continue
        file_keys = {stem: file_key for file_key, stem in effect.names_in_files().items()}
        for stem, quantity in effect.quantities.items():
            here = getattr(model.parameters[name], stem)
            if (
                quantity.neutral is None
                or quantity.usual is None
                or stem in effect.rows
                or stem in effect.held
                or here != quantity.to_si(quantity.neutral)
            ):
                continue
            alone = {stem: quantity}
            yield _candidate(f"{name}_{stem}", effect, model, file_keys, alone, {})


def _slow_sensors(model: Model) -> Iterator[CandidateEffect]:
    """Sensors that may be slower than the model says."""
    for name in CATALOGUE:
        if name not in sensors.SENSORS or name not in model.parameters:
            continue
        path = f"{name}.bandwidth_hz"
        here = values(model, [path])
        probes = here * np.array(SLOWER)[:, None]
        none = np.zeros(1, bool)
        yield CandidateEffect(
            *(f"{name}_lag", name, model, (path,), ~none, here, probes, none),
            np.zeros(len(probes), bool),
        )


def _has_sensor(model: Model, output: str) -> bool:
    return any(
        measured_output(model.effects[name].port) == output
        for name in sensors.SENSORS
        if name in model.effects
    )


def _is_limit(quantity: Quantity) -> bool:
    """Whether a parameter is a limit, whose neutral value is one that is never reached."""
    return quantity.neutral is not None and quantity.neutral > FAR * abs(_usual(quantity))


def _usual(quantity: Quantity) -> float:
    assert quantity.usual is not None
    return quantity.usual


def _neutral_or_usual(quantity: Quantity) -> float:
    return _usual(quantity) if quantity.neutral is None else quantity.neutral
