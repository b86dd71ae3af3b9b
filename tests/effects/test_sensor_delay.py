"""A late sensor reads what was true a while ago, and nothing else changes."""

import math

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.effects import CATALOGUE
from pma_gym.effects.sensors.sensor_delay import SENSOR_DELAYS
from pma_gym.plant.equilibrium.solver import NoLoadEquilibria
from pma_gym.plant.model import Model, ModelError
from pma_gym.plant.plant import Plant

DELAY_S, LAG_S = 7e-3, 1.0 / (2.0 * math.pi * 1000.0)


def test_every_sensor_of_the_catalogue_may_be_late():
    sensors = {
        e.port: e.name for e in CATALOGUE.values() if e.port.startswith("sensor:") and not e.law
    }
    late = {e.port.replace("sensor_delay:", "sensor:"): e.name for e in SENSOR_DELAYS}
    assert late == {port: f"{name}_delay" for port, name in sensors.items()}


def test_a_delay_without_its_sensor_is_refused(station):
    kept = {name: p for name, p in station.model.parameters.items() if name != "load_cell"}
    blind = Model("blind", "", "station", kept)
    with pytest.raises(ModelError, match=r"\[load_cell_delay\].*add \[load_cell\] with bandwidth"):
        blind.with_effects({"load_cell_delay": {"share": 1.0, "delay_ms": 5.0}})


def test_a_late_load_cell_reads_the_tension_of_before(station, station_with):
    time = np.arange(0.0, 2.0, 0.002)
    tones = [(0.4, 0.0), (1.1, 1.0), (3.0, 2.0)]
    pull = 3.0 + 0.5 * np.sum([np.sin(2.0 * np.pi * f * time + p) for f, p in tones], axis=0)
    trial = Trial(time, {"motor_voltage": pull, "regulator_voltage": 0.0 * time + 5.5})
    plant = station_with("load_cell_delay", delay_ms=1e3 * DELAY_S)
    plain, late = (each.simulate(trial, noise=False) for each in (station, plant))
    read = plain.measurements["load"]
    before = np.interp(time[50:] - DELAY_S, time, read)
    assert np.abs(late.measurements["load"][50:] - before).max() < 4e-3 * np.ptp(read)
    assert np.abs(late.measurements["load"] - read).max() > 0.02 * np.ptp(read)
    for name, truth in plain.truth.items():
        np.testing.assert_allclose(late.truth[name], truth, rtol=0.0, atol=1e-9)
    assert NoLoadEquilibria(plant)(np.array([300e3])) is None


def test_a_joint_that_already_turns_is_late_from_the_first_reading():
    """Under a constant torque q = q0 + v t + a t^2 / 2, also before the trial began."""
    start, speed, torque, inertia = math.radians(10.0), 3.0, 0.1, 0.01
    tables = {
        "torque_drive": {"gain": 1.0},
        "inertia": {"inertia_kg_m2": inertia},
        "joint_start": {"angle_deg": 10.0, "spin_deg_per_s": math.degrees(speed)},
        "encoder": {"bandwidth_hz": 1000.0, "noise_deg": 0.0},
        "gyroscope": {"bandwidth_hz": 1000.0, "noise_rad_per_s": 0.0},
        "encoder_delay": {"share": 1.0, "delay_ms": 1e3 * DELAY_S},
        "gyroscope_delay": {"share": 1.0, "delay_ms": 1e3 * DELAY_S},
    }
    effects = {name: CATALOGUE[name].parse(table) for name, table in tables.items()}
    time = np.arange(0.0, 0.3, 1e-3)
    trial = Trial(time, {"torque_command": torque + 0.0 * time})
    read = Plant(Model("arm", "", "joint", effects)).simulate(trial, noise=False).measurements
    before, rate = time - DELAY_S - LAG_S, torque / inertia
    angle = start + speed * before + 0.5 * rate * before**2
    assert read["angle"] == pytest.approx(angle, abs=5e-5)
    # The lag of a gyroscope begins settled.
    assert read["speed"] == pytest.approx(speed + rate * before, abs=1.1 * rate * LAG_S)
