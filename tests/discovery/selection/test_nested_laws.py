"""Nested laws: what trials do not determine leaves the law of an effect, and has no value."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting import held_out
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import free_parameters
from pma_gym.discovery.fitting.held_out import HeldOutMisfit
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.selection import nested_laws, profile_limits
from pma_gym.discovery.selection.nested_laws import FLAT, nested
from pma_gym.discovery.selection.profile_limits import limits
from pma_gym.discovery.workflow import diagnose
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from tests.discovery.laboratory import only
from tests.discovery.rig_trials import FROZEN
from tests.discovery.test_imposed_motion import SENSOR, trials
from tests.plant.test_imposed import imposed

SLIDE = load_model(FROZEN / "driven_slide" / "model.toml")
STATIC, DYNAMIC, SPEED = (
    f"coulomb_friction.{name}" for name in ("static_n", "dynamic_n", "stribeck_speed_mm_per_s")
)
DRY = next(each for each in candidate_effects(SLIDE) if each.name == "coulomb_friction")


@cache
def rubbing(static, dynamic, speed, count=3):
    """Trials of a driven slide with dry friction (N, N, mm/s), and their model."""
    table = {"static_n": static, "dynamic_n": dynamic, "stribeck_speed_mm_per_s": speed}
    truth = SLIDE.with_effects({"coulomb_friction": table | {"presliding_um": 10.0}})
    time, logs = np.arange(0.0, 1.0, 0.01), []
    for k in range(count):
        waves = 60.0 * np.sin(2 * np.pi * (0.9 + 0.3 * k) * time + k)
        force = waves + 30.0 * np.sign(np.sin(2 * np.pi * (1.1 + 0.4 * k) * time))
        trial = Plant(truth).simulate(Trial(time, {"load_command": force}), seed=k)
        logs.append(only(trial, "contraction"))
    return logs, truth


@cache
def fit_of(static, dynamic, speed, begun, level=2e-5):
    """A fit of such trials with the whole law, begun at values, and on which bench."""
    logs, _ = rubbing(static, dynamic, speed)
    bench = FitProblem(logs, SLIDE, free_parameters(SLIDE), (white_noise(level),) * 2)
    start = np.array([*begun, *DRY.absent[len(begun) :]])
    fitted = bench.fit(SLIDE, (DRY,), {DRY.name: start})
    assert fitted is not None
    return bench, fitted


def falling():
    """A fit of friction that falls with the speed."""
    return fit_of(18.0, 12.0, 30.0, (17.0, 12.0, 20.0))


@pytest.fixture
def asked_for(monkeypatch):
    """Readings left out ask for every whole law."""
    monkeypatch.setattr(nested_laws, "is_asked_for", lambda *_: True)


def test_friction_of_one_size_has_one_number():
    """One that falls with the speed is at its bound, or anywhere, and is said to be neither."""
    bench, fit = fit_of(12.0, 12.0, 5.0, (40.0, 11.0, 0.02))
    less = nested(bench, fit, (DRY,))
    assert set(less.undetermined) == {STATIC, SPEED}
    assert less.chosen[0].fitted_paths == [DYNAMIC]
    assert less.fit.chi_square < fit.chi_square + FLAT
    value, error = less.fit.estimate(DYNAMIC)
    assert value == pytest.approx(12.0, rel=0.005)
    assert abs(value - 12.0) < 4.0 * error


def test_friction_that_falls_with_the_speed_keeps_its_law():
    bench, fit = falling()
    less = nested(bench, fit, (DRY,))
    assert not less.undetermined and less.fit is fit


def test_a_law_that_ended_below_one_number_is_begun_again_at_it():
    """A fit that ended in a local minimum, with a static friction of nothing, hides the fall."""
    bench, fit = falling()
    ended = {STATIC: 1.0, DYNAMIC: 13.0, SPEED: 0.1}
    at = [ended.get(path, value) for path, value in zip(fit.paths, fit.values, strict=True)]
    local = replace(fit, values=np.array(at), chi_square=1e6)
    less = nested(bench, local, (DRY,))
    assert not less.undetermined
    assert less.fit.chi_square == pytest.approx(fit.chi_square, rel=0.01)
    assert less.fit.estimate(DYNAMIC)[0] == pytest.approx(12.0, rel=0.02)
    for path in (STATIC, DYNAMIC, SPEED):
        low, high = less.fit.spread[path]
        assert low < less.fit.estimate(path)[0] < high


def test_a_law_with_a_number_at_an_end_of_its_range_is_left(asked_for):
    """Readings left out may ask for a static friction of 0: it stands for something else."""
    bench, fit = fit_of(0.0, 12.0, 3.0, (0.0, 12.0, 3.0))
    at_end = replace(fit, values=np.where(np.array(fit.paths) == STATIC, 0.0, fit.values))
    less = nested(bench, at_end, (DRY,))
    assert set(less.undetermined) == {STATIC, SPEED}
    assert less.chosen[0].fitted_paths == [DYNAMIC]


@pytest.mark.parametrize(
    ("speed", "left"), [(0.0105, {STATIC, SPEED}), (0.03, {STATIC, SPEED}), (3.0, set())]
)
def test_a_static_level_that_no_motion_shows_leaves_the_law(speed, left, monkeypatch, asked_for):
    """A Stribeck speed that may be the least there is, beside a chi-square that is rugged in it."""
    monkeypatch.setattr(nested_laws, "_left", lambda *_: None)
    bench, fit = fit_of(12.0, 12.0, 5.0, (14.0, 12.0, 3.0))
    values, covariance, at = fit.values.copy(), fit.covariance.copy(), fit.paths.index(SPEED)
    values[fit.paths.index(STATIC)], values[at] = 24.0, speed
    covariance[at, at] = 0.02**2
    # Half the residual is no ruggedness: then the whole law stays whatever its intervals say.
    for share, leaves in ((0.3, left), (0.2, set())):
        better = share * fit.chi_square
        rugged = replace(fit, values=values, covariance=covariance, chi_square=better)
        assert set(nested(bench, rugged, (DRY,)).undetermined) == leaves


def test_a_static_friction_below_the_dynamic_one_leaves_the_law(asked_for):
    """No contact holds less than it drags, even where that form of the law explains more."""
    bench, fit = fit_of(6.0, 12.0, 60.0, (6.0, 12.0, 60.0))
    assert fit.estimate(STATIC)[0] < 0.8 * fit.estimate(DYNAMIC)[0]
    less = nested(bench, fit, (DRY,))
    assert set(less.undetermined) == {STATIC, SPEED}
    assert less.fit.chi_square > fit.chi_square + 10.0 * FLAT


def test_a_speed_beyond_all_speeds_is_only_known_to_lie_above():
    """A static friction that hardly falls: the fall's speed is above something, no more."""
    bench, fit = fit_of(12.0, 4.0, 900.0, (12.0, 4.0, 900.0), 2e-4)
    known = nested(bench, fit, (DRY,)).undetermined[SPEED]
    assert known.below is None and known.unit == "mm/s"
    assert known.above is not None and 100.0 < known.above < 900.0


def test_scales_of_limits_come_from_the_trials():
    bench, fit = falling()
    low, high = limits(bench, fit, (DRY,), SPEED)
    contractions = [log.measurements["contraction"] for log in bench.trials]
    fastest = max(1e3 * np.abs(np.gradient(each, 0.01)).max() for each in contractions)
    quantity = CATALOGUE["coulomb_friction"].quantities["stribeck_speed"]
    assert low == pytest.approx(max(quantity.lower, 1e-4 * fastest), rel=0.2)
    assert high == pytest.approx(min(quantity.upper, 30.0 * fastest), rel=0.2)


@pytest.mark.parametrize("largest", [1e-9, 1e9])
def test_limits_stay_within_what_the_catalogue_allows(monkeypatch, largest):
    bench, fit = falling()
    monkeypatch.setattr(profile_limits, "_scales", lambda *_: {"mm/s": largest})
    quantity = CATALOGUE["coulomb_friction"].quantities["stribeck_speed"]
    assert limits(bench, fit, (DRY,), SPEED) == (quantity.lower, quantity.upper)


@pytest.mark.campaign
def test_no_value_is_said_of_what_is_not_determined():
    diagnosis = diagnose(rubbing(12.0, 12.0, 5.0)[0], SLIDE, propose=False)
    assert "static not determined" in diagnosis.sentence
    assert "Stribeck speed not determined" in diagnosis.sentence
    assert "limit" not in diagnosis.sentence
    (written,) = json.loads(diagnosis.text())["effects"]
    assert set(written["not_determined"]) == {"static_n", "stribeck_speed_mm_per_s"}
    assert set(written["parameters"]) == {"dynamic_n"}
    assert "not determined" in diagnosis.model.notes[STATIC].source


@pytest.mark.parametrize(("asking", "numbers"), [(2, 3), (1, 1)])
def test_the_whole_law_stays_where_most_readings_left_out_ask_for_it(monkeypatch, asking, numbers):
    """By chi-square alone it is worth its two parameters; most trials must say so when left out."""
    bench, fit = falling()

    def left_out(_problem, _fit, chosen):
        whole = len(chosen[0].fitted_paths) == 3
        chi_square = np.where(np.arange(3) < asking, 1.0, 3.0) if whole else np.full(3, 2.0)
        return HeldOutMisfit([], chi_square, np.empty(0))

    monkeypatch.setattr(held_out, "held_out_misfit", left_out)
    assert len(nested(bench, fit, (DRY,)).chosen[0].fitted_paths) == numbers


def test_intervals_of_a_simpler_law_hold_what_a_whole_law_that_is_turned_away_says(monkeypatch):
    """Friction without its rise near rest is larger than the friction, and takes up damping."""
    damping = {"intercept_n_s_per_mm": 0.5, "slope_n_s_per_mm_per_kpa": 0.0}
    known = imposed(force_sensor=SENSOR, symmetric_damping=damping)
    table = {"presliding_um": 50.0, "rise_n": 2.0, "stribeck_speed_mm_per_s": 20.0}
    hidden = {"contact_friction": {"force_n": 40.0} | table}
    logs = trials(strokes=(0.03, 0.06), symmetric_damping=damping, **hidden)
    bench = FitProblem(
        logs, known, free_parameters(known), (white_noise(0.3),) * len(known.rig.signals)
    )
    dry = next(each for each in candidate_effects(known) if each.name == "contact_friction")
    whole = bench.fit(known, (dry,), {dry.name: np.array([38.0, 60.0, 1.0, 10.0])})
    assert whole is not None
    assert nested(bench, whole, (dry,)).fit is whole
    monkeypatch.setattr(nested_laws, "is_asked_for", lambda *_: False)
    less = nested(bench, whole, (dry,))
    assert {path.partition(".")[2] for path in less.undetermined} == {
        "rise_n",
        "stribeck_speed_mm_per_s",
    }
    for path, true in (
        ("contact_friction.force_n", 40.0),
        ("symmetric_damping.intercept_n_s_per_mm", 0.5),
    ):
        value, error = less.fit.estimate(path)
        assert abs(value - true) > 5.0 * error
        low, high = less.fit.interval(path)
        assert low < true < high
