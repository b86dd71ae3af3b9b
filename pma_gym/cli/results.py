"""Result folder of a diagnosis or a fit: older results are protected, and files are complete."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from pma_gym.files import OutputError, check_output, replace_file
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
