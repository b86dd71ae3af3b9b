"""Finished stages of the job, kept in a folder: what an interrupted run goes on from."""

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from benchmarks.files import write_text
from benchmarks.runner.damaged_results import UNREADABLE, reason, say_damaged
from benchmarks.runner.fingerprint import ROOT, code_digest_with
from pma_gym.document_shape import check_shape, shape_of
from pma_gym.documents import read_json

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
