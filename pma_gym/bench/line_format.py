"""Lines between host and firmware: words, an asterisk and a checksum; see docs/bench.md."""

import binascii
import math
import re

from pma_gym.bench.rig import RigError

LONGEST = 240
"""Most bytes of a line, its end included."""

_LINE = re.compile(rb"([A-Z](?: [ -)+-~]+)?)\*([0-9A-F]{4})\r?")
_NUMBER = re.compile(r"-?\d{1,18}(?:\.\d{1,18})?(?:e[+-]?\d{1,3})?")


def encoded(*words: object) -> bytes:
    r"""The line of some words, with its checksum, CRC-16 with polynomial 1021 from FFFF.

    >>> encoded("R", 7)
    b'R 7*BC60\n'
    """
    text = " ".join(f"{word:.9g}" if isinstance(word, float) else str(word) for word in words)
    content = text.encode("ascii", "replace")
    return b"%s*%04X\n" % (content, binascii.crc_hqx(content, 0xFFFF))


def decoded(line: bytes) -> list[str]:
    """The words of a line without its end.

    Raises:
        RigError: the line is too long, or its characters or its checksum are wrong.
    """
    if len(line) >= LONGEST:
        raise RigError(f"a line must be shorter than {LONGEST} bytes, got {line[:20]!r}...")
    match = _LINE.fullmatch(line)
    if match is None:
        raise RigError(f"a line must be words, '*' and four hexadecimal digits, got {line!r}")
    sum_of_words = b"%04X" % binascii.crc_hqx(match[1], 0xFFFF)
    if sum_of_words != match[2]:
        raise RigError(f"the checksum must be {sum_of_words.decode()}, got {line!r}")
    return match[1].decode("ascii").split(" ")


def numbers(words: list[str], count: int) -> list[float]:
    """So many finite numbers of words.

    Raises:
        RigError: another count, or a word that is no finite number.
    """
    values = [float(word) for word in words if _NUMBER.fullmatch(word)]
    if len(values) != len(words) or len(words) != count or not all(map(math.isfinite, values)):
        raise RigError(f"there must be {count} numbers, got {' '.join(words)!r}")
    return values


class LineBuffer:
    """Bytes of a line as they arrive; what is too long is cut, never kept.

    Attributes:
        count: lines that were complete.
    """

    def __init__(self) -> None:
        self.count = 0
        self._rest = b""

    def lines(self, received: bytes) -> list[bytes]:
        """Lines that are complete now, without their ends, cut where they are too long."""
        *complete, rest = (self._rest + received).split(b"\n")
        self._rest = rest[:LONGEST]
        self.count += len(complete)
        return [line[:LONGEST] for line in complete]
