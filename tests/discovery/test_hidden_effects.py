"""Data of the independent generator, frozen: every effect hidden once, nothing, parameters off.

`hidden/` was drawn by `python -m benchmarks hidden-effects --keep` and holds what a lab would have:
trials, the model that it believes. `truth.json` beside it is read here alone. Seeds: 7 (three
trials of 5 s, r = 2), 11 (passive_stretch and warm_up: four of 6 s), 12 (nothing, parameters).
"""

import json
from functools import cache
from pathlib import Path

import pytest

from benchmarks.hidden_effects.generation.groups import group
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.discovery import diagnose

HIDDEN = Path(__file__).parent / "hidden"
TRUTH = json.loads((HIDDEN / "truth.json").read_text(encoding="utf-8"))
EFFECTS = [name for name, truth in TRUTH.items() if truth["effects"]]
AT_EVERY_RUN = (
    "cable_slack",
    "potentiometer_lag",
    "sensor_quantisation",
    "nothing_1",
    "parameters_1",
)
"""The others: `make test-campaigns`."""

QUIET = [name for name, truth in TRUTH.items() if not truth["effects"]]


@cache
def diagnosed(name):
    return diagnose(read_dataset(HIDDEN / name), propose=False)


def marked(names):
    """The names, of which most run with the campaigns alone."""
    marks = {name: () if name in AT_EVERY_RUN else pytest.mark.campaign for name in names}
    return pytest.mark.parametrize("name", [pytest.param(n, marks=m) for n, m in marks.items()])


@marked(EFFECTS)
def test_a_hidden_effect_is_named(name):
    diagnosis = diagnosed(name)
    assert diagnosis.verdict == "effect", diagnosis.sentence
    assert [effect.name for effect in diagnosis.effects if effect.name in group(name)], (
        diagnosis.sentence
    )
    assert len(diagnosis.effects) == 1, diagnosis.sentence


@pytest.mark.campaign
def test_a_lag_of_the_drive_is_written_with_the_delay_that_explains_as_much():
    diagnosis = diagnosed("drive_lag")
    (rival,) = diagnosis.rivals
    assert (rival.name,) == diagnosis.effects[0].confused_with == ("drive_delay",)
    assert rival.absent["drive_delay"]["share"] == 0.0 and rival.values["drive_lag.share"] == 0.0
    assert rival.values["drive_delay.delay_ms"] == pytest.approx(4.5, rel=0.05)


@marked(QUIET)
def test_where_nothing_is_hidden_nothing_is_claimed(name):
    diagnosis = diagnosed(name)
    assert diagnosis.verdict in ("parameters", "agrees") and not diagnosis.effects, (
        diagnosis.sentence
    )


MOVED = {
    "force_slope": "contractile_force.slope_n_per_kpa",
    "damping_contracting": "damping.contracting_n_s_per_mm",
    "damping_relaxing": "damping.relaxing_n_s_per_mm",
    "regulator_time": "regulator_lag.time_constant_s",
    "drive_gain": "drive.gain_n_per_v",
    "radius": "rotor.radius_mm",
}


@marked([name for name in QUIET if TRUTH[name]["block"] == "parameters"])
def test_parameters_that_were_off_are_named(name):
    diagnosis = diagnosed(name)
    assert diagnosis.verdict == "parameters"
    off = {
        path: TRUTH[name]["base_factors"][factor]
        for factor, path in MOVED.items()
        if abs(TRUTH[name]["base_factors"].get(factor, 1.0) - 1.0) > 0.05
    }
    identifiable = {path for path in off if path not in diagnosis.not_identifiable}
    assert identifiable
    for path in identifiable:
        moved = diagnosis.parameters[path]
        assert moved.significant
        assert moved.now.value / moved.start == pytest.approx(off[path], rel=0.02)


def test_what_a_diagnosis_reads_does_not_hold_the_truth():
    for name in TRUTH:
        files = {path.name for path in (HIDDEN / name).iterdir()}
        assert not any("truth" in each for each in files)
        assert name not in (HIDDEN / name / "dataset.toml").read_text(encoding="utf-8")
