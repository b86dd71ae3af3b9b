"""Records of an imposed motion: what a diagnosis makes of them before it looks at the force."""

import numpy as np
import pytest

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.fast_motion import with_fast_motion
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import free_parameters
from pma_gym.discovery.preparation.data_checks.lead_in import with_lead_in
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.prepared_trials import prepared
from pma_gym.discovery.preparation.recorded_bandwidth import with_recorded_bandwidth
from pma_gym.discovery.screening.candidates import candidate_effects
from tests.plant.test_imposed import FRICTION, SINE, TIME, imposed

MUSCLE = {"contractile_force": {"slope_n_per_kpa": 2.9, "intercept_n": 45.0}}


def named(time, position):
    force = {"force": np.zeros(len(time))}
    return NamedTrial("run.csv", Trial(time, {"contraction_command": position}, force))


def test_a_record_that_begins_in_motion_gets_the_motion_before_it():
    time = np.linspace(5.0, 8.0, 601)
    led = with_lead_in(named(time, 0.02 * (time - 5.0)), imposed()).trial
    assert led.time[0] == pytest.approx(4.0) and len(led) == 801
    np.testing.assert_allclose(np.diff(led.commands["contraction_command"]), 1e-4, atol=1e-9)
    assert np.isnan(led.measurements["force"][:200]).all()
    assert np.isfinite(led.measurements["force"][200:]).all()


def test_a_record_that_begins_at_rest_stays_as_it_is():
    given = named(TIME, 0.02 * SINE)
    assert with_lead_in(given, imposed()) is given


def test_a_record_of_positions_is_no_voltage():
    (kept,), _ = prepared([named(TIME, 0.02 * SINE)], imposed())
    np.testing.assert_array_equal(kept.trial.commands["contraction_command"], 0.02 * SINE)


def test_what_may_be_missing_is_what_the_rig_has():
    bare = {each.name for each in candidate_effects(imposed(contact_friction=FRICTION))}
    muscle = {each.name for each in candidate_effects(imposed(**MUSCLE))}
    assert {"backlash", "pressure_friction", "constant_force", "cogging"} <= bare
    assert not {"hysteresis", "creep", "filling", "regulator_delay"} & bare
    assert {"hysteresis", "creep", "contact_friction"} <= muscle


def test_averaged_rows_record_a_motion_of_less_bandwidth():
    fast = imposed().replace({"imposed_motion.bandwidth_hz": 40.0})
    rows = slice(None, None, 4)
    fewer = named(TIME[rows], 0.02 * SINE[rows]).trial
    rate = 1.0 / (TIME[4] - TIME[0])
    slower, words = with_recorded_bandwidth(fast, [fewer])
    assert slower.parameters["imposed_motion"].bandwidth == pytest.approx(0.4 * rate)
    assert f"{0.4 * rate:.3g} Hz, not 40 Hz" in words[0]
    same, nothing = with_recorded_bandwidth(imposed(), [named(TIME, 0.02 * SINE).trial])
    assert same == imposed() and not nothing


@pytest.mark.parametrize(
    ("record_noise", "bandwidth", "taken"), [(1e-7, 2.0, 8.0), (1e-7, 60.0, 60.0), (1e-3, 5.0, 5.0)]
)
def test_a_motion_is_as_fast_as_its_record_beyond_the_noise(record_noise, bandwidth, taken):
    """Strokes with short rounded ends: 2 Hz cut them, and what the dampers make of them."""
    rng = np.random.default_rng(1)
    strokes = 0.02 * np.sin(0.5 * np.pi * np.sin(2.0 * np.pi * 0.5 * TIME) ** 3)
    rig = imposed(symmetric_damping={"intercept_n_s_per_mm": 1.0, "slope_n_s_per_mm_per_kpa": 0.0})
    rig = rig.replace({"imposed_motion.bandwidth_hz": bandwidth})
    force = -1e3 * np.gradient(strokes, TIME) + rng.normal(0.0, 0.1, len(TIME))
    record = strokes + rng.normal(0.0, record_noise, len(TIME))
    trial = Trial(TIME, {"contraction_command": record}, {"force": force})
    noise = (white_noise(1e-3), white_noise(0.1), white_noise(1.0))
    problem = FitProblem([trial], rig, free_parameters(rig), noise)
    refitted = problem.careful_fit(rig)
    assert refitted is not None
    faster, better, words = with_fast_motion(problem, refitted)
    got = faster.given.parameters["imposed_motion"].bandwidth
    assert got >= taken if taken > bandwidth else got == taken
    assert bool(words) == (taken > bandwidth)
    assert better.chi_square <= 1.01 * refitted.chi_square


def test_without_a_pressure_nothing_is_looked_for_that_pressure_makes():
    force = {"force": 3.0 * SINE}
    without = Trial(TIME, {"contraction_command": 0.02 * SINE}, force)
    pressed = Trial(TIME, {**without.commands, "pressure_command": np.full(len(TIME), 1e5)}, force)
    pressing = {"pressure_friction", "piston_force"}
    names = [{c.name for c in candidate_effects(imposed(), None, [t])} for t in (without, pressed)]
    assert not pressing & names[0]
    assert pressing <= names[1]
    assert names[1] - names[0] <= pressing | {"symmetric_damping_slope"}
