"""Diagnosis after diagnosis, each of what the one before amended; finished stages are kept."""

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from benchmarks.files import UNREADABLE, reason, say_damaged, write_text
from benchmarks.runner.fingerprint import ROOT, code_digest_with
from pma_gym.data.datasets.dataset import Dataset
from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.fitting.journal import digest
from pma_gym.discovery.result.candidate import ADDED
from pma_gym.discovery.workflow import diagnose
from pma_gym.document_shape import check_shape, shape_of
from pma_gym.documents import read_json
from pma_gym.plant.model import Model, dump_model, load_model

ELSEWHERE = (
    "reproduction/replay",
    "reproduction/results",
    "reproduction/targets",
    "runner/case",
    "runner/controller_spec",
    "runner/phase_score",
    "runner/rollout",
    "suites/frozen",
    "suites/reproduction",
    "suites/suite",
)
"""Modules of the benchmark, beside its own, that a stage depends on."""

T = TypeVar("T")


@cache
def fingerprint() -> str:
    """Compute the fingerprint of all code that a stage uses: package, job and replay."""
    own = sorted(Path(__file__).parent.glob("*.py"))
    others = [ROOT / "benchmarks" / f"{name}.py" for name in ELSEWHERE]
    return code_digest_with([*own, *others, ROOT / "benchmarks/suites/reproduction.toml"])


@dataclass
class Stages:
    """Stages in a folder, each with its question and the code that made it.

    A stage is used again where the same is asked. One that other code made is used too, unless all
    such are to be made anew: what has taken hours is not thrown away for an edit of a comment.

    Attributes:
        folder: where they are.
        recompute: anew what other code made.
        code: fingerprint of this code.
        codes: how many stages of this run each code made.
    """

    folder: Path
    recompute: bool = False
    code: str = field(default_factory=fingerprint)
    codes: Counter[str] = field(default_factory=Counter)

    @property
    def journal(self) -> Path:
        """Folder of the fits of a diagnosis that is not finished; those of other code go unused."""
        return self.folder / "journal" / self.code

    def kept(self, name: str, asked: str, made: Callable[..., T]) -> T | None:
        """Read the stored result of a stage if its fingerprint agrees, else None.

        Args:
            name: of the stage.
            asked: digest of its question.
            made: makes it of what was kept, by keywords; None too where other code kept others.
        """
        path = self._path(name)
        entry = self._entry(path)
        code = entry.pop("code", "")
        if entry.pop("asked", None) != asked or (code != self.code and self.recompute):
            return None
        try:
            shape = shape_of(made, finite=False)
            if shape is not object:
                check_shape(entry, shape)
            result = made(**entry)
        except UNREADABLE as error:
            say_damaged(path, reason(error))
            return None
        self.codes[code] += 1
        return result

    def keep(self, name: str, asked: str, entry: dict[str, Any]) -> None:
        """Keep a stage that this code has made; its file is there whole or not at all."""
        self.codes[self.code] += 1
        whole = {"asked": asked, "code": self.code, **entry}
        write_text(self._path(name), json.dumps(whole, indent=1))

    def others(self) -> str:
        """A line on what is kept of other code; empty if nothing is."""
        codes = [self._entry(path).get("code") for path in sorted(self.folder.glob("*.json"))]
        kept = [code for code in codes if code is not None]
        other = sum(code != self.code for code in kept)
        if not other or self.recompute:
            return ""
        return (
            f"{other} of {len(kept)} stages kept in {self.folder} are by other code than this "
            "(--recompute makes those anew)"
        )

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.json"

    @staticmethod
    def _entry(path: Path) -> dict[str, Any]:
        if not path.is_file():
            return {}
        try:
            entry = read_json(path, "journal_mib", own=True, finite=False)
            check_shape(entry, {"code?": str, "asked?": str})
        except ValueError as error:
            say_damaged(path, str(error))
            return {}
        return entry


MOST_ROUNDS = 2
"""Most diagnoses, one after the other, where nobody says otherwise: both see the smaller set of
trials, and bring the extension within the target. Others after them take longer, on more trials."""

MOST_RIVALS = 8
"""How many candidates of a round are kept."""

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Round:
    """One diagnosis.

    Attributes:
        trials: how many trials it saw.
        verdict: its verdict.
        sentence: its answer in words.
        effects: effects that it added, in order.
        p_values: family-wise, by effect.
        rivals: the candidates that came next: name, gain in log-likelihood, p-value, reason.
        not_detectable: effects that these trials would not show at their usual size.
        next_experiment: what to measure next, or nothing.
        gap: misfit as given, refitted, amended and the noise, by signal.
        seconds: by step.
    """

    trials: int
    verdict: str
    sentence: str
    effects: tuple[str, ...]
    p_values: Mapping[str, float]
    rivals: Sequence[Sequence[Any]]
    not_detectable: tuple[str, ...]
    next_experiment: Mapping[str, Any] | None
    gap: Mapping[str, Mapping[str, float | bool | None]]
    seconds: Mapping[str, float] = field(default_factory=dict)


def rounds(
    data: Sequence[Dataset],
    initial_model: Model,
    stages: Stages,
    seed: int,
    jobs: int,
    progress: Callable[[int], Progress],
    most: int = MOST_ROUNDS,
) -> tuple[list[Round], Model]:
    """Diagnose until nothing more is found, first in few trials, then in more.

    Args:
        data: sets of trials, the smallest first: what is large shows in few, and is found sooner.
        initial_model: the model to begin with.
        stages: finished rounds and fits, from which an interrupted job goes on.
        seed: of simulated chance.
        jobs: threads.
        progress: gives what is called with a round's steps.
        most: most diagnoses.
    Returns:
        The rounds, the last of which added nothing unless there were too many; the amended model.
    """
    done: list[Round] = []
    model = initial_model
    for some in data:
        while len(done) < most:
            number = len(done) + 1
            each, model = _round(some, model, stages, seed, jobs, progress(number), number)
            done.append(each)
            if not each.effects:
                break
    return done, model


def _round(
    data: Dataset,
    model: Model,
    stages: Stages,
    seed: int,
    jobs: int,
    progress: Progress,
    number: int,
) -> tuple[Round, Model]:
    """A round and its amended model, from what is kept where it is there."""
    name = f"round_{number}"
    amended = stages.folder / f"{name}.toml"
    asked = digest([each.trial for each in data.trials], model, f"measured, seed {seed}")
    kept = stages.kept(name, asked, Round) if amended.is_file() else None
    if kept is not None:
        try:
            return kept, load_model(amended)
        except ValueError as error:
            say_damaged(amended, reason(error), "its round is computed anew")
    diagnosis = diagnose(
        data, model, seed=seed, jobs=jobs, journal=stages.journal, progress=progress
    )
    result = round_of(diagnosis, len(data))
    write_text(amended, dump_model(diagnosis.model if result.effects else model))
    stages.keep(name, asked, asdict(result))
    # As it is read again, so that a job that goes on ends as one that was not interrupted.
    return result, load_model(amended)


def round_of(diagnosis: Diagnosis, trials: int) -> Round:
    """Result of a diagnosis.

    A diagnosis that says `unknown`, because what it added leaves too much, has added effects to its
    model all the same: these count. One that cannot decide has not.
    """
    added = [each.name for each in diagnosis.candidates if each.why == ADDED]
    named = {each.name: each for each in diagnosis.effects}
    kept = diagnosis.verdict in ("effect", "unknown")
    ordered = [name for name in named if name in added]
    ordered += [name for name in added if name not in named]
    experiment = diagnosis.next_experiment
    return Round(
        trials=trials,
        verdict=diagnosis.verdict,
        sentence=diagnosis.sentence,
        effects=tuple(ordered) if kept else (),
        p_values={each.name: each.p_value for each in diagnosis.candidates if each.name in added},
        rivals=[
            (each.name, each.delta_log_likelihood, each.p_value, each.why)
            for each in diagnosis.candidates[:MOST_RIVALS]
        ],
        not_detectable=tuple(diagnosis.not_detectable),
        next_experiment=None
        if experiment is None
        else {
            "excitation": experiment.excitation,
            "separates": list(experiment.separates),
            "expected_odds": experiment.expected_odds,
        },
        gap={signal: asdict(gap) for signal, gap in diagnosis.gap.items()},
        seconds=dict(diagnosis.seconds),
    )
