"""The folder that a diagnosis or a fit writes: nothing older is lost, nothing is half there."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from pma_gym.files import OutputError, check_output, replace_file
from pma_gym.partials import clean_folder

JOURNAL = "unfinished"
"""Folder of what an interrupted run has finished."""


@dataclass(frozen=True)
class Results:
    """Where results go.

    Attributes:
        folder: the folder; it or its parent exists.
        names: files that a run may write.
    """

    folder: Path
    names: Sequence[str]

    @property
    def journal(self) -> Path:
        """Where finished fits are kept until all are."""
        return self.folder / JOURNAL

    def check(self, force: bool, resume: bool = False) -> None:
        """Refuse a folder that holds an older result, before anything is computed.

        Args:
            force: older results may be replaced.
            resume: what an interrupted run left is wanted.
        Raises:
            OutputError: what is in the way, and the options that help.
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
        """The folder, made and writable; if the run fails and nothing came into it, it goes.

        Args:
            resume: keep what an interrupted run left.
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
            if not any(self.folder.iterdir()):
                self.folder.rmdir()
            raise

    def write(self, files: Mapping[str, bytes]) -> None:
        """Write all files, each whole; those of an older result that have no successor go."""
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
