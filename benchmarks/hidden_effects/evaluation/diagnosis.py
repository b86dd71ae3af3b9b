"""Asking for a diagnosis of a case: files are written, and read back as a user's would be."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden_effects.generation.cases import Case
from benchmarks.hidden_effects.generation.files import case_name, write_case
from benchmarks.hidden_effects.physics.rig import Array
from pma_gym.partials import begin_temporary_folder, end_partial


@dataclass(frozen=True)
class Answer:
    """Answer of a diagnosis.

    Attributes:
        document: its `diagnosis.json`; None where it gave none.
        message: what it raised instead.
        following: motor and regulator voltages of the experiment that it proposes, shape (rows,)
            each; None without a proposal.
    """

    document: dict[str, Any] | None
    message: str = ""
    following: tuple[Array, Array] | None = None


Judge = Callable[[Path], Answer]
"""What `diagnosed` is: takes the folder of a data set."""


def unproposed(folder: Path) -> Answer:
    """As `diagnosed`, without the seconds that a proposal takes."""
    return diagnosed(folder, propose=False)


def diagnosed(folder: Path, propose: bool = True) -> Answer:
    """The answer of `pma-gym diagnose` with its defaults, without the start of a process."""
    # Here, for other judges need none of it.
    from pma_gym.data.datasets.dataset import read_dataset
    from pma_gym.discovery import diagnose

    diagnosis = diagnose(read_dataset(folder), jobs=1, propose=propose)
    proposal, following = diagnosis.next_experiment, None
    if proposal is not None:
        commands = proposal.trial.commands
        motor, regulator = (
            np.round(commands[name], 3) for name in ("motor_voltage", "regulator_voltage")
        )
        following = motor, regulator
    return Answer(diagnosis.document(), following=following)


def asked(case: Case, number: int, judge: Judge, keep: Path | None = None) -> Answer:
    """A judge's answer to a case; what it raises becomes the answer's message.

    Args:
        case: the case, of whose truth the judge sees nothing.
        number: of the case.
        judge: makes the answer.
        keep: folder in which the files stay; none do if not given.
    """
    place = begin_temporary_folder("hidden_effects") if keep is None else keep
    try:
        write_case(case, place, number)
        return judge(place / "cases" / case_name(number))
    except Exception as error:
        return Answer(None, f"{type(error).__name__}: {error}")
    finally:
        if keep is None:
            with suppress(OSError):
                end_partial(place)
