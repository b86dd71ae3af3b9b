"""The nominal motion: its local models and statics are the plant's, its plan is feasible."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest

from controllers.models.local_model import step_response
from controllers.models.nominal_motion import nominal_motion
from controllers.models.operating_range import rest_voltages
from pma_gym.data.signals import SIGNALS
from pma_gym.envs import PMAEnv, StationInfo
from pma_gym.plant.forms.linear import linearize
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.tasks import EVERY_TASK


def station_of(task="displacement", pressure_kpa=300.0, model="station", rate=100.0, **delays):
    return StationInfo(
        load_model(model), EVERY_TASK[task], 1e3 * pressure_kpa, 1.0 / rate, **delays
    )


def motion_of(*args, **kwargs):
    where = station_of(*args, **kwargs)
    return nominal_motion(where.task.schedule.at, where)


def full_response(where: StationInfo, position: float, steps: int) -> np.ndarray:
    """Measured position after 1, 2... periods of 1 V, with all states of the plant."""
    plant, quantity = Plant(where.model), where.task.schedule.quantity
    rest = plant.settle(0.0, pressure=where.pressure).zero_contraction
    radius = where.model.parameters["rotor"].radius if quantity == "rotation" else 1.0
    system = linearize(plant, where.pressure, rest - radius * position, "relaxing")
    sensor = where.model.parameters[SIGNALS[quantity].sensor]
    lagged = control.tf([1.0], [1.0 / (2.0 * math.pi * sensor.bandwidth), 1.0])
    times = where.period * np.arange(steps + 1)
    return control.step_response(lagged * system[quantity, "motor_voltage"], times).outputs[1:]


@pytest.mark.parametrize("rate", [50.0, 100.0, 384.0])
@pytest.mark.parametrize(
    ("task", "pressure", "share"),
    [
        ("displacement", 150, 0.9),
        ("displacement", 550, 0.5),
        ("rotation", 300, 0.3),
        ("rotation", 550, 0.8),
    ],
)
def test_reduced_models_answer_a_step_as_the_whole_plant(task, pressure, share, rate):
    motion = motion_of(task, pressure, rate=rate)
    position = share * motion.station.task.schedule.span
    local = motion.local(position)
    full = full_response(motion.station, position, 60)
    reduced = step_response(local.a, local.b, local.c, 60)
    # The place is taken from the angle as if the cable did not give: half a per cent of the gain.
    assert np.abs(reduced - full).max() < 0.01 * full[-1]
    assert len(local.b) <= 3


@pytest.mark.parametrize(("task", "pressure"), [("displacement", 200), ("rotation", 400)])
def test_gain_is_the_slope_of_the_plants_statics(task, pressure):
    motion = motion_of(task, pressure)
    stroke, plant = motion.stroke, Plant(motion.station.model)
    for at in (20, 50, 80):
        volts, ends = stroke.volts[at], []
        for voltage in (volts - 1e-3, volts + 1e-3):
            rest = plant.settle(voltage, pressure=motion.station.pressure)
            truth = plant.observe(rest.state[None, :], rest.zero_contraction)
            name = motion.station.task.schedule.quantity
            ends.append(float(truth[name][0]))
        assert stroke.models[at].gain == pytest.approx((ends[1] - ends[0]) / 2e-3, rel=0.02)
        share = at / (len(stroke.models) - 1)
        where = stroke.first + share * (stroke.last - stroke.first)
        assert sum(ends) / 2 == pytest.approx(where, abs=2e-3 * (stroke.last - stroke.first))


def test_slowest_lag_is_damping_over_stiffness():
    # serres2008 relaxing: tau = B / K, beside it only rotor and cable, 20 times as fast.
    motion = motion_of("displacement", 300, model="serres2008")
    damping, stiffness = 1.57e3 + 7.64e-4 / 25.4e-3**2, 32.7e3 - 0.0321e3 * 300
    assert motion.local(10e-3).time_constant == pytest.approx(damping / stiffness, rel=0.06)


def test_correction_holds_the_position_when_the_pressure_changes():
    motion = motion_of("displacement", 300)
    plant, position = Plant(motion.station.model), 12e-3
    volts = motion.stroke.volts[motion.stroke.nearest(position)]
    start = plant.settle(volts, pressure=300e3)
    at = plant.states.index("contraction")
    for pressure in (290e3, 310e3):
        corrected = volts + motion.pressure_correction(position, pressure)
        moved = plant.settle(corrected, pressure=pressure).state[at] - start.state[at]
        alone = plant.settle(volts, pressure=pressure).state[at] - start.state[at]
        assert abs(moved) < 0.03 * abs(alone)


def test_the_nominal_station_reads_what_is_foreseen():
    for task in ("displacement", "rotation", "isotonic"):
        env = PMAEnv(task, pressure_kpa=300.0, noise=False, action_delay_s=0.02)
        env.reset(seed=0)
        motion = nominal_motion(env.reference, env.station)
        for _ in range(200):
            said = env.station.position(env.measurement)
            assert said == pytest.approx(motion.predicted(env.time), abs=2e-6)
            turned = motion.predicted_rotation(env.time)
            assert env.measurement.rotation == pytest.approx(turned, abs=1e-4)
            env.step(env.action(motion.command(env.time)))


def test_commands_are_sent_the_delay_ahead():
    motion = motion_of("rotation", 400, rate=50.0, action_delay=0.04)
    assert [motion.command(t) for t in (0.0, 3.0)] == [motion.voltage(t) for t in (0.04, 3.04)]
    # Nothing can be in force before: the plan stays at rest, and the drive pulls nothing.
    assert motion.planned(0.04) == 0.0
    assert motion.voltage(0.02) == pytest.approx(2.0015 / 97.838, abs=1e-6)


def test_what_is_kept_changes_no_bit():
    first = motion_of("rotation", 300)
    motion_of("rotation", 310)
    again = motion_of("rotation", 300)
    assert again.volts is first.volts  # computed once
    assert not np.array_equal(again.volts, motion_of("rotation", 310).volts)
    copied = replace(first.station, model=first.station.model.replace({}))
    assert nominal_motion(copied.task.schedule.at, copied).volts is first.volts
    with pytest.raises(ValueError, match="read-only"):
        first.volts[0] = 1.0


def test_another_reference_is_followed_although_the_task_has_its_own():
    where = station_of("displacement", 300)
    slow = nominal_motion(lambda time: 2e-3 * time, where)
    assert slow.planned(2.5) == pytest.approx(5e-3, abs=1e-12)
    assert slow.predicted(4.0) == pytest.approx(8e-3, abs=2e-5)


@pytest.mark.parametrize("task", ["displacement_steps", "rotation_steps"])
def test_a_jump_becomes_a_way_that_the_drive_can_go(task):
    motion = motion_of(task, 300)
    reference, span = motion.station.task.schedule.reference, motion.station.task.schedule.span
    times = 2e-3 * np.arange(5000)
    planned = np.array([motion.planned(t) for t in times.tolist()])
    wanted = reference(times)
    jump = int(np.argmax(np.abs(np.diff(wanted)))) + 1
    rise = wanted[jump] - wanted[jump - 1]
    # Halfway there as the reference jumps, and never the other way.
    assert abs(planned[jump] - 0.5 * (wanted[jump] + wanted[jump - 1])) < 0.2 * abs(rise)
    assert np.abs(np.diff(planned)).max() < 0.4 * np.abs(np.diff(wanted)).max()
    # Away from jumps the plan is the reference.
    near = np.zeros(len(times), bool)
    for at in np.flatnonzero(np.abs(np.diff(wanted)) > 0.02 * span):
        near[max(at - 100, 0) : at + 100] = True
    assert np.abs(planned - wanted)[~near].max() < 1e-12
    outside = (motion.volts < 0.0) | (motion.volts > 10.0)
    assert outside.mean() < 0.02


def test_a_regulators_task_begins_under_its_load():
    where = station_of("isotonic", 300)
    motor, regulator = rest_voltages(where)
    drive, line = (where.model.parameters[n] for n in ("drive", "regulator_line"))
    assert drive.gain * motor + drive.offset == pytest.approx(200.0)
    assert line.gain * regulator + line.offset == pytest.approx(300e3)
    motion = nominal_motion(where.task.schedule.at, where)
    assert motion.pressure_correction(5e-3, 320e3) == 0.0
    # More voltage, more pressure, more contraction.
    assert all(model.gain > 0.0 for model in motion.stroke.models)
