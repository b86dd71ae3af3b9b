"""Bytes of a text file to text: UTF-8, UTF-16 with or without its mark, else Windows-1252."""

import codecs

from pma_gym.data.readers.table import UnreadableError
from pma_gym.data.trial_columns import TrialError
from pma_gym.limits import check_limit

_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    # Before UTF-16's, whose mark begins this one.
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_SAMPLE = 4096
"""Bytes that tell UTF-16 by its zeros."""
_MANY = 0.4
"""Share of zeros at every other byte from which a text is UTF-16: Latin letters and digits."""


def decode_text(
    content: bytes, file: str, encoding: str | None = None
) -> tuple[str, tuple[str, ...]]:
    """Text of a file.

    Zero bytes at its end are what a file system leaves that lost its power: they are passed over,
    and so is a row before them whose end was not written.

    Args:
        content: its bytes.
        file: its name, for messages.
        encoding: which encoding to take; None: by mark, else by content. Text that is no UTF-8 is
            read as Windows-1252, in which every byte of a number is what it is in ASCII.
    Returns:
        The text, without a byte order mark, and remarks on what was passed over.
    Raises:
        UnreadableError: bytes that are no text, or not of that encoding.
        TrialError: no such encoding.
        LimitError: more text than is read.
    """
    check_limit(file, "text_mib", len(content) / 2**20)
    if encoding is None:
        mark, encoding = next(((m, name) for m, name in _MARKS if content.startswith(m)), (b"", ""))
        content = content[len(mark) :]
        encoding = encoding or _guess(content)
    wide = 4 if "32" in encoding else 2 if "16" in encoding else 1
    # Zeros may end within a character of UTF-16.
    missing = -len(content) % wide if content.endswith(b"\0") else 0
    content += bytes(missing)
    try:
        text = content.decode(encoding)
    except UnicodeError as error:
        at = f" (byte {error.start})" if isinstance(error, UnicodeDecodeError) else ""
        said = f"{file} is not {encoding} text{at}; save it as 'CSV UTF-8'"
        raise UnreadableError(said) from None
    except LookupError:
        raise TrialError(
            f"{encoding!r} is no encoding of text; give another, for example 'cp1252'"
        ) from None
    text = text.removeprefix("\ufeff")
    whole = text.rstrip("\0")
    zeros, at = text.count("\0") * wide - missing, text.find("\0")
    if 0 <= at < max(len(whole), 1):
        raise UnreadableError(
            f"{file} holds {zeros} zero bytes, the first in row {_rows(text[:at] + '-')}: it is no "
            "text there; remove them, or save it as 'CSV UTF-8'"
        )
    if not zeros:
        return whole, ()
    said = f"{zeros} zero bytes behind row {_rows(whole)}, as a loss of power leaves them, are "
    if whole.endswith(("\n", "\r")):
        return whole, (f"{said}passed over",)
    last = max(whole.rfind("\n"), whole.rfind("\r"))
    return whole[: last + 1], (f"{said}passed over, and so is that row, whose end is missing",)


def _rows(text: str) -> int:
    """How many rows a text has."""
    return max(text.count("\n"), text.count("\r")) + (not text.endswith(("\n", "\r")))


def _guess(content: bytes) -> str:
    """Encoding of bytes without a mark."""
    sample = content.rstrip(b"\0")[:_SAMPLE]
    even, odd = sample[::2].count(0), sample[1::2].count(0)
    if odd >= _MANY * (len(sample) / 2) > 0 and not even:
        return "utf-16-le"
    if even >= _MANY * (len(sample) / 2) > 0 and not odd:
        return "utf-16-be"
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        # latin-1 names the five bytes that Windows-1252 leaves open.
        open_bytes = bytes(range(0x80, 0xA0)).translate(None, delete=_DEFINED)
        return "latin-1" if any(byte in content for byte in open_bytes) else "cp1252"
    return "utf-8"


_DEFINED = bytes(set(range(0x80, 0xA0)) - {0x81, 0x8D, 0x8F, 0x90, 0x9D})
