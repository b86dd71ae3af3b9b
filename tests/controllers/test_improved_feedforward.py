"""The inverse of the nominal model: exact at rest, smooth, at any rate, better than the replay."""

import math

import numpy as np
import pytest

from controllers import ImprovedFeedforward, SerresReplay
from controllers.models.inverse import inverse_of
from pma_gym.data.serres2008 import pressures
from pma_gym.envs import StationInfo
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.tasks import EVERY_TASK, TASKS

FRICTIONLESS = {"coulomb_friction.static_n": 0.0, "coulomb_friction.dynamic_n": 0.0}
TRIALS = [
    (task, p)
    for task in ("displacement", "rotation")
    for p in pressures(task)[:: len(pressures(task)) - 1]
]


def voltages(station):
    controller = ImprovedFeedforward()
    controller.reset(lambda time: float(station.task.schedule.reference(time)), station)
    steps = station.task.steps(1.0 / station.period)
    return np.array([controller.voltage(k * station.period) for k in range(steps)])


def inverted(station):
    """As the inverse gives them, before they are nominal_rollout."""
    inverse, steps = inverse_of(station.model), station.task.steps(1.0 / station.period)
    parts = inverse.parts(station.period)
    times = np.arange(steps * parts + 1) * station.period / parts
    return inverse.along(station.task.schedule.reference(times), station)


def test_while_held_it_asks_for_the_voltage_that_settles_there():
    model = load_model("serres2008").replace(FRICTIONLESS)
    volts = voltages(StationInfo(model, TASKS["rotation"], 350e3, 0.01))
    plant = Plant(model)
    rest = plant.settle(volts[800], pressure=350e3)
    truth = plant.observe(rest.state[None, :], rest.zero_contraction)
    assert math.degrees(truth["rotation"][0]) == pytest.approx(90.0, abs=1e-3)


def test_lag_is_compensated_by_the_damping_of_the_model():
    # Constant speed, no friction, no hysteresis: L = K y + B y'.
    model = load_model("serres2008").replace(FRICTIONLESS)
    where = StationInfo(model, TASKS["displacement"], 300e3, 0.01)
    plant = Plant(model)
    volts, middle = inverted(where), 5e-3 * 2.505
    static = plant.settle(3.0, pressure=300e3)
    truth = plant.observe(static.state[None, :], static.zero_contraction)
    stiffness = truth["load"][0] / truth["extension"][0]  # serres2008 is linear in x
    damping = 1.57e3 + 7.64e-4 / 25.4e-3**2  # table 2 relaxing; the rotor's own
    load = 97.84 * volts[250] - 2.0
    assert load == pytest.approx(stiffness * middle + damping * 5e-3, abs=1e-6)


def test_cascade_gets_the_lower_root_of_its_map():
    model = load_model("cascade")
    volts = inverted(StationInfo(model, TASKS["displacement"], 300e3, 0.01))
    lag = 1.57e3 / (32.7e3 - 0.0321e3 * 300)
    wanted = 5e-3 * (2.505 + lag)
    assert np.polyval([-0.0005, 0.0107, -0.0050], volts[250]) == pytest.approx(wanted, abs=1e-8)
    assert volts[250] < 0.0107 / (2 * 0.0005)


def test_dead_zone_of_the_map_is_passed_at_once():
    # Table 18 at 300 kPa moves nothing below 0.478 V.
    volts = voltages(StationInfo(load_model("cascade"), TASKS["rotation"], 300e3, 0.01))
    edge = min(np.roots([-0.0005, 0.0107, -0.0050]))
    assert volts[0] == pytest.approx(edge, abs=0.01)


def test_voltage_does_not_chatter(station):
    volts = voltages(station("rotation", 300))
    ramp, hold = volts[100:499], volts[520:999]
    assert np.abs(np.diff(ramp, 2)).max() < 1e-3
    assert np.ptp(hold) < 0.01


@pytest.mark.parametrize(("task", "pressure"), TRIALS)
def test_better_than_the_replay_in_every_phase(task, pressure, drive):
    improved, _ = drive(ImprovedFeedforward(), task, pressure)
    replay, _ = drive(SerresReplay(), task, pressure)
    assert all(improved[phase] < 0.1 * replay[phase] for phase in replay)


@pytest.mark.parametrize(
    ("pressure", "model", "time", "asked", "given"),
    [
        # The three-element model of 575 kPa needs over 10 V for 90 deg.
        (575, "serres2008", 7.0, (10.0, 20.0), 10.0),
        # Hysteresis holds the muscle back at the end of phase III: the cable would have to push.
        (300, "station", 14.95, (-10.0, 0.0), 0.0),
    ],
)
def test_what_the_station_cannot_give_is_asked_for_at_the_limit(
    pressure, model, time, asked, given, station, reading
):
    where = station("rotation", pressure, model=model)
    controller = ImprovedFeedforward()
    controller.reset(lambda time: float(where.task.schedule.reference(time)), where)
    assert asked[0] < controller.voltage(time) < asked[1]
    assert controller.act(reading(), time) == given


def test_it_follows_any_reference(station):
    where = station("displacement", 300)
    controller = ImprovedFeedforward()
    controller.reset(lambda time: 2e-3 * time, where)
    slow = controller.voltage(4.0)
    controller.reset(lambda time: 5e-3 * time, where)
    assert 0.0 < slow < controller.voltage(4.0)


def test_the_regulator_gets_the_voltage_that_holds(station):
    # In the hold of the isotonic task: settle there by the plant's own statics.
    model = load_model("serres2008").replace(FRICTIONLESS)
    where = StationInfo(model, EVERY_TASK["isotonic"], 300e3, 0.01)
    controller, plant = ImprovedFeedforward(), Plant(model)
    controller.reset(where.task.schedule.at, where)
    motor = (200.0 + 2.0) / 97.84
    rests = [
        plant.settle(motor, regulator_voltage=volts)
        for volts in (plant.regulator_voltage(300e3), controller.voltage(4.5))
    ]
    at = plant.states.index("contraction")
    assert rests[1].state[at] - rests[0].state[at] == pytest.approx(12.5e-3, abs=2e-6)
