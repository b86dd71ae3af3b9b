"""The inverse of the nominal model: exact at rest, smooth, at any rate, better than the replay.

The dissertation's voltages: as printed, and as computed for anything else.
"""

import math

import numpy as np
import pytest

from controllers import ImprovedFeedforward, SerresFeedforward, SerresReplay
from controllers.models.inverse import inverse_of
from controllers.serres_feedforward import PROFILE_RADIUS
from pma_gym.data.serres2008 import load_table, pressures
from pma_gym.envs import StationInfo
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.studies.voltage_profile import reachable_mm
from pma_gym.tasks import EVERY_TASK, TASKS

FRICTIONLESS = {"coulomb_friction.static_n": 0.0, "coulomb_friction.dynamic_n": 0.0}
TRIALS = [
    (task, p)
    for task in ("displacement", "rotation")
    for p in pressures(task)[:: len(pressures(task)) - 1]
]


SMOOTH = load_model("serres2008").replace(FRICTIONLESS)


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
    volts = voltages(StationInfo(SMOOTH, TASKS["rotation"], 350e3, 0.01))
    plant = Plant(SMOOTH)
    rest = plant.settle(volts[800], pressure=350e3)
    truth = plant.observe(rest.state[None, :], rest.zero_contraction)
    assert math.degrees(truth["rotation"][0]) == pytest.approx(90.0, abs=1e-3)


def test_lag_is_compensated_by_the_damping_of_the_model():
    # Constant speed, no friction, no hysteresis: L = K y + B y'.
    where = StationInfo(SMOOTH, TASKS["displacement"], 300e3, 0.01)
    plant = Plant(SMOOTH)
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
    where = StationInfo(SMOOTH, EVERY_TASK["isotonic"], 300e3, 0.01)
    controller, plant = ImprovedFeedforward(), Plant(SMOOTH)
    controller.reset(where.task.schedule.at, where)
    motor = (200.0 + 2.0) / 97.84
    rests = [
        plant.settle(motor, regulator_voltage=volts)
        for volts in (plant.regulator_voltage(300e3), controller.voltage(4.5))
    ]
    at = plant.states.index("contraction")
    assert rests[1].state[at] - rests[0].state[at] == pytest.approx(12.5e-3, abs=2e-6)


PRINTED = [(task, p) for task in ("displacement", "rotation") for p in pressures(task)]


def task_reference(station):
    return lambda time: float(station.task.schedule.reference(time))


def printed(task, pressure_kpa):
    for number in range(4, 21):
        table = load_table(f"I{number}")
        if table["task"][0] == task and table["pressure_kpa"][0] == pressure_kpa:
            return table
    raise AssertionError((task, pressure_kpa))


@pytest.mark.parametrize(
    # Half a unit of the last of four digits; tests of the profile itself hold every digit.
    ("kind", "off"),
    [(SerresReplay, 0.0), (SerresFeedforward, 5.1e-5)],
)
@pytest.mark.parametrize(("task", "pressure"), PRINTED)
def test_voltages_are_those_of_the_printed_table(task, pressure, kind, off, station):
    controller, table = kind(), printed(task, pressure)
    where = station(task, pressure)
    controller.reset(task_reference(where), where)
    computed = [controller.voltage(time) for time in table["time_s"]]
    assert computed == pytest.approx(table["motor_voltage_v"], rel=0.0, abs=off)


def test_samples_are_joined_or_held(station):
    where = station("displacement", 300)
    volts = printed("displacement", 300)["motor_voltage_v"]
    linear, held = SerresReplay(), SerresReplay(interpolation="zoh")
    for replay in (linear, held):
        replay.reset(task_reference(where), where)
    assert linear.voltage(0.3) == pytest.approx(0.5 * (volts[1] + volts[2]), abs=1e-12)
    assert held.voltage(0.3) == volts[1]
    # 3 * 0.2 is above 0.6 and 0.6 below it: neither rounding may lose a sample.
    assert held.voltage(3 * 0.2) == held.voltage(0.6) == volts[3]
    assert linear.voltage(9.0) == held.voltage(9.0) == volts[-1]


def test_a_period_gets_the_voltage_of_its_middle(station, reading):
    where = station("displacement", 300)
    replay = SerresReplay()
    replay.reset(task_reference(where), where)
    assert replay.act(reading(), 1.0) == replay.voltage(1.005)


def test_unknown_interpolation_is_refused():
    with pytest.raises(ValueError, match="interpolation must be 'foh'.*or 'zoh'.*got 'cubic'"):
        SerresReplay(interpolation="cubic")  # type: ignore[arg-type]


def test_replay_names_the_printed_pressures(station):
    where = station("rotation", 325)
    with pytest.raises(ValueError, match=r"rotation task for 275, 300, 350, .*not for 325 kPa"):
        SerresReplay().reset(task_reference(where), where)


def test_live_feedforward_covers_pressures_between(station):
    voltages = []
    for pressure in (300, 325, 350):
        where = station("displacement", pressure)
        live = SerresFeedforward()
        live.reset(task_reference(where), where)
        voltages.append([live.voltage(time) for time in np.arange(0.4, 5.0, 0.2)])
    low, between, high = np.array(voltages)
    assert np.all(between <= np.maximum(low, high) + 0.05)
    assert np.all(between >= np.minimum(low, high) - 0.05)


DEGREES = math.degrees(1e-3 * reachable_mm(200) / PROFILE_RADIUS)
RANGE = "pressure must lie in 150-575 kPa.*got 140"


@pytest.mark.parametrize(
    ("task", "pressure", "share", "message"),
    [
        (
            "displacement",
            150,
            1.2,
            f"150 kPa: .* must lie in 0-{reachable_mm(150):.4g} mm",
        ),
        ("rotation", 200, 1.0, f"rotation must lie in 0-{DEGREES:.4g} deg"),
        ("displacement", 140, 1.0, RANGE),
        ("rotation", 140, 1.0, RANGE),
    ],
)
def test_what_the_map_does_not_reach_is_refused(task, pressure, share, message, station):
    where = station(task, pressure)
    with pytest.raises(ValueError, match=message):
        SerresFeedforward().reset(lambda time: share * task_reference(where)(time), where)


def test_rotation_aims_at_the_dissertation_s_pulley():
    assert PROFILE_RADIUS * math.pi / 2.0 == pytest.approx(45e-3, rel=1e-15)
