"""Drift and hum as laboratories have them are told from what is missing."""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym import Plant, Trial, load_model
from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.discovery import diagnose
from pma_gym.discovery.preparation.learnt_noise import learnt_noise
from pma_gym.discovery.preparation.mains_lines import with_lines
from pma_gym.discovery.preparation.noise import Whitening, white_noise
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


def _levels() -> list[Whitening]:
    return [white_noise(1.0), white_noise(1.0), white_noise(1.0), white_noise(LEVEL)]


def test_a_drift_is_learnt_from_repeats_and_one_that_repeats_is_structure() -> None:
    """Slow cosines that differ between repeats are a drift; the same in all of them are none."""
    rng, slow = np.random.default_rng(2), np.cos(np.pi * np.arange(1024) / 1024)
    for signs, least, most in (((1.0, -0.8), 0.3 * LEVEL, np.inf), ((1.0, 1.0), 0.0, 0.0)):
        drift = _learnt([rng.standard_normal(1024) + sign * slow for sign in signs]).drift
        assert least <= drift <= most


def test_white_repeats_of_few_readings_show_no_drift() -> None:
    """What lies beside a drift's waves says what noise is; three readings have nothing there.

    Half a period and more of three or four readings is all that they can differ by: white noise of
    thirty such repeats counted as a drift of 1.7 noises in 18 draws of 20.
    """
    rng = np.random.default_rng(5)
    for rows in (3, 4, 8, 16):
        assert all(_learnt(list(rng.standard_normal((30, rows)))).drift == 0.0 for _ in range(5))


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
