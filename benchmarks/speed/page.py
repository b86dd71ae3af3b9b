"""Puts a run's figures into the pages on speed: `python -m benchmarks.speed.page [FILE]`.

A block of figures stands between `<!-- figures: NAME -->` and `<!-- end of figures -->`; nobody
types one in. `--check` changes nothing and fails if a page is not as the run would have it.
"""

import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from benchmarks.files import write_text
from benchmarks.speed.measure import Repetition
from benchmarks.speed.report.tables import SpeedTable, sentences, speed_tables
from pma_gym.documents import read_json

ROOT = Path(__file__).resolve().parents[2]
PAGES = (ROOT / "docs" / "speed.md", ROOT / "docs" / "notebook" / "speed.md")
RUN = ROOT / "results" / "speed.json"
ABSENT = "Not measured in this run."

_BLOCK = re.compile(
    r"(?P<start><!-- figures: (?P<name>\w+) -->\n).*?(?P<end><!-- end of figures -->)", re.DOTALL
)


class RunError(ValueError):
    """A run whose figures are not for print; the message says why and what to do."""


def load_run(path: Path) -> Mapping[str, Any]:
    """The whole run in a file.

    Raises:
        RunError: there is none, or it is a part, or a smoke run.
    """
    advice = "run `python -m benchmarks speed --json results/speed.json`"
    if not path.is_file():
        raise RunError(f"there is no file {path}; {advice} first")
    try:
        run = read_json(path, "journal_mib", own=True, finite=False)
    except ValueError as error:
        raise RunError(f"{error}; {advice} again") from None
    whole, made = Repetition(), run["run"]
    if not run["complete"] or made["rounds"] < whole.rounds or made["seconds"] < whole.seconds:
        raise RunError(f"{path} is no whole run; {advice} without --quick and let it finish")
    return run


def refreshed(text: str, run: Mapping[str, Any]) -> str:
    """A text with the run's figures in its blocks.

    A table that the run has not becomes a sentence that says so.
    """
    blocks = {table.name: _markdown(table) for table in speed_tables(run)}
    blocks["setting"] = "\n".join(f"- {sentence}" for sentence in sentences(run))

    def block(match: re.Match[str]) -> str:
        return f"{match['start']}\n{blocks.get(match['name'], ABSENT)}\n\n{match['end']}"

    return _BLOCK.sub(block, text)


def main(
    file: Annotated[Path, typer.Argument(help="JSON of a whole run.")] = RUN,
    check: Annotated[
        bool, typer.Option("--check", help="Change nothing; fail on a difference.")
    ] = False,
) -> None:
    """Put a run's figures into docs/speed.md and its record in the notebook."""
    try:
        run = load_run(file)
    except RunError as error:
        print(f"error: {error}", file=sys.stderr)
        raise typer.Exit(2) from None
    changed = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        content = refreshed(text, run)
        if content != text:
            changed.append(page)
            if not check:
                write_text(page, content)
            print(f"{page.relative_to(ROOT)}: {'differs' if check else 'refreshed'}")
    if check and changed:
        raise typer.Exit(1)


def _markdown(table: SpeedTable) -> str:
    rules = [":--" if column < table.words else "--:" for column in range(len(table.header))]
    lines: Sequence[Sequence[str]] = (table.header, rules, *table.rows)
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


if __name__ == "__main__":
    typer.run(main)
