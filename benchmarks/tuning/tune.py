"""Tunes the PIDs of `controllers/pid.py` on a model of the station and writes their gains.

For every loop (100 Hz; 50 Hz with commands 20 ms late), task, controller and pressure of a small
table:

1. Start: lambda tuning (Rivera et al. 1986) on the plant linearised in the middle of the stroke,
   k_p = tau / (g (lambda + delay)), k_i = k_p / tau, with g the static gain, tau the sum of the
   time constants that the voltage moves, delay half a control period more than commands are late,
   and lambda 2 periods more than that. Lead of the PID: 1 / (g k_i), which a ramp asks for; of the
   one with feed-forward: none.
2. Search: Nelder-Mead on the logarithms of k_p, k_i, k_d, the factor on them at the end of the
   range and, for the PID alone, the lead. The cost of gains is the mean over four stations - twice
   the nominal one, one with 20 % more force and 20 % less damping, one the other way round (on the
   cascade also with 10 % less and more displacement) - of what a whole trial with sensor noise
   costs, the noise another in each:

       mean over the phases of RMSE / target + 0.01 s/V * total variation of the voltage / duration

   with the RMSE of the true position at 384 Hz, targets 0.10 mm and 0.4 deg, of contractions by the
   regulator 0.30 mm.
3. Margin: gains whose loop, linearised at three places of the stroke and in each direction of
   motion, with its delays, has a largest sensitivity above 2 pay for it. At 2 the gain may be off
   by a factor of 2 and the phase by 29 deg at least before the loop is unstable.

The same seed gives the same bytes on the same machine and versions.

Rows that are done are kept in a file beside that of the gains; after Ctrl-C the same command goes
on from there.
"""

import hashlib
import platform
import sys
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, cast

import numpy as np
from rich.progress import Progress
from scipy.optimize import minimize

from benchmarks.executors.choice import local
from benchmarks.executors.executor import ProcessDied, run_all
from benchmarks.files import toml_document, write_text
from benchmarks.tuning.cost import Cost, chosen
from benchmarks.tuning.loop_margins import Job, KeptRows, lambda_tuning, name_of
from controllers.design.designs import (
    GAINS_FILE,
    GAINS_SCHEMA,
    Gains,
    column_names,
    read_settings,
)
from controllers.pid import PID, FeedforwardPID
from pma_gym.document_shape import check_shape
from pma_gym.plant.model import Model, dump_model, load_model
from pma_gym.plant.plant import Plant
from pma_gym.tasks import EVERY_TASK
from pma_gym.terminal import SafeConsole

PRESSURES_KPA = {
    "displacement": (150, 200, 250, 300, 400, 575),
    "rotation": (275, 350, 450, 575),
    "isotonic": (150, 200, 250, 300, 350),
    "triangle_high": (450,),
}
"""Pressures that trials begin at, by task; between them gains are interpolated. Tasks of one kind
(`controllers.design.designs.task_kind`) fill one table, whose pressures rise."""

LOOPS = ((100.0, 0.0), (50.0, 0.02))
"""Control rates (Hz), and how late commands are with each (s)."""

HEAD = "Gains by model, loop, kind of task and controller: python -m benchmarks tune"
CONTROLLERS = (PID.name, FeedforwardPID.name)
FILTER_S = 0.005
EVALUATIONS = 100
SEARCH_WIDTH = 3.0
"""How far the search may leave its start, as the logarithm of a factor: 20 either way."""


class TuneError(RuntimeError):
    """A table of gains that could not be computed; the message says why and how to go on."""


def run_tune(
    out: Path = GAINS_FILE,
    seed: int = 0,
    model: str = "station",
    jobs: int = 2,
    only: str = "*",
) -> bool:
    """Tune on a model and write the gains; other tables in the file stay.

    Args:
        out: file of gains, replaced whole once all is computed.
        seed: seed of the sensors' noise.
        model: name of a shipped model or path of a TOML file.
        jobs: number of processes.
        only: which tables, by loop and kind of task: patterns such as `100hz/*` by commas.
    Returns:
        Whether it was written: Ctrl-C leaves the file as it was, and says how to go on.
    Raises:
        TuneError: the process of a row died.
        ModelError: no such model.
        ValueError: the file of gains is broken, or no table is called so.
    """
    known, document = load_model(model), _read(out)
    rows = table_rows(known, seed, only)
    kept = KeptRows(out, {"made": _provenance(known, seed), "evaluations": EVALUATIONS})
    left = [row for row in rows if name_of(row) not in kept.rows]
    if len(left) < len(rows):
        print(
            f"{len(rows) - len(left)} of {len(rows)} rows are taken from {kept.path}, which an "
            "earlier run left; delete it to tune them anew"
        )
    if not _all_tuned(left, jobs, kept):
        done = sum(name_of(row) in kept.rows for row in rows)
        print(_interrupted(done, len(rows), kept.path, out), file=sys.stderr)
        return False
    for loop, kinds in _tables(rows, [kept.rows[name_of(row)] for row in rows]).items():
        for kind, controllers in kinds.items():
            table = {"provenance": _provenance(known, seed)} | controllers
            document.setdefault(known.name, {}).setdefault(loop, {})[kind] = table
    write_text(out, toml_document(HEAD, GAINS_SCHEMA, document))
    kept.forget()
    return True


def table_rows(model: Model, seed: int, only: str) -> list[Job]:
    """The rows of the tables asked for.

    Raises:
        ValueError: a pattern matches none.
    """
    rows = [
        Job(model, task, controller, pressure, seed, rate, delay)
        for rate, delay in LOOPS
        for task, pressures in PRESSURES_KPA.items()
        # A cascade has no muscle that a load could be held against.
        if model.rig.balances_loads or EVERY_TASK[task].actuator == "motor"
        for controller in CONTROLLERS
        for pressure in pressures
    ]
    tables = chosen((f"{row.loop}/{row.kind}" for row in rows), only)
    return [row for row in rows if f"{row.loop}/{row.kind}" in tables]


def _interrupted(done: int, total: int, kept: Path, out: Path) -> str:
    """What to say after Ctrl-C."""
    if not done:
        return f"Interrupted before the first of {total} rows was tuned; {out} is as it was."
    return (
        f"Interrupted: {done} of {total} rows are tuned and kept in {kept}; {out} is as it was. "
        "Run the same command again to go on from there."
    )


def _all_tuned(rows: list[Job], jobs: int, kept: KeptRows) -> bool:
    """Tune rows and keep each as it is done; false after Ctrl-C."""
    # The longest trials first, so that no process waits at the end.
    order = sorted(rows, key=lambda row: -row.schedule.duration * row.rate_hz)
    try:
        if order:
            Plant(order[0].model)  # compiled here, once, so that the processes find it on disk
        with Progress(console=SafeConsole()) as progress:
            bar = progress.add_task("Tuning", total=len(rows))

            def keep(index: int, result: object) -> None:
                if isinstance(result, ProcessDied):
                    raise TuneError(
                        f"row {name_of(order[index])}: {result}; the rows that are done are kept "
                        f"in {kept.path}: fix it and run again to go on"
                    )
                if isinstance(result, BaseException):
                    raise result
                kept.keep(order[index], cast("tuple[Gains, float]", result))
                progress.update(bar, advance=1)

            return run_all([partial(tuned, row) for row in order], local(jobs), keep)
    except KeyboardInterrupt:
        return False


def tuned(job: Job) -> tuple[Gains, float]:
    """Best gains (SI) of a job, to four digits, and their cost."""
    cost = Cost(job)
    start = np.log(lambda_tuning(job))

    def objective(logarithms: np.ndarray) -> float:
        return cost(gains_from(logarithms, job.start_factor))

    simplex = np.vstack([start, start + 0.4 * np.eye(len(start))])
    minimum = minimize(
        objective,
        start,
        method="Nelder-Mead",
        bounds=[(value - SEARCH_WIDTH, value + SEARCH_WIDTH) for value in start],
        options={"maxfev": EVALUATIONS, "initial_simplex": simplex, "xatol": 0.02, "fatol": 1e-3},
    )
    gains = gains_from(minimum.x, job.start_factor)
    return gains, cost(gains)


def gains_from(logarithms: np.ndarray, start_factor: float = 1.0) -> Gains:
    """Gains (SI), to four digits, from logarithms: k_p, k_i, k_d, end factor, lead or none."""
    proportional, integral, derivative, end, *lead = (_rounded(v) for v in np.exp(logarithms))
    ahead = lead[0] if lead else 0.0
    return Gains(proportional, integral, derivative, FILTER_S, ahead, end, start_factor)


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")


def _tables(jobs: list[Job], results: list[tuple[Gains, float]]) -> dict[str, Any]:
    """Gains in file units by loop, kind of task and controller."""
    tables: dict[str, Any] = {}
    for job, (gains, cost) in zip(jobs, results, strict=True):
        kinds = tables.setdefault(job.loop, {}).setdefault(job.kind, {})
        table = kinds.setdefault(job.controller, {})
        columns = column_names(job.schedule.unit)
        row = {"pressure_kpa": job.pressure_kpa} | {
            name: float(f"{getattr(gains, field) / factor:.4g}")
            for field, (name, factor) in columns.items()
        }
        row["cost"] = round(cost, 4)
        for name, value in row.items():
            table.setdefault(name, []).append(value)
    return tables


def _provenance(model: Model, seed: int) -> str:
    """What gains depend on, in one line."""
    digest = hashlib.sha256(dump_model(model).encode()).hexdigest()[:16]
    versions = [
        f"Python {platform.python_version()}",
        *(f"{name} {version(name)}" for name in ("numpy", "scipy", "llvmlite")),
    ]
    return f"tuned on the model {digest}, seed {seed}; {' '.join(versions)}"


def _read(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {}
    try:
        tables = read_settings(path, GAINS_SCHEMA, "tune")
        check_shape(tables, {"*": {"*": {"*": dict}}})
    except ValueError as error:
        raise ValueError(
            f"{path} is no file of gains ({error}); delete it or name another"
        ) from error
    return tables
