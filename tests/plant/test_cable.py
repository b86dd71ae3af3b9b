"""The cable pulls, has slack, cannot push; the drive winds in and cannot unwind."""

import numpy as np
import pytest

from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.statics import Condition

FINE = 1e-5
"""Time between rows (s), for impulses."""


@pytest.fixture(scope="module")
def loose():
    """A station with 2 mm of slack."""
    return Plant(load_model("serres2008").replace({"cable.slack_mm": 2.0}))


def held(plant, start, motor, duration, rows):
    """States over time at constant motor voltage and 300 kPa."""
    when = np.linspace(0.0, duration, rows)
    regulator = np.full(rows, plant.regulator_voltage(300e3))
    states, zero = plant.run(when, np.full(rows, motor), regulator, condition=start)
    return when, states, plant.observe(states, zero)


def test_at_rest_the_pulley_has_taken_up_slack_and_stretch(loose):
    part = loose.model.parameters
    for voltage in (0.1, 1.0, 4.0):
        rest = loose.settle(voltage, 300e3)
        seen = {
            k: v[0] for k, v in loose.observe(rest.state[None, :], rest.zero_contraction).items()
        }
        wound = part["rotor"].radius * seen["rotation"]
        stretch = seen["load"] / part["cable"].stiffness
        assert wound == pytest.approx(seen["extension"] + 2e-3 + stretch, rel=1e-12)
        assert seen["load"] == pytest.approx(97.84 * voltage - 2.0, rel=1e-9)


def test_dead_travel_is_the_slack(loose):
    _, states, truth = held(loose, loose.settle(0.0, 300e3), 0.5, 0.3, 30001)
    first = int(np.argmax(truth["load"] > 0.0))
    assert abs(truth["extension"][first - 1]) < 1e-12
    assert 0.0254 * truth["rotation"][first] == pytest.approx(2e-3, rel=1e-2)
    assert np.all(truth["load"][:first] == 0.0)
    # On the way the rotor is driven by L alone: r L t^2 / 2 J but for its own small damping.
    load, when = 97.84 * 0.5 - 2.0, 1e-5 * (first - 1)
    free = 0.5 * 0.0254 * load * when**2 / 2e-3
    assert states[first - 1, loose.states.index("angle")] == pytest.approx(free, rel=2e-2)


def test_slackening_and_tightening_again_keep_the_momentum(loose):
    plant = Plant(loose.model, tolerance=1e-6)
    start = plant.settle(4.0, 300e3)
    begin, states, released = held(plant, start, 0.0, 0.15, 15001)
    assert released["load"][0] > 300.0
    assert released["load"].min() == 0.0
    again = Condition(states[-1].copy(), start.zero_contraction)
    _, pulled, tightened = held(plant, again, 3.0, 0.6, 60001)
    assert tightened["load"][-1] == pytest.approx(97.84 * 3.0 - 2.0, rel=1e-2)
    part = plant.model.parameters
    spin, angle = plant.states.index("spin"), plant.states.index("angle")
    for path, truth, load in ((states, released, 0.0), (pulled, tightened, 97.84 * 3.0 - 2.0)):
        assert np.all(truth["load"] >= 0.0)
        # J dw = r (L t - impulse of the tension) - B_M d theta, through every impact.
        impulse = np.trapezoid(truth["load"], dx=FINE)
        given = part["rotor"].radius * (load * FINE * (len(path) - 1) - impulse)
        given -= part["rotor"].damping * (path[-1, angle] - path[0, angle])
        taken = part["rotor"].inertia * (path[-1, spin] - path[0, spin])
        assert taken == pytest.approx(given, abs=1e-4 * part["rotor"].radius * impulse)
    assert begin[-1] == pytest.approx(0.15)


def test_a_cable_cannot_push():
    plant = Plant("serres2008")
    start = plant.settle(0.0, 400e3)
    when = np.linspace(0.0, 1.0, 501)
    lower = np.full(501, plant.regulator_voltage(300e3))
    states, zero = plant.run(when, np.zeros(501), lower, condition=start)
    truth = plant.observe(states, zero)
    # The muscle lengthens by itself; the pulley has no reason to turn.
    assert truth["extension"][-1] > 0.01
    assert np.all(truth["load"] == 0.0)
    # But for the first step, whose Jacobian stands at the very point where the cable tightens.
    assert np.all(np.abs(truth["rotation"]) < 1e-8)


def test_the_drive_cannot_unwind():
    plant = Plant("serres2008")
    start = plant.settle(0.0, 400e3)
    slack = Condition(start.state.copy(), start.zero_contraction + 0.02)
    spin = plant.states.index("spin")
    slack.state[spin] = 1.0
    when = np.linspace(0.0, 0.5, 251)
    regulator = np.full(251, plant.regulator_voltage(400e3))
    states, _ = plant.run(when, np.zeros(251), regulator, condition=slack)
    # V = 0 asks for -2 N on the line; the drive gives none, and only the bearing slows the rotor.
    expected = np.exp(-7.64e-4 / 2e-3 * when)
    np.testing.assert_allclose(states[:, spin], expected, rtol=1e-9)
