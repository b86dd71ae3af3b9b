"""Regions and maps speak of the conditions that a rig has, in its units."""

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.fit_problem import Fitted
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.discovery.screening.localisation import localise
from pma_gym.discovery.screening.regions import level_axes
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.rigs import RIGS

FREE = ("drive.gain_n_per_v",)
LEVELS = np.array([0.05e-3, 5e-3, 2.0, 1e3])


def trials(number: int, seconds: float = 8.0, rate: float = 128.0) -> list[Trial]:
    """Triangles of load at several pressures, with a hold at the end."""
    clock = np.arange(round(seconds * rate)) / rate
    plant, simulated = Plant("serres2008"), []
    for k in range(number):
        turn = np.interp(clock, [1.0, 3.0, 5.0, seconds - 2.0], [1.0, 5.0, 2.0, 4.0])
        volts = plant.regulator_voltage(np.linspace(220e3, 520e3, 6)[5 * k % 6 if k % 2 else k % 6])
        commands = {"motor_voltage": turn, "regulator_voltage": np.full(len(clock), volts)}
        simulated.append(plant.simulate(Trial(clock, commands), noise=False))
    return simulated


def noisy(clean: list[Trial], gap=lambda trial: 0.0, seed: int = 0) -> list[Trial]:
    """The trials with noise, and a gap (noise levels) in the contraction."""
    generator = np.random.default_rng(seed)
    made = []
    for trial in clean:
        rows = {
            name: row + level * generator.standard_normal(len(trial))
            for (name, row), level in zip(trial.measurements.items(), LEVELS, strict=True)
        }
        rows["contraction"] = rows["contraction"] + LEVELS[0] * gap(trial)
        made.append(Trial(trial.time, trial.commands, rows))
    return made


def localised(made: list[Trial], seed: int = 0):
    model = load_model("serres2008")
    noise = [white_noise(float(level)) for level in LEVELS]
    whitened = WhitenedResiduals(model, made, FREE, noise, np.ones(1))
    one = np.ones(1)
    fit = Fitted(model, (), FREE, whitened.start, np.eye(1), 0.0, one, True)
    return localise(whitened, fit, LEVELS, seed)


@pytest.mark.parametrize(("more", "most"), [(0.0, 0), (1.0, 1)])
def test_noise_alone_lies_nowhere_be_it_larger_than_was_thought(more, most):
    data, generator = trials(6), np.random.default_rng(3)
    places = [
        localised(noisy(data, lambda trial: more * generator.standard_normal(len(trial)), seed))[0]
        for seed in range(10)
    ]
    assert sum(1 for each in places if each) <= most


def after_reversals(trial: Trial) -> np.ndarray:
    """Whether less than 0.2 s have passed since the motion turned."""
    speed = np.gradient(trial.truth["contraction"], trial.time)
    turned = np.flatnonzero((speed[1:] * speed[:-1] < 0.0) & (np.abs(trial.time[1:] - 4.0) < 2.0))
    since = trial.time[:, None] - trial.time[turned]
    return np.any((since >= 0.0) & (since < 0.2), axis=1)


GAPS = {
    "while held": lambda trial: 4.0 * (trial.time > 6.2),
    "above": lambda trial: 4.0 * (trial.truth["pressure"] > 390e3) * np.sin(40 * trial.time),
    "pulling out": lambda trial: 4.0 * ((trial.time > 1.0) & (trial.time < 3.0)),
    "0-0.2 s after reversals": lambda trial: 6.0 * after_reversals(trial),
}


@pytest.mark.parametrize("words", GAPS)
def test_a_gap_is_found_where_it_is(words):
    places, maps = localised(noisy(trials(6), GAPS[words]))
    assert places and all(place.signal == "contraction_mm" for place in places)
    assert words in places[0].region
    assert all(place.p_value <= 0.05 and 0.0 < place.share_of_gap <= 1.0 for place in places)
    shares = [place.share_of_gap for place in places]
    assert shares == sorted(shares, reverse=True) and shares[0] > 0.5
    assert [each.signal for each in maps] == ["contraction_mm"]


def test_signals_that_are_not_measured_and_empty_cells_are_passed_over():
    made = []
    for trial in noisy(trials(6), GAPS["while held"]):
        sparse = np.where(np.arange(len(trial)) % 7 == 0, trial.measurements["contraction"], np.nan)
        made.append(Trial(trial.time, trial.commands, {"contraction": sparse}))
    places, maps = localised(made)
    assert places and {place.signal for place in places} == {"contraction_mm"}
    assert len(maps) == 1


def test_one_short_trial_of_few_rows_is_no_reason_to_fail():
    (trial,) = noisy(trials(1), lambda trial: 9.0)
    few = slice(0, None, 400)
    short = Trial(
        trial.time[few],
        {name: row[few] for name, row in trial.commands.items()},
        {name: row[few] for name, row in trial.measurements.items()},
    )
    places, _ = localised([short])
    assert places == ()


@pytest.mark.parametrize(("name", "force"), [("station", "load"), ("imposed", "force")])
def test_conditions_have_the_words_of_the_rigs_signals(name, force):
    spoken = ", ".join(f"{axis.words} {axis.unit}" for axis in level_axes(RIGS[name].signals))
    assert spoken == f"pressure kPa, {force} N, contraction mm"
