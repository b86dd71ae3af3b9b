"""Dates of workbooks: numbers of days, shown as dates by the format of their cell."""

import datetime
import re

EPOCH_1900 = datetime.datetime(1899, 12, 30)
"""Day 0; Excel counts a 29 February 1900 that never was, so days from 61 on are right."""
EPOCH_1904 = datetime.datetime(1904, 1, 1)

_BUILT_IN = set(map(str, (*range(14, 23), *range(27, 37), *range(45, 48), *range(50, 59))))
"""Numbers of the formats for dates that every workbook has."""
_QUOTED = re.compile(r'"[^"]*"|\\.|_.|\*.|\[(?!h+\]|m+\]|s+\])[^\]]*\]', re.IGNORECASE)
_LONGEST = 255


def is_date_format(number: str, code: str | None) -> bool:
    """Whether a number format shows a date, a time or a duration.

    Args:
        number: of the format.
        code: its text, if the workbook gives one.

    Example:
        >>> is_date_format("164", "yyyy-mm-dd hh:mm:ss.000"), is_date_format("165", '0.00" m"')
        (True, False)
    """
    if code is None:
        return (
            number.isascii() and number.isdigit() and len(number) < 6 and int(number) in _BUILT_IN
        )
    bare = _QUOTED.sub("", code[:_LONGEST].partition(";")[0]).lower()
    return "general" not in bare and any(letter in bare for letter in "dmyhs")


def date_of(days: float, epoch: datetime.datetime) -> datetime.datetime | None:
    """The date of a number of days; None beyond the calendar.

    A time of day without a date is one of day 0.
    """
    if not abs(days) < 3e6:
        return None
    try:
        # Spreadsheets keep 15 digits of days, some microseconds.
        return epoch + datetime.timedelta(microseconds=round(days * 86_400e6))
    except OverflowError:
        return None
