"""`pma-gym diagnose` and `pma-gym fit`: a lab's logs against a model.

Result folder of a diagnosis or a fit: older results are protected, and files are complete.
"""

import json
import os
import platform
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pma_gym.cli.options import JsonOption
from pma_gym.cli.progress import StepProgress
from pma_gym.cli.terminal import model_names, print_json, say, warnings_said, warnings_said_at_once
from pma_gym.data.datasets.dataset import Dataset, read_dataset
from pma_gym.effects.user_effects import NAMED
from pma_gym.files import OutputError
from pma_gym.plant.model import Model, dump_model, load_model

if TYPE_CHECKING:
    from pma_gym.discovery.diagnosis import Diagnosis
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pma_gym.files import check_output, replace_file
from pma_gym.partials import clean_folder

JOURNAL = "unfinished"
"""Folder of the finished parts of an interrupted run."""


@dataclass(frozen=True)
class Results:
    """Folder for the results of a run.

    Attributes:
        folder: the folder; it or its parent exists.
        names: files that a run may write.
    """

    folder: Path
    names: Sequence[str]

    @property
    def journal(self) -> Path:
        """Folder of finished fits until the run is complete."""
        return self.folder / JOURNAL

    def check(self, force: bool, resume: bool = False) -> None:
        """Reject a folder with an older result, before any computation.

        Args:
            force: replace older results.
            resume: continue an interrupted run.
        Raises:
            OutputError: with the older files, and the options that help.
        """
        if self.folder.exists() and not self.folder.is_dir():
            raise OutputError(f"--out {self.folder} is no folder; name a folder for the results")
        if not self.folder.parent.is_dir():
            raise OutputError(
                f"--out {self.folder}: there is no folder {self.folder.parent}; make it, or name "
                "another"
            )
        old = [name for name in self.names if (self.folder / name).exists()]
        # A run that was killed while it wrote its results has both, some of the results and the
        # journal.
        going_on = resume and self.journal.is_dir()
        if old and not force and not going_on:
            raise OutputError(
                f"{self.folder} holds an older result ({', '.join(old)}); --force replaces it, "
                "--out FOLDER writes to another place"
            )
        if self.journal.is_dir() and not (resume or force):
            raise OutputError(
                f"{self.folder} holds an unfinished run; --resume goes on with it, --force begins "
                "anew"
            )

    @contextmanager
    def opened(self, resume: bool = False) -> Iterator[None]:
        """Create the folder and check that it is writable; remove it if a run fails without files.

        Args:
            resume: keep the finished parts of an interrupted run.
        Raises:
            OutputError: the folder cannot be made or written to.
        """
        try:
            self.folder.mkdir(exist_ok=True)
        except OSError as error:
            raise OutputError(f"cannot make the folder {self.folder}: {error.strerror}") from None
        try:
            for name in self.names:
                check_output(self.folder / name)
            if not resume:
                self._drop_journal()
            yield
        except BaseException:
            self.abandon()
            raise

    def abandon(self) -> None:
        """Remove the folder if a run left nothing in it."""
        if not any(self.folder.iterdir()):
            self.folder.rmdir()

    def write(self, files: Mapping[str, bytes]) -> None:
        """Write all files atomically, and remove files of an older result that are not replaced."""
        for name in self.names:
            if name in files:
                replace_file(self.folder / name, files[name])
            else:
                (self.folder / name).unlink(missing_ok=True)
        self._drop_journal()

    def _drop_journal(self) -> None:
        """Remove the journal's files, and its folder if it holds nothing else."""
        if self.journal.is_dir():
            clean_folder(self.journal)
            for path in self.journal.glob("*.json"):
                path.unlink()
            if not any(self.journal.iterdir()):
                self.journal.rmdir()


DRAFT = "proposed_effect.py"
"""File of a user effect with the law that was found."""

INTERRUPTED = 130
LONGEST_S = 1.5
"""How long after Ctrl-C a compiled integration may go on."""
DEFAULT_MODEL = "station"
_FITTED = (
    "schema",
    "verdict",
    "sentence",
    "parameters",
    "gap",
    "adequacy",
    "written",
    "not_identifiable",
    "warnings",
)
"""Fields of a diagnosis that `fit.json` contains."""

DatasetArgument = Annotated[
    Path,
    typer.Argument(help="Folder of logs (CSV, XLSX, Parquet, LVM, MAT, TDMS...), one a trial."),
]
ModelOption = Annotated[
    str | None,
    typer.Option(
        help="Shipped name or TOML file; else the data set's own, else station.",
        autocompletion=model_names,
    ),
]
OutOption = Annotated[
    Path | None, typer.Option(help="Folder for the results; else the data set's name and command.")
]
SeedOption = Annotated[int, typer.Option(min=0, help="Seed of chance.")]
CORES = os.cpu_count() or 1

JobsOption = Annotated[
    int,
    typer.Option(min=1, help="How many cores to use.", show_default="all"),
]
ChecksOption = Annotated[
    bool,
    typer.Option(help="Stop where a unit is certainly wrong; else only warn."),
]
ForceOption = Annotated[bool, typer.Option("--force", help="Replace an older result.")]


def diagnose(
    dataset: DatasetArgument,
    model: ModelOption = None,
    out: OutOption = None,
    seed: SeedOption = 0,
    jobs: JobsOption = CORES,
    checks: ChecksOption = True,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with a run that was interrupted.")
    ] = False,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Say where logs and model disagree, and which effect is missing."""
    results = Results(
        out or _default(dataset, "diagnosis"),
        ("model.toml", "trials.toml", "next.csv", DRAFT, "report.html", "diagnosis.json"),
    )
    _check_apart(results, dataset)
    results.check(force, resume)
    trials, initial_model = _inputs(dataset, model, checks)
    from pma_gym import discovery
    from pma_gym.discovery.experiments.command_file import proposed_file
    from pma_gym.discovery.fitting.trial_states import dump_states
    from pma_gym.discovery.report.page import report_page

    with results.opened(resume):
        diagnosis = _run(
            discovery.diagnose,
            trials,
            initial_model,
            results,
            {"seed": seed, "jobs": jobs, "journal": results.journal},
        )
        files = {
            "diagnosis.json": diagnosis.text().encode(),
            "model.toml": dump_model(diagnosis.model).encode(),
            "trials.toml": dump_states(diagnosis.states).encode(),
            "report.html": report_page(
                diagnosis, trials.title, _origin(dataset, trials, seed)
            ).encode(),
        }
        if diagnosis.next_experiment:
            files["next.csv"] = proposed_file(
                diagnosis.next_experiment.trial, trials, initial_model
            )
        draft = results.folder / DRAFT
        if str(draft.resolve()) in os.environ.get(NAMED, "").split(os.pathsep):
            # The model may have its effect, as its user has changed it.
            files[DRAFT] = draft.read_bytes()
        elif diagnosis.draft:
            files[DRAFT] = diagnosis.draft.encode()
        results.write(files)
    from pma_gym.discovery.report.summary import diagnosis_summary

    if as_json:
        print_json(diagnosis.document())
        return
    print(diagnosis_summary(diagnosis))
    _print_files(results)


def fit(
    dataset: DatasetArgument,
    model: ModelOption = None,
    out: OutOption = None,
    seed: SeedOption = 0,
    jobs: JobsOption = CORES,
    checks: ChecksOption = True,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Refit a model's parameters to logs, without looking for new effects."""
    results = Results(out or _default(dataset, "fit"), ("model.toml", "trials.toml", "fit.json"))
    _check_apart(results, dataset)
    results.check(force)
    trials, initial_model = _inputs(dataset, model, checks)
    from pma_gym import discovery
    from pma_gym.discovery.fitting.trial_states import dump_states

    with results.opened():
        refitted = _run(
            discovery.refit,
            trials,
            initial_model,
            results,
            {"seed": seed, "jobs": jobs},
        )
        document = refitted.document()
        kept = {key: document[key] for key in _FITTED}
        results.write(
            {
                "fit.json": (json.dumps(kept, indent=1, allow_nan=False) + "\n").encode(),
                "model.toml": dump_model(refitted.model).encode(),
                "trials.toml": dump_states(refitted.states).encode(),
            }
        )
    from pma_gym.discovery.report.summary import print_fit

    if as_json:
        print_json(kept)
        return
    print_fit(refitted)
    _print_files(results)


def _default(dataset: Path, command: str) -> Path:
    """`lab-diagnosis` here, for the data set `/data/lab`."""
    return Path(f"{dataset.resolve().name}-{command}")


def _check_apart(results: Results, dataset: Path) -> None:
    """Refuse to write among the logs: next.csv and model.toml may be the lab's own there."""
    if results.folder.resolve() == dataset.resolve():
        raise OutputError(
            f"--out {results.folder} is the data set itself; name a folder of its own for the "
            "results"
        )


def _inputs(folder: Path, model: str | None, checks: bool) -> tuple[Dataset, Model]:
    """The data set and the model, all that can be refused before anything is fitted."""
    with warnings_said():
        trials = read_dataset(folder)
    initial_model = load_model(model or trials.model or DEFAULT_MODEL)
    if initial_model.rig.is_diagnosable:
        from pma_gym.discovery.preparation.data_checks import check_dataset

        trials = check_dataset(trials, initial_model, stop=checks)
        for message in trials.checked or ():
            say(f"warning: {message}")
    return trials, initial_model


def _run(
    function: Callable[..., Any],
    trials: Dataset,
    model: Model,
    results: Results,
    arguments: dict[str, Any],
) -> "Diagnosis":
    """Runs a diagnosis or a fit, with progress; Ctrl-C says how to go on."""
    try:
        from pma_gym.discovery.fitting.journal import JournalWarning

        with StepProgress() as progress, warnings_said_at_once(JournalWarning):

            def leave() -> None:
                progress.__exit__()
                _say_interrupted(results)
                results.abandon()

            with _interruptible(leave):
                return function(trials, model, progress=progress, **arguments)
    except KeyboardInterrupt:
        _say_interrupted(results)
        raise typer.Exit(INTERRUPTED) from None


def _say_interrupted(results: Results) -> None:
    kept = results.journal.is_dir()
    how = "the same command with --resume goes on" if kept else "nothing was finished yet"
    say(f"interrupted; {how}")


@contextmanager
def _interruptible(leave: Callable[[], None]) -> Iterator[None]:
    """Let Ctrl-C end the process soon, even within a compiled integration of many seconds.

    Python hears an interrupt when the compiled code returns. Every finished fit is in a file of its
    own, so that nothing is lost where the process ends before.

    Args:
        leave: what is done before the process ends.
    """
    over, (reader, writer) = threading.Event(), socket.socketpair()
    writer.setblocking(False)

    def watch() -> None:
        while received := reader.recv(1):
            if received[0] == signal.SIGINT and not over.wait(LONGEST_S):
                leave()
                sys.stderr.flush()
                os._exit(INTERRUPTED)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    before = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    try:
        yield
    finally:
        over.set()
        signal.set_wakeup_fd(before)
        writer.close()
        watcher.join()
        reader.close()


def _origin(folder: Path, trials: Dataset, seed: int) -> dict[str, str]:
    """What the page says so that it can be made again."""
    names = ("pma-gym", "numpy", "scipy")
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in names)
    return {
        "Data set": f"`{folder}`, {len(trials)} trials",
        "Seed": str(seed),
        "Versions": f"{versions}, Python {platform.python_version()}",
        "Command": f"`pma-gym {' '.join(sys.argv[1:])}`",
    }


def _print_files(results: Results) -> None:
    written = [name for name in reversed(results.names) if (results.folder / name).exists()]
    print(f"Written to {results.folder}: {', '.join(written)}")
