"""Event location: steps end where the rates have a kink, and near where a law changes form.

At an event (a zero of an event function) a step ends exactly, or its order would be lost: a step
that has passed one is rejected. At a breakpoint, where a law only changes form smoothly, it ends
close to it, so that no step is rejected because of it. Both are predicted from where states stand
and how fast they move as a step begins.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pma_gym.codegen.generic import square_root, where
from pma_gym.codegen.graph import Value
from pma_gym.codegen.trace import substitute
from pma_gym.integrator.equations import Equations, Event, State
from pma_gym.integrator.exponential_rosenbrock import Step

AIMED = 0.9995
"""Share of a step behind which an event has been aimed at."""

BEYOND = 1.0001
"""How far a step goes on to be surely past an event, as a factor of the way there."""

PAST = 1.01
"""Share of the rest of the way to an event that is made."""

SHORT = 0.96
"""Share of the way to an event that is made first: the rest, predicted anew, is known exactly."""

CLOSE = 0.1
"""An event within this share of the proposed step is the end of the next."""

BREAKPOINT = 1.02
"""Share of the way to a breakpoint that is made."""

SPENT = 0.1
"""Share of the way by which a step may miss where the slide turns that is left of it where it has
as good as turned."""

NEGLIGIBLE = 0.05
"""Breakpoints within this share of the proposed step are not waited for."""

SAME = 1e-9
"""Share of the way to a breakpoint within which a stage is at it: rounding."""

LEAST_AIM_S = 3e-7
"""No step is made shorter than this (s) to end at an event."""

FAR_S = 1e9
"""Time to an event (s) where there is none."""


@dataclass(frozen=True)
class PredictedEvent:
    """The next event or breakpoint ahead of a step.

    Attributes:
        length: how long a step may be (s).
        landing: whether that takes it to an event.
    """

    length: Value
    landing: Value


def predict_event(
    eq: Equations, size: Value, frozen: Mapping[int, Value], here: Mapping[int, Value]
) -> PredictedEvent | None:
    """Predict how long a step may be; None where no event or breakpoint can lie ahead.

    Args:
        eq: the plant's equations.
        size: proposed size of the step (s).
        frozen: what is fixed for the step, by id.
        here: what holds at its beginning, by id.
    """
    if not eq.events and not eq.breakpoints and not eq.path_breakpoints:
        return None
    graph, begin = eq.graph, {**frozen, **here}
    along = graph.constant(1.0)
    if eq.travelled is not None:
        # By the speed alone, which is there at once: it is wrong only where the slide turns, and
        # how long a step may be is waited for by all else.
        begin[eq["direction"].id] = along = where(eq.travelled[1] < 0.0, -1.0, 1.0)
    considered: list[tuple[Value, Value, Value]] = []

    def consider(is_ahead: Value, its_way: Value, its_speed: Value, is_event: bool) -> None:
        far = (graph.constant(1.0), graph.constant(1.0 / FAR_S))
        way, speed = (where(is_ahead, a, b) for a, b in zip((its_way, its_speed), far, strict=True))
        considered.append((way, speed, graph.constant(is_event, "truth")))

    for event in eq.events:
        value, rate = substitute([event.value, event.rate], begin)
        coming = (value * rate < 0.0) & (abs(value) > event.overshoot)
        if event.turning:
            coming = (value * rate < 0.0) & ~turns(event, value, rate)
        consider(coming, abs(value), abs(rate), True)
    for breakpoint in eq.breakpoints:
        value, rate = substitute([breakpoint.value, breakpoint.rate], begin)
        left = abs(value) > (NEGLIGIBLE * size) * abs(rate)
        consider((value * rate < 0.0) & left, abs(value), abs(rate), False)
    for its_way in eq.path_breakpoints:
        # At the mean of the speeds here and there, with the acceleration as it is here.
        assert eq.travelled is not None
        (rate,) = substitute([eq.rate_of(eq.travelled[1])], begin)
        (its_way,) = substitute([its_way], begin)
        now = along * eq.travelled[1]
        square = now * now + 2.0 * its_way * (along * rate)
        twice = now + square_root(where(square > 0.0, square, 0.0))
        left = 2.0 * its_way > (NEGLIGIBLE * size) * twice
        consider((square > 0.0) & left, 2.0 * its_way, twice, False)
    way, speed, exact = _soonest(considered)
    soon = way / speed
    landing = exact & (soon < CLOSE * size)
    length = soon * where(landing, PAST, where(exact, SHORT, BREAKPOINT))
    return PredictedEvent(where(length > LEAST_AIM_S, length, LEAST_AIM_S), landing)


def _soonest(considered: list[tuple[Value, Value, Value]]) -> tuple[Value, Value, Value]:
    """The soonest of ways and speeds, and its truth: in rounds, of two that stand side by side.

    They are compared as quotients, so that it takes one division whatever there is.
    """
    while len(considered) > 1:
        won = []
        for first, second in zip(considered[::2], considered[1::2], strict=False):
            sooner = second[0] * first[1] < first[0] * second[1]
            won.append(tuple(where(sooner, b, a) for a, b in zip(first, second, strict=True)))
        considered = won + considered[2 * len(won) :]
    return considered[0]


def turns(event: Event, speed: Value, rate: Value) -> Value:
    """Test for an imminent reversal of motion, by the speed and its rate."""
    return (speed * rate < 0.0) & (speed * speed < (SPENT * event.overshoot) * abs(rate))


def locate_event(
    eq: Equations,
    leading: Sequence[State],
    made: Step,
    length: Value,
    frozen: Mapping[int, Value],
    here: Mapping[int, Value],
    moved: Mapping[int, Value],
) -> tuple[Value, Value]:
    """Locate an event within a step: the share at which it is passed, and if it must not be missed.

    The share is that of the last of the events that are passed; the others come in turn.

    Args:
        eq: the plant's equations.
        leading: the states that the step is made with.
        made: the step.
        length: how long it is (s).
        frozen: what is fixed for it, by id.
        here: what holds at its beginning, by id.
        moved: what states are at its end, by the id of what they were.
    """
    graph = eq.graph
    missed = twice = graph.constant(False, "truth")
    start = rate = end = graph.constant(1.0)
    for event in eq.events:
        at_end, at_start, speed = (
            *substitute([event.value], {**frozen, **moved}),
            *substitute([event.value, event.rate], {**frozen, **here}),
        )
        if event.turning:
            sign = frozen[eq["direction"].id]
        else:
            still = where(speed < 0.0, -1.0, 1.0)
            sign = where(at_start > 0.0, 1.0, where(at_start < 0.0, -1.0, still))
        twice = twice | _passed_twice(leading, event, made, length, frozen, sign)
        beyond = -sign * at_end
        # Way beyond the point of turning, or penetration times its share of the step, by the speed
        # at which the parabola through both ends comes there.
        over = beyond * beyond * (0.5 * length if event.turning else 1.0)
        coming = 2.0 * (at_end - at_start) - speed * length
        is_crossed = (beyond > 0.0) & (over > event.overshoot * abs(coming))
        if event.turning:
            # As good as turned, it may go on as it did for longer than was thought.
            turns_late = sign * at_start < 0.0
            twice = twice | (turns_late & (beyond * length > event.overshoot))
            is_crossed = is_crossed & ~turns_late
        missed = missed | is_crossed
        start = where(is_crossed, sign * at_start, start)
        rate = where(is_crossed, sign * speed, rate)
        end = where(is_crossed, sign * at_end, end)
    slope = rate * length
    curvature = end - start - slope
    inside = slope * slope - 4.0 * curvature * start
    root = square_root(where(inside > 0.0, inside, 0.0))
    # The form of the solution that adds what has one sign: where an event function first moves off,
    # from as good as zero, the difference of root and slope has no right digit, and may be zero.
    off = slope > 0.0
    share = where(off, root + slope, 2.0 * start) / where(off, -2.0 * curvature, root - slope)
    # What lies in the last bit of the step has been aimed at: no step aims twice.
    aimed = start + AIMED * (slope + AIMED * curvature) >= 0.0
    missed = (missed & ~aimed) | twice
    # From rest the way back may begin at once: 0 / 0, which is no share above 0.05. Whatever is
    # rejected is tried again shorter, or it would be tried for ever.
    share = where((end < 0.0) & ~aimed, where(share > 0.05, BEYOND * share, 0.05), 0.5)
    unseen, bent = _unseen(eq, leading, made, frozen, here, moved)
    return where(unseen & ~missed, BREAKPOINT * bent, share), missed | unseen


def _unseen(
    eq: Equations,
    leading: Sequence[State],
    made: Step,
    frozen: Mapping[int, Value],
    here: Mapping[int, Value],
    moved: Mapping[int, Value],
) -> tuple[Value, Value]:
    """Whether a breakpoint lies behind the last stage, seen by no rate; its share of the step."""
    graph, begin = eq.graph, {**frozen, **here}
    unseen, share = graph.constant(False, "truth"), graph.constant(1.0)
    stage = {s.value.id: value for s, value in zip(leading, made.visited[-1], strict=True)}
    courses = [
        [substitute([breakpoint.value], {**frozen, **at})[0] for at in ({}, stage, moved)]
        for breakpoint in eq.breakpoints
    ]
    for way in eq.path_breakpoints:
        assert eq.travelled is not None
        (first,) = substitute([way], begin)
        place, along = eq.travelled[0], frozen[eq["direction"].id]
        courses.append(
            [first, *(first - along * (at[place.id] - place) for at in (stage, moved))],
        )
    for first, there, last in courses:
        # Not what has been aimed at.
        far = abs(last) > NEGLIGIBLE * abs(first)
        # A last stage at the breakpoint itself sees it as little as one before it.
        before = first * (there + SAME * first) > 0.0
        is_unseen = before & (first * last < 0.0) & far
        unseen = unseen | is_unseen
        share = where(is_unseen, first / (first - last), share)
    return unseen, share


def _passed_twice(
    leading: Sequence[State],
    event: Event,
    made: Step,
    length: Value,
    frozen: Mapping[int, Value],
    sign: Value,
) -> Value:
    """Whether an event was passed and passed again on the way, such as by turning twice."""
    least = event.overshoot * (10.0 if event.turning else 1.0)
    crossed = []
    for states in made.visited:
        known = {state.value.id: value for state, value in zip(leading, states, strict=True)}
        (there,) = substitute([event.value], {**frozen, **known})
        beyond = (-0.25 * sign) * there
        crossed.append((beyond * length if event.turning else beyond) > least)
    return crossed[0] | crossed[1]
