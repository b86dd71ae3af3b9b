"""Dead time of the commands: what comes out is what went in, a while ago."""

import numpy as np
import pytest

from pma_gym.effects import CATALOGUE
from pma_gym.effects.delay import (
    DriveDelay,
    RegulatorDelay,
    delayed_load,
    delayed_load_rate,
    delayed_pressure,
    delayed_pressure_rate,
)
from pma_gym.effects.sensors.sensor_delay import SensorDelay, late_reading, late_reading_rate
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant

DELAY_S = 0.02


def multisine(time, mean, swing):
    """A smooth command of up to 3 Hz."""
    waves = [np.sin(2.0 * np.pi * f * time + p) for f, p in [(0.4, 0.0), (1.1, 1.0), (3.0, 2.0)]]
    return mean + swing * sum(waves) / 3.0


LAWS = {
    "drive": (delayed_load, delayed_load_rate, DriveDelay),
    "regulator": (delayed_pressure, delayed_pressure_rate, RegulatorDelay),
    "sensor": (late_reading, late_reading_rate, SensorDelay),
}


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize(("angle", "error"), [(0.3, 1e-8), (0.5, 2e-7), (1.0, 2e-5), (2.0, 2e-3)])
def test_amplitude_and_phase_are_those_of_a_true_delay(name, angle, error):
    """The response at w T = angle, from the laws themselves, beside exp(-i w T)."""
    law, law_rate, parameters = LAWS[name]
    p = parameters(1.0, DELAY_S)

    def rates(value, memory):
        pairs = law_rate(value, tuple(memory), p)
        return np.array([s - decay * m for (s, decay), m in zip(pairs, memory, strict=True)])

    drift = np.stack([rates(0.0, unit) for unit in np.eye(4)], axis=1)
    state = np.linalg.solve(1j * angle / DELAY_S * np.eye(4) - drift, rates(1.0, np.zeros(4)))
    assert abs(law(1.0, state, p) - np.exp(-1j * angle)) < error
    assert law(1.0, (0.0, 1.0, 0.0, 1.0), p) == pytest.approx(1.0)


@pytest.mark.parametrize("share", [1.0, 0.4])
def test_a_delayed_drive_asks_for_what_was_asked_before(station_with, share):
    plant = station_with("drive_delay", share=share, delay_ms=1e3 * DELAY_S)
    time = np.arange(0.0, 4.0, 0.002)
    motor = multisine(time, 3.0, 1.5)
    states, _ = plant.run(time, motor, np.full(len(time), plant.regulator_voltage(300e3)))
    drive, p = (plant.model.parameters[name] for name in ("drive", "drive_delay"))
    columns = [plant.states.index(name) for name in CATALOGUE["drive_delay"].memory_names]
    asked = drive.gain * motor + drive.offset
    loads = np.array(
        [delayed_load(a, tuple(m), p) for a, m in zip(asked, states[:, columns], strict=True)]
    )
    # The first while still knows the command at rest, which stood still.
    late = np.interp(time - DELAY_S, time, asked)
    expected = asked + share * (late - asked)
    later = time > 0.2
    error = np.abs(loads - expected)[later].max() / np.ptp(asked)
    # At 3 Hz, w = 0.38: the law is exact to 1e-8, the commands are joined linearly.
    assert error < 2e-4
    assert np.abs(loads - asked)[later].max() / np.ptp(asked) > 0.1 * share


def test_a_delayed_regulator_fills_a_while_later(station_with, station):
    late = station_with("regulator_delay", delay_ms=1e3 * DELAY_S)
    time = np.arange(0.0, 3.0, 0.002)

    def pressures(plant):
        line = plant.model.parameters["regulator_line"]
        volts = (multisine(time, 300e3, 50e3) - line.offset) / line.gain
        states, zero = plant.run(time, np.full(len(time), 1.0), volts)
        return plant.observe(states, zero)["pressure"]

    plain, late_pressures = pressures(station), pressures(late)
    expected = np.interp(time - DELAY_S, time, plain)
    later = time > 0.5
    assert np.abs(late_pressures - expected)[later].max() < 0.005 * np.ptp(plain)
    assert np.abs(late_pressures - plain)[later].max() > 0.05 * np.ptp(plain)


@pytest.mark.parametrize(
    ("name", "law"), [("drive_delay", delayed_load), ("regulator_delay", delayed_pressure)]
)
def test_a_step_arrives_late_after_a_tenth_of_it_the_wrong_way(station_with, name, law):
    plant = station_with(name, delay_ms=1e3 * DELAY_S)
    time = np.arange(0.0, 0.2, 0.0005)
    low, high = (plant.regulator_voltage(p) for p in (300e3, 350e3))
    ahead = time > 0.0
    motor = np.where(ahead & (name == "drive_delay"), 3.0, 2.0)
    regulator = np.where(ahead & (name == "regulator_delay"), high, low)
    states, _ = plant.run(time, motor, regulator)
    columns = [plant.states.index(memory) for memory in CATALOGUE[name].memory_names]
    p = plant.model.parameters[name]
    # With a share of 1, the law passes nothing of the command at once.
    came = np.array([law(0.0, tuple(memory), p) for memory in states[:, columns]])
    share = (came - came[0]) / (came[-1] - came[0])
    assert share.min() == pytest.approx(-0.099, abs=0.002)
    assert share.max() == pytest.approx(1.052, abs=0.002)
    assert time[np.argmax(share > 0.5)] == pytest.approx(DELAY_S, abs=0.001)
    # The impulse of a step is right: what was missed before and after adds up to the delay.
    assert np.trapezoid(1.0 - share, time) == pytest.approx(DELAY_S, rel=0.02)


def test_delays_are_part_of_the_linear_system(station_with, station):
    late = station_with("drive_delay", delay_ms=1e3 * DELAY_S).linearize(300e3, 0.03)
    plain = station.linearize(300e3, 0.03)
    assert late.nstates == plain.nstates + 4
    at = late.output_labels.index("extension"), late.input_labels.index("motor_voltage")
    frequency = 2.0 * np.pi * 2.0
    ratio = late(1j * frequency)[at] / plain(1j * frequency)[at]
    assert np.angle(ratio) == pytest.approx(-frequency * DELAY_S, rel=1e-6)
    assert abs(ratio) == pytest.approx(1.0, abs=1e-6)


def test_a_cascade_has_a_delayed_regulator_too():
    plain = Plant("cascade")
    late = Plant(
        load_model("cascade").with_effects({"regulator_delay": {"share": 1.0, "delay_ms": 20}})
    )
    time = np.arange(0.0, 0.5, 0.001)
    volts = np.where(time > 0.0, *(plain.regulator_voltage(p) for p in (350e3, 300e3)))

    def half(plant):
        states, zero = plant.run(time, np.full(len(time), 2.0), volts)
        return time[np.argmax(plant.observe(states, zero)["pressure"] > 325e3)]

    assert half(late) - half(plain) == pytest.approx(0.02, abs=0.002)
