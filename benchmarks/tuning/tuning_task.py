"""Rows of the table of gains: what each is tuned for, and those that are finished."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.files import write_text
from benchmarks.runner.damaged_results import say_damaged
from benchmarks.runner.provenance import ROOT, git_state
from controllers.design.designs import Gains, loop_name, task_kind
from controllers.pid import PID
from pma_gym.data.trial_schedule import TrialSchedule
from pma_gym.document_shape import ListOf, Real, check_shape
from pma_gym.documents import read_json
from pma_gym.envs import StationInfo
from pma_gym.plant.model import Model
from pma_gym.tasks import EVERY_TASK

START_FACTOR = 0.3
"""Factor on the gains of the PID where the cable may go slack; see `Gains.scaled`. Set by hand: of
16 trials of phase III at each of 275, 500 and 575 kPa the worst fell from 0.41 to 0.29 deg."""


@dataclass(frozen=True)
class Job:
    """One row of the table of gains.

    Attributes:
        model: model to tune on.
        task: name of the task that is tried.
        controller: one of `CONTROLLERS`.
        pressure_kpa: gauge pressure that trials begin at (kPa).
        seed: seed of the sensors' noise on the nominal station; the others get the next ones.
        rate_hz: control rate (Hz).
        delay_s: how late a command reaches the station (s), whole periods.
    """

    model: Model
    task: str
    controller: str
    pressure_kpa: float
    seed: int
    rate_hz: float = 100.0
    delay_s: float = 0.0

    @property
    def station(self) -> StationInfo:
        """The station info that a controller of the row receives."""
        task, pressure = EVERY_TASK[self.task], self.pressure_kpa * 1e3
        return StationInfo(self.model, task, pressure, 1.0 / self.rate_hz, self.delay_s)

    @property
    def loop(self) -> str:
        """Name of its loop, such as `50hz_delay20ms`."""
        return loop_name(self.station)

    @property
    def kind(self) -> str:
        """Kind of its task: the tables are of one kind each."""
        return task_kind(self.station)

    @property
    def schedule(self) -> TrialSchedule:
        """The task's schedule."""
        return EVERY_TASK[self.task].schedule

    @property
    def start_factor(self) -> float:
        """`START_FACTOR` for a PID that brings the cable back to slack, else 1."""
        slack = "cable" in self.model.parameters and self.schedule.followed.is_angle
        return START_FACTOR if slack and self.controller == PID.name else 1.0


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
        provenance = made_with | {"commit": git_state(ROOT)["commit"]}
        self.made_with = json.loads(json.dumps(provenance))
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
