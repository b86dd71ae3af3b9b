"""The filter of a free rig against one with the matrix exponential, and against `Plant`."""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.trial import Trial
from pma_gym.effects import CATALOGUE
from pma_gym.estimation.innovations import Rows, counted, log_likelihood, predictions
from pma_gym.estimation.logged import Logged
from pma_gym.plant.model import Model
from tests.estimation.linear_slide import NOISES, box, kalman, logged, point, slide

NO_FORCE = 1e-9
"""Deviation (N, N m) of a latent force that moves nothing."""


def errors_of(trial, channels, steps, force, colour=0.0, fades=1.0):
    """How far innovations, variances and log likelihood are from the exact filter's, in shares."""
    made = box([trial], slide(speed=1 in channels), channels, steps)
    here = replace(point(made, force), colour=colour, colour_memory=fades)
    ((errors, spreads),) = made.innovations([here])
    e, s, total = kalman(trial, channels, force, colour=colour, fades=fades)
    there = np.isfinite(e)
    value = log_likelihood([(errors, spreads)], made.rows)[0]
    return [
        np.abs((errors[0] - e) / np.sqrt(s))[there].max(),
        np.abs(spreads[0] / s - 1.0).max(),
        abs(value - total) / abs(total),
    ]


@pytest.mark.parametrize("channels", [(0,), (0, 1)])
@pytest.mark.parametrize("uneven", [False, True])
def test_innovations_and_likelihood_are_those_of_the_exact_filter(channels, uneven):
    trial, _ = logged(uneven=uneven, missing=uneven)
    assert max(errors_of(trial, channels, 128, 2.0)) < 1e-3


@pytest.mark.parametrize("fades", [0.02, 5.0])
@pytest.mark.parametrize("channels", [(0,), (0, 1)])
def test_coloured_noise_and_drift_are_those_of_the_exact_filter(channels, fades):
    trial, _ = logged()
    assert max(errors_of(trial, channels, 128, 2.0, 3.0 * NOISES[0], fades)) < 1e-3


def test_without_a_latent_force_halved_steps_leave_a_quarter_of_the_error():
    trial, _ = logged(force=0.0)
    coarse, fine = (errors_of(trial, (0, 1), steps, NO_FORCE) for steps in (8, 16))
    assert all(3.0 < c / f < 5.0 for c, f in zip(coarse, fine, strict=True))


def test_with_a_latent_force_halved_steps_leave_a_quarter_of_the_error():
    trial, _ = logged(force=2.0)
    coarse, fine = (errors_of(trial, (0, 1), steps, 2.0) for steps in (8, 16))
    assert all(3.0 < c / f < 5.0 for c, f in zip(coarse, fine, strict=True))


FRICTION = {
    "static_n": 12.0,
    "dynamic_n": 8.0,
    "stribeck_speed_mm_per_s": 5.0,
    "presliding_um": 20.0,
}


def arm():
    """A joint with weight, damping and an encoder."""
    tables = {
        "torque_drive": {"gain": 1.0},
        "joint_weight": {"moment_n_m": 0.5, "offset_deg": 0.0},
        "joint_damping": {"coefficient_n_m_s": 0.05},
        "inertia": {"inertia_kg_m2": 0.01},
        "joint_start": {"angle_deg": 0.0, "spin_deg_per_s": 0.0},
        "encoder": {"bandwidth_hz": 200.0, "noise_deg": 0.02},
    }
    return Model("arm", "An arm", "joint", {n: CATALOGUE[n].parse(t) for n, t in tables.items()})


@pytest.mark.parametrize(
    ("model", "command", "size", "reading", "noise", "share"),
    [
        # A bristle keeps a ten-thousandth of its slope: friction is that much smaller.
        (slide(coulomb_friction=FRICTION), "load_command", 40.0, "contraction", NOISES[0], 0.3),
        (arm(), "torque_command", 0.6, "angle", np.radians(0.02), 1e-3),
    ],
    ids=["dry friction", "weight"],
)
def test_without_noise_and_latent_force_readings_are_expected_as_the_plant_simulates_them(
    model, command, size, reading, noise, share
):
    time = np.arange(0.0, 1.5, 0.01)
    asked = size * np.sin(9.0 * time) * np.linspace(0.0, 1.0, time.size) * (time > 0.1)
    trial = Plant(model).simulate(Trial(time, {command: asked}), noise=False)
    assert np.ptp(trial.measurements[reading]) > 1e3 * noise
    made = box([trial], model, steps=64, linear=True)
    still = replace(point(made, NO_FORCE), deviations=(noise,))
    unread = [counted(rows, np.zeros(time.size, bool)) for rows in made.rows]
    ((errors, _),) = made.innovations([still], unread)
    assert np.abs(errors).max() < share * noise


@pytest.mark.parametrize("rows", [2, 2.5])
def test_a_delay_is_a_command_that_comes_later(rows):
    trial, _ = logged()
    finer = np.arange(0.0, trial.time[-1], 0.005)
    at = np.searchsorted(trial.time, finer - 0.01 * rows + 1e-9, side="right") - 1
    load = trial.commands["load_command"][np.maximum(at, 0)]
    y = np.full(finer.size, np.nan)
    y[::2] = trial.measurements["contraction"][: y[::2].size]
    short = trial.time[: y[::2].size]
    asked = {"load_command": trial.commands["load_command"][: short.size]}
    prompt = box([Trial(finer, {"load_command": load}, {"contraction": y})], slide(), steps=2)
    late = box([Trial(short, asked, {"contraction": y[::2]})], slide(), steps=4)
    ((expected, _),) = prompt.innovations([point(prompt)])
    ((errors, _),) = late.innovations([replace(point(late), delay=0.01 * rows)])
    assert np.abs(errors[0] - expected[0, ::2]).max() < 1e-6 * NOISES[0]


def test_a_lane_s_bits_do_not_depend_on_the_others():
    trial, _ = logged(missing=True)
    made = box([trial, trial], slide(coulomb_friction=FRICTION))
    own = point(made)
    others = [replace(own, delay=0.003 * k, forces=(1.0 + k, 2.0)) for k in range(17)]
    others[3] = point(made, **{"slide.mass": 1e-9})
    among = made.innovations([*others[:5], own, *others[5:]])
    for alone, every in zip(made.innovations([own]), among, strict=True):
        for a, b in zip(alone, every, strict=True):
            assert a[0].tobytes() == b[5].tobytes()
            assert not np.array_equal(b[4], b[5])


def test_rows_that_are_not_counted_are_predicted():
    trial, _ = logged()
    made, there = box([trial], slide()), np.arange(200) < 100
    read = trial.measurements["contraction"]
    unread = {"contraction": np.where(there, read, np.nan)}
    gone = box([Trial(trial.time, trial.commands, unread)], slide())
    ((errors, spreads),) = made.innovations([point(made)], [counted(made.rows[0], there)])
    ((less, wide),) = gone.innovations([point(gone)])
    assert spreads.tobytes() == wide.tobytes()
    np.testing.assert_allclose((errors - less)[0, ~there, 0], read[~there], rtol=1e-9, atol=1e-15)
    assert made.rows[0].readings[:, 0, 1].all()


def test_predictions_of_a_perfect_model_miss_by_noise_alone():
    trials = [logged(seed, force=0.0)[0] for seed in range(3)]
    made = box(trials, slide())
    curves = predictions(made, point(made, NO_FORCE), 0.25)
    off = [
        c[25:, 0] - t.measurements["contraction"][25:] for c, t in zip(curves, trials, strict=True)
    ]
    assert 0.9 < np.std(np.concatenate(off)) / NOISES[0] < 1.25


def test_predictions_of_a_window_do_not_know_its_readings():
    trial, _ = logged()
    window = (trial.time / 0.25).astype(int)
    moved = trial.measurements["contraction"] + 1e-3 * (window == 2)
    other = Trial(trial.time, trial.commands, {"contraction": moved})
    (before,), (after,) = (
        predictions(made, point(made), 0.25)
        for made in (box([trial], slide()), box([other], slide()))
    )
    off = np.abs(after - before)[:, 0]
    assert np.isnan(off[window == 0]).all()
    assert np.nanmax(off[window % 2 == 0]) < 1e-12 and off[window == 3].max() > 1e-4


def test_a_dwell_in_a_coarse_step_counts_as_its_first_and_last_reading():
    steps = np.array([0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 3.0, 3.0, 3.0])
    time = np.arange(9) / 100
    log = Trial(time, {"load_command": 0 * time}, {"contraction": 1e-3 * steps})
    one = Logged.of(slide(), 0, log)
    coarse, fine = (Rows(one, (0,), 2, False, 1, coarse=[each]) for each in (True, False))
    read = np.array([1, 1, 0, 0, 1, 1, 1, 0, 1], bool)
    assert np.array_equal(coarse.there[:, 0], read)
    assert fine.there.all() and coarse.measured.all()


@pytest.mark.parametrize("block", [1, 2, 8])
def test_a_blocks_reading_is_where_the_motion_is_at_its_middle(block):
    time = np.arange(800) / 1000
    log = Trial(time, {"load_command": 0 * time}, {"contraction": np.cos(10.0 * time)})
    rows = Rows(Logged.of(slide(), 0, log), (0,), 1, False, block)
    off = (rows.readings[:, 0, 0] - np.cos(10.0 * rows.time))[2:-2]
    # A mean is off by w^2 (N^2 - 1) dt^2 / 24 of the motion, 2.6e-4 at 8 rows.
    shift = 10.0**2 * (block**2 - 1) * 1e-6 / 24.0
    assert np.abs(off).max() < 0.02 * shift + 1e-12


def test_a_straight_motion_shifts_no_mean_where_rows_are_lost_or_uneven():
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.uniform(0.5e-3, 1.5e-3, 800))
    time[400:] += 0.5
    log = Trial(time, {"load_command": 0 * time}, {"contraction": 0.2 * time})
    rows = Rows(Logged.of(slide(), 0, log), (0,), 1, False, 8)
    assert np.abs(rows.readings[:, 0, 0] - 0.2 * rows.time).max() < 1e-12
