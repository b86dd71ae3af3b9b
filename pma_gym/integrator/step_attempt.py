"""Step-size control: a step attempt's length, whether it is accepted, the next one's length."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pma_gym.codegen.generic import from_bits, to_bits, where
from pma_gym.codegen.graph import CHANGING, FIXED, Value
from pma_gym.codegen.trace import order, substitute
from pma_gym.integrator.cascaded_states import cascaded_states, cascaded_step
from pma_gym.integrator.equations import Equations
from pma_gym.integrator.events import locate_event, predict_event, turns
from pma_gym.integrator.exponential_rosenbrock import step

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
