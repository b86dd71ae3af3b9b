"""The regulator contracts the muscle against a constant load that the motor holds."""

import numpy as np
import pytest

from pma_gym.envs import PMAEnv
from pma_gym.plant.model import load_model
from pma_gym.plant.statics import contraction_at, muscle_force
from pma_gym.tasks import ISOTONIC, isotonic

FRICTIONLESS = load_model("serres2008").replace(
    {"coulomb_friction.static_n": 0.0, "coulomb_friction.dynamic_n": 0.0}
)


def static(model, pressure_kpa: float, load: float) -> float:
    """Contraction (m) at which the muscle balances a load."""
    at = np.array([1e3 * pressure_kpa]), np.array([load])
    return float(contraction_at(muscle_force(model), *at)[0])


@pytest.mark.parametrize(
    ("model", "name"), [*(("station", name) for name in ISOTONIC), ("serres2008", "isotonic")]
)
def test_an_episode_begins_settled_under_its_load(name, model):
    env = PMAEnv(name, model=model, noise=False)
    _, info = env.reset(seed=3)
    load = env.task.load
    assert info["load_n"] == pytest.approx(load, rel=1e-9) == env.station.load
    drive = env.station.model.parameters["drive"]
    assert env.motor_voltage == pytest.approx((load - drive.offset) / drive.gain)
    low, high = env.task.starts
    assert low - 1.0 <= 1e3 * info["pressure_kpa"] <= high + 1.0 and not info["extrapolated"]
    # What hysteresis holds where the muscle was filled, the muscle pulls beside the load.
    hysteresis = env.station.model.parameters.get("hysteresis")
    held = hysteresis.force * hysteresis.memory_at_start if hysteresis else 0.0
    balanced = static(env.station.model, info["pressure_kpa"], load + held)
    assert env.truth["contraction"] == pytest.approx(balanced, abs=1e-9)
    assert info["contraction_mm"] == info["measured_contraction_mm"] == 0.0
    for _ in range(100):
        *_, info = env.step(env.action(env.regulator_voltage))
    # It stays where it is, but for rounding.
    assert abs(info["contraction_mm"]) < 1e-6 and info["load_n"] == pytest.approx(load, rel=1e-6)


@pytest.mark.parametrize("pressure_kpa", [150.0, 350.0])
def test_contraction_comes_to_rest_where_the_forces_balance(pressure_kpa):
    env = PMAEnv("isotonic", model=FRICTIONLESS, noise=False, pressure_kpa=pressure_kpa)
    env.reset(seed=0)
    for end_kpa in (pressure_kpa + 100.0, pressure_kpa + 40.0):
        for _ in range(300):
            *_, info = env.step(env.action(env.nominal_plant.regulator_voltage(1e3 * end_kpa)))
        moved = static(FRICTIONLESS, end_kpa, 200.0) - static(FRICTIONLESS, pressure_kpa, 200.0)
        assert info["pressure_kpa"] == pytest.approx(end_kpa, rel=1e-6)
        assert 1e-3 * info["contraction_mm"] == pytest.approx(moved, abs=2e-6)


def test_the_regulator_is_the_actuator(make):
    env = make("isotonic", noise=False, action_delay_s=0.02)
    env.reset(seed=0)
    held, rest = env.motor_voltage, env.regulator_voltage
    for k in range(50):
        observation, *_, info = env.step(env.action(6.0))
        assert info["motor_voltage_v"] == held
        assert info["regulator_voltage_v"] == pytest.approx(rest if k < 2 else 6.0)
        assert observation[6] == pytest.approx(0.2)
    assert env.station.task.actuator == "regulator"
    assert env.voltages == pytest.approx([rest] * 2 + [6.0] * 48)
    assert env.motor_voltages == pytest.approx([held] * 50)
    assert env.condition.commands == pytest.approx((held, 6.0))
    assert env.table.rows[6] == ("last regulator action", "10 V, -1.0 = 0 V")
    assert env.action_space.shape == (1,)


def test_contraction_is_positive_and_extension_negative_while_it_shortens(make):
    env = make("isotonic", history=2, preview=1)
    env.reset(seed=2)
    start = env.truth["contraction"]
    delayed = [env.measurement] * 2
    for _ in range(80):
        observation, *_, info = env.step(env.action(7.0))
        delayed.append(env.measurement)
    position = env.station.position(env.measurement)
    assert position == -env.measurement.extension > 5e-3
    assert 1e-3 * info["measured_contraction_mm"] == pytest.approx(position)
    assert 1e-3 * info["contraction_mm"] == pytest.approx(env.truth["contraction"] - start)
    assert env.position == pytest.approx(-env.truth["extension"])
    # The LVDT lags by 1.6 ms, has 0.02 mm of noise and steps of 0.05 mm.
    assert position == pytest.approx(env.position, abs=0.2e-3)
    past = [env.station.position(reading) / env.task.schedule.span for reading in delayed[-2:-4:-1]]
    np.testing.assert_allclose(observation[[8, 9]], past, rtol=1e-6)
    off = env.reference(env.time) / env.task.schedule.span - position / env.task.schedule.span
    assert observation[5] == pytest.approx(off, rel=1e-5)


def test_the_triangles_are_the_dissertations_trials():
    low, high = ISOTONIC["triangle_low"], ISOTONIC["triangle_high"]
    # Section 5.1.5: 1.94 mm are 17 % and 1.38 mm are 25 % of the total contraction.
    assert 1e3 * low.schedule.span == pytest.approx(1.94 / 0.17, abs=0.05)
    assert 1e3 * high.schedule.span == pytest.approx(1.38 / 0.25, abs=0.05)
    assert (low.load, low.starts, low.schedule.duration) == (150.0, (150e3, 150e3), 12.0)
    assert (high.load, high.starts, high.schedule.duration) == (400.0, (450e3, 450e3), 30.0)
    for task, period in ((low, 4.0), (high, 10.0)):
        turns = task.schedule.reference(np.arange(7) * 0.5 * period) / task.schedule.span
        np.testing.assert_allclose(turns, [0, 1, 0, 1, 0, 1, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("task", "options", "words"),
    [
        ("isotonic", {"regulator_action": True}, ["regulator_action", "isotonic", "leave"]),
        ("isotonic", {"model": "cascade"}, ["isotonic", "station", "cascade"]),
        (isotonic(load=5e3), {}, ["load must lie in 0 to 976.4 N", "5000 N"]),
        ("isotonix", {}, ["task must be one of", "did you mean 'isotonic'?"]),
        (3, {}, ["task must be one of", "got 3"]),
    ],
)
def test_what_cannot_be_is_refused(task, options, words):
    with pytest.raises(ValueError) as caught:
        PMAEnv(task, **({"model": "serres2008"} | options))
    for word in words:
        assert word in str(caught.value)


def test_a_load_that_nothing_balances_is_refused():
    short = load_model("serres2008").replace({"limits.stretch_mm": 2.0})
    env = PMAEnv(isotonic(load=900.0), model=short, pressure_kpa=150.0)
    with pytest.raises(ValueError, match="balances the load .* at 150 kPa; give a higher"):
        env.reset(seed=0)
    # Nothing of the seed is lost: the episode that could not begin was none.
    whole = PMAEnv(isotonic(load=900.0), model=short, pressure_kpa=550.0)
    possible = {"options": {"pressure_kpa": 550.0}}
    np.testing.assert_array_equal(env.reset(**possible)[0], whole.reset(seed=0)[0])
    np.testing.assert_array_equal(env.reset(**possible)[0], whole.reset()[0])
