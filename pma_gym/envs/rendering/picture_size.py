"""Size of pictures."""

from numbers import Integral

USUAL_WIDTH = 800
"""Usual width of a picture (pixels); every picture is half as high as wide."""

LEAST_WIDTH, MOST_WIDTH = 400, 3200


def check_render_width(width: object) -> int:
    """Check the width of pictures and return it.

    It must be a multiple of 4, so that the height is even, as H.264 videos need.

    Raises:
        ValueError: with the rule, the unit and the invalid value.
    """
    whole = isinstance(width, Integral) and not isinstance(width, bool)
    if not whole or not LEAST_WIDTH <= int(width) <= MOST_WIDTH or int(width) % 4:  # type: ignore[call-overload]
        raise ValueError(
            f"render_width must be a multiple of 4 in {LEAST_WIDTH}-{MOST_WIDTH} pixels (a picture "
            f"is half as high), got {width!r}; leave it out for {USUAL_WIDTH}"
        )
    return int(width)  # type: ignore[call-overload]
