"""Diagnoses of logs whose readings are wrong: the rigs of another simulator have what is known."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from pma_gym import Plant
from pma_gym.data.trial import Trial
from pma_gym.discovery import diagnose
from pma_gym.discovery.grey_box.hum import without_hum
from pma_gym.discovery.grey_box.prepared_trials import PreparedTrials, white_noise
from pma_gym.discovery.report.next_steps import what_to_do
from pma_gym.estimation.logged import Logged
from tests.discovery.grey_box import test_free_rigs as rigs

NOISE = {"slide": 2e-5, "joint": 4e-4}
READING = {"slide": "contraction", "joint": "angle"}


@cache
def moved(plant):
    """Trials of a rig without dry friction, whose readings have no noise."""
    kept = rigs.RIGS[plant]
    try:
        rigs.RIGS[plant] = (*kept[:2], 0.0, *kept[3:5], 0.0, *kept[6:])
        return rigs.logs(plant)
    finally:
        rigs.RIGS[plant] = kept


def diagnosed(plant, wrong):
    """The diagnosis where `wrong(time, position)` is read, with noise."""
    generator, trials = np.random.default_rng(7), []
    for trial in moved(plant):
        read = wrong(trial.time, trial.measurements[READING[plant]])
        read = read + NOISE[plant] * generator.standard_normal(len(read))
        trials.append(replace(trial, measurements={READING[plant]: read}))
    return diagnose(trials, rigs.model(plant), propose=False)


def holds(estimate, truth):
    """Whether the truth is in an interval."""
    return estimate.low <= truth <= estimate.high


@pytest.mark.campaign
def test_a_bent_sensor_is_named_with_its_curvature():
    diagnosis = diagnosed("slide", lambda _, q: q + 0.1 * q**2)
    sizes = {effect.name: effect.parameters for effect in diagnosis.effects}
    assert holds(sizes["lvdt_bend"]["curvature_percent_per_mm"], 0.01), diagnosis.sentence


def lost(position, width):
    """What a sensor reads behind a play that friction holds."""
    place, shown = position[0], []
    for q in position:
        place = min(max(place, q - 0.5 * width), q + 0.5 * width)
        shown.append(place)
    return np.array(shown)


def test_play_before_a_sensor_is_named_with_its_width():
    diagnosis = diagnosed("slide", lambda _, q: lost(q, 4e-4))
    (effect,) = diagnosis.effects
    assert effect.name == "lvdt_backlash", diagnosis.sentence
    assert effect.parameters["width_mm"].value == pytest.approx(0.4, rel=0.02)


def test_a_clock_that_runs_fast_is_said_with_its_share_and_is_no_effect():
    """Readings at labels that are 0.4 % ahead of the commands' time."""
    fast = 4e-3
    diagnosis = diagnosed("slide", lambda t, q: CubicSpline(t, q)(t / (1.0 + fast)))
    assert diagnosis.verdict == "parameters", diagnosis.sentence
    assert not diagnosis.effects
    said = re.search(r"clock of the readings runs ([\d.]+) % .* fast", diagnosis.sentence)
    assert said and float(said[1]) == pytest.approx(100.0 * fast, rel=0.05), diagnosis.sentence
    (clock,) = diagnosis.nuisances
    assert clock.kind == "clock"
    assert clock.signals["contraction_mm"] == pytest.approx(fast, rel=0.05)
    # Readings whose times are divided as it says are those of the commands' clock.
    (step,) = [each for each in what_to_do(diagnosis) if "one clock" in each]
    by = re.search(r"by (1\.\d+)", step)
    assert by and float(by[1]) == pytest.approx(1.0 + fast, abs=2e-4)
    mass = diagnosis.model.parameters["slide"].mass
    assert mass == pytest.approx(rigs.RIGS["slide"][0], rel=3e-3)


def test_the_hum_of_a_sensor_is_said_and_leaves_no_misfit():
    size, hertz = 2e-4, 37.3
    diagnosis = diagnosed("slide", lambda t, q: q + size * np.sin(2.0 * np.pi * hertz * t + 1.0))
    assert not diagnosis.effects, diagnosis.sentence
    said = re.search(
        r"sensor of contraction hums at ([\d.]+) Hz with ([\d.]+) mm", diagnosis.sentence
    )
    assert said, diagnosis.sentence
    assert float(said[1]) == pytest.approx(hertz, rel=1e-3)
    assert float(said[2]) == pytest.approx(1e3 * size, rel=0.03)
    (line,) = diagnosis.nuisances
    assert line.hertz == pytest.approx(hertz, abs=0.02)
    assert any("filter 37.3 Hz" in step for step in what_to_do(diagnosis))
    after = re.search(r"miss by ([\d.]+) mm", diagnosis.sentence)
    assert after and float(after[1]) < 1.2e3 * NOISE["slide"]


@pytest.mark.parametrize("share", [0.02, 0.2, 0.42, 1.0])
def test_the_noise_of_readings_is_told_however_coarse_their_step(share):
    """Half a step of noise was two thirds of itself: the median of whole steps is a whole one."""
    step, generator = 1e-4, np.random.default_rng(1)
    drawn = 0.0317 * step * np.arange(20_000) + share * step * generator.standard_normal(20_000)
    read = step * np.round(drawn / step)
    expected = np.hypot(share * step, step / 12**0.5)
    assert max(white_noise([read], step), step / 12**0.5) == pytest.approx(expected, rel=0.2)


def coloured(time, size, lasts, seed=3):
    """Noise of an exponential correlation, from its own seed."""
    kept = np.exp(-(time[1] - time[0]) / lasts)
    new = np.random.default_rng((seed, len(time))).standard_normal(len(time))
    new[1:] *= np.sqrt(1.0 - kept**2)
    return size * lfilter([1.0], [1.0, -kept], new)


def test_coloured_noise_is_said_with_its_size_and_memory_and_is_no_effect():
    size, lasts = 6e-5, 0.04
    diagnosis = diagnosed("slide", lambda t, q: q + coloured(t, size, lasts))
    assert not diagnosis.effects, diagnosis.sentence
    said = re.search(
        r"coloured noise of ([\d.]+) mm with a correlation time of ([\d.]+) s", diagnosis.sentence
    )
    assert said, diagnosis.sentence
    assert float(said[1]) == pytest.approx(1e3 * size, rel=0.2)
    assert float(said[2]) == pytest.approx(lasts, rel=0.4)
    (known,) = diagnosis.nuisances
    assert known.kind == "coloured noise"
    assert known.signals["contraction_mm"] == pytest.approx(0.7, abs=0.15)
    assert holds(diagnosis.parameters["slide.mass_kg"].now, rigs.RIGS["slide"][0])
    # What is missed is all noise, of either kind.
    gap = diagnosis.gap["contraction_mm"]
    assert gap.floor == pytest.approx(1e3 * np.hypot(size, NOISE["slide"]), rel=0.2)
    assert gap.after < 1.3 * gap.floor


def test_readings_without_hum_have_no_line():
    """Nor have those whose noise has a colour: its spectrum is high in a band."""
    for colour in (0.0, 0.8):
        trials = []
        for i, trial in enumerate(moved("slide")):
            noise = NOISE["slide"] * np.random.default_rng(i).standard_normal(len(trial.time))
            read = trial.measurements["contraction"] + lfilter([1.0], [1.0, -colour], noise)
            trials.append(replace(trial, measurements={"contraction": read}))
        made = rigs.model("slide")
        every = [Logged.of(made, i, trial) for i, trial in enumerate(trials)]
        assert not without_hum(PreparedTrials(made, every, 1)).hums


def test_mains_at_half_the_rate_of_the_readings_hum_though_they_move_more_elsewhere():
    """The line is the last of the spectrum, one of its waves is none, and a motion is louder."""
    trials = []
    for i, trial in enumerate(moved("slide")):
        noise = NOISE["slide"] * np.random.default_rng(i).standard_normal(len(trial.time))
        half = 0.5 / (trial.time[1] - trial.time[0])
        hum = 2e-4 * np.sin(2.0 * np.pi * (half - 0.005) * trial.time + 2.0)
        read = trial.measurements["contraction"] + noise + hum
        trials.append(replace(trial, measurements={"contraction": read}))
    made = rigs.model("slide")
    every = [Logged.of(made, i, trial) for i, trial in enumerate(trials)]
    (hum,) = without_hum(PreparedTrials(made, every, 1)).hums
    assert hum.hertz == pytest.approx(half, abs=0.1)
    # Its phase is nearly that of the start: of 2e-4 m they show the sine of 2.
    assert np.ptp(hum.of(0, trials[0].time[:2])) == pytest.approx(2.0 * 2e-4 * np.sin(2.0), rel=0.1)


def test_a_hum_is_taken_out_of_averaged_rows_too():
    """Where several readings are one row, which hums less than they do."""
    time = np.arange(60_000) * 1e-3
    generator = np.random.default_rng(3)
    load = np.repeat(generator.uniform(-20.0, 20.0, 61), 1000)[: len(time)]
    made = rigs.model("slide")
    motion = Plant(made).simulate(Trial(time, {"load_command": load}), noise=False)
    read = motion.measurements["contraction"] + 2e-5 * generator.standard_normal(len(time))
    read += 1e-4 * np.cos(2.0 * np.pi * 50.02 * time)
    trial = Trial(time, {"load_command": load}, {"contraction": read})
    prepared = PreparedTrials(made, [Logged.of(made, 0, trial)], 1)
    assert prepared.block > 1
    (hum,) = without_hum(prepared).hums
    assert hum.hertz == pytest.approx(50.02, abs=1e-3)
    assert hum.amplitude == pytest.approx(1e-4, rel=0.02)
