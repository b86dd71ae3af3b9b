"""Both simulators of rigs against mechanics: periods, decay, stopping, breaking away, energy."""

import math

import numpy as np
import pytest
from scipy.special import ellipk

from benchmarks.hidden_effects.rigs import laws
from benchmarks.hidden_effects.rigs.rig import Rig
from benchmarks.hidden_effects.rigs.simulators import mujoco_axis, stick_slip
from benchmarks.hidden_effects.rigs.simulators.drive import Transmission

SLIDE = Rig("slide", 2.0, 0.0, 0.0, 0.0, 0.0, 0.05, 2.0, 1000.0)
JOINT = Rig("joint", 0.02, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 1000.0)


@pytest.fixture(params=["own", "MuJoCo"])
def simulate(request):
    if request.param == "own":
        return stick_slip.simulate
    pytest.importorskip("mujoco")
    return mujoco_axis.simulate


def rig(base, **values):
    return Rig(**(vars(base) | values))


def idle(row, q):
    return 0.0


def moved(simulate, axis, effects, source=idle, rows=3000, start=(0.0, 0.0)):
    return simulate(axis, effects, Transmission(), source, rows, start)


def test_a_pendulum_swings_with_the_period_of_its_amplitude(simulate):
    swung = moved(simulate, rig(JOINT, gravity=0.5), (), start=(1.2, 0.0))
    period = 4.0 * math.sqrt(0.02 / 0.5) * ellipk(math.sin(0.6) ** 2)
    down = np.flatnonzero((swung.q[:-1] > 0.0) & (swung.q[1:] <= 0.0))
    crossings = down + swung.q[down] / (swung.q[down] - swung.q[down + 1])
    assert np.diff(crossings) / 1000.0 == pytest.approx(period, rel=2e-5)


def test_a_pendulum_hangs_at_its_angle(simulate):
    heavy = rig(JOINT, gravity=0.5, gravity_angle=0.3, damping=0.2)
    hanging = moved(simulate, heavy, (), start=(-0.1, 0.0), rows=6000)
    assert hanging.q[-1] == pytest.approx(-0.3, abs=1e-3)
    hidden = laws.Gravity(0.5, 0.3)
    same = moved(simulate, rig(JOINT, damping=0.2), (hidden,), start=(-0.1, 0.0), rows=6000)
    assert same.q == pytest.approx(hanging.q, abs=1e-6)


def test_a_block_stops_after_its_speed_over_the_friction(simulate):
    slid = moved(simulate, SLIDE, (laws.CoulombFriction(4.0),), start=(0.0, 1.0), rows=1000)
    assert slid.q[-1] == pytest.approx(2.0 * 1.0 / (2.0 * 4.0), rel=1e-3)
    assert np.flatnonzero(slid.v > 1e-3)[-1] / 1000.0 == pytest.approx(0.5, abs=2e-3)


def test_a_sprung_block_loses_four_times_friction_over_stiffness_a_period(simulate):
    sprung = rig(SLIDE, stiffness=200.0)
    swung = moved(simulate, sprung, (laws.CoulombFriction(2.0),), start=(0.2, 0.0), rows=6000)
    tops = [i for i in range(1, 5999) if swung.q[i - 1] < swung.q[i] >= swung.q[i + 1]]
    heights = swung.q[[0, *tops]][:4]
    assert np.diff(heights) == pytest.approx(-4.0 * 2.0 / 200.0, rel=5e-3)
    # It rests where the spring is weaker than the friction.
    assert abs(swung.q[-1]) < 2.0 / 200.0 and abs(swung.v[-1]) < 1e-4


def test_it_breaks_away_at_the_static_level_and_slips_at_the_kinetic_one(simulate):
    friction = laws.CoulombFriction(4.0, rise=0.5, stribeck=1e-3)

    def ramp(row, q):
        return 3.0 * row / 1000.0

    pushed = moved(simulate, SLIDE, (friction,), ramp)
    assert abs(pushed.q[1900]) < 1e-6
    # From the static level on the force grows by 3 N a second above what friction falls to.
    first = np.flatnonzero(pushed.q > 2e-6)[0] / 1000.0
    assert 6.0 / 3.0 < first < 6.0 / 3.0 + (2e-6 * 6.0 * 2.0 / 3.0) ** (1.0 / 3.0)
    assert pushed.a[-1] == pytest.approx((3.0 * 2.999 - 4.0) / 2.0, rel=2e-3)


def test_the_drive_s_work_is_what_is_stored_and_what_is_lost(simulate):
    damped = rig(SLIDE, damping=3.0, stiffness=150.0)

    def push(row, q):
        return 30.0 * math.sin(2.0 * math.pi * 1.7 * row / 1000.0)

    effects = (laws.CoulombFriction(2.0), laws.HardeningSpring(2e4))
    driven = moved(simulate, damped, effects, push)
    q, v = driven.q, driven.v
    work = np.trapezoid(driven.command * v, driven.time)
    lost = np.trapezoid(3.0 * v * v + 2.0 * np.abs(v), driven.time)
    stored = v[-1] ** 2 + 75.0 * q[-1] ** 2 + 0.25 * 2e4 * q[-1] ** 4
    assert work == pytest.approx(lost + stored, rel=6e-3)


STEADY = (
    (laws.QuadraticDrag(5.0), 2.0, math.sqrt(2.0 / 5.0)),
    (laws.DirectionalDamping(4.0), 2.0, 0.5),
    (laws.DirectionalDamping(4.0), -2.0, None),
    (laws.LoadFriction(0.25), 8.0, None),
)


@pytest.mark.parametrize(("effect", "push", "speed"), STEADY)
def test_a_steady_force_ends_in_the_speed_that_balances_it(simulate, effect, push, speed):
    driven = moved(simulate, SLIDE, (effect,), lambda row, q: push, rows=8000)
    if speed is not None:
        assert driven.v[-1] == pytest.approx(speed, abs=1e-3)
    elif isinstance(effect, laws.LoadFriction):
        assert driven.q[-1] == pytest.approx(0.5 * 8.0 * 0.75 / 2.0 * 7.999**2, rel=1e-3)
    else:
        assert driven.q[-1] == pytest.approx(-0.5 * 7.999**2, rel=1e-3)


def rattled(row, q):
    return float(np.random.default_rng(row).normal(0.0, 4.0))


def test_friction_that_bends_where_the_drive_turns_is_exact_at_the_longest_step(monkeypatch):
    damped = rig(SLIDE, damping=5.0, rate=1000.0)
    friction = (laws.LoadFriction(0.3),)
    rough = moved(stick_slip.simulate, damped, friction, rattled, rows=1000)
    monkeypatch.setattr(stick_slip, "LONGEST", 2e-5)
    fine = moved(stick_slip.simulate, damped, friction, rattled, rows=1000)
    assert np.abs(fine.q).max() > 1e-4
    assert np.abs(rough.q - fine.q).max() < 1e-9


TRANSMISSIONS = {
    "none": Transmission(),
    "delay": Transmission(delay=0.58e-3),
    "late lag": Transmission(delay=1.3e-3, lag=0.4e-3),
    "dead band": Transmission(delay=0.58e-3, dead=3.0),
    "gain by sign": Transmission(forward=1.1),
}


@pytest.mark.parametrize("transmission", TRANSMISSIONS.values(), ids=TRANSMISSIONS)
def test_a_drive_s_force_is_followed_whatever_bends_within_a_step(transmission, monkeypatch):
    damped = rig(SLIDE, damping=5.0, rate=1000.0)
    rough = stick_slip.simulate(damped, (), transmission, rattled, 500)
    monkeypatch.setattr(stick_slip, "LONGEST", 1e-5)
    fine = stick_slip.simulate(damped, (), transmission, rattled, 500)
    assert np.abs(fine.q).max() > 1e-3
    assert np.abs(rough.q - fine.q).max() < 1e-9
    pytest.importorskip("mujoco")
    other = mujoco_axis.simulate(damped, (), transmission, rattled, 500)
    assert np.abs(other.q - fine.q).max() < 5e-9


def test_mujoco_s_dry_friction_is_nearer_at_a_tenth_of_the_step():
    pytest.importorskip("mujoco")
    damped = rig(SLIDE, damping=5.0, rate=1000.0)
    friction = (laws.LoadFriction(0.3),)
    exact = moved(stick_slip.simulate, damped, friction, rattled, rows=1000)
    step = mujoco_axis.dry_step(mujoco_axis.LONGEST, 1.0)
    assert step == pytest.approx(0.1 * mujoco_axis.LONGEST)
    errors = [
        np.abs(
            mujoco_axis.simulate(
                damped, friction, Transmission(), rattled, 1000, (0.0, 0.0), each
            ).q
            - exact.q
        ).max()
        for each in (mujoco_axis.LONGEST, step)
    ]
    assert errors[1] < 0.2 * errors[0]
    # A file of an hour takes the step that other forces ask for.
    assert mujoco_axis.dry_step(mujoco_axis.LONGEST, 3600.0) == mujoco_axis.LONGEST


POSITION_LAWS = (
    laws.Spring(40.0),
    laws.HardeningSpring(3e3),
    laws.Cogging(1.0, 0.03, 0.4),
    laws.Detent(2.0, 0.01, 0.01),
    laws.EndBumper(300.0, 0.02),
    laws.EddyBrake(5.0, 0.01, 0.01),
)


@pytest.mark.parametrize("effect", POSITION_LAWS, ids=lambda each: each.name)
def test_both_simulators_agree_on_an_effect(effect):
    pytest.importorskip("mujoco")
    axis = rig(SLIDE, damping=5.0, stiffness=100.0)

    def push(row, q):
        return 1.8 * math.sin(2.0 * math.pi * 1.1 * row / 1000.0) * min(1.0, row / 500.0)

    own = moved(stick_slip.simulate, axis, (effect,), push)
    other = moved(mujoco_axis.simulate, axis, (effect,), push)
    plain = moved(stick_slip.simulate, axis, (), push)
    assert 0.03 < np.abs(plain.q).max() < 0.06
    changed = np.abs(own.q - plain.q).max()
    assert changed > 1e-3
    assert np.abs(own.q - other.q).max() < 0.03 * changed


def test_without_mujoco_the_message_names_the_extra(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(mujoco_axis.NoMujoco, match=r"pma-gym\[foreign\]"):
        mujoco_axis.mujoco()


def test_mujoco_errs_by_no_more_than_its_step_is_chosen_for():
    pytest.importorskip("mujoco")
    rng = np.random.default_rng(7)
    forces = np.cumsum(rng.normal(0.0, 1.0, 1000))
    sprung = rig(SLIDE, stiffness=2000.0, damping=20.0, rate=500.0)
    exact = moved(stick_slip.simulate, sprung, (), lambda row, q: forces[row], rows=1000)
    acceleration, errors = float(np.abs(exact.a).max()), (1e-7, 1e-8, 1e-9)
    for error in errors:
        step = mujoco_axis.step_within(error, acceleration)
        swung = mujoco_axis.simulate(
            sprung, (), Transmission(), lambda row, q: forces[row], 1000, (0.0, 0.0), step
        )
        assert np.abs(swung.q - exact.q).max() < error
    assert mujoco_axis.step_within(1.0, 1.0) == mujoco_axis.LONGEST
