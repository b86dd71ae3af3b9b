"""Trials on the nominal station: every controller stays within the error that it is to reach."""

import pytest

from controllers import ADRC, LQG, PID, FeedforwardPID, ImprovedFeedforward, PreviewMPC, SlidingMode
from controllers import adrc as adrc_file
from controllers import sliding_mode as sliding_file

LATE = {"control_rate_hz": 50.0, "action_delay_s": 0.02}
CALM = {"noise": False}
RAMPS = {"I": 0.25, "II": 0.25}
PIDS = {"I": 0.4, "II": 0.4, "III": 0.3}


def adrc(*settings):
    return lambda: ADRC(adrc_file.Settings(*settings))


def sliding(*settings):
    return lambda: SlidingMode(sliding_file.Settings(*settings))


TARGETS = [
    (adrc(0.6, 0.35), "displacement", 150, LATE, 0.05),
    (adrc(0.6, 0.35), "rotation", 400, LATE, RAMPS),
    (adrc(0.6, 0.6), "isotonic", 200, LATE, 0.15),
    (sliding(0.6, 0.35, 0.1), "displacement", 150, LATE, 0.05),
    (sliding(0.6, 0.3, 0.1), "rotation", 400, LATE, RAMPS),
    (sliding(0.6, 0.6, 0.3), "isotonic", 200, LATE, 0.15),
    # Up to 20 % of force, held at 90 deg: no more is left than the sensor's noise, 0.14 deg.
    (sliding(0.6, 0.4, 0.1), "rotation", 350, {"randomisation": "varied"}, {"II": 0.1}),
    *((LQG, "displacement", pressure, {}, 0.05) for pressure in (150, 300, 550)),
    # Within 0.2 deg of what is achievable in phase III, whatever that is.
    *((LQG, "rotation", pressure, {}, RAMPS | {"III": 0.2}) for pressure in (275, 550)),
    *((LQG, task, 150, {}, 0.06) for task in ("isotonic", "triangle_low")),
    (LQG, "displacement", 300, {"model": "cascade"} | LATE, 0.05),
    (LQG, "rotation", 300, {"model": "cascade"}, 0.25),
    (LQG, "rotation", 400, {"action_delay_s": 0.02, "observation_delay_s": 0.03}, 0.3),
    *((PreviewMPC, "displacement", pressure, {}, 0.05) for pressure in (150, 550)),
    (PreviewMPC, "rotation", 400, {}, RAMPS),
    # The achievable bound of phase III is under 0.01 deg here (`benchmarks.bounds`).
    (PreviewMPC, "rotation", 575, {}, {"III": 0.2}),
    (PreviewMPC, "isotonic", 300, {}, 0.1),
    *((PID, "displacement", pressure, {}, 0.10) for pressure in (150, 225, 550)),
    (FeedforwardPID, "displacement", 225, {}, 0.10),
    *((kind, "displacement", 200, LATE, 0.10) for kind in (PID, FeedforwardPID)),
    (PID, "rotation", 275, {}, PIDS),
    (FeedforwardPID, "rotation", 500, {}, PIDS),
    *((kind, "isotonic", 200, {}, 0.05) for kind in (PID, FeedforwardPID)),
    # PID alone has 0.113 mm in phase III of the late loop.
    (PID, "isotonic", 200, LATE, 0.115),
    (FeedforwardPID, "isotonic", 200, LATE, 0.10),
    *((ImprovedFeedforward, "displacement", 300, {"control_rate_hz": r}, 0.03) for r in (50, 384)),
    # A late command is sent early.
    (ImprovedFeedforward, "displacement", 400, LATE | CALM, 0.03),
    (ImprovedFeedforward, "rotation", 400, LATE | CALM, 0.15),
    (ImprovedFeedforward, "isotonic", 300, CALM, 0.02),
    (ImprovedFeedforward, "triangle_low", 150, CALM, 0.02),
    (ImprovedFeedforward, "triangle_high", 450, CALM, 0.02),
]
"""Controller, task, pressure (kPa), options, and the most (mm or deg) in every phase or in some."""


@pytest.mark.parametrize(("make", "task", "pressure", "options", "most"), TARGETS)
def test_a_trial_stays_within_its_target(make, task, pressure, options, most, drive):
    got, _ = drive(make(), task, pressure, **options)
    limits = most if isinstance(most, dict) else dict.fromkeys(got, most)
    assert {phase: got[phase] for phase in limits if got[phase] > limits[phase]} == {}
