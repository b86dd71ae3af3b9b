"""Shared parts of a workbook: its sheets' names, texts and styles."""

import datetime
import posixpath
import zipfile

from pma_gym.data.readers.xlsx.dates import EPOCH_1900, EPOCH_1904, is_date_format
from pma_gym.data.readers.xlsx.xml import BadXmlError, cell_text, elements, parse_xml
from pma_gym.limits import check_limit, limit

TEXTS, STYLES = "xl/sharedStrings.xml", "xl/styles.xml"
_BOOK, _LINKS = "xl/workbook.xml", "xl/_rels/workbook.xml.rels"


def sheet_names(
    archive: zipfile.ZipFile, names: set[str]
) -> tuple[list[tuple[str, bool, str]], datetime.datetime]:
    """Title, whether hidden, and part of each sheet; and where its dates begin to count."""
    links: dict[str, str] = {}
    for tag, attributes, _ in elements(archive, _LINKS, {"Relationship"}):
        assert tag
        target = attributes.get("Target", "")
        part = target.lstrip("/") if target.startswith("/") else posixpath.join("xl", target)
        links[attributes.get("Id", "")] = posixpath.normpath(part)
    sheets: list[tuple[str, bool, str]] = []
    epoch = EPOCH_1900
    for tag, attributes, _ in elements(archive, _BOOK, {"sheet", "workbookPr"}):
        if tag == "workbookPr":
            if attributes.get("date1904", "") in ("1", "true"):
                epoch = EPOCH_1904
            continue
        part = links.get(attributes.get("id", ""), "")
        # A sheet that is a chart has no cells.
        if part in names and "worksheets" in part:
            hidden = attributes.get("state", "visible") != "visible"
            sheets.append((attributes.get("name", ""), hidden, part))
    if not sheets:
        raise BadXmlError("it has no sheet")
    return sheets, epoch


def date_styles(archive: zipfile.ZipFile) -> set[int]:
    """Numbers of the styles that show a cell as a date or a time."""
    formats: dict[str, str] = {}
    dates: set[int] = set()
    inside, index = False, 0
    for tag, attributes, ended in elements(
        archive, STYLES, {"numFmt", "cellXfs", "xf"}, ends={"cellXfs"}
    ):
        if tag == "numFmt":
            formats[attributes.get("numFmtId", "")] = attributes.get("formatCode", "")
        elif tag == "cellXfs":
            inside = not ended
        elif inside:
            number = attributes.get("numFmtId", "0")
            if is_date_format(number, formats.get(number)):
                dates.add(index)
            index += 1
    return dates


def shared_texts(archive: zipfile.ZipFile, file: str) -> list[str]:
    """Texts that cells refer to by number."""
    texts: list[str] = []
    parts: list[str] = []
    state = {"t": False, "rPh": 0}
    most = limit("cells")

    def start(tag: str, _: dict[str, str]) -> None:
        if tag == "si":
            parts.clear()
        elif tag == "rPh":
            state["rPh"] += 1
        state["t"] = tag == "t" and not state["rPh"]

    def end(tag: str) -> None:
        if tag == "si":
            texts.append(cell_text(parts))
            if len(texts) > most:
                check_limit(file, "cells", len(texts))
        elif tag == "rPh":
            state["rPh"] -= 1
        state["t"] = False

    def data(text: str) -> None:
        if state["t"]:
            parts.append(text)

    parse_xml(archive, TEXTS, start, end, data)
    return texts
