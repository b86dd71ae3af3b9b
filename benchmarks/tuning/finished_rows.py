"""Rows of the table of gains that are done, kept on disk until the whole table is."""

import json
from pathlib import Path
from typing import Any

from benchmarks.files import write_text
from benchmarks.runner.damaged_results import say_damaged
from benchmarks.runner.environment_info import ROOT, git_state
from benchmarks.tuning.job import Job
from controllers.design.gains import Gains
from pma_gym.document_shape import ListOf, Real, check_shape
from pma_gym.documents import read_json


class KeptRows:
    """Gains (SI) and cost by row; what an interrupted run left is there again.

    Args:
        out: the file of gains; the rows are kept beside it.
        made_with: what the rows depend on; rows made with something else are not taken.

    Attributes:
        path: file of the rows.
        rows: gains and cost by the row's name.
    """

    def __init__(self, out: Path, made_with: dict[str, Any]) -> None:
        self.path = out.with_name(f"{out.stem}.partial.json")
        # As JSON gives it back, so that the two can be compared.
        given = made_with | {"commit": git_state(ROOT)["commit"]}
        self.made_with = json.loads(json.dumps(given))
        self.rows = self._read()

    def keep(self, row: Job, result: tuple[Gains, float]) -> None:
        """Add a row that is done, on disk too."""
        self.rows[name_of(row)] = result
        document = {"made_with": self.made_with, "rows": self.rows}
        write_text(self.path, json.dumps(document, indent=1) + "\n")

    def forget(self) -> None:
        """Remove the file: the whole table is written."""
        self.path.unlink(missing_ok=True)

    def _read(self) -> dict[str, tuple[Gains, float]]:
        """The rows in the file; none if it is missing, broken or made with something else."""
        if not self.path.exists():
            return {}
        try:
            document = read_json(self.path, "journal_mib", own=True)
            check_shape(document, {"made_with": dict, "rows": dict})
        except ValueError as error:
            say_damaged(self.path, str(error))
            return {}
        if document["made_with"] != self.made_with:
            return {}
        rows, damaged = dict[str, tuple[Gains, float]](), list[str]()
        for name, row in document["rows"].items():
            try:
                check_shape(row, ListOf(object, 2), name)
                gains, cost = row
                check_shape([*gains, cost], ListOf(Real()), name)
                rows[name] = Gains._make(gains), float(cost)
            except (ValueError, TypeError) as error:
                damaged.append(str(error))
        if damaged:
            say_damaged(self.path, damaged[0], f"{len(damaged)} rows are computed anew")
        return rows


def name_of(row: Job) -> str:
    """Return a row's unique name: `100hz/rotation/pid/350`."""
    return f"{row.loop}/{row.task}/{row.controller}/{row.pressure_kpa:g}"
