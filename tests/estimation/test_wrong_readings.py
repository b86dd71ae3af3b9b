"""What the filter makes of bent sensors, play before a sensor and clocks that disagree."""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.trial import Trial
from pma_gym.estimation.likelihood_fit import STEP, value_of, with_values
from tests.estimation.linear_slide import NOISES, box, logged, point, slide

MOUNTS = {
    "lvdt_bend": {"curvature_percent_per_mm": 0.0},
    "lvdt_backlash": {"width_mm": 0.0},
}


@pytest.mark.parametrize("name", MOUNTS)
def test_an_absent_mount_leaves_innovations_but_for_rounding(name):
    trial, _ = logged()
    plain, mounted = (box([trial], slide(**more)) for more in ({}, {name: MOUNTS[name]}))
    for one, other in zip(
        *(each.innovations([point(each)])[0] for each in (plain, mounted)), strict=True
    ):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * NOISES[0])


SIZES = {"lvdt_bend.curvature": 0.2, "lvdt_backlash.width": 4e-4, "clock": 4e-3}


@pytest.mark.parametrize("name", SIZES)
def test_an_innovation_grows_evenly_with_what_is_wrong(name):
    """Derivatives by steps of a fit are those by steps ten times as long."""
    trial, _ = logged()
    mount = name.partition(".")[0]
    made = box([trial], slide(**({mount: MOUNTS[mount]} if mount in MOUNTS else {})), steps=8)
    at = with_values(point(made), {name: SIZES[name]})
    short, long = (STEP * SIZES[name], 10.0 * STEP * SIZES[name])
    beside = [with_values(at, {name: SIZES[name] + s}) for s in (short, -short, long, -long)]
    ((errors, _),) = made.innovations(beside)
    fine, coarse = (errors[0] - errors[1]) / short, (errors[2] - errors[3]) / long
    assert np.linalg.norm(fine - coarse) < 0.01 * np.linalg.norm(coarse)
    assert value_of(at, name) == SIZES[name]


def swung(**mount):
    """True positions (m) of a slide under a sine of force, and those that a sensor reads."""
    model = slide(**mount)
    bare = replace(model, parameters={n: p for n, p in model.parameters.items() if n != "lvdt"})
    time = np.arange(0.0, 2.0, 0.001)
    trial = Trial(time, {"load_command": 20.0 * np.sin(9.0 * time)})
    made = Plant(bare).simulate(trial, noise=False)
    return made.truth["contraction"], made.measurements["contraction"]


def test_a_bent_sensor_without_a_table_reads_the_square_of_the_position():
    truth, read = swung(lvdt_bend={"curvature_percent_per_mm": 1.0})
    np.testing.assert_allclose(read, truth + 10.0 * truth**2)
    assert np.abs(truth).max() > 0.01


def test_a_gear_loses_half_its_play_each_way():
    truth, read = swung(lvdt_backlash={"width_mm": 0.4})
    place, expected = 0.0, []
    for q in truth:
        place = min(max(place, q - 2e-4), q + 2e-4)
        expected.append(place)
    np.testing.assert_allclose(read, expected, atol=2e-6)
