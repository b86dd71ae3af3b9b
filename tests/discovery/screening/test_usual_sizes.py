"""Effects of a free rig are looked for at the sizes of its trials, of a watch as of a crane."""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import FreeParameters
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.screening.usual_sizes import sizes
from pma_gym.plant.model import load_model
from pma_gym.units import Quantity
from tests.discovery.test_joint import joint
from tests.plant.test_imposed import SINE, TIME, imposed

INERTIA = joint().parameters["inertia"].inertia
NOISE = (white_noise(1e-3), white_noise(0.01), white_noise(1.0))


def swung(torque, angle, hertz=2.0):
    """A joint's trial under a sine of torque (N m), whose angle (rad) is a sine too."""
    time = np.linspace(0.0, 2.0, 801)
    wave = np.sin(2.0 * np.pi * hertz * time)
    return Trial(time, {"torque_command": torque * wave}, {"angle": -angle * wave})


def pushed(force):
    """A trial of an imposed sine with a force (N)."""
    return Trial(TIME, {"contraction_command": 0.02 * SINE}, {"force": force})


def candidate(name, *trials, rig=None):
    """An effect as it is looked for in trials of a rig, a joint unless one is named."""
    known = candidate_effects(rig or joint(), None, list(trials))
    return next(each for each in known if each.name == name)


def fit_of(rig, trial, effect, begun):
    """A fit of an effect alone, and its problem."""
    noise = NOISE if rig.rig.name == "imposed" else NOISE[::2]
    problem = FitProblem([trial], rig, FreeParameters((), np.empty(0)), noise)
    fit = problem.fit(rig, (effect,), {effect.name: begun})
    assert fit is not None
    return problem, fit


@pytest.mark.parametrize("factor", [1e-4, 1.0, 1e3])
def test_probes_grow_with_the_torque_of_the_trials(factor):
    trial = swung(0.5 * factor, 0.3)
    scores = sizes(joint(), [trial])
    assert scores.force == pytest.approx(0.49 * factor, rel=0.02)
    assert scores.speed == pytest.approx(0.3 * 4.0 * np.pi, rel=0.05)
    assert scores.way == pytest.approx(0.3, rel=0.01)
    # A tenth of the torque at the speed of the trials, times the factors of the probes.
    usual = 0.1 * scores.force / scores.speed**2
    assert candidate("joint_drag", trial).probes.max() == pytest.approx(3.0 * usual, rel=1e-6)
    # A log of speed alone has the sizes of its motion.
    speed = np.gradient(trial.measurements["angle"], trial.time)
    alone = sizes(joint(), [Trial(trial.time, trial.commands, {"speed": speed})])
    assert (alone.speed, alone.way) == pytest.approx((scores.speed, scores.way), rel=0.02)


def test_a_station_keeps_the_sizes_of_the_catalogue():
    assert sizes(load_model("station"), []) is None


@pytest.mark.parametrize("factor", [1.0, 1e4])
def test_an_imposed_motion_has_the_sizes_of_the_force_that_it_takes(factor):
    """A tenth of the force's change, and what that makes over the motion's speeds and ways."""
    swing = 0.02 * SINE
    commands = {"contraction_command": swing, "pressure_command": np.full(len(TIME), 2e5)}
    trial = Trial(TIME, commands, {"force": 7.0 + 5.0 * factor * SINE})
    known = sizes(imposed(), [trial])
    assert known is not None
    # Half of the sine's change beyond its median, nine tenths of the time below.
    assert known.force == pytest.approx(2.5 * factor, rel=0.05)
    assert known.way == pytest.approx(0.01, rel=0.01)
    assert known.speed == pytest.approx(np.quantile(np.abs(np.gradient(swing, TIME)), 0.9), rel=0.1)
    assert known.pressure == pytest.approx(2e5)
    per_pressure = Quantity("N/kPa", 0.0, 1e9, "a test", 0.0, usual=1.0)
    assert known.scaled(per_pressure).usual == pytest.approx(0.1 * known.force / 200.0)


def test_a_ripple_is_seen_to_repeat_in_the_way():
    """Half a period in the way is a bump at an end as much as a wave: no fit goes there."""
    trial = pushed(3.0 * np.cos(2.0 * np.pi * 25.0 * 0.02 * SINE))
    ripple = candidate("cogging", trial, rig=imposed())
    at = ripple.paths.index("cogging.periods_per_m")
    assert ripple.probes[:, at].min() == pytest.approx(62.5, rel=0.01)
    assert len(np.unique(ripple.probes, axis=0)) == len(ripple.probes) == len(ripple.signs)
    assert ripple.grown(0, 1e-3)[at] == ripple.bounds[0][at]
    problem, fit = fit_of(imposed(), trial, ripple, ripple.probes[0])
    assert fit.estimate("cogging.periods_per_m")[0] >= 62.0
    assert problem.left(fit) > 10.0


def test_a_weight_is_looked_for_wherever_its_arm_hangs():
    """With the arm level at angle 0 a weight is a constant torque, which no probe at 0 shows."""
    weight = candidate("joint_weight", swung(0.5, 0.3))
    at = weight.paths.index("joint_weight.offset_deg")
    assert set(weight.probes[:, at]) == {-90.0, 0.0, 90.0, 180.0}


def test_a_spring_is_looked_for_relaxed_within_the_way_and_away_from_it():
    spring = candidate("spring", pushed(3.0 * SINE), rig=imposed())
    rests = np.unique(spring.probes[:, spring.paths.index("spring.rest_mm")])
    np.testing.assert_allclose(rests, [-40.0, -10.0, 0.0, 10.0, 40.0], rtol=0.01)


@pytest.mark.parametrize(("start", "phase"), [(170.0, -130.0), (-170.0, 150.0), (90.0, 20.0)])
def test_a_ripple_is_found_at_any_phase(start, phase):
    """Phases go round: a search from one side of half a turn ends on the other."""
    trial = pushed(3.0 * np.cos(2.0 * np.pi * 120.0 * 0.02 * SINE + np.radians(phase)))
    ripple = candidate("cogging", trial, rig=imposed())
    _, fit = fit_of(imposed(), trial, ripple, np.array([2.0, 118.0, start]))
    assert fit.estimate("cogging.phase_deg")[0] == pytest.approx(phase, abs=1.0)


def highest_static(*trials):
    friction = candidate("joint_friction", *trials)
    static, dynamic = (
        friction.bounds[1][friction.paths.index(f"joint_friction.{stem}_n_m")]
        for stem in ("static", "dynamic")
    )
    assert dynamic == static
    return static


@pytest.mark.parametrize(("torque", "angle"), [(5e-4, 3e-4), (0.5, 0.3), (1e-9, 0.3)])
def test_no_static_friction_is_looked_for_that_nothing_in_the_trials_overcomes(torque, angle):
    """Twice the torque of the drive and of inertia, whose sines have known peaks."""
    strongest = torque + INERTIA * angle * (4.0 * np.pi) ** 2
    assert highest_static(swung(torque, angle)) == pytest.approx(2.0 * strongest, rel=0.03)


def test_readings_that_stand_alone_raise_no_bound():
    trial = swung(0.5, 0.3)
    angle = trial.measurements["angle"].copy()
    angle[[100, 300]] += 0.5
    spoilt = Trial(trial.time, trial.commands, {"angle": angle})
    assert highest_static(spoilt) == pytest.approx(highest_static(trial), rel=0.1)


def test_friction_of_a_rig_without_one_inertia_has_the_bound_of_the_catalogue(monkeypatch):
    quantity = Quantity("N", 0.0, 500.0, "a test", 0.0, usual=1.0)
    alone = replace(joint().rig, inertia=())
    monkeypatch.setattr(type(joint()), "rig", property(lambda _: alone))
    unknown = sizes(joint(), [swung(0.5, 0.3)])
    assert unknown is not None and unknown.strongest == np.inf
    assert unknown.most_friction(quantity) == 500.0


def test_a_fit_keeps_to_static_friction_that_the_trials_overcome():
    """A joint that stands still under its drive: any larger friction holds it as well."""
    time, rng = np.linspace(0.0, 2.0, 401), np.random.default_rng(4)
    torque = {"torque_command": 0.5 * np.sin(2.0 * np.pi * time)}
    trials = Trial(time, torque, {"angle": 1e-3 * rng.standard_normal(401)}), swung(0.5, 0.3)
    friction = candidate("joint_friction", *trials)
    _, fit = fit_of(joint(), trials[0], friction, friction.probes[0])
    assert fit.estimate("joint_friction.static_n_m")[0] <= highest_static(*trials) < 1e4
