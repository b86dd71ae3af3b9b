"""A mass that stops, turns or breaks away within a step: the filter's motion is that by hand.

Mass m, dry friction F that gives way at once, a force u: it slows by (F - u) / m, from rest speeds
up by (|u| - F) / m, and under a ramp of r N/s has moved by r t^3 / (6 m) a time t after F.
"""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.estimation.innovations import counted
from tests.estimation.linear_slide import box, point, slide

MASS, FRICTION, RATE = 5.0, 10.0, 0.1
RIGID = {
    "static_n": FRICTION,
    "dynamic_n": FRICTION,
    "stribeck_speed_mm_per_s": 5.0,
    "presliding_um": 1e-4,
}
ROWS = np.arange(0.0, 4.05, RATE)


def miss(load, speed, there, steps, linear):
    """How far the filter's positions are off those by hand (m); it begins with a speed (m/s)."""
    model = slide(
        coulomb_friction=RIGID,
        symmetric_damping={"intercept_n_s_per_mm": 0.0, "slope_n_s_per_mm_per_kpa": 0.0},
        bandwidth=1e5,
        speed=True,
    )
    first = {"contraction": 0.0 * ROWS, "velocity": np.full(ROWS.size, speed)}
    # A load pulls against the contraction.
    trial = Trial(ROWS, {"load_command": -load}, first)
    made = box([trial], model, (0, 1), steps=steps, linear=linear)
    made.rows[0] = counted(made.rows[0], np.arange(ROWS.size) == 0)
    still = replace(point(made), forces=(1e-12,))
    return float(np.abs(made.kept(0, still).predicted[1:, 0] - there[1:]).max())


@pytest.mark.parametrize("steps", [1, 4])
def test_a_mass_that_coasts_stops_where_its_energy_ends_and_stays(steps):
    there = np.where(ROWS < 0.15, 0.3 * ROWS - ROWS**2, 0.0225)
    assert miss(0.0 * ROWS, 0.3, there, steps, linear=False) < 1e-5


@pytest.mark.parametrize("steps", [1, 4])
def test_a_mass_that_turns_has_friction_in_the_old_direction_until_then_alone(steps):
    """From 0.1 s on 30 N stop it in 0.0375 s; friction to the end of the step cost 1.2 m."""
    back, now = ROWS - 0.1375, ROWS - 0.1
    there = np.where(back < 0.0, 0.04 + 0.3 * now - 4.0 * now**2, 0.045625 - 2.0 * back**2)
    there[ROWS < 0.1] = (0.5 * ROWS - ROWS**2)[ROWS < 0.1]
    push = np.where(ROWS > 0.05, -30.0, 0.0)
    assert miss(push, 0.5, there, steps, linear=False) < 1e-3


def test_a_mass_breaks_away_when_a_ramp_exceeds_its_friction():
    """Commands are means over steps: halved steps leave a quarter of the error."""
    since = np.maximum(ROWS - FRICTION / 7.0, 0.0)
    there = 7.0 * since**3 / (6.0 * MASS)
    off = [miss(7.0 * ROWS, 0.0, there, steps, linear=True) for steps in (1, 2, 4, 8)]
    assert off[0] < 0.02 * there[-1]
    assert off[3] < off[0] / 40.0
