"""The cable pulls, has slack, cannot push; the drive winds in and cannot unwind.

The cascade is the dissertation's linear model, with its map, and with the motor's inertia.
"""

import control
import numpy as np
import pytest

from pma_gym.data.serres2008 import load_table
from pma_gym.effects.drive.position_map import mapped_displacement
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.statics import Condition

FINE = 1e-5
"""Time between rows (s), for impulses."""


MAP = load_model("cascade").parameters["position_map"]


SERRES = Plant("serres2008")


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
    start = SERRES.settle(0.0, 400e3)
    when = np.linspace(0.0, 1.0, 501)
    lower = np.full(501, SERRES.regulator_voltage(300e3))
    states, zero = SERRES.run(when, np.zeros(501), lower, condition=start)
    truth = SERRES.observe(states, zero)
    # The muscle lengthens by itself; the pulley has no reason to turn.
    assert truth["extension"][-1] > 0.01
    assert np.all(truth["load"] == 0.0)
    # But for the first step, whose Jacobian stands at the very point where the cable tightens.
    assert np.all(np.abs(truth["rotation"]) < 1e-8)


def test_the_drive_cannot_unwind():
    start = SERRES.settle(0.0, 400e3)
    slack = Condition(start.state.copy(), start.zero_contraction + 0.02)
    spin = SERRES.states.index("spin")
    slack.state[spin] = 1.0
    when = np.linspace(0.0, 0.5, 251)
    regulator = np.full(251, SERRES.regulator_voltage(400e3))
    states, _ = SERRES.run(when, np.zeros(251), regulator, condition=slack)
    # V = 0 asks for -2 N on the line; the drive gives none, and only the bearing slows the rotor.
    expected = np.exp(-7.64e-4 / 2e-3 * when)
    np.testing.assert_allclose(states[:, spin], expected, rtol=1e-9)


def stepped(model, pressure, before, after, rows=201, duration=0.5):
    """Extension over time when the motor voltage steps at constant pressure."""
    plant = Plant(model)
    when = np.linspace(0.0, duration, rows)
    regulator = np.full(rows, plant.regulator_voltage(pressure))
    start = plant.settle(before, pressure)
    states, zero = plant.run(when, np.full(rows, after), regulator, condition=start)
    return plant, when, plant.observe(states, zero)["extension"]


@pytest.mark.parametrize(("pressure", "before", "after"), [(250e3, 1.0, 4.0), (500e3, 6.0, 2.0)])
def test_without_inertia_it_is_eq_22(pressure, before, after):
    plant, when, extension = stepped("cascade", pressure, before, after)
    part = plant.model.parameters
    stiffness, damping = (32.7 - 0.0321 * 250) * 1e3, 1.57e3
    if pressure > 314e3:
        # The motor lets go, so the muscle contracts.
        stiffness, damping = (17.0 + 0.0179 * 500) * 1e3, 2.90e3
    muscle, motor = stiffness / damping, part["servo"].stiffness / part["servo"].damping
    assert motor == pytest.approx(13_428, abs=2)
    system = control.tf([muscle * motor], [1.0, muscle + motor, muscle * motor])
    response = control.step_response(system, when).outputs
    ends = [mapped_displacement(v, pressure, part["position_map"]) for v in (before, after)]
    expected = ends[0] + (ends[1] - ends[0]) * response
    assert np.abs(extension - expected).max() < 1e-6 * abs(ends[1] - ends[0])


def test_with_inertia_it_is_eq_10_and_the_muscle():
    inertial = {"inertia_kg_m2": 2e-3, "damping_ratio": 0.7}
    model = load_model("cascade").with_effects({"servo_inertia": inertial})
    plant, when, extension = stepped(model, 400e3, 1.0, 4.0)
    part = plant.model.parameters
    square = part["servo"].stiffness / 2e-3
    motor = control.tf([square], [1.0, 1.4 * square**0.5, square])
    # The motor overshoots, but the muscle never passes it at 0.7: one damping all the way.
    rate = (17.0 + 0.0179 * 400.0) / (0.311 + 0.00338 * 400.0)
    response = control.step_response(motor * control.tf([rate], [1.0, rate]), when[:60]).outputs
    ends = [mapped_displacement(v, 400e3, part["position_map"]) for v in (1.0, 4.0)]
    expected = ends[0] + (ends[1] - ends[0]) * response
    assert np.abs(extension[:60] - expected).max() < 1e-6 * (ends[1] - ends[0])


def test_the_map_passes_through_table_18_and_is_linear_between_its_rows():
    for row in range(len(MAP.pressure)):
        for voltage in (1.0, 3.0):
            parabola = (MAP.square[row] * voltage + MAP.linear[row]) * voltage + MAP.constant[row]
            displacements = mapped_displacement(voltage, MAP.pressure[row], MAP)
            assert displacements == pytest.approx(max(0.0, parabola), rel=1e-12)
    printed = load_table("18")
    assert set(np.asarray(printed["pressure_kpa"]) * 1e3) <= set(MAP.pressure)
    ends = [mapped_displacement(2.0, pressure, MAP) for pressure in (500e3, 550e3)]
    assert mapped_displacement(2.0, 525e3, MAP) == pytest.approx(sum(ends) / 2.0)


def test_the_map_gives_nothing_at_no_voltage_and_never_falls():
    for pressure in np.linspace(100e3, 600e3, 11):
        along = [mapped_displacement(v, pressure, MAP) for v in np.linspace(0.0, 10.0, 101)]
        assert along[0] < 1e-3
        assert np.all(np.diff(along) >= 0.0)


def test_a_straight_or_rising_map_has_no_peak():
    for square in (0.0, 1e-4):
        bent = MAP._replace(square=tuple(square for _ in MAP.square))
        expected = square * 81.0 + 9.0 * MAP.linear[0] + MAP.constant[0]
        assert mapped_displacement(9.0, 100e3, bent) == pytest.approx(expected)


def contraction_after_a_pressure_step(model):
    """Times (s), and the share of its way that the muscle has gone from 200 to 400 kPa."""
    plant = Plant(model)
    when = np.linspace(0.0, 2.0, 2001)
    regulator = np.full(when.size, plant.regulator_voltage(400e3))
    start = plant.settle(0.0, 200e3)
    states, zero = plant.run(when, np.zeros(when.size), regulator, condition=start)
    contraction = plant.observe(states, zero)["contraction"]
    rest = plant.settle(0.0, 400e3).zero_contraction
    return when, (contraction - start.zero_contraction) / (rest - start.zero_contraction)


def test_a_pressure_step_takes_the_muscles_time_constant():
    """Eq. 16: tau = B / K, 0.12 s at 400 kPa; on top comes the regulator's own lag."""
    tau = 2.90 / (17.0 + 0.0179 * 400.0)
    at_once = load_model("cascade").replace({"regulator_lag.time_constant_s": 1e-4})
    when, share = contraction_after_a_pressure_step(at_once)
    assert np.interp(1.0 - np.exp(-1.0), share, when) == pytest.approx(tau, abs=0.5e-3)
    when, share = contraction_after_a_pressure_step("cascade")
    assert np.interp(1.0 - np.exp(-1.0), share, when) == pytest.approx(0.215, abs=0.01)
