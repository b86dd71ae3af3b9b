"""Writes the report of a run: page, pictures, and every figure as CSV and JSON."""

import shutil
from dataclasses import asdict
from pathlib import Path

from benchmarks.files import write_bytes, write_text
from benchmarks.reproduction.page import report_blocks, report_pictures
from benchmarks.reproduction.replay import all_replay_errors
from benchmarks.reproduction.results import Results, csv_text, json_text
from benchmarks.reproduction.rotation_reading import entries
from benchmarks.reproduction.targets import check_targets
from pma_gym.pages.document import to_html, to_markdown
from pma_gym.pages.figures import picture_files, pngs

PLOTS = "plots"


def write_report(results: Results, out: Path, vector: bool = False) -> None:
    """Write everything; all is computed before anything is replaced, so no folder mixes two runs.

    Args:
        results: the run.
        out: folder; made if need be.
        vector: whether every picture is written as SVG and PDF too.
    """
    files = picture_files(report_pictures(results), vector)
    pictures = pngs(files)
    checks = check_targets(results)
    blocks = report_blocks(results)
    errors = all_replay_errors(results, results.suite.models[0])
    texts = {
        "report.md": to_markdown(blocks, pictures, PLOTS),
        "report.html": to_html(blocks, pictures),
        "scores.csv": csv_text(results.scores),
        "scores.json": json_text(
            results,
            targets=[asdict(check) | {"verdict": check.verdict} for check in checks],
            replay_errors=[asdict(error) for trials in errors.values() for error in trials],
            rotation_reading=entries(results.suite.models[0]) if errors else [],
        ),
    }
    shutil.rmtree(out / PLOTS, ignore_errors=True)
    for name, content in files.items():
        write_bytes(out / PLOTS / name, content)
    for name, text in texts.items():
        write_text(out / name, text)
