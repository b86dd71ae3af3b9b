"""Trials as a diagnosis takes them, and what it must say of them beforehand."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.quality import clipping
from pma_gym.data.quality.lone_readings import without_lone_readings
from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial
from pma_gym.discovery.preparation.splits import FOLDS, stretches
from pma_gym.plant import sensors
from pma_gym.plant.model import Model

PIECE_S = 1.0
"""Longest trial of a free rig (s): an error of its force leads it away with the square of time,
and what starts anew forgets it."""


def prepared(named: Sequence[NamedTrial], model: Model) -> tuple[list[NamedTrial], tuple[str, ...]]:
    """Trials without outliers and what sensors read at an end of their range; free ones in pieces.

    Args:
        named: the trials as they were given.
        model: what they are compared with.
    Returns:
        The trials, and warnings: what was taken out of them, how a single trial is held out.
    """
    trials = [each.trial for each in named]
    clipped = clipping.ends(trials)
    words = [end.words([each.name for each in named], trials) for end in clipped]
    within, slips = without_lone_readings(clipping.without(trials, clipped))
    words += slips
    kept = [replace(each, trial=trial) for each, trial in zip(named, within, strict=True)]
    # By the model as it was given: a line that is fitted later says what such volts give.
    kept = [replace(each, trial=_in_volts(each.trial, model)) for each in kept]
    if model.rig.is_free:
        words += _unused(trials, model)
        pieces = [piece for each in kept for piece in _pieces(each)]
        if len(pieces) > len(kept):
            whole = f"its {len(kept)} trials are" if len(kept) > 1 else "its trial is"
            words.append(
                f"errors of force add up in the motion of a {model.rig.name}, so {whole} taken as "
                f"{len(pieces)} pieces of up to {PIECE_S:g} s, each with its own start"
            )
        kept = pieces
    elif stretches(trials):
        words.append(
            f"there is one trial, of {trials[0].duration:.4g} s: instead of whole trials, every "
            f"{FOLDS}th stretch of its time is left out in turn; readings beside a stretch tell of "
            "it, so measure several trials if you can"
        )
    return kept, tuple(words)


def _unused(trials: Sequence[Trial], model: Model) -> list[str]:
    """Words on what was measured that a free rig does not have."""
    names = [
        signal.column
        for signal in SIGNALS.values()
        if signal not in model.rig.signals
        and any(signal.name in trial.measurements for trial in trials)
    ]
    return [f"{', '.join(names)}: not used: {model.rig.absent_signals}"] if names else []


def _pieces(named: NamedTrial) -> list[NamedTrial]:
    """A trial cut into equal pieces that are short enough; as it is if it is."""
    trial = named.trial
    count = max(1, math.ceil(trial.duration / PIECE_S * (1.0 - 1e-9)))
    if count == 1:
        return [named]
    edges = np.searchsorted(trial.time, np.linspace(trial.time[0], trial.time[-1], count + 1))
    edges[-1] = len(trial)
    pieces = []
    for start, stop in zip(edges, edges[1:], strict=False):
        rows = slice(int(start), int(stop))
        piece = Trial(
            trial.time[rows],
            {name: values[rows] for name, values in trial.commands.items()},
            {name: values[rows] for name, values in trial.measurements.items()},
            provenance=trial.provenance,
            memory_at_start=None if start else trial.memory_at_start,
        )
        since = f"from {trial.time[start]:.4g} s"
        repeats = named.repeat_of and f"{named.repeat_of} {since}"
        if any(np.isfinite(values).any() for values in piece.measurements.values()):
            name = f"{named.name} {since}"
            pieces.append(
                replace(
                    named, name=name, trial=piece, repeat_of=repeats, file=named.file or named.name
                )
            )
    return pieces


def _in_volts(trial: Trial, model: Model) -> Trial:
    """A trial whose commands are the volts that a model has for them, in every row.

    What a drive takes as it comes keeps its name.
    """
    if model.rig.imposes_motion:
        # A record of positions is smoothed whenever a model reads it.
        return trial
    motor, regulator = sensors.voltages(model, trial)
    direct = sensors.direct_command(model)
    if direct:
        return replace(trial, commands={direct: motor})
    return replace(trial, commands={"motor_voltage": motor, "regulator_voltage": regulator})
