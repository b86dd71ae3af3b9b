import csv
import io

from rich.console import Console

from benchmarks.dissertation import COLUMNS, run_studies
from pma_gym.studies import VERDICTS


def test_the_report_shows_and_writes_every_comparison(tmp_path):
    out = tmp_path / "studies.csv"
    text = io.StringIO()
    rows = run_studies(out, Console(file=text, width=200))
    with out.open(newline="") as file:
        written = list(csv.DictReader(file))
    assert len(written) == len(rows) > 600
    assert tuple(written[0]) == COLUMNS
    assert {row["verdict"] for row in written} == set(VERDICTS)
    for study in {row.study for row in rows}:
        assert study in text.getvalue()


def test_notes_stay_on_a_narrow_terminal():
    text = io.StringIO()
    rows = run_studies(console=Console(file=text, width=80))
    shown = " ".join(text.getvalue().split())
    assert all(" ".join(row.note.split()) in shown for row in rows)
    assert "…" not in shown
    assert max(map(len, text.getvalue().splitlines())) <= 80
