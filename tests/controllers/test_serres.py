"""The dissertation's voltages: as printed, and as computed for anything else."""

import math

import numpy as np
import pytest

from controllers import SerresFeedforward, SerresReplay
from controllers.serres_feedforward import PROFILE_RADIUS
from pma_gym.data.serres2008 import load_table, pressures
from pma_gym.studies.voltage_profile import reachable_mm

PRINTED = [(task, p) for task in ("displacement", "rotation") for p in pressures(task)]


def task_reference(station):
    return lambda time: float(station.task.schedule.reference(time))


def printed(task, pressure_kpa):
    for number in range(4, 21):
        table = load_table(f"I{number}")
        if table["task"][0] == task and table["pressure_kpa"][0] == pressure_kpa:
            return table
    raise AssertionError((task, pressure_kpa))


@pytest.mark.parametrize(("task", "pressure"), PRINTED)
def test_replay_is_the_printed_table_at_its_samples(task, pressure, station):
    replay, table = SerresReplay(), printed(task, pressure)
    where = station(task, pressure)
    replay.reset(task_reference(where), where)
    for time, volts in zip(table["time_s"], table["motor_voltage_v"], strict=True):
        assert replay.voltage(time) == volts


@pytest.mark.parametrize(("task", "pressure"), PRINTED)
def test_live_feedforward_gives_the_printed_voltages(task, pressure, station):
    live, table = SerresFeedforward(), printed(task, pressure)
    where = station(task, pressure)
    live.reset(task_reference(where), where)
    computed = [live.voltage(time) for time in table["time_s"]]
    # Half a unit of the last of four digits; tests of the profile itself hold every digit.
    assert computed == pytest.approx(table["motor_voltage_v"], abs=5.1e-5)


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


def test_unreachable_reference_names_the_range(station):
    where = station("displacement", 150)
    expected = rf"at 150 kPa: displacement must lie in 0-{reachable_mm(150):.4g} mm"
    with pytest.raises(ValueError, match=expected):
        SerresFeedforward().reset(lambda time: 6e-3 * time, where)


def test_unreachable_rotation_names_the_range_in_degrees(station):
    where = station("rotation", 200)
    degrees = math.degrees(1e-3 * reachable_mm(200) / PROFILE_RADIUS)
    with pytest.raises(ValueError, match=rf"rotation must lie in 0-{degrees:.4g} deg"):
        SerresFeedforward().reset(task_reference(where), where)


def test_pressure_outside_the_map_is_refused(station):
    for task in ("displacement", "rotation"):
        where = station(task, 140)
        with pytest.raises(ValueError, match=r"pressure must lie in 150-575 kPa.*got 140"):
            SerresFeedforward().reset(task_reference(where), where)


def test_rotation_aims_at_the_dissertation_s_pulley():
    assert PROFILE_RADIUS * math.pi / 2.0 == pytest.approx(45e-3, rel=1e-15)
