"""Step-size control: a step attempt's length, whether it is accepted, the next one's length.

Cascaded states: driven by the others without feedback, such as a sensor's lag; stepped last.

A cascaded state's rate is S - d y, with a decay d that is fixed for the model and a source S of the
other states, none of which depends on it. Its equation is linear, and where the others are at a
step's ends is known when its turn comes. So it takes two evaluations of its rate in place of the
stages of the integrator, with as high an order.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pma_gym.codegen.derivative import derivatives
from pma_gym.codegen.generic import from_bits, to_bits, where
from pma_gym.codegen.graph import CHANGING, FIXED, HELD, Value
from pma_gym.codegen.trace import live_inputs, operation_counts, order, substitute
from pma_gym.integrator.equations import Equations, State
from pma_gym.integrator.events import locate_event, predict_event, turns
from pma_gym.integrator.exponential_rosenbrock import step

DEAREST = 80
"""Operations that the rate of a source may take at most. A position's or a pressure's takes 1 to
30, with whatever effects; that of a force, which needs all accelerations, 160 and more, and costs
more than the integrator's stages."""


@dataclass(frozen=True)
class CascadedState:
    """A state that the others drive and that drives none of them.

    Attributes:
        state: the state.
        decay: its decay d (1/s).
        drift: rate of its source S.
    """

    state: State
    decay: Value
    drift: Value


def cascaded_states(eq: Equations) -> list[CascadedState]:
    """The cascaded states of a plant."""
    cascaded = []
    for i, state in enumerate(eq.states):
        if state.scale is None or _is_followed(eq, state):
            continue
        (row,) = derivatives([state.rate], [other.value for other in eq.states])
        slope = row[i]
        if slope is None or slope.level > HELD:
            continue
        drift = eq.graph.constant(0.0)
        for other, part in zip(eq.states, row, strict=True):
            if part is not None and other is not state:
                drift = drift + part * other.rate
        if sum(operation_counts([drift], CHANGING).values()) <= DEAREST:
            cascaded.append(CascadedState(state, -slope, drift))
    return cascaded


def _is_followed(eq: Equations, state: State) -> bool:
    """Whether anything but itself depends on a state."""
    others = [other.rate for other in eq.states if other is not state]
    memories = [memory.after for memory in eq.rate_independent_states]
    ends = [value for end in (*eq.events, *eq.breakpoints) for value in (end.value, end.rate)]
    known = live_inputs([*others, *memories, *ends])
    return any(value is state.value for value in known)


def cascaded_step(
    cascaded: CascadedState, length: Value, start: Mapping[int, Value], end: Mapping[int, Value]
) -> Value:
    """A cascaded state at the end of a step.

        y1 = y0 + h / (1 + e / 2 + e^2 / 12)
                  ((g0 + g1) / 2 + e (g1 - g0) / 12 + h (S'0 - S'1) / 12),   e = h d

    Here g0 and g1 are its rates S - d y0 with the source at either end. It is the formula of order
    4 with two derivatives at two points (Hermite and Obreschkoff), solved for y1, and stable for
    every d.

    Args:
        cascaded: the cascaded state.
        length: the step's length h (s).
        start: what holds at the step's beginning, by id.
        end: what the other states are at its end, by id.
    """
    state, twelfth = cascaded.state, length * (1.0 / 12.0)
    first, before = substitute([state.rate, cascaded.drift], start)
    last, after = substitute([state.rate, cascaded.drift], end)
    way = length * cascaded.decay
    mean = 0.5 * (first + last) + (cascaded.decay * twelfth) * (last - first)
    share = length / (1.0 + way * (0.5 + way * (1.0 / 12.0)))
    return state.value + share * (mean + twelfth * (before - after))


SAFETY = 0.8
SHRINK, GROW = 0.1, 6.0
"""How much smaller or larger the next attempt is than this one, at most."""

LEAST_S = 1e-7
"""A step of this length (s) is accepted whatever its error."""

SHORTER = 0.999
"""Largest share of its length at which a step that passed an event is tried again: where no smaller
one is found it is halved, or it would be tried for ever."""

LOST = 1e20
"""A step of the least length with such an error, or with one that is no number, ends the span: the
integration stops, and states that are no numbers mark the trial as failed."""

LANDED_S = 1.2e-4
"""First step after an event (s), at most: friction turns within some hundredths of a millimetre."""


@dataclass(frozen=True)
class StepAttempt:
    """An attempt at a step, as values.

    Attributes:
        size: proposed size at its beginning (s), an input.
        left: time left until the end of the span (s), an input.
        tolerance: largest error of a step, as a share of the states' scales, an input.
        accepted: whether its error is within the tolerance.
        length: how long it is (s).
        before: states and memories at its beginning, inputs.
        moved: what states and memories are at its end if it is accepted, by the id of what they
            were.
        frozen: what is fixed for the step, by id.
        here: what holds at its beginning, by id.
        states: states and memories after it, as they were if it is rejected.
        next_size: proposed size of the next.
        next_left: time left after it.
    """

    size: Value
    left: Value
    tolerance: Value
    accepted: Value
    length: Value
    before: list[Value]
    moved: dict[int, Value]
    frozen: dict[int, Value]
    here: dict[int, Value]
    states: list[Value]
    next_size: Value
    next_left: Value


def step_attempt(eq: Equations, positions: Mapping[str, float]) -> StepAttempt:
    """An attempt at a step of a plant.

    Args:
        eq: its equations.
        positions: states that are asked for more exactly than the others, and their tolerance
            beside that of the others.
    """
    graph = eq.graph
    size, left = graph.input("size", CHANGING), graph.input("left", CHANGING)
    tolerance = graph.input("tolerance", FIXED)
    # Two halves instead of a step and a scrap.
    length = where(left <= size, left, where(left < 2.0 * size, 0.5 * left, size))
    frozen, here = step_start(eq)
    frozen = frozen | _signs(eq, frozen)
    predicted, landing = predict_event(eq, size, frozen, here), graph.constant(False, "truth")
    if predicted is not None:
        sooner = predicted.length < length
        landing = predicted.landing & sooner
        length = where(sooner, predicted.length, length)
    behind = cascaded_states(eq)
    leading = [s for s in eq.states if all(s is not cascaded.state for cascaded in behind)]
    made = step(leading, length, frozen, here)
    moved = {s.value.id: new for s, new in zip(leading, made.states, strict=True)}
    ends = {**frozen, **moved}
    for cascaded in behind:
        new = cascaded_step(cascaded, length, {**frozen, **here}, ends)
        moved[cascaded.state.value.id] = new
    states = [moved[state.value.id] for state in eq.states]
    square = graph.constant(0.0)
    for state, error in zip(leading, made.errors, strict=True):
        if state.scale is None:
            continue
        scale = state.scale * positions.get(state.name, 1.0)
        share = error * (1.0 / (scale * tolerance))
        square = square + share * share
    allowed = _allowed(eq)
    factor = SAFETY * _inverse_eighth_root(square, allowed)
    factor = where(factor > SHRINK, where(factor < GROW, factor, GROW), SHRINK)
    exact = square <= allowed
    share, missed = locate_event(eq, leading, made, length, frozen, here, moved)
    # What lies beyond an event is not needed: a step that passed one is not made anew beyond it.
    share = where(share < SHORTER, share, 0.5)
    factor = where(missed & (exact | (share < factor)), share, factor)
    accepted = (exact & ~missed) | (length <= LEAST_S)
    proposed = length * factor
    # A step cut short by the end of the span says little against the size before.
    cut = accepted & (length < size) & (proposed < size)
    after = substitute([memory.after for memory in eq.rate_independent_states], {**frozen, **moved})
    landed = where(size < LANDED_S, size, LANDED_S)
    memories = eq.rate_independent_states
    before = [state.value for state in eq.states] + [memory.value for memory in memories]
    return StepAttempt(
        size=size,
        left=left,
        tolerance=tolerance,
        accepted=accepted,
        length=length,
        before=before,
        moved=moved,
        frozen=frozen,
        here=here,
        states=[
            where(accepted, new, old) for new, old in zip([*states, *after], before, strict=True)
        ],
        next_size=where(
            landing & accepted,
            landed,
            where(cut, size, where(proposed > LEAST_S, proposed, LEAST_S)),
        ),
        # States that are no numbers any more need no small steps to the end of the span.
        next_left=where(accepted, where(square < LOST, left - length, 0.0), left),
    )


def first_size(size: Any, jump: Any) -> Any:  # noqa: ANN401
    """Size of the first attempt after a command that jumps (s), of numbers or traced values.

    Args:
        size: size that the attempts before had come to (s).
        jump: how far the command jumps (V).
    Returns:
        The same, but 1 ms at most after a jump of 1 V, and less with its fourth root.
    """
    most = JUMP_S * _inverse_eighth_root(jump * jump, 1.0)
    return where(size < most, size, most)


JUMP_S = 1e-3
"""First attempt after a jump of 1 V (s): longer ones are rejected more often than they save."""


def step_start(eq: Equations) -> tuple[dict[int, Value], dict[int, Value]]:
    """Values that are constant over a step, and those at its start."""
    if eq.travelled is None:
        return {}, {}
    way, speed = eq.travelled
    here = {memory.after.id: memory.value for memory in eq.rate_independent_states}
    if eq.travel is not None:
        here[eq.travel.id] = eq.graph.constant(0.0)
    (rate,) = substitute([eq.rate_of(speed)], here)
    onwards = where(rate < 0.0, -1.0, 1.0)
    direction = where(speed > 0.0, 1.0, where(speed < 0.0, -1.0, onwards))
    for event in eq.events:
        if event.turning:
            direction = where(turns(event, speed, rate), onwards, direction)
    return {eq["origin"].id: way, eq["direction"].id: direction}, here


def _signs(eq: Equations, frozen: Mapping[int, Value]) -> dict[int, Value]:
    """What laws ask of the sign of the slide's velocity, by its direction in the step.

    No step goes on beyond where the slide turns, but one may begin before, where it has as good as
    turned. A damping that differs by direction is then that of the way which the step goes.
    """
    if eq.travelled is None:
        return {}
    speed, direction = eq.travelled[1], frozen[eq["direction"].id]
    signs = {}
    for value in order([state.rate for state in eq.states]):
        if value.operation not in ("less", "less_equal"):
            continue
        left, right = value.operands
        if left is speed and right.is_constant and right.data == 0.0:
            signs[value.id] = direction < 0.0
        elif right is speed and left.is_constant and left.data == 0.0:
            signs[value.id] = direction > 0.0
    return signs


def _allowed(eq: Equations) -> Value:
    """Squared error that a step may have: 1 at rest, more the faster the slide moves.

    An error counts against the range of a trial, and what moves at 0.5 m/s is not held to 10 nm.
    """
    if eq.travelled is None:
        return eq.graph.constant(1.0)
    share = eq.travelled[1] * (1.0 / SWIFT_M_PER_S)
    square = share * share
    return 1.0 + where(square < SWIFTEST, square, SWIFTEST)


SWIFT_M_PER_S, SWIFTEST = 0.075, 36.0
"""Speed of the slide at which twice the squared error is allowed (m/s), and the most that is added
to it: the error of one step stays about a millionth of the range of a position."""


def _inverse_eighth_root(square: Any, allowed: Any) -> Any:  # noqa: ANN401
    """(square / allowed)^(-1/8) within some 10 %, by the bits of the exponents.

    The error of a step goes with h^4, and comes squared. Below 1e-9 it is taken for that.
    """
    floored = where(square < 1e-9, 1e-9, square)
    bits = to_bits(floored) + _ONE_BITS - to_bits(allowed)
    return from_bits(_ONE_BITS + (_ONE_BITS >> 3) - (bits >> 3))


_ONE_BITS = 1023 << 52
"""Bits of 1.0."""
