"""What a policy sees is what the table says, and its action is the voltage that the form says.

What a policy sees of an exercise, by hand.
"""

import math

import numpy as np
import pytest

from controllers.models.voltage import nominal_offset
from controllers.policies.adapter import ActionMapping, PolicyAdapter
from controllers.policies.observation_spec import ObservationSpec
from pma_gym.envs import Measurement, PMAEnv, StationInfo
from pma_gym.plant.model import load_model
from pma_gym.tasks import named_task
from pma_gym.units import SI_FACTORS

RATE = {"control_rate_hz": 20.0, "pressure_kpa": 300.0}
OBSERVED = {
    "plain": ("displacement", {}),
    "preview and history": ("displacement", {"preview": 3, "history": 4}),
    "late": ("rotation", {"history": 2, "action_delay_s": 0.05, "observation_delay_s": 0.1}),
    "isotonic": ("isotonic", {"preview": 1, "history": 2, "observation_delay_s": 0.05}),
}


@pytest.mark.parametrize("case", OBSERVED)
def test_the_environments_view_is_the_environments_observation(case):
    task, options = OBSERVED[case]
    env = PMAEnv(task, **RATE, **options)
    observation, _ = env.reset(seed=2)
    view = ObservationSpec("environment", options.get("preview", 0), options.get("history", 0))
    pilot = PolicyAdapter(view, ActionMapping("increment", 0.5))
    pilot.reset(env.reference, env.station)
    # A regulator's first action is where it rests, as the environment says.
    np.testing.assert_array_equal(pilot.update(env.measurement, env.time), observation)
    ended = False
    actions = iter(np.random.default_rng(2).uniform(-1.0, 1.2, 1000))
    while not ended:
        volts = pilot.volts(next(actions))
        observation, _, terminated, truncated, _ = env.step(env.action(volts))
        ended = terminated or truncated
        np.testing.assert_array_equal(pilot.update(env.measurement, env.time), observation)


# -- tracking, by hand -----------------------------------------------------------------------------


def station_of(task="displacement", late=(0.0, 0.0)):
    return StationInfo(load_model("station"), named_task(task), 300e3, 0.1, *late)


def seen(pilot, station):
    """Entries of the pilot's next view by name, for a reading at a time."""

    def by_name(reading, time):
        entries = pilot.update(reading, time).tolist()
        names = [name for name, _ in pilot.view.rows(station, pilot.form.base)]
        assert len(names) == len(entries)
        return dict(zip(names, entries, strict=True))

    return by_name


def line(time):
    """A reference of 1 mm/s."""
    return 1e-3 * time


def test_every_tracking_entry_says_what_the_table_says():
    station = station_of()
    drive, radius = (station.model.parameters[name] for name in ("drive", "rotor"))
    radius = radius.radius
    pilot = PolicyAdapter(ObservationSpec("tracking", 2, 1), ActionMapping("increment", 0.5))
    pilot.reset(line, station)
    observe = seen(pilot, station)
    first = observe(Measurement(0.0, 0.1e-3, 0.0, 20.0, 305e3), 0.0)
    fine = 0.25e-3
    assert first == pytest.approx(
        {
            "reference now": 0.0,
            "pressure at the trial's start less 362.5 kPa": -62.5 / 212.5,
            "reference 1 ahead less reference now, over 1": 0.1e-3 / fine,
            "reference 2 ahead less reference now, over 2": 0.1e-3 / fine,
            "reference less measured position": -0.4,
            "reference less position by the other sensor": 0.0,
            "pressure less pressure at the trial's start": 0.25,
            # At 0 V the nominal drive does not pull.
            "load less what the nominal drive is asked for": 0.4,
            # Before a trial all was as at its start.
            "reference less measured position, 1 before": -0.4,
            "reference less position by the other sensor, 1 before": 0.0,
            "pressure less pressure at the trial's start, 1 before": 0.25,
            "load less what the nominal drive is asked for, 1 before": 0.4,
            "own action, 1 before": 0.0,
            "voltage commanded last": -1.0,
        },
        abs=1e-6,
    )
    assert drive.offset <= 0.0
    assert pilot.volts(0.9) == pytest.approx(0.45)
    for _ in range(3):
        volts = pilot.volts(1.0)
    assert volts == pytest.approx(1.95)
    pulled = max(drive.gain * 1.95 + drive.offset, 0.0)
    second = observe(Measurement(0.4, 0.3e-3, 0.2e-3 / radius, pulled - 10.0, 300e3), 0.4)
    assert second["reference now"] == pytest.approx(0.4e-3 / 25e-3)
    assert second["reference less measured position"] == pytest.approx(0.1e-3 / fine, abs=1e-6)
    assert second["reference less position by the other sensor"] == pytest.approx(0.2e-3 / fine)
    assert second["load less what the nominal drive is asked for"] == pytest.approx(-0.2, abs=1e-5)
    assert second["reference less measured position, 1 before"] == pytest.approx(-0.4)
    assert second["own action, 1 before"] == 1.0
    assert second["voltage commanded last"] == pytest.approx(1.95 / 5.0 - 1.0)


def test_late_loops_compare_what_belongs_together():
    station = station_of(late=(0.1, 0.2))
    drive = station.model.parameters["drive"]
    pilot = PolicyAdapter(ObservationSpec("tracking", 0, 0), ActionMapping("direct", 5.0))
    pilot.reset(line, station)
    observe = seen(pilot, station)
    commanded = []
    for step in range(6):
        taken = max(step - 2, 0)
        # Of a reading taken two steps ago, before which a command takes one to arrive.
        asked = drive.gain * commanded[step - 4] + drive.offset if step >= 4 else 0.0
        now = observe(
            Measurement(0.1 * taken, 1e-4 * taken, 0.0, max(asked, 0.0), 300e3), 0.1 * step
        )
        assert now["reference less measured position"] == pytest.approx(0.0, abs=1e-6)
        assert now["reference now"] == pytest.approx(1e-4 * step / 25e-3)
        load = now["load less what the nominal drive is asked for"]
        assert load == pytest.approx(0.0, abs=1e-4)
        commanded.append(pilot.volts(-0.9 + 0.1 * step))


def test_entries_are_held_to_five():
    station = station_of()
    pilot = PolicyAdapter(ObservationSpec("tracking", 0, 0), ActionMapping("direct", 5.0))
    pilot.reset(line, station)
    entries = pilot.update(Measurement(0.0, -1.0, 1.0, 1e4, 0.0), 0.0)
    assert entries.dtype == np.float32 and set(np.abs(entries[2:6])) == {5.0}


# -- volts -----------------------------------------------------------------------------------------


class Base:
    """A controller that always says 4 V."""

    name = "base"

    def reset(self, reference, station):
        pass

    def act(self, observation, time):
        return 4.0


FORMS = {
    "direct": (ActionMapping("direct", 5.0), [(-1.0, 0.0), (0.0, 5.0), (0.5, 7.5), (9.0, 10.0)]),
    "increment": (
        ActionMapping("increment", 2.0),
        # It does not wind up beyond the ends.
        [(-1.0, 0.0), (0.5, 1.0), (1.0, 3.0), (7.0, 5.0), (1.0, 7.0), (1.0, 9.0)]
        + [(1.0, 10.0), (1.0, 10.0), (-0.5, 9.0)],
    ),
    "residual": (
        ActionMapping("residual", 3.0, "pid"),
        [(0.0, 4.0), (1.0, 7.0), (-1.0, 1.0), (-5.0, 1.0), (0.5, 5.5)],
    ),
    "residual beyond the range": (
        ActionMapping("residual", 10.0, "pid"),
        [(1.0, 10.0), (-1.0, 0.0)],
    ),
}


@pytest.mark.parametrize("kind", FORMS)
def test_actions_become_volts(kind):
    form, pairs = FORMS[kind]
    pilot = PolicyAdapter(
        ObservationSpec("tracking", 0, 1), form, Base() if form.kind == "residual" else None
    )
    pilot.reset(line, station_of())
    for step, (action, volts) in enumerate(pairs):
        pilot.update(Measurement(0.1 * step, 0.0, 0.0, 0.0, 300e3), 0.1 * step)
        assert pilot.volts(action) == pytest.approx(volts, abs=1e-12)


# -- no numbers ------------------------------------------------------------------------------------


@pytest.mark.parametrize("action", [math.nan, math.inf, -math.inf])
def test_an_action_that_is_no_number_is_refused_and_leaves_the_pilot(action):
    pilot = PolicyAdapter(ObservationSpec("tracking", 0, 1), ActionMapping("increment", 0.5))
    pilot.reset(line, station_of())
    pilot.update(Measurement(0.0, 0.0, 0.0, 0.0, 300e3), 0.0)
    with pytest.raises(ValueError, match=rf"action must be a finite number, got {action}"):
        pilot.volts(action)
    assert pilot.volts(1.0) == pytest.approx(0.5)


@pytest.mark.parametrize("kind", ["tracking", "environment"])
@pytest.mark.parametrize("part", ["extension", "rotation", "load", "pressure"])
def test_a_reading_that_is_no_number_is_named(part, kind):
    pilot = PolicyAdapter(ObservationSpec(kind, 0, 1), ActionMapping("increment", 0.5))
    pilot.reset(line, station_of())
    bad = Measurement(0.0, 0.0, 0.0, 0.0, 300e3)._replace(**{part: math.nan})
    with pytest.raises(ValueError, match=f"{part} is nan.*check the sensor"):
        pilot.update(bad, 0.0)
    assert np.isfinite(pilot.update(Measurement(0.0, 0.0, 0.0, 0.0, 300e3), 0.0)).all()


DEG = SI_FACTORS["deg"]


def exercise_view(task, reading, time):
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
    observation = exercise_view("isokinetic_exercise", reading, 1.0)
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
    observation = exercise_view("profile_exercise", reading, 0.0)
    # 4 % of the greatest moment, 9 N m, is 0.36 N m.
    assert observation["prescribed less measured moment"] == pytest.approx(-2.0, abs=1e-5)
    assert observation["measured rotation"] == pytest.approx(angle / 90.0)
