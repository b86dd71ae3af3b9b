"""The achievable bound: below every controller, zero where the drive can give all.

The exact inverse is one of the ideal controllers and `ImprovedFeedforward` is the same: equal but
for the rounding of the times at which a voltage changes.
"""

from functools import lru_cache

import numpy as np
import pytest

from benchmarks.bounds import achievable_bound
from controllers import CONTROLLERS
from pma_gym.plant.model import load_model

RIVALS = [
    make
    for make in CONTROLLERS.values()
    if not hasattr(make, "receive") and "rotation" in getattr(make, "kinds", ["rotation"])
]

bound_of = lru_cache(achievable_bound)


@pytest.mark.campaign
def test_no_controller_comes_closer_in_rotation(drive):
    bound = bound_of("station", "rotation", 400)
    for make in RIVALS:
        got, _ = drive(make(), "rotation", 400)
        assert all(bound[phase] <= 1.02 * got[phase] for phase in bound)


@pytest.mark.campaign
def test_no_controller_comes_closer_in_displacement(drive):
    bound = bound_of("station", "displacement", 300)["displacement"]
    for make in RIVALS:
        assert bound <= 1.02 * drive(make(), "displacement", 300)[0]["displacement"]


@pytest.mark.campaign
def test_phase_three_is_limited_by_what_the_drive_cannot_push():
    # More friction of the rotor brakes it sooner where the cable hangs loose.
    model = load_model("station")
    braked = model.replace({"rotor.damping_n_m_s": 7.64e-3})
    free = bound_of("station", "rotation", 400)["III"]
    assert achievable_bound(braked, "rotation", 400)["III"] > 3.0 * free > 0.0


@pytest.mark.campaign
def test_cascade_that_is_pushed_and_pulled_alike_has_no_floor():
    bound = achievable_bound("cascade", "rotation", 300)
    assert np.all(np.array(list(bound.values())) < 0.005)
