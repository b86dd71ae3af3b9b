"""`python -m benchmarks remove`: take a controller's rows out of journals; all others stay."""

import difflib
import json
from collections.abc import Sequence
from pathlib import Path

from benchmarks.runner.journal import JOURNAL, rewrite
from benchmarks.runner.provenance import read_run, write_run
from benchmarks.suites.suite import FrozenSuite, SuiteError


def remove_controller(name: str, suites: Sequence[FrozenSuite], results: Path) -> dict[Path, int]:
    """Take a controller out of the results of suites.

    Each journal is replaced as a whole by one in which every other line has the same bytes, damaged
    lines included; what `run.json` says of the controller goes too. Pages stay until `report`.

    Args:
        name: of the controller, as the journal has it.
        suites: whose folders are looked at.
        results: folder with a folder of results for each suite.
    Returns:
        How many rows were taken out of each journal that had some.
    Raises:
        SuiteError: no journal has any, or a run is writing to one.
    """
    journals = [results / suite.name / JOURNAL for suite in suites]
    known = {path: _names(path) for path in journals if path.is_file()}
    if not any(name in names for names in known.values()):
        raise SuiteError(_unknown(name, known, results))
    return {path: _removed(name, path) for path, names in known.items() if name in names}


def _removed(name: str, path: Path) -> int:
    count = rewrite(path, lambda line: _controller(line) != name)
    info = read_run(path.parent)
    specs = info.get("contenders")
    if isinstance(specs, dict) and name in specs:
        rest = {each: entry for each, entry in specs.items() if each != name}
        write_run(path.parent, info, contenders=rest)
    return count


def _controller(line: bytes) -> str | None:
    """Whose row a line is; None for a damaged one."""
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return None
    name = row.get("controller") if isinstance(row, dict) else None
    return name if isinstance(name, str) else None


def _names(path: Path) -> set[str]:
    with path.open("rb") as lines:
        return {name for line in lines if (name := _controller(line)) is not None}


def _unknown(name: str, known: dict[Path, set[str]], results: Path) -> str:
    every = sorted(set().union(*known.values()))
    if not every:
        return f"{results} has no journal of these suites; name the folder by --results"
    near = difflib.get_close_matches(name, every, 1)
    hint = f"; did you mean {near[0]}?" if near else ""
    where = ", ".join(map(str, known))
    return f"no rows of {name!r} in {where}; they have rows of {', '.join(every)}{hint}"
