"""Text that is safe to show: control codes in names and file names never reach a terminal.

Names, titles, columns and paths come from files of strangers. An escape code in one could move the
cursor, change colours or hide text; a bidi control could reorder a line.
"""

import re

_UNSAFE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufff9-\ufffb"
    "\ud800-\udfff\U000e0000-\U000e007f]"
)
"""Control codes but tab and line feed, bidi controls, bytes of names that are no UTF-8."""


def printable(text: str) -> str:
    r"""Replace control codes and invalid characters of a text by escapes.

    Example:
        >>> printable("a\x1b[31mb"), printable("\udce9t\u00e9")
        ('a\\x1b[31mb', '\\udce9t\xe9')
    """
    return _UNSAFE.sub(lambda match: match[0].encode("unicode_escape").decode(), text)
