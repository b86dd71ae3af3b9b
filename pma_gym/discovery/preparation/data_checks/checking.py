"""All checks of a data set in their order: what is said, what is set right, what stops a diagnosis.

Copies of files go, rounded time stamps become even, gaps are cut, trials that begin in motion get a
start of their own, very long ones are averaged. A column in another unit, or a clock that cannot
be in seconds, is no matter of taste: it ends in one message with the lines that correct it.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from pma_gym.data.datasets.dataset import Dataset, NamedTrial
from pma_gym.data.datasets.dataset_files import copies
from pma_gym.data.files.even_clock import even_clock
from pma_gym.data.quality import gaps
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import TrialError
from pma_gym.discovery.preparation.data_checks import timing
from pma_gym.discovery.preparation.data_checks.averaging import averaged
from pma_gym.discovery.preparation.data_checks.lead_in import with_lead_in
from pma_gym.discovery.preparation.data_checks.simulated import pairs
from pma_gym.discovery.preparation.data_checks.starts import moving_start, with_start
from pma_gym.discovery.preparation.data_checks.wrong_columns import clock_proposals, unit_proposals
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant

SHOWN = 3
"""Files that a message names."""

Said = list[tuple[str, str]]
"""File and what is said of it."""


def check_dataset(dataset: Dataset, model: Model, stop: bool = True) -> Dataset:
    """A data set as a diagnosis can use it, with what there is to say about it in `checked`.

    Args:
        dataset: as it was read.
        model: the model that it is to be compared with.
        stop: whether a column in another unit, or a wrong clock, is refused; else it is said.
    Returns:
        The data set; the same trials where there is nothing to set right.
    Raises:
        TrialError: all columns that are certainly in another unit, and the lines of `[columns]`
            that correct them; or no trial is left.
    """
    words: list[str] = []
    named = _without_copies(dataset.trials, words)
    _refuse(clock_proposals(dataset, named, model), stop, words)
    named = _changed(named, _evened, words)
    named, wholes = _cut(named, words)
    if not model.rig.is_free:
        _refuse(unit_proposals(dataset, named, model), stop, words)
        # Lags after units: a signal turned round has none.
        words += timing.words(timing.lags(pairs(model, [each.trial for each in named])))
        if model.rig.imposes_motion:
            named = [with_lead_in(each, model) for each in named]
        else:
            named = _started(named, Plant(model), wholes, words)
    named, said = averaged(named)
    words += said
    # What the lab states of a sensor is no longer true of averages of its readings.
    sensors = {} if said else dataset.sensors
    return replace(dataset, trials=tuple(named), checked=tuple(words), sensors=sensors)


def _refuse(proposals: Sequence[str], stop: bool, words: list[str]) -> None:
    """End with all proposals in one message, or only say them."""
    if proposals and stop:
        raise TrialError(
            f"{'; '.join(proposals)}. If the log is right as it stands, --no-checks goes on with it"
        )
    words += proposals


def _without_copies(named: Sequence[NamedTrial], words: list[str]) -> list[NamedTrial]:
    """Trials less those with the content of another; a repeat of a copy is one of the original."""
    copied = copies([each.trial for each in named])
    firsts = {named[copy].name: named[first].name for copy, first in copied.items()}
    for first in dict.fromkeys(firsts.values()):
        same = [name for name, other in firsts.items() if other == first]
        words.append(
            f"{_listed(same)} {'have' if len(same) > 1 else 'has'} the same content as {first}: a "
            "copy is no second measurement, it is used once"
        )
    kept = [each for number, each in enumerate(named) if number not in copied]
    renamed = [
        replace(each, repeat_of=firsts.get(each.repeat_of or "", each.repeat_of)) for each in kept
    ]
    return [replace(e, repeat_of=None) if e.repeat_of == e.name else e for e in renamed]


def _changed(
    named: Sequence[NamedTrial],
    change: Callable[[NamedTrial], tuple[NamedTrial, str]],
    words: list[str],
) -> list[NamedTrial]:
    """Trials, each changed; the same words about several are said once."""
    kept, said = [], []
    for each in named:
        changed, message = change(each)
        kept.append(changed)
        if message:
            said.append((each.name, message))
    words += gathered(said, len(named))
    return kept


def _evened(each: NamedTrial) -> tuple[NamedTrial, str]:
    clock = even_clock(each.trial.time)
    if clock is None:
        return each, ""
    return replace(each, trial=replace(each.trial, time=clock.time)), clock.words()


def _cut(
    named: Sequence[NamedTrial], words: list[str]
) -> tuple[list[NamedTrial], dict[str, Trial]]:
    """Trials cut at their gaps; and the whole log of each piece behind one, by the piece's name."""
    kept: list[NamedTrial] = []
    wholes: dict[str, Trial] = {}
    messages: Said = []
    for each in named:
        trial_gaps = gaps.gaps(each.trial)
        if not trial_gaps:
            kept.append(each)
            continue
        pieces = gaps.pieces(each.trial, trial_gaps)
        said = "; ".join(gap.words() for gap in trial_gaps)
        left = {0: "nothing long enough is left", 1: "one piece is used"}.get(
            len(pieces), f"{len(pieces)} pieces are used"
        )
        messages.append((each.name, f"{said}: the trial is cut there; {left}"))
        cut = [_piece(each, piece) for piece in pieces]
        wholes |= {piece.name: each.trial for piece in cut if piece.name != each.name}
        kept += cut
    words += gathered(messages, len(named))
    if named and not kept:
        raise TrialError(
            f"{words[-1]}; log without gaps of over {gaps.LONGEST_S:g} s, at least "
            f"{gaps.LEAST_S:g} s long"
        )
    return kept, wholes


def _piece(each: NamedTrial, piece: Trial) -> NamedTrial:
    begin = float(piece.time[0])
    file = each.file or each.name
    if begin == float(each.trial.time[0]):
        return replace(each, trial=piece, file=file)
    name = f"{each.name} from {begin:.4g} s"
    return replace(each, name=name, trial=piece, repeat_of=None, file=file)


def _started(
    named: Sequence[NamedTrial], plant: Plant, wholes: Mapping[str, Trial], words: list[str]
) -> list[NamedTrial]:
    """Trials, those that begin in motion with a start of their own, or left out if too short."""
    kept: list[NamedTrial] = []
    followed = {pair.number for pair in pairs(plant.model, [each.trial for each in named])}
    for number, each in enumerate(named):
        # Commands that the model cannot follow: its fit says so, in its own words.
        moving = moving_start(plant, each.trial) if number in followed else ""
        if not moving and number in followed and each.name in wholes:
            moving = "behind a gap"
        if not moving:
            kept.append(each)
            continue
        start = with_start(plant, each.trial, wholes.get(each.name, each.trial), moving)
        if start is None:
            words.append(
                f"{each.name} begins {moving}, and most of it depends on how it began: it is not "
                "used; begin the log at rest, under its first commands"
            )
            continue
        words.append(f"{each.name} {start.words(float(each.trial.time[0]))}")
        kept.append(replace(each, trial=start.trial, repeat_of=None))
    if named and not kept:
        others = f" (and {len(named) - 1} others)" if len(named) > 1 else ""
        raise TrialError(f"no trial can be used: {words[-1]}{others}")
    return kept


def gathered(said: Said, count: int) -> Iterator[str]:
    """One message for each thing said, however many files it holds for."""
    files: dict[str, list[str]] = {}
    for file, message in said:
        files.setdefault(message, []).append(file)
    for message, names in files.items():
        yield f"{'all files' if len(names) == count > 1 else _listed(names)}: {message}"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
