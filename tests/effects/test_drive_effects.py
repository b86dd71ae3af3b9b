"""What effects of the drive leave in data: dead zone, saturation, lag, ripple.

Unequal phase currents: where the shaft stands decides, and table I3 has it.

Dead time of the commands: what comes out is what went in, a while ago.
"""

import numpy as np
import pytest

from pma_gym.codegen.derivative import derivatives
from pma_gym.codegen.graph import CHANGING, FIXED, Graph
from pma_gym.codegen.text import evaluate
from pma_gym.codegen.trace import trace
from pma_gym.data.serres2008 import load_table
from pma_gym.data.trial import Trial
from pma_gym.effects import CATALOGUE
from pma_gym.effects.arithmetic import cosine
from pma_gym.effects.delay import (
    DriveDelay,
    RegulatorDelay,
    delayed_load,
    delayed_load_rate,
    delayed_pressure,
    delayed_pressure_rate,
)
from pma_gym.effects.drive.drive_dead_zone import load_beyond_dead_zone
from pma_gym.effects.drive.drive_lag import late_load
from pma_gym.effects.ports import STATION_PORTS
from pma_gym.effects.sensors.sensor_delay import SensorDelay, late_reading, late_reading_rate
from pma_gym.plant.equilibrium.solver import equilibria_at
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from tests.discovery.grey_box.test_free_rigs import RIGS, model

VOLTAGES = np.array([0.0, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 4.0])


def held_loads(plant, voltages=VOLTAGES, pressure=300e3):
    """Load cell (N) at rest under each voltage."""
    rests = [plant.settle(float(voltage), pressure) for voltage in voltages]
    seen = [plant.observe(rest.state[None, :], rest.zero_contraction) for rest in rests]
    return np.array([truth["load"][0] for truth in seen])


def asked(plant, voltages=VOLTAGES):
    drive = plant.model.parameters["drive"]
    return np.maximum(0.0, drive.gain * voltages + drive.offset)


@pytest.mark.parametrize(
    ("name", "values", "law"),
    [
        (
            "drive_dead_zone",
            {"width_n": 15.0},
            lambda f: np.minimum(f, 2 * np.maximum(f - 15, 0)),
        ),
        ("drive_saturation", {"limit_n": 150.0}, lambda f: np.minimum(f, 150.0)),
        ("drive_lag", {}, lambda f: f),  # statically absent
    ],
)
def test_loads_at_rest(station_with, name, values, law):
    plant = station_with(name, **values)
    np.testing.assert_allclose(held_loads(plant), law(asked(plant)), rtol=1e-8, atol=1e-7)


@pytest.mark.parametrize("slope", [1.2, 2.0, 4.0])
def test_a_dead_zone_neither_pushes_nor_falls_and_ends(slope):
    effect = CATALOGUE["drive_dead_zone"]
    p, none = (effect.parse({"width_n": width, "slope": slope}) for width in (15.0, 0.0))
    asked = np.linspace(0.0, 100.0, 401)
    loads = np.array([load_beyond_dead_zone(load, p) for load in asked])
    assert np.all(loads >= 0.0) and np.all(np.diff(loads) >= 0.0)
    ended = asked > 15.0 * slope / (slope - 1.0)
    np.testing.assert_array_equal(loads[ended], asked[ended])
    within = (asked > 0.0) & (asked < 15.0 * slope / (slope - 1.0) - 1e-9)
    assert np.all(loads[within] < asked[within])
    # Without a width the slope does nothing.
    for load in (0.0, 1e-300, 1e-9, 0.1, 1.0 / 3.0, 976.0):
        assert load_beyond_dead_zone(load, none) == load


TWO_WAY = {
    "drive_dead_band": ({"width_n_or_n_m": 15.0}, lambda f: f - np.clip(f, -15.0, 15.0)),
}
"""Effects of a drive of either sign: values, and the force of the drive (N, N m) with them."""


@pytest.mark.parametrize("rig", ["slide", "joint"])
@pytest.mark.parametrize("name", TWO_WAY)
def test_a_drive_of_either_sign_accelerates_by_its_law(rig, name):
    bare, (values, law) = model(rig, inertia=1.0), TWO_WAY[name]
    command, pull = {"slide": ("load_command", -1.0), "joint": ("torque_command", 1.0)}[rig]
    forces = np.linspace(-100.0, 100.0, 9)

    def speeds(model, time):
        trials = [Trial(time, {command: np.full(len(time), pull * force)}) for force in forces]
        runs = [Plant(model).simulate(each, noise=False).measurements for each in trials]
        return np.array([run[bare.rig.outputs[1]] for run in runs])

    with_effect = speeds(bare.with_effects({name: values}), np.array([0.0, 1e-6]))
    np.testing.assert_allclose(1e6 * RIGS[rig][0] * with_effect[:, -1], law(forces), rtol=1e-3)
    absent, time = bare.with_effects([name]), np.linspace(0.0, 0.1, 21)
    np.testing.assert_array_equal(speeds(absent, time), speeds(bare, time))


@pytest.mark.parametrize("name", TWO_WAY)
def test_slopes_of_a_drive_of_either_sign_are_differences(name):
    effect, values = CATALOGUE[name], TWO_WAY[name][0]
    graph, size = Graph(), next(iter(values.values()))
    load, own = graph.input("load", CHANGING), graph.input("own", FIXED)
    force = trace(effect.law, load, effect.parameters(own))
    at = {"load": np.linspace(-40.0, 40.0, 12), "own": np.full(12, size)}
    for name, slope in zip(at, derivatives([force], [load, own])[0], strict=True):
        ends = [evaluate([force], {**at, name: at[name] + step})[0] for step in (-1e-4, 1e-4)]
        np.testing.assert_allclose(
            evaluate([slope], at)[0], (ends[1] - ends[0]) / 2e-4, rtol=1e-7, atol=1e-7
        )


@pytest.mark.parametrize("share", [1.0, 0.4])
def test_a_late_drive_follows_a_step_exponentially(station_with, share):
    plant = station_with("drive_lag", share=share, time_constant_ms=20.0)
    rest, regulator = plant.settle(2.0, 300e3), plant.regulator_voltage(300e3)
    drive, p = plant.model.parameters["drive"], plant.model.parameters["drive_lag"]
    at = plant.states.index("memory_drive_lag")
    before, after = (drive.gain * v + drive.offset for v in (2.0, 3.0))
    assert rest.state[at] == pytest.approx(share * before, rel=1e-12)
    for i in range(1, 9):
        plant.step(rest, 3.0, regulator, 0.01)
        arrived = late_load(after, rest.state[at], p)
        expected = after - share * (after - before) * np.exp(-0.01 * i / 0.02)
        assert arrived == pytest.approx(expected, rel=1e-5)


def test_the_laws_cosine_is_exact_to_1e_11():
    values = np.concatenate([np.linspace(-300.0, 300.0, 20_001), np.linspace(-1e4, 1e4, 20_001)])
    assert np.abs(cosine(values) - np.cos(values)).max() < 1e-11


def test_ripple_comes_as_often_a_turn_as_it_says(station_with):
    plant = station_with("torque_ripple", amplitude_percent=1.0, periods=24.0, phase_deg=0.0)
    voltages = np.linspace(1.0, 5.0, 150)
    rests = [plant.settle(float(voltage), 300e3) for voltage in voltages]
    truth = [plant.observe(rest.state[None, :], rest.zero_contraction) for rest in rests]
    loads = np.array([seen["load"][0] for seen in truth])
    angles = np.array([seen["rotation"][0] for seen in truth])
    share = loads / asked(plant, voltages) - 1.0
    assert np.abs(share).max() == pytest.approx(0.01, rel=1e-3)
    np.testing.assert_allclose(share, 0.01 * np.cos(24.0 * angles), atol=1e-8)
    assert np.ptp(angles) > np.radians(60.0)


def test_one_effect_of_the_drive_takes_what_the_one_before_gives():
    # In catalogue order: dead zone, limit, delay, lag, ripple, whatever order a file has.
    names = [n for n in CATALOGUE if n.startswith("drive_") or n == "torque_ripple"]
    names = [n for n in names if CATALOGUE[n].port in STATION_PORTS]
    shape = ["drive_dead_zone", "drive_saturation"]
    assert names == [*shape, "drive_delay", "drive_lag", "torque_ripple"]


RADIUS_M = 25.9e-3
SEEN_KPA = (150.0, 250.0, 300.0, 400.0, 500.0, 575.0)
"""Pressures that the load is fitted to; the other five judge."""


def shares(plant, pressure):
    """Swing of the load as a share of it, contraction (m) and the shaft's angle (rad)."""
    drive, radius = plant.model.parameters["drive"], plant.model.parameters["rotor"].radius
    volts = np.linspace(1.0, 7.0, 60)
    states, zero = equilibria_at(plant, volts, np.full(60, plant.regulator_voltage(pressure)))
    truth = [
        plant.observe(state[None, :], start) for state, start in zip(states, zero, strict=True)
    ]
    load, contraction, angle = (
        np.array([seen[name][0] for seen in truth]) for name in ("load", "contraction", "rotation")
    )
    return load / (drive.gain * volts + drive.offset) - 1.0, contraction, angle - zero / radius


def test_peaks_stand_where_the_slide_stands_at_every_pressure(station_with):
    plant = station_with("current_imbalance", amplitude_percent=3.0, phase_deg=40.0)
    places = []
    for pressure in (300e3, 450e3):
        share, contraction, angle = shares(plant, pressure)
        expected = 0.03 * np.cos(6.0 * angle + np.radians(40.0))
        np.testing.assert_allclose(share, expected, atol=1e-8)
        between = (contraction > 20e-3) & (contraction < 42e-3)
        places.append(contraction[between][np.argmax(share[between])])
    # The cable gives by 1 mm between the loads that hold these places; a ripple over the angle from
    # no load would stand 10 mm apart.
    assert places[0] == pytest.approx(places[1], abs=2e-3)


def fitted(columns, loads, chosen):
    """Rms (N) of loads about their fit on some rows, at the other rows."""
    coefficients, *_ = np.linalg.lstsq(columns[chosen], loads[chosen], rcond=None)
    off = (loads - columns @ coefficients)[~chosen]
    return float(np.sqrt(np.mean(off**2))), coefficients


def test_table_i3_has_it_on_pressures_that_were_not_fitted_to():
    table = load_table("I3")
    volts, loads = table["motor_voltage_v"], table["load_n"]
    seen = np.isin(table["pressure_nominal_kpa"], SEEN_KPA)
    line = np.column_stack([volts, np.ones_like(volts)])
    # Where the slide stands, as an angle of the pulley.
    stands = (table["extension_mm"] - table["no_load_contraction_mm"]) * 1e-3 / RADIUS_M
    from_no_load = table["extension_mm"] * 1e-3 / RADIUS_M

    def wave(angle, periods):
        return [volts * np.cos(periods * angle), volts * np.sin(periods * angle)]

    plain, _ = fitted(line, loads, seen)
    by_stand, coefficients = fitted(np.column_stack([line, *wave(stands, 5.9)]), loads, seen)
    from_rest, _ = fitted(np.column_stack([line, *wave(from_no_load, 5.9)]), loads, seen)
    assert plain > 12.0 and from_rest > 11.5
    assert by_stand < 6.5
    assert np.hypot(*coefficients[2:]) / coefficients[0] == pytest.approx(0.027, abs=0.002)
    tried = np.arange(2.0, 12.05, 0.1)
    errors = [fitted(np.column_stack([line, *wave(stands, n)]), loads, ~seen)[0] for n in tried]
    assert tried[int(np.argmin(errors))] == pytest.approx(6.0, abs=0.25)


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
