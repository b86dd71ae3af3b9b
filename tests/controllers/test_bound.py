"""The achievable bound: below every controller, zero where the drive can give all.

The exact inverse is one of the ideal controllers and `ImprovedFeedforward` is the same: equal but
for the rounding of the times at which a voltage changes.
"""

import numpy as np
import pytest

from benchmarks.bound import achievable_bound
from controllers import CONTROLLERS
from pma_gym.plant.model import load_model


@pytest.mark.parametrize("pressure", [275, 575])
def test_no_controller_comes_closer_in_rotation(pressure, drive):
    bound = achievable_bound("station", "rotation", pressure)
    for make in CONTROLLERS.values():
        got, _ = drive(make(), "rotation", pressure)
        assert all(bound[phase] <= 1.02 * got[phase] for phase in bound)


def test_no_controller_comes_closer_in_displacement(drive):
    bound = achievable_bound("station", "displacement", 300)["displacement"]
    for make in CONTROLLERS.values():
        assert bound <= 1.02 * drive(make(), "displacement", 300)[0]["displacement"]


def test_phase_three_is_limited_by_what_the_drive_cannot_push():
    # More friction of the rotor brakes it sooner where the cable hangs loose.
    model = load_model("station")
    braked = model.replace({"rotor.damping_n_m_s": 7.64e-3})
    free = achievable_bound(model, "rotation", 400)["III"]
    assert achievable_bound(braked, "rotation", 400)["III"] > 3.0 * free > 0.0


def test_cascade_that_is_pushed_and_pulled_alike_has_no_floor():
    bound = achievable_bound("cascade", "rotation", 300)
    assert np.all(np.array(list(bound.values())) < 0.005)
