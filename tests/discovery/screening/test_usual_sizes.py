"""Effects of a free rig are looked for at the sizes of its trials, of a watch as of a crane."""

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.screening.usual_sizes import sizes
from pma_gym.units import Quantity
from tests.discovery.test_joint import joint
from tests.plant.test_imposed import SINE, TIME, imposed

INERTIA = joint().parameters["inertia"].inertia


def swung(torque, angle, hertz=2.0):
    """A joint's trial under a sine of torque (N m), whose angle (rad) is a sine too."""
    time = np.linspace(0.0, 2.0, 801)
    wave = np.sin(2.0 * np.pi * hertz * time)
    return Trial(time, {"torque_command": torque * wave}, {"angle": -angle * wave})


def candidate(name, *trials, rig=None):
    """An effect as it is looked for in trials of a rig, a joint unless one is named."""
    known = candidate_effects(rig or joint(), None, list(trials))
    return next(each for each in known if each.name == name)


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
