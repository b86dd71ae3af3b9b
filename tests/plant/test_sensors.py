"""Sensors: lag, noise, calibration, quantisation."""

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.plant import sensors
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant

STEPS = {"contraction": 0.050e-3, "load": 1.19, "pressure": 0.48e3, "rotation": np.radians(0.344)}
NOISE = {"contraction": 0.02e-3, "load": 0.5, "pressure": 0.3e3, "rotation": np.radians(0.1)}


PLANT = Plant("serres2008")


@pytest.fixture(scope="module")
def slow():
    """A trial that passes slowly over many steps of the DAQ."""
    rows = 20_000
    motor, regulator = np.linspace(2.5, 3.5, rows), np.linspace(6.0, 6.2, rows)
    commands = {"motor_voltage": motor, "regulator_voltage": regulator}
    return Trial(time=1e-3 * np.arange(rows), commands=commands)


def test_one_daq_step_is_what_the_station_has(slow):
    measured = Plant("serres2008").simulate(slow).measurements
    for name, step in STEPS.items():
        levels = np.unique(measured[name])
        widths = np.diff(levels) / step
        assert np.abs(widths - np.round(widths)).max() < 0.011
        assert np.round(widths).min() == 1


def test_noise_has_the_stated_standard_deviation(slow):
    measured, true = PLANT.simulate(slow).measurements, PLANT.simulate(slow).truth
    for name, sd in NOISE.items():
        # Quantising adds a twelfth of the square of its step.
        expected = np.hypot(sd, STEPS[name] / np.sqrt(12.0))
        assert np.std(measured[name] - true[name]) == pytest.approx(expected, rel=0.03)
    levels = sensors.noise_levels(PLANT.model)
    assert dict(zip(("contraction", "rotation", "load", "pressure"), levels, strict=True)) == (
        pytest.approx(NOISE)
    )


def test_the_same_seed_gives_the_same_bits(slow):
    one, same, other = (PLANT.simulate(slow, seed=seed) for seed in (7, 7, 8))
    for name in STEPS:
        np.testing.assert_array_equal(one.measurements[name], same.measurements[name])
        assert np.any(one.measurements[name] != other.measurements[name])
        np.testing.assert_array_equal(one.truth[name], other.truth[name])


def test_without_noise_the_readings_are_the_lagged_truth():
    rows = 2001
    when = 1e-3 * np.arange(rows)
    motor = 3.0 + np.sin(2.0 * np.pi * when)
    trial = Trial(
        time=when, commands={"motor_voltage": motor, "regulator_voltage": np.full(rows, 6.0)}
    )
    run = PLANT.simulate(trial, noise=False)
    for name, bandwidth in (("contraction", 100.0), ("load", 500.0), ("rotation", 200.0)):
        delayed = np.interp(when - 1.0 / (2.0 * np.pi * bandwidth), when, run.truth[name])
        span = np.ptp(run.truth[name])
        # A first-order lag delays what changes slowly by its time constant.
        assert np.abs(run.measurements[name] - delayed)[500:].max() < 2e-4 * span
        assert np.abs(run.measurements[name] - run.truth[name])[500:].max() > 5e-4 * span


def test_a_model_without_a_sensor_reads_the_truth():
    full = load_model("serres2008")
    names = [name for name in full.parameters if name not in ("lvdt", "potentiometer")]
    from pma_gym.plant.model import Model

    bare = Model("bare", "", "station", {name: full.parameters[name] for name in names})
    plant = Plant(bare)
    commands = {"motor_voltage": np.array([2.0, 3.0]), "regulator_voltage": np.full(2, 6.0)}
    run = plant.simulate(Trial(time=np.array([0.0, 0.05]), commands=commands), noise=False)
    np.testing.assert_array_equal(run.measurements["contraction"], run.truth["contraction"])
    assert np.any(run.measurements["load"] != run.truth["load"])
    assert list(sensors.noise_levels(bare)[:2]) == [0.0, 0.0]


@pytest.mark.parametrize(
    ("command", "value", "message"),
    [
        ("pressure_command", 700e3, "must lie in 0 to 578.6 kPa, .* sample 1 has 700; write ga"),
        ("pressure_command", -1e3, "must lie in 0 to 578.6 kPa, .* sample 1 has -1; write gauge"),
        ("load_command", 2e3, "must lie in 0 to 976.4 N, .* sample 1 has 2000; write newto"),
        ("load_command", -1.0, "must lie in 0 to 976.4 N, .* sample 1 has -1; a cable pulls"),
    ],
)
def test_commands_that_no_voltage_gives_are_refused(command, value, message):
    good = {"pressure_command": [300e3, 300e3], "load_command": [0.0, 100.0]}
    trial = Trial(time=[0.0, 1.0], commands=good | {command: [good[command][0], value]})
    with pytest.raises(ValueError, match=message):
        sensors.voltages(load_model("serres2008"), trial)
    volts = sensors.voltages(load_model("serres2008"), Trial(time=[0.0, 1.0], commands=good))
    assert all(np.all((0.0 <= one) & (one <= 10.0)) for one in volts)
