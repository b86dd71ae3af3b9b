"""Initial states that the readings of a trial say.

The interval of a fitted delay holds the true one, which a sensor had exactly.
"""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pma_gym import Plant
from pma_gym.data.trial import Trial
from pma_gym.estimation.fitting import fit
from pma_gym.estimation.initial_states import meet
from pma_gym.estimation.logged import Logged
from pma_gym.plant import sensors
from pma_gym.plant.model import load_model
from tests.discovery.rig_trials import FROZEN


def _logged(rows, seed):
    """A slide's trial, one reading of which is missing."""
    at, generator = np.arange(rows) / 100.0, np.random.default_rng(seed)
    readings = 1e-3 * generator.normal(size=rows)
    readings[rows // 2] = np.nan
    trial = Trial(at, {"load_command": np.zeros(rows)}, {"contraction": readings})
    return Logged.of(load_model(FROZEN / "driven_slide" / "model.toml"), 0, trial)


def test_trials_are_corrected_together_as_each_alone():
    """One of them runs away; the others do not mind."""
    generator = np.random.default_rng(7)
    logs = [_logged(rows, rows) for rows in (40, 55, 40)]
    spaces = [generator.normal(size=(6, len(logged.time), 3)) for logged in logs]
    spaces[1][-1] = 1e200
    held = [[space[:, :, k].copy() for k in range(len(logs[0].signals))] for space in spaces]
    levels = np.full(len(logs[0].signals), 1e-5)
    alone = [space.copy() for space in spaces]
    together = meet(spaces, held, logs, levels, 2)
    for space, here, logged, one, other in zip(alone, held, logs, together, spaces, strict=True):
        (correction,) = meet([space], [here], [logged], levels, 2)
        np.testing.assert_array_equal(correction.moves, one.moves)
        assert (correction.misfit, correction.rough) == (one.misfit, one.rough)
        np.testing.assert_array_equal(space, other)


ROW_S, FINE_S, BEFORE_S = 0.01, 5e-4, 0.2
TACHOMETER = {"tachometer": {"bandwidth_hz": 1000.0, "noise_mm_per_s": 1.0}}
SLIDE = load_model(str(FROZEN / "driven_slide" / "model.toml")).with_effects(TACHOMETER)
RIGS = {
    "slide": (
        SLIDE,
        {"load_command": (0.0, 25.0)},
        ("lvdt", "contraction"),
        ("slide.mass_kg", "symmetric_damping.intercept_n_s_per_mm"),
    ),
    "station": (
        load_model("station"),
        {"motor_voltage": (3.0, 0.45), "regulator_voltage": (5.5, 0.0)},
        ("load_cell", "load"),
        ("slide.mass_kg", "symmetric_damping.intercept_n_s_per_mm", "drive.gain_n_per_v"),
    ),
}


def late_trials(model, commands, output, delay, generator):
    """A log of 1 s, and its repeat, whose one output was read so much earlier; free rigs move."""
    before = BEFORE_S if model.rig.is_free else 0.0
    rows = np.arange(0.0, before + 1.0 + 0.5 * ROW_S, ROW_S)
    fine = np.arange(0.0, rows[-1], FINE_S)
    given = {}
    for name, (mean, size) in commands.items():
        waves = [(f, generator.uniform(0.0, 6.0)) for f in (0.4, 1.1, 2.3)]
        tones = [np.sin(2.0 * np.pi * f * rows + phase) for f, phase in waves]
        given[name] = mean + size * np.sum(tones, axis=0)
    asked = Trial(fine, {name: np.interp(fine, rows, row) for name, row in given.items()})
    exact = Plant(model).simulate(asked, noise=False).measurements
    there = rows[(rows > before - 1e-9) & (rows < before + 1.0 - 1e-9)]
    noise = dict(zip(model.rig.outputs, sensors.deviations(model), strict=True))
    for _ in range(2):
        # A station stood still before its trial began.
        read = {
            name: CubicSpline(fine, row)(np.maximum(there - delay * (name == output), 0.0))
            + noise[name] * generator.standard_normal(there.size)
            for name, row in exact.items()
        }
        started = {name: np.interp(there, rows, row) for name, row in given.items()}
        yield Trial(there - before, started, read)


@pytest.mark.parametrize("rig", RIGS)
def test_the_interval_of_a_delay_holds_the_true_one(rig):
    model, commands, (sensor, output), free = RIGS[rig]
    generator, path = np.random.default_rng(11), f"{sensor}_delay.delay_ms"
    late = model.with_effects({f"{sensor}_delay": {"share": 1.0, "delay_ms": 5.0}})
    off = []
    for delay in generator.uniform(1e-3, 20e-3, 20):
        trials = list(late_trials(model, commands, output, delay, generator))
        fitted = fit(late, trials, [path, *free])
        off.append((fitted.values[path] - 1e3 * delay) / fitted.errors[path])
        assert fitted.errors[path] < 0.1
    assert np.mean(np.abs(off) < 1.96) >= 0.9, off
