"""A random forest that tells effects by their signatures, as one would do without any physics.

It learns from cases of its own seeds. Their signatures, not the forest, are what is kept: a table
of `signatures.csv`, one line a case, from which the forest is grown when it is asked.
"""

# pyright: reportMissingImports=false
import csv
import io
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.executors.choice import local
from benchmarks.executors.executor import run_or_raise
from benchmarks.hidden_effects.baselines.preparation import answer, moved, prepare
from benchmarks.hidden_effects.baselines.signatures import signature
from benchmarks.hidden_effects.generation.cases import draw_case
from benchmarks.hidden_effects.generation.effects import KINDS
from benchmarks.hidden_effects.generation.files import case_name, write_case
from pma_gym.data.datasets.dataset import Dataset, read_dataset
from pma_gym.documents import read_json
from pma_gym.files import replace_file

Array = NDArray[np.float64]

TABLE = Path(__file__).with_name("signatures.csv")
"""What the forest has seen."""

NOTHING = "nothing"
"""Class of cases that hide no effect."""

CONFUSED = 0.8
"""Share of the most votes from which on another class is told as well."""

TREES = 500
LEARNT = ("single", "single", "single", "single", "nothing", "parameters")
"""Blocks that cases to learn from take turns in."""


@dataclass(frozen=True)
class Learnt:
    """Signatures of cases.

    Attributes:
        seeds: the set that each case is of, shape (n,).
        numbers: its number in it, shape (n,).
        labels: what it hides, or `NOTHING`.
        names: of the signature's numbers, in the order of columns.
        values: shape (n, len(names)).
    """

    seeds: NDArray[np.int64]
    numbers: NDArray[np.int64]
    labels: tuple[str, ...]
    names: tuple[str, ...]
    values: Array


def random_forest(dataset: Dataset, seed: int, jobs: int) -> Mapping[str, Any]:
    """The class with most votes; others with nearly as many are told beside it."""
    ready = prepare(dataset, jobs)
    forest, names = _grown(TABLE, seed)
    features = signature(ready)
    votes = forest.predict_proba(np.array([[features[name] for name in names]]))[0]
    order = np.argsort(-votes, kind="stable")
    first = str(forest.classes_[order[0]])
    shares = {str(forest.classes_[k]): float(votes[k]) for k in order[:5]}
    parameters = moved(ready.problem, ready.refitted)
    if first == NOTHING:
        return answer("parameters" if ready.moved else "agrees", (), parameters, votes=shares)
    near = [name for name, share in shares.items() if share >= CONFUSED * shares[first]]
    others = [name for name in near if name not in (first, NOTHING)]
    effect = {"name": first, "confused_with": others}
    return answer("effect", (effect,), parameters, votes=shares)


@cache
def _grown(file: Path, seed: int):  # noqa: ANN202
    """The forest, and the names of what it reads; the same table and seed give the same one."""
    from sklearn.ensemble import RandomForestClassifier

    known = read_table(file)
    forest = RandomForestClassifier(
        TREES, min_samples_leaf=1, class_weight="balanced_subsample", random_state=seed
    )
    return forest.fit(known.values, known.labels), known.names


def check_unseen(folder: Path, file: Path) -> None:
    """Refuse to judge a forest by cases of a set that it has learnt from.

    Args:
        folder: what `draw` wrote.
        file: the table.
    Raises:
        ValueError: a case of one of its seeds.
    """
    learnt = set(read_table(file).seeds.tolist())
    for path in sorted((folder / "truth").glob("case_*.json")):
        seed = read_json(path, "journal_mib", own=True, finite=False)["seed"]
        if seed in learnt:
            raise ValueError(
                f"{path.stem} in {folder} is of seed {seed}, from which the forest's table {file} "
                "was made: it would know the answers; draw cases of another seed"
            )


def train(count: int, seed: int, file: Path, jobs: int) -> None:
    """Draw cases, read their signatures, and add those that are missing to a table.

    Args:
        count: how many cases the set has.
        seed: of the set; no case of it may be judged (`check_unseen`).
        file: the table; what it has is kept.
        jobs: processes.
    """
    rows = _rows(file)
    known = {(int(row["seed"]), int(row["number"])) for row in rows}
    missing = [k for k in range(1, count + 1) if (seed, k) not in known]
    begun = time.monotonic()
    print(f"{count - len(missing)} of {count} cases are in the table", file=sys.stderr)
    there = len(rows)

    def keep(_: int, row: dict[str, Any]) -> None:
        rows.append(row)
        _write(file, rows)
        done, took = len(rows) - there, time.monotonic() - begun
        print(f"{done}/{len(missing)}  {row['label']}  ({took:.0f} s)", file=sys.stderr, flush=True)

    run_or_raise([partial(read_case, seed, number) for number in missing], local(jobs), keep)


def read_case(seed: int, number: int) -> dict[str, Any]:
    """A line of the table: a case to learn from, drawn and read."""
    block = LEARNT[(number - 1) % len(LEARNT)]
    case = draw_case(seed, number, block, _hidden(block, number))
    with tempfile.TemporaryDirectory(prefix="signature_") as folder:
        write_case(case, Path(folder), number)
        ready = prepare(read_dataset(Path(folder) / "cases" / case_name(number)), 1)
    hidden = [effect["name"] for effect in case.truth["effects"]]
    features = {name: f"{value:.4g}" for name, value in signature(ready).items()}
    return {"seed": seed, "number": number, "label": hidden[0] if hidden else NOTHING} | features


def _hidden(block: str, number: int) -> tuple[str, ...]:
    """Effects take turns."""
    turn = sum(LEARNT[(k - 1) % len(LEARNT)] == "single" for k in range(1, number))
    return (list(KINDS)[turn % len(KINDS)],) if block == "single" else ()


def read_table(file: Path) -> Learnt:
    """The signatures in a table.

    Raises:
        FileNotFoundError: there is none.
    """
    if not file.is_file():
        raise FileNotFoundError(
            f"there is no table {file} to grow a forest from; make it with "
            "`python -m benchmarks.hidden_effects.baselines train`"
        )
    rows = _rows(file)
    names = tuple(rows[0])[3:]
    return Learnt(
        np.array([int(row["seed"]) for row in rows]),
        np.array([int(row["number"]) for row in rows]),
        tuple(row["label"] for row in rows),
        names,
        np.array([[float(row[name]) for name in names] for row in rows]),
    )


def _rows(file: Path) -> list[dict[str, Any]]:
    if not file.is_file():
        return []
    return list(csv.DictReader(io.StringIO(file.read_text("utf-8"))))


def _write(file: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    ordered = sorted(rows, key=lambda row: (int(row["seed"]), int(row["number"])))
    text = io.StringIO()
    writer = csv.DictWriter(text, list(ordered[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(ordered)
    replace_file(file, text.getvalue().encode())
