"""Noise as laboratories have it is learnt from repeats and rest, and projected out of every fit."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pma_gym import Plant, Trial, load_model
from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.discovery import diagnose
from pma_gym.discovery.preparation.learnt_noise import UNSURE, learnt_noise
from pma_gym.discovery.preparation.mains_lines import with_lines
from pma_gym.discovery.preparation.noise import Whitening, white_noise
from pma_gym.discovery.preparation.nuisance_projection import drift_columns, projection
from pma_gym.estimation.logged import Logged

RATE = 128.0
LEVEL = 1e3
CHANNEL = 3


def _logged(noises: list[np.ndarray]) -> tuple[list[Logged], list[NamedTrial]]:
    """Repeats of one trial with pressure (Pa) alone, each with its noise."""
    model, named = load_model("serres2008"), []
    for number, noise in enumerate(noises):
        wave = 2.0 * np.pi * 0.5 * np.arange(len(noise)) / RATE
        commands = {"motor_voltage": np.ones(len(wave)), "regulator_voltage": 5.0 + np.sin(wave)}
        pressure = 3e5 + 2e4 * np.sin(wave - 0.4) + LEVEL * noise
        trial = Trial(np.arange(len(noise)) / RATE, commands, {"pressure": pressure})
        named.append(NamedTrial(f"{number}", trial, repeat_of="0" if number else None))
    return [Logged.of(model, i, each.trial) for i, each in enumerate(named)], named


def _learnt(noises: list[np.ndarray]) -> Whitening:
    """What repeats with such noise tell of the pressure's."""
    return learnt_noise(_levels(), *_logged(noises))[CHANNEL]


def _rms_left(noise: Whitening, trial: Logged, rows: np.ndarray, free_zero: bool = False) -> Any:
    """What a projection leaves of rows, root mean square."""
    left = np.atleast_2d(rows).copy()
    projection(noise, trial, CHANNEL, free_zero).out_of(left)
    return np.sqrt(np.mean(left**2, axis=1))


def _levels() -> list[Whitening]:
    return [white_noise(1.0), white_noise(1.0), white_noise(1.0), white_noise(LEVEL)]


def _coloured(rng: np.random.Generator, memory: float, rows: int) -> np.ndarray:
    noise = np.zeros(rows)
    for row in range(1, rows):
        noise[row] = memory * noise[row - 1] + np.sqrt(1.0 - memory**2) * rng.standard_normal()
    return noise


def test_repeats_tell_the_colour_of_the_noise() -> None:
    """An AR(1) of 0.8 is learnt from what two repeats differ by; white noise stays white."""
    rng = np.random.default_rng(1)
    learnt = _learnt([_coloured(rng, 0.8, 1024) for _ in range(2)])
    assert learnt.coefficients[0] == pytest.approx(0.8, abs=0.08)
    assert learnt.drift == 0.0
    assert _learnt([rng.standard_normal(1024) for _ in range(2)]).coefficients == ()


def test_a_drift_is_learnt_from_repeats_and_one_that_repeats_is_structure() -> None:
    """Slow cosines that differ between repeats are a drift; the same in all of them are none."""
    rng, slow = np.random.default_rng(2), np.cos(np.pi * np.arange(1024) / 1024)
    for signs, least, most in (((1.0, -0.8), 0.3 * LEVEL, np.inf), ((1.0, 1.0), 0.0, 0.0)):
        drift = _learnt([rng.standard_normal(1024) + sign * slow for sign in signs]).drift
        assert least <= drift <= most


@pytest.mark.parametrize("memory", [0.0, 0.8, 0.95])
def test_the_size_of_a_drift_does_not_depend_on_the_colour_of_the_noise(memory: float) -> None:
    """Coloured noise has many times as much at a drift's frequencies as white noise of its size."""
    rng, slow = np.random.default_rng(11), np.cos(np.pi * np.arange(4096) / 4096)
    learnt = _learnt([_coloured(rng, memory, 4096) + sign * slow for sign in (1.0, -1.0) * 4])
    # Two that drift against each other differ by twice what each of them does: by root 2 more than
    # two that drift at random.
    assert learnt.drift / UNSURE == pytest.approx(LEVEL, rel=0.15)


def test_repeats_with_holes_tell_the_noise_too() -> None:
    """Readings that were set aside, as outliers are, hide neither colour nor drift of the rest."""
    rng, slow = np.random.default_rng(4), np.cos(np.pi * np.arange(1024) / 1024)
    noises = [_coloured(rng, 0.8, 1024) + sign * slow for sign in (2.0, -2.0)]
    for noise in noises:
        noise[rng.choice(1024, 20, replace=False)] = np.nan
    learnt = _learnt(noises)
    assert learnt.coefficients[0] == pytest.approx(0.8, abs=0.1)
    assert learnt.drift > LEVEL


def test_rows_of_commands_alone_hide_no_drift() -> None:
    """Averaged logs keep rows without readings where commands bend; they are no holes."""
    rng, at = np.random.default_rng(7), np.arange(2048)
    noises = [rng.standard_normal(2048) + sign * np.cos(np.pi * at / 2048) for sign in (1.0, -0.8)]
    for noise in noises:
        noise[(at > 500) & (at % 2 == 1)] = np.nan
    learnt = _learnt(noises)
    assert np.mean(_logged(noises)[0][0].counts[CHANNEL] > 0.0) < 0.7
    assert learnt.drift > 0.3 * LEVEL and learnt.coefficients == ()


def test_repeated_pieces_of_runs_tell_a_drift_by_their_constants() -> None:
    """A wave of 32 s is a constant in each piece of a second; between whole trials it is a zero."""
    rng, at = np.random.default_rng(8), np.pi * np.arange(2 * 16 * 128) / (16 * 128)
    waves = [
        np.sqrt(2.0) * np.sin(at[start : start + 128] + phase)
        for start in range(0, 16 * 128, 128)
        for phase in (0.4, 3.0)
    ]
    learnt, whole, none = (
        learnt_noise(_levels(), logged, runs)[CHANNEL]
        for share, files in ((1.0, True), (1.0, False), (0.0, True))
        for logged, named in [_logged([rng.standard_normal(128) + share * w for w in waves])]
        for runs in [
            [
                replace(e, file=f"run{i % 2}" if files else None, repeat_of=f"{i - i % 2}")
                for i, e in enumerate(named)
            ]
        ]
    )
    assert 0.8 * LEVEL < learnt.offset / UNSURE < 1.5 * LEVEL
    assert whole.offset == none.offset == 0.0
    # A constant of its own in every piece loses its weight, and a course keeps it.
    rows = np.stack([np.ones(128), np.sin(2.0 * np.pi * np.arange(128) / 128)])
    left = _rms_left(learnt, _logged([waves[0]])[0][0], rows)
    assert left == pytest.approx([0.05, np.sqrt(0.5)], abs=0.03)


@pytest.mark.parametrize("turns", [0.5, 0.8, 1.1, 1.5])
def test_columns_of_a_drift_hold_a_wave_of_any_phase(turns: float) -> None:
    """They leave 1 % of it at most; cosines alone leave up to 60 %."""
    logged, _ = _logged([np.zeros(1024)])
    columns = np.stack([np.ones(1024), *drift_columns(logged[0])], axis=1)
    assert np.mean(np.sum(columns[:, 1:] ** 2, axis=1)) == pytest.approx(1.0, abs=0.05)
    basis = np.linalg.qr(columns)[0]
    angle = 2.0 * np.pi * turns * np.arange(1024)[:, None] / 1024
    waves = np.sin(angle + np.linspace(0.0, np.pi, 16)[None, :])
    waves -= waves.mean(axis=0)
    left = waves - basis @ (basis.T @ waves)
    assert np.all(np.linalg.norm(left, axis=0) < 0.01 * np.linalg.norm(waves, axis=0))


@pytest.mark.parametrize("turns", [0.7, 1.5, 2.2])
def test_a_drift_has_as_many_half_waves_as_repeats_tell(turns: float) -> None:
    """What it leaves of a wave of other phases in each repeat is less than a third of the noise."""
    rng, at = np.random.default_rng(5), np.arange(1024) / 1024
    waves = [2.0 * np.sin(2.0 * np.pi * turns * at + phase) for phase in (0.4, 3.0)]
    noises = [rng.standard_normal(1024) + wave for wave in waves]
    assert _rms_left(_learnt(noises), _logged(noises)[0][0], waves[0]) < 0.33


@pytest.mark.parametrize("phase", [0.4, 1.5, 3.0])
def test_a_drift_of_one_period_is_none_of_the_rigs_where_commands_are_as_slow(phase: float) -> None:
    """What it leaves of a wave twice the noise is less than a third of the noise."""
    turn, (logged, *_) = 2.0 * np.pi * np.arange(1024) / 1024, _logged([np.zeros(1024)])[0]
    slow = replace(logged, motor=np.sin(turn), regulator=np.zeros(1024))
    noise, wave = replace(white_noise(LEVEL), drift=3.0 * LEVEL), np.sin(turn + phase)
    assert _rms_left(noise, slow, 2.0 * wave / np.std(wave), free_zero=True) < 0.33


def _humming(hertz: list[float], seconds: float) -> tuple[list[Logged], list[np.ndarray]]:
    """Trials whose residual is noise and a line as large, of some frequency and phase in each."""
    rng, time = np.random.default_rng(6), np.arange(round(seconds * RATE)) / RATE
    left = []
    for each in hertz:
        part = np.full((4, len(time)), np.nan)
        angle = 2.0 * np.pi * each * time + rng.uniform(0.0, 6.0)
        part[CHANNEL] = LEVEL * (rng.standard_normal(len(time)) + np.sqrt(2.0) * np.sin(angle))
        left.append(part)
    return _logged([np.zeros(len(time))] * len(hertz))[0], left


@pytest.mark.parametrize(
    ("hertz", "seconds"), [([59.966] * 3, 8.0), ([50.027] * 3, 8.0), ([49.985, 49.999], 70.0)]
)
def test_of_a_line_less_than_a_tenth_of_the_noise_is_left(
    hertz: list[float], seconds: float
) -> None:
    """Mains are never at 50 or 60 Hz, and in long trials not at the same frequency twice."""
    logged, left = _humming(hertz, seconds)
    noise = with_lines(_levels(), logged, left)[CHANNEL]
    assert len(noise.lines) == 1
    for part, trial, each in zip(left, logged, hertz, strict=True):
        made = projection(replace(white_noise(1.0), lines=noise.lines), trial, CHANNEL, False)
        known = part[CHANNEL][None].copy()
        made.out_of(known)
        line = np.exp(-2j * np.pi * each * trial.time) / len(trial.time)
        assert np.abs(known[0] @ line) < 0.1 * np.abs(part[CHANNEL] @ line)
        assert np.std(known) == pytest.approx(LEVEL, rel=0.08)


def test_only_mains_and_their_aliases_are_lines() -> None:
    """50 Hz and the third harmonic's alias are fitted; a tone of 9 Hz is structure."""
    rng, time = np.random.default_rng(3), np.arange(1024) / RATE
    left = []
    for phase in (0.1, 1.7, 4.0):
        part = np.full((4, 1024), np.nan)
        tones = np.sin(2 * np.pi * 50 * time + phase) + 0.5 * np.sin(2 * np.pi * 150 * time - phase)
        tones = tones + np.sin(2 * np.pi * 9.0 * time + phase)
        part[CHANNEL] = LEVEL * (rng.standard_normal(1024) + tones)
        left.append(part)
    logged, _ = _logged([np.zeros(1024)] * 3)
    fitted = with_lines(_levels(), logged, left)[CHANNEL]
    assert fitted.lines == pytest.approx((50.0, 150.0))
    assert all(not each.lines for each in with_lines(_levels(), logged, left)[:CHANNEL])


def test_a_small_harmonic_counts_beside_a_line_of_the_same_mains() -> None:
    """Of 12 % of the noise it adds up over long trials; alone it is none."""
    logged, left = _humming([50.0, 50.01], 70.0)
    small = 0.12 * np.sqrt(2.0) * LEVEL * np.sin(2.0 * np.pi * 150.0 * logged[0].time)
    rng = np.random.default_rng(8)
    alone = [part * np.nan for part in left]
    for part in alone:
        part[CHANNEL] = LEVEL * rng.standard_normal(part.shape[1]) + small
    for rows, lines in ((left, [50.0]), ([p + small for p in left], [50.0, 150.0]), (alone, [])):
        fitted = with_lines(_levels(), logged, rows)[CHANNEL].lines
        assert list(fitted) == pytest.approx(lines, abs=0.05)


def test_pieces_of_a_large_slow_misfit_have_no_lines() -> None:
    """A piece of a second ends otherwise than it begins, which has a part at every frequency."""
    rng, time = np.random.default_rng(4), np.arange(128) / RATE
    logged, left = _logged([np.zeros(128)] * 200)[0], np.full((200, 4, 128), np.nan)
    for number, part in enumerate(left):
        slow = 60.0 * np.sin(2 * np.pi * 0.4 * (time + number) + 0.9)
        part[CHANNEL] = LEVEL * (rng.standard_normal(128) + slow)
    assert with_lines(_levels(), logged, list(left))[CHANNEL] == _levels()[CHANNEL]


def test_a_projection_makes_noise_with_a_drift_white() -> None:
    """Its matrix is the inverse root of the covariance, and what is free leaves nothing."""
    logged, _ = _logged([np.zeros(200)])
    noise = replace(white_noise(LEVEL), drift=0.7 * LEVEL, lines=(50.0,))
    made = projection(noise, logged[0], CHANNEL, free_zero=False)
    time = logged[0].time
    line = np.sin(2 * np.pi * 50 * time + 0.3)[None]
    made.out_of(line)
    assert np.abs(line).max() < 1e-9
    eye = np.eye(200)
    made.out_of(eye)
    covariance = np.eye(200)
    random = made.loss < 1.0
    strength = 1.0 / (1.0 - made.loss[random]) ** 2 - 1.0
    covariance += made.basis[random].T @ (strength[:, None] * made.basis[random])
    free = made.basis[~random]
    outside = np.eye(200) - free.T @ free
    assert eye @ covariance @ eye == pytest.approx(outside, abs=1e-9)


@pytest.mark.campaign
def test_hum_is_named_and_does_not_alarm() -> None:
    """50 Hz of 1.2 sd in all sensors: the model still agrees or data are too few, no structure."""
    time = np.arange(0.0, 6.0, 1 / RATE)
    rng, rig = np.random.default_rng(4), Plant(load_model("serres2008"))
    trials = []
    for seed, period in enumerate((2.0, 3.0, 1.5, 2.5), 1):
        motor = 1.5 * (1.0 - np.cos(2.0 * np.pi * np.maximum(time - 1.0, 0.0) / period))
        regulator = 5.5 + 1.5 * np.sin(2.0 * np.pi * np.maximum(time - 1.0, 0.0) / (1.4 * period))
        commands = {"motor_voltage": motor, "regulator_voltage": regulator}
        trial = rig.simulate(Trial(time, commands), seed=seed)
        sizes = {"contraction": 2.5e-5, "rotation": 2e-3, "load": 0.6, "pressure": 320.0}
        noisy = {
            name: values
            + 1.2 * np.sqrt(2.0) * sizes[name] * np.sin(2 * np.pi * 50 * time + rng.uniform(0, 6))
            for name, values in trial.measurements.items()
        }
        trials.append(replace(trial, measurements=noisy))
    fitted = diagnose(trials, "serres2008", propose=False)
    assert fitted.verdict in ("agrees", "parameters", "undecidable")
    (line,) = [each for each in fitted.nuisances if each.kind == "line"]
    assert line.hertz == pytest.approx(50.0, abs=0.06)
    assert set(line.signals) == {"contraction_mm", "rotation_deg", "load_n", "pressure_kpa"}
    assert "50 Hz in all four sensors" in fitted.steps[0]
