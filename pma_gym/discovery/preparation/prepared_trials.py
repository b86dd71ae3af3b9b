"""Trials as a diagnosis takes them, and what it must say of them beforehand."""

from collections.abc import Sequence
from dataclasses import replace

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.quality import clipping
from pma_gym.data.quality.lone_readings import without_lone_readings
from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial
from pma_gym.discovery.preparation.splits import stretches
from pma_gym.discovery.thresholds import FOLDS
from pma_gym.plant import sensors
from pma_gym.plant.model import Model


def prepared(named: Sequence[NamedTrial], model: Model) -> tuple[list[NamedTrial], tuple[str, ...]]:
    """Trials without outliers and what sensors read at an end of their range.

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


def _in_volts(trial: Trial, model: Model) -> Trial:
    """A trial whose commands are the volts that a model has for them, in every row.

    What a drive takes as it comes keeps its name.
    """
    if model.rig.imposes_motion:
        # A record of positions is smoothed whenever a model reads it.
        return trial
    motor, regulator = sensors.voltages(model, trial)
    if model.rig.commands:
        active = zip(sensors.active_commands(model), (motor, regulator), strict=True)
        return replace(trial, commands={each.name: values for each, values in active if each})
    direct = sensors.direct_command(model)
    if direct:
        return replace(trial, commands={direct: motor})
    return replace(trial, commands={"motor_voltage": motor, "regulator_voltage": regulator})
