"""User pages are short, have their place in the navigation and few words in all."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
RECORDS = ("reference", "notebook", "development")
"""Folders of pages that are looked up, and of records; every other page is read."""

USER = sorted(
    path
    for path in DOCS.rglob("*.md")
    if not path.relative_to(DOCS).as_posix().startswith(tuple(f"{name}/" for name in RECORDS))
)
LONGEST, WHOLE = 900, 14_400


def words(path):
    """How many words a page's source has, with its tables and code."""
    return len(path.read_text(encoding="utf-8").split())


@pytest.mark.parametrize("path", USER, ids=lambda path: path.relative_to(DOCS).as_posix())
def test_a_user_page_is_two_screens(path):
    assert words(path) <= LONGEST


def test_the_user_pages_are_read_in_an_hour():
    counts = {path.relative_to(DOCS).as_posix(): words(path) for path in USER}
    assert len(counts) > 20 and sum(counts.values()) <= WHOLE, counts


def sections():
    """Pages of the navigation by section."""
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    nav = text.split("\nnav:\n")[1].split("\n\n")[0]
    parts = re.split(r"^  - ", nav, flags=re.MULTILINE)[1:]
    return {part.split(":")[0]: re.findall(r"[\w/-]+\.md", part) for part in parts}


def test_navigation_is_by_what_a_reader_wants_to_do():
    assert list(sections()) == [
        *("Home", "Tutorials", "How-to", "Explanation", "Results"),
        *("Reference", "Development", "Notebook"),
    ]


@pytest.mark.parametrize("name", RECORDS)
def test_looked_up_pages_stand_apart_from_those_that_are_read(name):
    in_nav = {page for page in sections()[name.capitalize()]}
    assert in_nav == {path.relative_to(DOCS).as_posix() for path in (DOCS / name).rglob("*.md")}


@pytest.mark.parametrize("path", USER, ids=lambda path: path.relative_to(DOCS).as_posix())
def test_a_user_page_starts_with_its_answer(path):
    title, first, *_ = path.read_text(encoding="utf-8").split("\n\n")
    assert re.fullmatch(r"# .+", title)
    assert re.match(r"[`\w*]", first), "the first thing under the title is a sentence"


@pytest.mark.parametrize("path", sorted((DOCS / "notebook").glob("*.md")), ids=lambda p: p.stem)
def test_a_record_is_dated(path):
    head = "\n\n".join(path.read_text(encoding="utf-8").split("\n\n")[:2])
    assert path.stem == "index" or re.search(r"20\d\d-\d\d", head)
