"""What a regulator's limit and wrong sensors leave in data."""

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.plant.equilibrium.solver import NoLoadEquilibria, equilibria_at


def pressures(plant, step, dense):
    """True pressure (Pa) after a step of the asked one from 200 kPa."""
    low, high = (plant.regulator_voltage(p) for p in (200e3, 200e3 + step))
    regulator = np.where(dense > 0.0, high, low)
    states, zero = plant.run(dense, np.full(len(dense), 1.0), regulator)
    return plant.observe(states, zero)["pressure"]


def test_a_large_step_rises_straight_and_a_small_one_as_ever(station_with, station):
    dense = np.concatenate([[0.0], np.arange(0.001, 0.6, 0.001)])
    plant = station_with("regulator_rate_limit", limit_kpa_per_s=1000.0)
    rising = pressures(plant, 300e3, dense)
    rate = np.diff(rising[5:200]) / np.diff(dense[5:200])
    np.testing.assert_allclose(rate, 1e6, rtol=1e-3)
    # tau 55 ms: 1000 kPa/s is what an error of 55 kPa asks for.
    np.testing.assert_allclose(
        pressures(plant, 50e3, dense), pressures(station, 50e3, dense), atol=5.0
    )
    assert np.abs(rising - pressures(station, 300e3, dense)).max() > 50e3


def test_a_limited_regulator_rests_where_it_is_told(station_with):
    plant = station_with("regulator_rate_limit", limit_kpa_per_s=10.0)
    for pressure in (150e3, 300e3, 575e3):
        rest = plant.settle(1.0, pressure)
        assert rest.state[plant.states.index("pressure")] == pytest.approx(pressure, rel=1e-12)


LINES = [
    ("lvdt_error", "contraction", 0.01, 0.5e-3),
    ("load_cell_error", "load", 0.02, 5.0),
    ("pressure_transducer_error", "pressure", 0.016, 3.4e3),
    ("potentiometer_error", "rotation", -0.01, np.radians(1.0)),
]


@pytest.mark.parametrize(("name", "quantity", "gain", "offset"), LINES)
def test_a_wrong_sensor_reads_a_line_of_the_truth(name, quantity, gain, offset, station_with):
    plant = station_with(name)
    time = np.linspace(0.0, 3.0, 31)
    trial = Trial(
        time=time,
        commands={
            "motor_voltage": np.interp(time, [0.0, 1.0, 2.0], [1.0, 4.0, 4.0]),
            "regulator_voltage": np.full(31, plant.regulator_voltage(300e3)),
        },
        measurements={},
    )
    logged = plant.simulate(trial, noise=False)
    assert logged.truth is not None
    for other, truth in logged.truth.items():
        if other not in logged.measurements:
            continue
        wrong = truth * (1.0 + gain) + offset if other == quantity else truth
        for row in (0, -1):
            # Ten time constants of the slowest sensor after the last move.
            scale = np.abs(truth).max()
            assert logged.measurements[other][row] == pytest.approx(wrong[row], abs=1e-6 * scale)


@pytest.mark.parametrize(("name", "quantity", "gain", "offset"), LINES)
def test_many_wrong_sensors_begin_at_rest(name, quantity, gain, offset, station_with):
    plant = station_with(name)
    assert NoLoadEquilibria(plant)(np.array([300e3])) is None
    voltages = np.full(2, plant.regulator_voltage(300e3))
    states, zero = equilibria_at(plant, np.array([0.0, 2.0]), voltages)
    for motor, state, x0 in zip((0.0, 2.0), states, zero, strict=True):
        alone = plant.settle(motor, 300e3)
        np.testing.assert_array_equal(alone.state, state)
        rates = plant.derivative(state, motor, voltages[0], x0)
        assert np.all(np.abs(rates) < 1e-5)


def test_the_truth_knows_nothing_of_a_wrong_sensor(station_with, station):
    dense = np.arange(0.0, 0.2, 0.01)
    for name, *_ in LINES:
        late_pressures, expected = (
            pressures(p, 50e3, dense) for p in (station_with(name), station)
        )
        np.testing.assert_allclose(late_pressures, expected, atol=0.01)
