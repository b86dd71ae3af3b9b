"""What is between an axis and its log: drive, sensor, noise, and the size of an effect."""

import math

import numpy as np
import pytest

from benchmarks.hidden_effects.rigs import effect_size, laws
from benchmarks.hidden_effects.rigs.rig import Rig
from benchmarks.hidden_effects.rigs.sensing import Noise, Sensor
from benchmarks.hidden_effects.rigs.simulators import stick_slip
from benchmarks.hidden_effects.rigs.simulators.drive import Drive, Transmission

INTERVAL = 0.01


def driven(transmission, commands):
    """Forces at ten instants of each interval."""
    drive = Drive(transmission, INTERVAL)
    drive.begin(commands[0])
    forces = []
    for command in commands[1:]:
        drive.push(command)
        forces += [drive.at(INTERVAL * share / 10.0) for share in range(10)]
    return np.array(forces)


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.01, 0.0237])
def test_a_late_drive_gives_the_joined_commands_of_before(delay):
    commands = np.random.default_rng(1).normal(size=40)
    times = np.arange(390) * INTERVAL / 10.0
    wanted = np.interp(times - delay, np.arange(40) * INTERVAL, commands)
    assert driven(Transmission(delay=delay), commands) == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("delay", [0.0, 0.0237])
def test_a_lag_follows_as_its_differential_equation_says(delay):
    commands = np.random.default_rng(2).normal(size=40)
    lag, fine = 0.015, 20000
    times = np.linspace(0.0, 0.39, fine)
    late = np.interp(times - delay, np.arange(40) * INTERVAL, commands)
    value, values = commands[0], []
    for k in range(fine - 1):
        values.append(value)
        value += (times[1] - times[0]) * (0.5 * (late[k] + late[k + 1]) - value) / lag
    got = driven(Transmission(delay=delay, lag=lag), commands)
    wanted = np.interp(np.arange(380) * INTERVAL / 10.0, times[:-1], values)
    assert got[:380] == pytest.approx(wanted, abs=2e-3)


def test_a_drive_may_be_stronger_forwards():
    forces = driven(Transmission(forward=1.1, backward=0.9), np.array([2.0, 2.0, -2.0, -2.0]))
    assert forces[0] == pytest.approx(2.2) and forces[-1] == pytest.approx(-1.8)


def test_an_encoder_rounds_to_its_step():
    sensor = Sensor("encoder", 0.01, Noise(0.0))
    read = [sensor.reading(q, 0.0) for q in (0.1234, -0.1266)]
    assert read == pytest.approx([0.12, -0.13])


TIME = np.arange(60000) / 1000.0


def test_noise_has_the_rms_that_it_says():
    loud = Noise(1.0, hum=0.7, drift=0.6, colour=0.9, memory=0.02, tails=4.0)
    for seed in range(3):
        drawn = loud.draw(np.random.default_rng(seed), TIME)
        assert float(np.std(drawn)) == pytest.approx(loud.rms, rel=0.1)
    assert loud.rms == pytest.approx(math.sqrt(1.0 + 0.49 + 0.36 + 0.81))


def test_hum_is_at_the_mains_and_its_harmonics():
    humming = Noise(1e-6, hum=1.0, mains=60.0, harmonics=(0.0, 0.5))
    power = np.abs(np.fft.rfft(humming.draw(np.random.default_rng(3), TIME))) ** 2
    frequencies = np.fft.rfftfreq(len(TIME), 1e-3)
    total = power.sum()
    for middle in (60.0, 180.0):
        near = np.abs(frequencies - middle) < 0.5
        power[near], kept = 0.0, power[near].sum()
        assert kept > 0.1 * total
    assert power.sum() < 1e-3 * total


def test_colour_forgets_in_its_time_and_outliers_are_as_many_as_said():
    coloured = Noise(1e-9, colour=1.0, memory=0.05).draw(np.random.default_rng(4), TIME)
    assert float(np.corrcoef(coloured[:-50], coloured[50:])[0, 1]) == pytest.approx(
        math.exp(-1.0), abs=0.05
    )
    noise = Noise(1.0, outlier_share=2e-3, outlier_size=15.0)
    spoiled = noise.draw(np.random.default_rng(5), TIME)
    assert 80 < np.sum(np.abs(spoiled) > 7.0) < 160


AXIS = Rig("slide", 2.0, 6.0, 0.0, 0.0, 0.0, 0.05, 2.0, 500.0)


def push(row, q):
    return 6.0 * math.sin(2.0 * math.pi * 1.3 * row / 500.0 + 0.3) * min(1.0, row / 250.0)


def moved(axis, *effects):
    return stick_slip.simulate(axis, effects, Transmission(), push, 3000)


def test_what_a_refit_can_do_is_no_effect():
    heavier = Rig(**(vars(AXIS) | {"inertia": 2.02, "damping": 6.1}))
    plain = effect_size.change(AXIS, moved(AXIS))
    other = effect_size.change(AXIS, moved(heavier))
    assert effect_size.size(plain, 1e-6) < 0.1
    bent = effect_size.change(AXIS, moved(AXIS, laws.CoulombFriction(0.1)))
    # 1 % of inertia moves it by half a millimetre; of second order, a little stays.
    assert effect_size.size(other, 1e-6) < 0.15 * effect_size.size(bent, 1e-6)


@pytest.mark.campaign
def test_the_size_is_the_misfit_of_a_refitted_model():
    """Against a refit by simulation: mass, damping and the start of every window free."""
    from scipy.optimize import least_squares

    hidden = moved(AXIS, laws.CoulombFriction(0.05))
    ratio = effect_size.size(effect_size.change(AXIS, hidden), 1e-5)
    rows = 1250  # the slowest period of the reference: 2.5 s

    def misfit(x):
        axis, parts = Rig(**(vars(AXIS) | {"inertia": x[0], "damping": x[1]})), []
        for w in range(2):
            first = w * rows
            part = stick_slip.simulate(
                axis,
                (),
                Transmission(),
                lambda row, q, first=first: float(hidden.command[first + row]),
                rows,
                (hidden.q[first] + 1e-3 * x[2 + 2 * w], hidden.v[first] + 1e-2 * x[3 + 2 * w]),
            )
            parts.append(part.q - hidden.q[first : first + rows])
        return np.concatenate(parts) / 1e-5

    fit = least_squares(misfit, [2.0, 6.0, 0.0, 0.0, 0.0, 0.0], diff_step=1e-4)
    assert math.sqrt(np.mean(fit.fun**2)) == pytest.approx(ratio, rel=0.05)
