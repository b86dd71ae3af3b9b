"""All of a run as one document for JSON: every round, every reason, how it was made."""

import os
import platform
import shlex
import sys
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from benchmarks.runner.environment_info import environment_info
from benchmarks.speed.measure import SEED, Measured, Measurement, spread
from benchmarks.speed.peers import PEERS
from benchmarks.speed.report.ratios import Verdict

SCHEMA = 1

Document = dict[str, Any]
"""What the JSON file holds."""


def started() -> Document:
    """Collect what is known before a run: versions, commit, machine, command, load."""
    return environment_info() | {
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": shlex.join(["python", "-m", "benchmarks", *sys.argv[1:]]),
        "processor": processor(),
        "load_before": _load(),
    }


def document(
    measurement: Measurement, verdicts: Sequence[Verdict], info: Document, seconds: float
) -> Document:
    """A run as a document.

    Args:
        measurement: what was measured.
        verdicts: the targets' verdicts.
        info: what `started` told.
        seconds: how long the run took (s).
    """
    return {
        "schema": SCHEMA,
        "complete": measurement.complete,
        "run": info
        | {
            "wall_time_s": seconds,
            "load_after": _load(),
            "seed": SEED,
            **asdict(measurement.repetition),
        },
        "workers": {
            name: {"title": PEERS[name].title, "versions": versions}
            for name, versions in measurement.versions.items()
        },
        "rows": [_row(one) for one in measurement.rows.values()],
        "ratios": [_ratio(verdict) for verdict in verdicts],
    }


def _row(one: Measured) -> Document:
    row = one.row
    document = {
        "key": row.key,
        "group": row.group,
        "title": row.title,
        "number": row.number,
        "worker": row.worker,
        "settings": dict(row.settings),
        "unit": row.unit,
        "step": row.step,
        "right_hand_sides_per_step": one.right_hand_sides,
        "facts": one.facts,
        "rounds": [{"round": n, "per_second": rate} for n, rate in sorted(one.rates.items())],
        "left_out": one.absence or None,
        "failed": one.broke,
    }
    low, middle, high = spread(list(one.rates.values())) if one.rates else (None, None, None)
    return document | {"lower_quartile": low, "median": middle, "upper_quartile": high}


def _ratio(verdict: Verdict) -> Document:
    target = verdict.target
    low, middle, high = verdict.got or (None, None, None)
    return {
        "title": target.title,
        "quantity": target.quantity,
        "ratio": bool(target.others),
        "limit": target.limit,
        "at_most": target.at_most,
        "own": verdict.own or None,
        "other": verdict.other or None,
        "lower_quartile": low,
        "median": middle,
        "upper_quartile": high,
        "verdict": verdict.word,
        "left_out": verdict.absence or None,
        "failed": verdict.broke,
    }


def processor() -> str:
    """Name of the processor."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            name, _, value = line.partition(":")
            if name.strip() == "model name":
                return value.strip()
    except OSError:
        pass  # Not Linux.
    return platform.processor() or platform.machine()


def _load() -> float | None:
    """Processes that wanted a core over the last minute, if the system tells."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None
