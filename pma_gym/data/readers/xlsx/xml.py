"""XML of workbooks as a stream of events, without entities, which may grow without bound."""

import zipfile
from collections.abc import Iterator
from xml.parsers import expat

_CHUNK = 1 << 16
_MOST = 100_000
"""Styles, sheets and links of a workbook; spreadsheet programs write 64 000 styles at most."""
_LONGEST_TEXT = 32_767
"""Characters of a cell, by the format."""


class BadXmlError(Exception):
    """XML that no workbook has."""


def cell_text(parts: list[str]) -> str:
    """Text of a cell from its parts.

    Raises:
        BadXmlError: it is longer than the format allows.
    """
    text = "".join(parts)
    if len(text) > _LONGEST_TEXT:
        raise BadXmlError(f"a cell holds {len(text)} characters, the format allows {_LONGEST_TEXT}")
    return text


def elements(
    archive: zipfile.ZipFile,
    part: str,
    tags: set[str],
    ends: frozenset[str] | set[str] = frozenset(),
) -> Iterator[tuple[str, dict[str, str], bool]]:
    """Tag, attributes and whether it ended, of some elements of a part."""
    out: list[tuple[str, dict[str, str], bool]] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        if tag in tags:
            out.append((tag, attributes, False))
            if len(out) > _MOST:
                raise BadXmlError(f"{part} lists over {_MOST} things")

    def end(tag: str) -> None:
        if tag in ends:
            out.append((tag, {}, True))

    parse_xml(archive, part, start, end, lambda _: None)
    yield from out


def parse_xml(archive: zipfile.ZipFile, part: str, start, end, data) -> None:  # noqa: ANN001
    """Hand the events of a part's XML on, names without their namespace."""
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True

    def local(name: str) -> str:
        return name.rpartition(" ")[2]

    parser.StartElementHandler = lambda tag, attributes: start(
        local(tag), {local(name): value for name, value in attributes.items()}
    )
    parser.EndElementHandler = lambda tag: end(local(tag))
    parser.CharacterDataHandler = data

    def refuse(*_: object) -> None:
        # Entities may grow without bound.
        raise BadXmlError("its XML declares a document type, which no workbook does")

    parser.StartDoctypeDeclHandler = refuse
    with archive.open(part) as source:
        while chunk := source.read(_CHUNK):
            parser.Parse(chunk, False)
        parser.Parse(b"", True)
