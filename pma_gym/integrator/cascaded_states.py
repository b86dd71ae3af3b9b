"""Cascaded states: driven by the others without feedback, such as a sensor's lag; stepped last.

A cascaded state's rate is S - d y, with a decay d that is fixed for the model and a source S of the
other states, none of which depends on it. Its equation is linear, and where the others are at a
step's ends is known when its turn comes. So it takes two evaluations of its rate in place of the
stages of the integrator, with as high an order.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from pma_gym.codegen.derivative import derivatives
from pma_gym.codegen.graph import CHANGING, HELD, Value
from pma_gym.codegen.trace import live_inputs, operation_counts, substitute
from pma_gym.integrator.equations import Equations, State

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
