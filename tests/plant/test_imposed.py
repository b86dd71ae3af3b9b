"""An imposed motion measures what it moves: a muscle, a seal, a brake with backlash."""

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.files.trial_files import read_trial
from pma_gym.data.trial import Trial, TrialError
from pma_gym.effects import CATALOGUE
from pma_gym.plant.imposed_motion import smoothed
from pma_gym.plant.model import Model, load_model

TIME = np.arange(0.0, 3.0, 0.004)
SINE = 0.5 * (1.0 - np.cos(2.0 * np.pi * TIME))
BACK = (TIME > 1.5) & (TIME < 2.0)
"""Readings of a whole way back, with the motion at its end at 1.5 s."""

FRICTION = {"force_n": 10.0, "presliding_um": 100.0}
NEUTRAL = ("contact_friction", "constant_force", "pressure_friction", "cogging", "backlash")


def imposed(**tables):
    """A rig with effects given by their tables in files."""
    given = {"imposed_motion": {"bandwidth_hz": 20.0}, **tables}
    parameters = {name: CATALOGUE[name].parse(table) for name, table in given.items()}
    return Model("imposed", "An imposed motion", "imposed", parameters)


def trial(stroke=0.02, pressure=None):
    """Three periods of a sine, at a pressure (Pa)."""
    commands = {"contraction_command": stroke * SINE}
    if pressure is not None:
        commands["pressure_command"] = np.full(TIME.size, pressure)
    return Trial(TIME, commands)


def force(model, *conditions):
    return Plant(model).simulate(trial(*conditions), noise=False).measurements["force"]


@pytest.mark.parametrize(("share", "passed"), [(0.1, 0.9999), (1.0, 0.5), (3.0, 1.0 / 82.0)])
def test_a_records_amplitude_is_halved_at_the_bandwidth(share, passed):
    time = np.arange(0.0, 4.0, 1e-3)
    wave = np.sin(2.0 * np.pi * 5.0 * share * time)
    middle = slice(1000, 3000)
    motion, rate, _ = smoothed(time, wave, 5.0)
    assert motion[middle].max() == pytest.approx(passed, rel=2e-3)
    assert rate[middle].max() == pytest.approx(passed * 10.0 * np.pi * share, rel=2e-3)


def test_a_steady_motion_passes_uneven_times_as_it_is():
    time = np.cumsum(np.random.default_rng(0).uniform(0.001, 0.02, 500))
    motion, rate, curvature = smoothed(time, 0.3 + 0.02 * time, 2.0)
    np.testing.assert_allclose(motion, 0.3 + 0.02 * time, atol=1e-12)
    np.testing.assert_allclose(rate, 0.02, atol=1e-10)
    np.testing.assert_allclose(curvature, 0.0, atol=1e-8)


def test_a_record_that_ends_in_motion_ends_with_its_speed():
    time = np.arange(0.0, 3.2, 0.005)
    for phase in (0.0, 0.9, 2.0):
        _, rate, _ = smoothed(time, 0.02 * np.sin(2.0 * time + phase), 10.0)
        wanted = 0.04 * np.cos(2.0 * time + phase)
        assert np.abs(rate - wanted)[-40:].max() < 5e-3 * 0.04


def test_damping_feels_the_velocity_of_the_motion():
    damping = {"intercept_n_s_per_mm": 1.0, "slope_n_s_per_mm_per_kpa": 0.0}
    expected = -1000.0 * 0.02 * np.pi * np.sin(2.0 * np.pi * TIME)
    got = force(imposed(symmetric_damping=damping))
    np.testing.assert_allclose(got[50:-50], expected[50:-50], atol=0.05)


@pytest.mark.parametrize("bandwidth", [30.0, 60.0, 100.0])
def test_a_fast_motion_is_followed_between_the_rows_of_its_record(bandwidth):
    """A damper feels the spline's own speed, not that of the straight lines between rows."""
    damping = {"intercept_n_s_per_mm": 1.0, "slope_n_s_per_mm_per_kpa": 0.0}
    fast = imposed(symmetric_damping=damping).replace({"imposed_motion.bandwidth_hz": bandwidth})
    record = 0.02 * SINE * np.sin(2.0 * np.pi * 5.0 * TIME)
    wanted = -1000.0 * smoothed(TIME, record, bandwidth)[1]
    got = Plant(fast).simulate(Trial(TIME, {"contraction_command": record}), noise=False)
    errors = (got.measurements["force"] - wanted)[50:-50]
    assert np.sqrt(np.mean(errors**2)) < 1e-3 * np.sqrt(np.mean(wanted**2))


@pytest.mark.parametrize("pressure", [150e3, 400e3])
def test_a_muscle_pulls_by_its_own_laws(pressure):
    station = load_model("serres2008")
    laws = {name: station.parameters[name] for name in ("contractile_force", "stiffness")}
    model = Model("m", "", "imposed", {**imposed().parameters, **laws})
    stiffness = 32.7e3 - 32.1 * pressure / 1e3 if pressure < 314e3 else 17e3 + 17.9 * pressure / 1e3
    expected = 2.91e-3 * pressure + 44.6 - stiffness * 0.02 * SINE
    np.testing.assert_allclose(force(model, 0.02, pressure)[50:-50], expected[50:-50], atol=0.5)


@pytest.mark.parametrize("stroke", [0.005, 0.02])
def test_a_loop_of_dry_friction_has_its_area(stroke):
    got = force(imposed(contact_friction=FRICTION), stroke)
    last = slice(500, 750)
    area = -np.trapezoid(got[last], stroke * SINE[last])
    # A corner at either end: the integral of 1 - z over a turn, 2.015 presliding distances.
    assert area == pytest.approx(2.0 * 10.0 * (stroke - 2.015e-4), rel=1e-3)


@pytest.mark.parametrize("stroke", [0.01, 0.02])
def test_backlash_is_the_same_way_without_force_at_every_amplitude(stroke):
    got = force(imposed(contact_friction=FRICTION, backlash={"width_mm": 3.0}), stroke)
    way = stroke * (1.0 - SINE)
    free = np.abs(got) < 1e-6
    lost = way[BACK & free]
    assert lost.min() == pytest.approx(0.1e-3, abs=0.1e-3)
    assert lost.max() == pytest.approx(3.1e-3, abs=0.3e-3)
    assert got[BACK & (way > 3.5e-3)] == pytest.approx(10.0, abs=1e-6)


@pytest.mark.parametrize("pressure", [0.0, 100e3, 700e3])
def test_half_the_loop_grows_with_pressure(pressure):
    seal = {"slope_n_per_kpa": 0.0055, "presliding_um": 100.0}
    got = force(imposed(contact_friction=FRICTION, pressure_friction=seal), 0.02, pressure)
    half = 0.5 * (got[BACK & (SINE < 0.9)].mean() - got[(TIME < 0.45) & (TIME > 0.1)].mean())
    assert half == pytest.approx(10.0 + 0.0055e-3 * pressure, rel=1e-3)


def test_forces_of_position_and_of_nothing_add():
    cogging = {"amplitude_n": 2.0, "periods_per_m": 150.0, "phase_deg": 30.0}
    got = force(imposed(cogging=cogging, constant_force={"force_n": 7.0}))
    expected = 7.0 + 2.0 * np.cos(2.0 * np.pi * 150.0 * 0.02 * SINE + np.pi / 6.0)
    np.testing.assert_allclose(got[50:-50], expected[50:-50], atol=0.01)


def test_neutral_effects_are_absent_to_the_last_bit():
    bare = imposed(contractile_force={"slope_n_per_kpa": 0.49, "intercept_n": 3.0})
    neutral = {name: CATALOGUE[name].neutral for name in NEUTRAL}
    whole = Model("imposed", "", "imposed", {**bare.parameters, **neutral})
    np.testing.assert_array_equal(force(bare, 0.02, 3e5), force(whole, 0.02, 3e5))


def test_a_measured_motion_is_the_command(tmp_path):
    path = tmp_path / "run.csv"
    rows = [f"{t:.17g},{x:.17g},100" for t, x in zip(TIME, 0.02 * SINE * 1e3, strict=True)]
    path.write_text("\n".join(["time_s,contraction_mm,pressure_command_kpa", *rows]) + "\n")
    seal = imposed(pressure_friction={"slope_n_per_kpa": 0.05, "presliding_um": 10.0})
    got = Plant(seal).simulate(read_trial(path), noise=False).measurements["force"]
    np.testing.assert_allclose(got, force(seal, 0.02, 100e3), atol=1e-9)


def test_files_hold_inches_and_kips(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time_s,contraction_command_in,force_kip\n0,0,0\n0.1,1,2\n")
    read = read_trial(path)
    np.testing.assert_allclose(read.commands["contraction_command"], [0.0, 0.0254])
    np.testing.assert_allclose(read.measurements["force"], [0.0, 8896.44323])


def test_too_few_rows_for_a_bandwidth_are_refused_with_one_that_fits():
    slow = Trial(np.linspace(0.0, 0.4, 5), {"contraction_command": np.zeros(5)})
    with pytest.raises(TrialError, match=r"at most half of the rows in a second, 5 Hz .* 20 Hz"):
        Plant(imposed()).simulate(slow)


def test_a_log_without_a_motion_is_refused_with_its_column():
    with pytest.raises(TrialError, match="give contraction_command_mm"):
        Plant(imposed()).simulate(Trial(TIME, {"pressure_command": 0.0 * TIME}))


def test_friction_rises_near_rest():
    """By `rise` at rest, by half of that at the Stribeck speed, by nothing far above it."""
    falling = {**FRICTION, "rise_n": 4.0, "stribeck_speed_mm_per_s": 5.0}
    time = np.arange(0.0, 4.0, 0.004)
    speeds = {0.005: 12.0, 0.5: 10.0 + 4.0 / 10001.0}
    for speed, level in speeds.items():
        steady = Trial(time, {"contraction_command": speed * time})
        got = Plant(imposed(contact_friction=falling)).simulate(steady, noise=False)
        assert -got.measurements["force"][500] == pytest.approx(level, rel=1e-3)
    without = force(imposed(contact_friction=FRICTION), 0.02)
    none = force(imposed(contact_friction={**FRICTION, "rise_n": 0.0}), 0.02)
    np.testing.assert_array_equal(none, without)


@pytest.mark.parametrize("release", [0.4, 1.0])
def test_a_stop_operator_takes_the_work_of_its_loop_and_forgets_a_minor_one(release):
    """F (1 + r) (2 A - (1 + r) d) in a cycle of amplitude A."""
    values = {"force_n": 10.0, "release_ratio": release, "distance_mm": 3.0, "memory_at_start": 0.0}
    model = imposed(stop_operator=values)
    reading = Plant(model).simulate(trial(), noise=False).truth
    last = slice(TIME.size * 2 // 3 - 1, None)
    work = -np.trapezoid(reading["force"][last], reading["contraction"][last])
    amplitude = 0.5 * np.ptp(reading["contraction"][last])
    across = (1.0 + release) * 3e-3
    assert work == pytest.approx(10.0 * (1.0 + release) * (2.0 * amplitude - across), rel=1e-3)
    law = CATALOGUE["stop_operator"]
    p = law.parse(values)
    path, way = law.rate_independent_law, 1e-3
    there = path(0.2, way, 1.0, p)
    assert path(path(there, -0.5 * way, -1.0, p), 0.5 * way, 1.0, p) == pytest.approx(there)
    assert path(0.2, 1.0, 1.0, p) == 1.0 and path(0.2, -1.0, -1.0, p) == -release
