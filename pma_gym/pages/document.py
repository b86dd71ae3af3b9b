"""Blocks of a report, and their rendering as Markdown and as one HTML page."""

import base64
import html
import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from pma_gym.documents import printable
from pma_gym.pages.interactive import InteractiveFigure, scripts


@dataclass(frozen=True)
class Heading:
    """A heading; level 1 is the report's."""

    text: str
    level: int = 2


@dataclass(frozen=True)
class Paragraph:
    """Text; `code` and **bold** in it are marked up."""

    text: str


@dataclass(frozen=True)
class TextTable:
    """Cells of text.

    Attributes:
        title: above it.
        header: a cell a column; a group before ` | ` spans the columns that share it.
        rows: cells; a row of one empty cell draws a line.
        words: how many columns at the left hold words, aligned left.
    """

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    words: int = 1


@dataclass(frozen=True)
class Picture:
    """A plot.

    Attributes:
        name: of its file, without suffix.
        caption: below it.
        printed: whether only print and Markdown have it, since an interactive figure shows the
            same on a screen.
    """

    name: str
    caption: str
    printed: bool = False


@dataclass(frozen=True)
class Callout:
    """Important text in a box.

    Attributes:
        text: large.
        note: below it, in the size of text; empty for none.
        tone: `good`, `bad` or `open`, for its colour.
    """

    text: str
    note: str = ""
    tone: str = "open"


@dataclass(frozen=True)
class Formula:
    """Preformatted lines: equations, commands, a part of a file."""

    text: str


@dataclass(frozen=True)
class Steps:
    """A numbered list, with the markup of a paragraph."""

    items: Sequence[str]


Block = Heading | Paragraph | TextTable | Picture | InteractiveFigure | Callout | Formula | Steps

_PAGE = Path(__file__).parent / "page.html"
_GROUP = " | "

DPI = 120
"""Resolution of the PNGs (1/inch)."""

_MANY = 12
"""Columns beyond which print breaks words of the header, to fit the page."""


def to_markdown(blocks: Sequence[Block], pictures: Mapping[str, bytes], folder: str) -> str:
    """Render blocks as Markdown that links pictures in a folder beside the file.

    Args:
        blocks: the report.
        pictures: PNG by name; one that is missing is left out.
        folder: where their files will be.
    """
    parts = []
    for block in blocks:
        match block:
            case Heading(text, level):
                parts.append(f"{'#' * level} {_without_tags(text)}")
            case Paragraph(text):
                parts.append(_without_tags(text))
            case Callout(text, note):
                texts = (f"**{_without_tags(text)}**", _without_tags(note))
                parts.append("\n>\n".join(f"> {each}" for each in texts if each))
            case Formula(text):
                fence = "`" * (1 + max((len(run) for run in re.findall("`{2,}", text)), default=2))
                parts.append(f"{fence}text\n{text}\n{fence}")
            case Steps(items):
                texts = map(_without_tags, items)
                parts.append("\n".join(f"{i}. {item}" for i, item in enumerate(texts, start=1)))
            case TextTable():
                parts.append(_markdown_table(block))
            case Picture(name, caption) if name in pictures:
                parts.append(f"![{caption}]({folder}/{name}.png)\n\n*{caption}*")
            case Picture() | InteractiveFigure():
                pass
    return printable("\n\n".join(parts)) + "\n"


def to_html(blocks: Sequence[Block], pictures: Mapping[str, bytes]) -> str:
    """Render blocks as one self-contained HTML page with pictures, figures and style.

    Args:
        blocks: the report; the first is its heading.
        pictures: PNG by name; one that is missing is left out.
    """
    title = next(block.text for block in blocks if isinstance(block, Heading))
    body = "\n".join(html_block(block, pictures) for block in blocks)
    page = _PAGE.read_text(encoding="utf-8")
    # Once and together: a title may hold `{body}`.
    figures = [block for block in blocks if isinstance(block, InteractiveFigure)]
    parts = {
        "{title}": html.escape(printable(title)),
        "{scripts}": scripts(figures),
        "{body}": printable(body),
    }
    return re.sub(r"\{(?:title|scripts|body)\}", lambda match: parts[match[0]], page)


def _markdown_table(table: TextTable) -> str:
    """A table; groups of columns stay in front of their names, for Markdown cannot span."""
    columns = len(table.header)
    names = [_without_tags(name).replace(_GROUP, "<br>") for name in table.header]
    rules = [":--" if column < table.words else "--:" for column in range(columns)]
    rows = [[_without_tags(cell) for cell in row] for row in table.rows if len(row) == columns]
    lines = ["| " + " | ".join(map(_cell, row)) + " |" for row in [names, rules, *rows]]
    return "\n".join([f"**{_without_tags(table.title)}**", "", *lines])


def _cell(text: str) -> str:
    """A cell of Markdown: on one line, and no end of it inside."""
    return " ".join(text.split("\n")).replace("|", "\\|")


def _without_tags(text: str) -> str:
    """Text of Markdown that holds no HTML; `code` stays as it is."""
    return re.sub(r"(`[^`\n]*`)|<(?=[A-Za-z/!?])", lambda match: match[1] or "&lt;", text)


def html_block(block: Block, pictures: Mapping[str, bytes]) -> str:
    """Render a block as HTML.

    Args:
        block: the block.
        pictures: PNG by name; a picture that is missing is left out.
    """
    match block:
        case Heading(text, level):
            return f"<h{level}>{_inline(text)}</h{level}>"
        case Paragraph(text):
            return f"<p>{_inline(text)}</p>"
        case Callout(text, note, tone):
            more = f"<p>{_inline(note)}</p>" if note else ""
            return f'<div class="callout {tone}"><p class="large">{_inline(text)}</p>{more}</div>'
        case Formula(text):
            return f"<pre>{html.escape(text, quote=False)}</pre>"
        case Steps(items):
            return f"<ol>{''.join(f'<li>{_inline(item)}</li>' for item in items)}</ol>"
        case TextTable():
            return _html_table(block)
        case Picture(name, caption, printed) if name in pictures:
            data = base64.b64encode(pictures[name]).decode("ascii")
            alt = html.escape(caption)
            width = _shown_width(pictures[name])
            image = f'<img alt="{alt}" width="{width}" src="data:image/png;base64,{data}">'
            shown = ' class="printed"' if printed else ""
            figcaption = f"<figcaption>{_inline(caption)}</figcaption>"
            return f"<figure{shown}>{image}{figcaption}</figure>"
        case InteractiveFigure(name, caption):
            plot = f'<div class="plot" id="figure-{html.escape(name)}"></div>'
            figcaption = f"<figcaption>{_inline(caption)}</figcaption>"
            return f'<figure class="interactive">{plot}{figcaption}</figure>'
        case _:
            return ""


def _shown_width(image: bytes) -> int:
    """Width of a PNG on the page (CSS pixels), at which its text is as large as it was drawn."""
    (pixels,) = struct.unpack(">I", image[16:20])
    return round(pixels * 96 / DPI)


def _html_table(table: TextTable) -> str:
    columns = len(table.header)
    body = []
    ruled = False
    # A phone shows them, where a row is a list.
    names = [_data_name(name) for name in table.header]
    for row in table.rows:
        if len(row) != columns:
            ruled = True
            continue
        cells = "".join(
            f"<td{name}{_verdict_class(cell)}>{_inline(cell)}</td>"
            if column >= table.words
            else f"<th{name}>{_inline(cell)}</th>"
            for column, (name, cell) in enumerate(zip(names, row, strict=True))
        )
        body.append(f'<tr class="ruled">{cells}</tr>' if ruled else f"<tr>{cells}</tr>")
        ruled = False
    head = _html_header(table)
    kind = "prose" if table.words == columns else "many" if columns > _MANY else "few"
    return (
        f'<div class="wide"><table class="{kind}">'
        f"<caption><span>{_inline(table.title)}</span></caption>"
        f"<thead>{head}</thead><tbody>{''.join(body)}</tbody></table></div>"
    )


def _data_name(column: str) -> str:
    name = html.escape(re.sub(r"[`*]", "", column.replace(_GROUP, ", ")))
    return f' data-name="{name}"' if name else ""


def _html_header(table: TextTable) -> str:
    """One row of column names, or two where columns share a group."""
    top, below = [], []
    names = [name.partition(_GROUP) for name in table.header]
    grouped = any(title for _, title, _ in names)
    for group, same in groupby(enumerate(names), key=_group_of):
        members = list(same)
        index, (name, _, _) = members[0]
        if isinstance(group, str):
            top.append(f'<th class="group" colspan="{len(members)}">{_inline(name)}</th>')
            below += [f"<th>{_inline(part)}</th>" for _, (_, _, part) in members]
        else:
            words = ' class="words"' if index < table.words else ""
            rows = ' rowspan="2"' if grouped else ""
            top.append(f"<th{words}{rows}>{_inline(name)}</th>")
    lower = f"<tr>{''.join(below)}</tr>" if grouped else ""
    return f"<tr>{''.join(top)}</tr>{lower}"


def _group_of(column: tuple[int, tuple[str, str, str]]) -> str | int:
    """The name of a column's group; its own number if it has none."""
    index, (group, group_title, _) = column
    return group if group_title else index


def _verdict_class(cell: str) -> str:
    return f' class="{cell.replace(" ", "-")}"' if cell in ("met", "missed", "no figure") else ""


def _inline(text: str) -> str:
    """Escaped text with `code` and **bold**."""
    escaped = html.escape(text, quote=False)
    escaped = re.sub(r"`([^`]+)`", r"<code>\1</code>", escaped)
    return re.sub(r"\*\*([^*]+)\*\*", r"<strong>\1</strong>", escaped)
