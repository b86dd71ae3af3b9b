"""Names and titles are data: on terminals of any kind, in pages, on command lines."""

import io
import os
import subprocess
import sys

import pytest
from rich.table import Table
from typer.testing import CliRunner

from benchmarks.__main__ import app as benchmarks
from pma_gym.cli import app, progress
from pma_gym.documents import printable
from pma_gym.pages.document import Formula, Heading, Paragraph, TextTable, to_html, to_markdown
from pma_gym.plant.model import shipped_models
from pma_gym.terminal import SafeConsole, safe_streams

EVIL = "a\x1b[31mb\x07\u202e\u2066\x9b[red]x[/red] :smile: \udcff"


def test_what_controls_a_terminal_becomes_escapes_and_text_stays():
    shown = printable(EVIL)
    assert "[red]x[/red] :smile:" in shown and r"\x1b[31mb\x07\u202e\u2066\x9b" in shown
    assert not any(ord(c) < 32 or 0x7F <= ord(c) < 0xA0 or 0xD800 <= ord(c) < 0xE000 for c in shown)
    text = "Größe 5 µm, 圧力\tkPa\nعربي"
    assert printable(text) == text


def test_a_console_shows_names_as_they_are():
    out = io.StringIO()
    console = SafeConsole(file=out, width=200, force_terminal=True)
    table = Table("name", title=EVIL)
    table.add_row(EVIL, style="red")
    console.print(table)
    console.print(EVIL)
    shown = out.getvalue()
    assert "[red]x[/red]" in shown and ":smile:" in shown and r"\x1b[31mb" in shown
    assert "\x1b[31mb" not in shown and "\x07" not in shown and "\u202e" not in shown
    # The console's own colours are there.
    assert "\x1b[" in shown


def test_printed_text_is_safe_while_a_command_runs(capfd):
    before = sys.stdout
    with safe_streams():
        print(EVIL)
        print(EVIL, file=sys.stderr)
    assert sys.stdout is before
    for text in capfd.readouterr():
        assert r"\x1b[31mb" in text and "\x1b" not in text and r"\udcff" in text


TWICE = """
import sys
from pma_gym.cli import main
for path in sys.argv[1:]:
    try:
        main(["info", "--model", path])
    except SystemExit as end:
        code = end.code
sys.exit(code)
"""

TERMINALS = {
    "ascii": {"PYTHONIOENCODING": "ascii:strict"},
    "C": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
}


@pytest.mark.parametrize("terminal", TERMINALS)
def test_any_terminal_and_any_file_name_serve(terminal, tmp_path):
    text = shipped_models()["serres2008"].read_text(encoding="utf-8")
    title = r"\u001b[31m[bold]圧力\u202e"
    paths = [
        os.path.join(os.fsencode(tmp_path), name) for name in (b"\xfe.toml", b"model-\xff.toml")
    ]
    texts = text.replace('title = "', f'title = "{title} '), "a = = 1"
    for path, content in zip(paths, texts, strict=True):
        with open(path, "w", encoding="utf-8") as file:
            file.write(content)
    done = subprocess.run(
        [sys.executable, "-c", TWICE, *paths],
        capture_output=True,
        env=os.environ | TERMINALS[terminal],
    )
    assert b"[bold]" in done.stdout and b"\x1b" not in done.stdout
    assert rb"\x1b[31m" in done.stdout
    # Of the second file alone: the first is a model.
    assert done.returncode == 2 and done.stderr.startswith(b"error: ")
    assert done.stderr.count(b"error: ") == 1
    assert b"Traceback" not in done.stderr and rb"model-\udcff.toml" in done.stderr


NUMBERS = ["1_000", "٣", "３", "nan", "inf", "0x10", "1e400", "1.5"]


@pytest.mark.parametrize(
    ("command", "words", "number"),
    [
        *((benchmarks, ["tune", "--seed"], number) for number in NUMBERS),
        (app, ["simulate", "in.csv", "--out", "out.csv", "--seed"], "1_000"),
        (app, ["diagnose", "folder", "--jobs"], "1_000"),
        (benchmarks, ["run", "--suite", "nominal", "--jobs"], "1_000"),
    ],
)
def test_options_read_numbers_strictly(command, words, number):
    done = CliRunner().invoke(command, [*words, number])
    assert done.exit_code == 2 and "is not a whole number; write ASCII digits" in done.stderr


def test_options_read_numbers_as_before():
    done = CliRunner().invoke(app, ["simulate", "none.csv", "--out", "out.csv", "--seed", "3"])
    assert "none.csv" in f"{done.stderr} {done.exception}" and "whole number" not in done.stderr


@pytest.mark.parametrize("pressures", ["1_50", "nan", "٣٠٠", "150;300"])
def test_lists_of_numbers_are_strict(pressures):
    done = CliRunner().invoke(benchmarks, ["--pressures", pressures])
    assert done.exit_code == 2 and "--pressures must be numbers in kPa by commas" in done.stderr


def test_a_page_is_filled_once():
    blocks = [Heading("{body} {title} <script>x</script> \x1b[0m", 1), Paragraph("{title}")]
    page = to_html(blocks, {})
    assert page.count("<script>") == 0 and "\x1b" not in page
    assert page.count("<p>{title}</p>") == 1
    assert "<title>{body} {title} &lt;script&gt;" in page


def test_markdown_keeps_names_in_their_place():
    name = "a|b\n<script>x</script>\udcff"
    table = TextTable(name, ["Name", "p"], [[name, "p < 0.01"], [name, "`a<b`"]])
    page = to_markdown([Heading(name, 1), Paragraph(name), table, Formula("```\nx")], {}, "")
    assert "<script>" not in page and page.encode("utf-8")
    rows = [line for line in page.splitlines() if line.startswith("|")]
    assert len(rows) == 4 and rows[2].count("|") - rows[2].count("\\|") == 3
    assert "p < 0.01" in page and "`a<b`" in page
    assert "````text\n```\nx\n````" in page


def test_lines_say_where_a_step_is_and_a_bar_does_on_a_terminal(monkeypatch, capsys):
    times = iter((100.0, 150.0, 170.0, 180.0))
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(times))
    with progress.StepProgress() as said:
        for done in range(3):
            said("trials left out", done, 5)
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["trials left out ...", "trials left out 2 of 5 ..."]
    monkeypatch.undo()
    monkeypatch.setenv("FORCE_COLOR", "1")
    bars = progress.StepProgress()
    bars("trials left out", 1, 5)
    assert bars._bars is not None and bars._bars.tasks[0].completed == 1
