"""States that only follow the others, such as a sensor's lag: stepped when these have been.

A follower's rate is S - d y, with a decay d that is fixed for the model and a source S of the other
states, none of which depends on it. Its equation is linear, and where the others are at a step's
ends is known when its turn comes. So it takes two evaluations of its rate in place of the stages of
the integrator, with as high an order.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from pma_gym.codegen.derivative import derivatives
from pma_gym.codegen.graph import CHANGING, HELD, Value
from pma_gym.codegen.substitute import substitute
from pma_gym.codegen.trace import live_inputs, operation_counts
from pma_gym.integrator.equations import Equations, State

DEAREST = 80
"""Operations that the rate of a source may take at most. A position's or a pressure's takes 1 to
30, with whatever effects; that of a force, which needs all accelerations, 160 and more, and costs
more than the integrator's stages."""


@dataclass(frozen=True)
class Follower:
    """A state that follows.

    Attributes:
        state: the state.
        decay: its decay d (1/s).
        drift: rate of its source S.
    """

    state: State
    decay: Value
    drift: Value


def followers(eq: Equations) -> list[Follower]:
    """The states of a plant that follow."""
    found = []
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
            found.append(Follower(state, -slope, drift))
    return found


def _is_followed(eq: Equations, state: State) -> bool:
    """Whether anything but itself depends on a state."""
    others = [other.rate for other in eq.states if other is not state]
    paths = [path.after for path in eq.paths]
    switches = [value for switch in eq.switches for value in (switch.value, switch.rate)]
    bends = [value for bend in eq.bends for value in (bend.value, bend.rate)]
    known = live_inputs([*others, *paths, *switches, *bends])
    return any(value is state.value for value in known)


def followed(
    follower: Follower, length: Value, start: Mapping[int, Value], end: Mapping[int, Value]
) -> Value:
    """A follower at the end of a step.

        y1 = y0 + h / (1 + e / 2 + e^2 / 12)
                  ((g0 + g1) / 2 + e (g1 - g0) / 12 + h (S'0 - S'1) / 12),   e = h d

    Here g0 and g1 are its rates S - d y0 with the source at either end. It is the formula of order
    4 with two derivatives at two points (Hermite and Obreschkoff), solved for y1, and stable for
    every d.

    Args:
        follower: the follower.
        length: the step's length h (s).
        start: what holds at the step's beginning, by id.
        end: what the other states are at its end, by id.
    """
    state, twelfth = follower.state, length * (1.0 / 12.0)
    first, before = substitute([state.rate, follower.drift], start)
    last, after = substitute([state.rate, follower.drift], end)
    way = length * follower.decay
    mean = 0.5 * (first + last) + (follower.decay * twelfth) * (last - first)
    share = length / (1.0 + way * (0.5 + way * (1.0 / 12.0)))
    return state.value + share * (mean + twelfth * (before - after))
