"""Cases of blocks `lab` and `lab_nothing`: each trouble changes what it should, and no more."""

import math

import numpy as np
import pytest

from benchmarks.hidden_effects.evaluation.verdicts import compare
from benchmarks.hidden_effects.generation.cases import BLOCKS
from benchmarks.hidden_effects.generation.files import write_case
from benchmarks.hidden_effects.rigs import lab
from pma_gym.data.datasets.dataset import read_dataset
from tests.benchmarks.hidden_effects.cheap_diagnosis import document

SEED, DIGESTS = 3, {1: "f39ba002e200d4e9", 2: "7e33f1942f670cbb"}
"""Seed, and digests of a slide and a joint that the folder's own simulator draws quickly."""


def fitted(readings, *columns):
    """Numbers by which columns best add up to readings."""
    return np.linalg.lstsq(np.array(columns).T, readings, rcond=None)[0]


@pytest.mark.parametrize("number", DIGESTS)
def test_a_case_has_its_digest_and_is_read_by_a_diagnosis(number, tmp_path):
    case, again = (BLOCKS["lab_nothing"].draw(SEED, number) for _ in range(2))
    assert case.truth["digest"] == DIGESTS[number] and case == again
    assert BLOCKS["lab"].draw(SEED, number).truth["digest"] != case.truth["digest"]
    write_case(case, tmp_path, 1)
    assert len(read_dataset(tmp_path / "cases" / "case_0001").trials) == lab.TRIALS


@pytest.mark.parametrize("number", DIGESTS)
@pytest.mark.parametrize("name", ["clock", "bent_sensor", "play", "hum", "in_motion"])
def test_a_trouble_of_the_log_changes_the_readings_by_its_size_alone(name, number):
    case, plain = (lab.laboratory(SEED, number, each) for each in (name, "nothing"))
    rig, sensor, trouble = case.campaign.rig, case.campaign.sensor, case.trouble
    for i, (command, shown) in enumerate(case.trials):
        before, true = plain.trials[i]
        time, added = np.arange(len(true)) / rig.rate, shown - true[-len(shown) :]
        assert np.array_equal(command, before[-len(command) :])
        if name == "clock":
            errors = [
                np.std(shown - np.interp(time / (1.0 + share), time, true))
                for share in (0.0, trouble.size, 2.0 * trouble.size)
            ]
            assert errors[1] < 2.0 * sensor.rms and min(errors[0], errors[2]) > 3.0 * errors[1]
        elif name == "bent_sensor":
            assert fitted(added, (true / rig.travel) ** 2) == pytest.approx(trouble.size, rel=0.05)
        elif name == "play":
            assert np.ptp(added) == pytest.approx(trouble.size, abs=2.0 * sensor.step)
        elif name == "hum":
            angle = 2.0 * math.pi * trouble.mains * time
            wave = math.hypot(*fitted(added, np.sin(angle), np.cos(angle)))
            assert wave == pytest.approx(trouble.size, rel=0.05)
        else:
            assert not added.any() and abs(shown[4] - shown[0]) > 5.0 * sensor.rms


@pytest.mark.parametrize("number", DIGESTS)
@pytest.mark.parametrize("name", ["nothing", "one_trial", "gain_drift", "dead_band"])
def test_a_trouble_of_the_force_changes_what_the_motion_takes_by_its_size_alone(name, number):
    case = lab.laboratory(SEED, number, name)
    rig, size = case.campaign.rig, case.trouble.size
    for i in range(lab.TRIALS):
        motion, _ = case.campaign.run(case.effects(i), i)
        u, v = motion.command, motion.v
        taken = rig.inertia * motion.a + rig.damping * v + rig.stiffness * motion.q
        taken += rig.gravity * np.sin(motion.q + rig.gravity_angle)
        dead = size * rig.peak_force if name == "dead_band" else 0.0
        moves = (np.abs(v) > 0.01 * rig.peak_speed) & (np.abs(u) > 1.1 * dead)
        fit = fitted(taken[moves], *(x[moves] for x in (u, -np.sign(u), -np.sign(v))))
        more = size if name == "one_trial" and i == case.trouble.trial else 0.0
        gain = 1.0 - (size * i if name == "gain_drift" else 0.0)
        assert fit == pytest.approx([gain, dead, case.friction * (1.0 + more)], rel=1e-6, abs=1e-9)


def truth(name):
    trouble = {"name": name, "size": 0.02, "trial": "run_03.csv", "mains": 60.0, "seen_hz": 40.0}
    hidden = {"trouble": trouble, "friction": {"true": 9.8}, "effects": [], "base_factors": {}}
    return hidden | {"block": "lab_nothing" if name == "nothing" else "lab", "kind": name}


ALONE, FALLS = (
    "Trials differ: {} alone needs coulomb_friction.static_n {} N (95 %: 9 to 11).",
    "Trials differ: two_way_drive.gain_n_per_v falls by {} % from trial to trial (-2 N/V).",
)


@pytest.mark.parametrize(
    ("name", "verdict", "effects", "sentence", "judged"),
    [
        ("one_trial", "parameters", [], ALONE.format("run_03.csv", 10.5), "said"),
        ("one_trial", "parameters", [], ALONE.format("run_03.csv", 14.0), "wrong"),
        ("one_trial", "parameters", [], ALONE.format("run_02.csv", 10.0), "wrong"),
        ("one_trial", "effect", ["drive_lag"], ALONE.format("run_03.csv", 10.0), "beside"),
        ("one_trial", "unknown", [], "Goes with velocity; 90 % of it acts in run_03.csv.", "said"),
        ("one_trial", "unknown", [], "Goes with speed; 9 % of it acts in run_03.csv.", "missed"),
        ("gain_drift", "parameters", [], FALLS.format(2), "said"),
        ("gain_drift", "parameters", [], FALLS.format(4), "wrong"),
        ("clock", "parameters", [], FALLS.format(2), "wrong"),
        ("clock", "unknown", [], "The clock runs fast.", "said"),
        ("clock", "unknown", [], "A fast clock, or play.", "missed"),
        ("clock", "undecidable", [], "Log at rest, check the clock.", "missed"),
        ("play", "effect", ["backlash"], "", "said"),
        ("play", "effect", ["backlash", "drive_delay"], "", "beside"),
        ("play", "parameters", [], "", "missed"),
        ("dead_band", "unknown", [], "Best candidate: drive dead zone, which leaves 5 %.", "said"),
        ("dead_band", "unknown", [], "Best candidate: drive lag, which leaves 5 %.", "missed"),
        ("hum", "unknown", [], "The encoder hums at 40.1 Hz.", "said"),
        ("hum", "unknown", [], "The encoder hums at 50 Hz.", "missed"),
        ("hum", "unknown", [], "40 % of it goes with angle.", "missed"),
        ("in_motion", "parameters", [], "", "said"),
        ("in_motion", "undecidable", [], "Begin at rest.", "said"),
        ("in_motion", "undecidable", [], "Log at rest, check the clock.", "missed"),
        ("in_motion", "unknown", [], "", "missed"),
        ("nothing", "parameters", [], "", "quiet"),
        ("nothing", "parameters", [], FALLS.format(2), "alarm"),
        ("nothing", "parameters", [], FALLS.format("< 1"), "alarm"),
        ("nothing", "parameters", [], "Trials differ in mass.", "alarm"),
        ("nothing", "effect", ["drive_lag"], "", "alarm"),
    ],
)
def test_an_answer_counts_where_it_says_the_trouble_and_nothing_else(
    name, verdict, effects, sentence, judged
):
    answer = document(verdict, *((each, {}) for each in effects))
    assert compare(truth(name), answer | {"sentence": sentence}).trouble == judged
