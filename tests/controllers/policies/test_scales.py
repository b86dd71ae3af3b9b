"""What a policy sees of an exercise, by hand."""

import pytest

from controllers.models.voltage import nominal_offset
from controllers.policies.adapter import ActionMapping, PolicyAdapter
from controllers.policies.observation_spec import ObservationSpec, delayed_rows
from pma_gym.envs import Measurement, StationInfo
from pma_gym.plant.model import load_model
from pma_gym.tasks import TASKS, named_task
from pma_gym.units import SI_FACTORS

DEG = SI_FACTORS["deg"]


def seen(task, reading, time):
    """Entries of a pilot's first view by name."""
    station = StationInfo(load_model("station"), named_task(task), 400e3, 0.01)
    view = ObservationSpec("tracking", 1, 0)
    pilot = PolicyAdapter(view, ActionMapping("increment", 0.5))
    pilot.reset(station.task.schedule.at, station)
    names = [name for name, _ in view.rows(station)]
    entries = pilot.update(reading, time).tolist()
    # The regulator rests where it holds the trial's pressure.
    assert pilot.volts(0.0) == pytest.approx(nominal_offset(station))
    return dict(zip(names, entries, strict=True))


def test_an_exercise_of_one_speed_sees_both_angles_and_the_load():
    radius = load_model("station").parameters["rotor"].radius
    reading = Measurement(1.0, 18.9 * DEG * radius, 14.4 * DEG, 300.0, 350e3)
    observation = seen("isokinetic_exercise", reading, 1.0)
    assert observation["reference now"] == pytest.approx(0.2)
    # 18 deg/s for 10 ms is 0.18 deg.
    assert observation["reference 1 ahead less reference now, over 1"] == pytest.approx(0.2)
    assert observation["reference less measured position"] == pytest.approx(1.0)
    assert observation["reference less position by the other sensor"] == pytest.approx(-1.0)
    assert observation["pressure less pressure at the trial's start"] == pytest.approx(-0.5)
    assert observation["load"] == pytest.approx(1.5)


@pytest.mark.parametrize("angle, prescribed", [(0.0, 4.0), (15.0, 6.0), (60.0, 9.0), (100.0, 7.5)])
def test_a_prescribed_moment_is_compared_at_the_angle(angle, prescribed):
    radius = load_model("station").parameters["rotor"].radius
    reading = Measurement(0.0, 0.0, angle * DEG, (prescribed + 0.72) / radius, 400e3)
    observation = seen("profile_exercise", reading, 0.0)
    # 4 % of the greatest moment, 9 N m, is 0.36 N m.
    assert observation["prescribed less measured moment"] == pytest.approx(-2.0, abs=1e-5)
    assert observation["measured rotation"] == pytest.approx(angle / 90.0)


def test_units_stand_beside_the_names():
    units = dict(delayed_rows(named_task("isokinetic_exercise")))
    assert units["reference less measured position"] == "3.6 deg"
    assert dict(delayed_rows(TASKS["rotation"]))["reference less measured position"] == "0.9 deg"
    assert (
        dict(delayed_rows(named_task("isotonic_exercise")))["prescribed less measured moment"]
        == "0.32 N m"
    )
