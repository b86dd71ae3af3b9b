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


def miss(load, speed, there, steps, linear, presliding_um=1e-4):
    """How far the filter's positions are off those by hand (m); it begins with a speed (m/s)."""
    model = slide(
        coulomb_friction=RIGID | {"presliding_um": presliding_um},
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


def test_a_mass_that_slides_has_its_whole_friction():
    """5 parts in 100 000 less move it by 0.8 mm in 4 s."""
    there = 10.0 * ROWS - ROWS**2
    assert miss(0.0 * ROWS, 10.0, there, 4, linear=False) < 1e-5


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


def test_what_friction_lacks_at_its_turns_goes_with_the_root_of_its_presliding_distance():
    """A square wave of 30 N turns the mass nine times.

    Within its presliding distance friction is less; the time for that goes with its root.
    """
    pushes = np.where(np.arange(ROWS.size) // 4 % 2 == 0, 30.0, -30.0)
    there, place, speed = [0.0], 0.0, 0.0
    for push in pushes[:-1]:
        left = RATE
        if push * speed < 0.0:
            slows = (push - np.sign(speed) * FRICTION) / MASS
            took = min(left, -speed / slows)
            place, speed, left = (
                place + speed * took + 0.5 * slows * took**2,
                speed + slows * took,
                left - took,
            )
        if left > 1e-12:
            gains = (push - np.sign(push) * FRICTION) / MASS
            place, speed = place + speed * left + 0.5 * gains * left**2, speed + gains * left
        there.append(place)
    off = [miss(pushes, 0.0, np.array(there), 256, False, um) for um in (10.0, 0.1, 1e-3)]
    assert off[0] < 2e-3
    assert off[0] / off[1] == pytest.approx(10.0, rel=0.1)
    assert off[1] / off[2] == pytest.approx(10.0, rel=0.1)
