"""States that only follow the others are stepped after them, with as high an order."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pma_gym.codegen.graph import CHANGING, FIXED, Graph
from pma_gym.codegen.text import evaluate
from pma_gym.integrator.equations import State
from pma_gym.integrator.step_attempt import cascaded_states, cascaded_step
from pma_gym.plant.model import load_model
from pma_gym.plant.program import system

FREQUENCY = 3.0


def swing() -> Any:
    """A swing x = cos(3 t), and y that follows it: y' = d (x - y)."""
    graph = Graph()
    x, v, y, end_x, end_v, size = (
        graph.input(name, CHANGING) for name in ("x", "v", "y", "end_x", "end_v", "size")
    )
    d = graph.input("d", FIXED)
    states = [
        State("x", x, v, 1.0),
        State("v", v, -(FREQUENCY**2) * x, 1.0),
        State("y", y, d * x - d * y, 1.0),
    ]
    none: dict[str, list] = {"rate_independent_states": [], "events": [], "breakpoints": []}
    equations: Any = SimpleNamespace(graph=graph, states=states, **none)
    (cascaded,) = cascaded_states(equations)
    assert cascaded.state.name == "y"
    return cascaded_step(cascaded, size, {}, {x.id: end_x, v.id: end_v})


def exact(time: float, decay: float, start: float) -> float:
    """y of the swing: the particular solution, and what is left of the start."""
    part = decay / (decay**2 + FREQUENCY**2)

    def forced(t: float) -> float:
        angle = FREQUENCY * t
        return part * (decay * math.cos(angle) + FREQUENCY * math.sin(angle))

    return forced(time) + (start - forced(0.0)) * math.exp(-decay * time)


def stepped(value: Any, size: float, decay: float, start: float) -> float:
    angle = FREQUENCY * size
    given = {
        **{"x": 1.0, "v": 0.0, "y": start, "size": size, "d": decay},
        **{"end_x": math.cos(angle), "end_v": -FREQUENCY * math.sin(angle)},
    }
    return float(evaluate([value], given)[0])


@pytest.mark.parametrize("decay", [0.5, 4.0, 20.0])
def test_a_step_is_of_order_four(decay):
    value = swing()
    sizes = 0.2 * 0.5 ** np.arange(4) / max(1.0, 0.2 * decay)
    errors = [abs(stepped(value, h, decay, 0.3) - exact(h, decay, 0.3)) for h in sizes]
    orders_seen = np.log2(np.divide(errors[:-1], errors[1:]))
    assert orders_seen[-1] == pytest.approx(5.0, abs=0.3)


@pytest.mark.parametrize("decay", [1e2, 1e4, 1e8])
def test_whatever_is_fast_stays_near_what_it_follows(decay):
    value = swing()
    for size in (1e-3, 1e-2):
        after = stepped(value, size, decay, 1.2)
        assert abs(after - math.cos(FREQUENCY * size)) <= 0.2 + 1e-6


@pytest.mark.parametrize("model", ["station", "serres2008"])
def test_lags_of_positions_and_pressures_follow_and_that_of_a_force_does_not(model):
    equations = system(load_model(model), interpolation="foh").equations
    names = [cascaded.state.name for cascaded in cascaded_states(equations)]
    assert names == ["lag_lvdt", "lag_pressure_transducer", "lag_potentiometer"]


def test_what_others_depend_on_does_not_follow():
    equations = system(load_model("station"), interpolation="zoh").equations
    names = {one.state.name for one in cascaded_states(equations)}
    # The pressure decays towards a command as a lag does, but the muscle needs it.
    assert not names & {"pressure", "contraction", "velocity", "angle", "spin"}
