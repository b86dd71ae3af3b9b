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


def decode_text(content: bytes, file: str, encoding: str | None = None) -> str:
    """Text of a file.

    Args:
        content: its bytes.
        file: its name, for messages.
        encoding: which encoding to take; None: by mark, else by content. Text that is no UTF-8 is
            read as Windows-1252, in which every byte of a number is what it is in ASCII.
    Returns:
        The text, without a byte order mark.
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
    if "\0" in text:
        raise UnreadableError(
            f"{file} is no text file, it holds zero bytes; save it as 'CSV UTF-8'"
        )
    return text.removeprefix("\ufeff")


def _guess(content: bytes) -> str:
    """Encoding of bytes without a mark."""
    sample = content[:_SAMPLE]
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
