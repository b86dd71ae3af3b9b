"""The same axes in MuJoCo: friction loss, damping, springs, tendons, gravity and fluid are its own.

Its semi-implicit Euler steps are a leapfrog: positions at the ends of steps, speeds half a step
before. Damping takes the speed at the end of its step; half a step of it is taken off the inertia,
so that it acts at the middle. The drive's force is its mean around the start of a step, with
weights that fall to 0 a step away: of it alone the positions are exact.
"""

import math
from types import ModuleType
from typing import Any

import numpy as np

from benchmarks.hidden_effects.rigs import laws
from benchmarks.hidden_effects.rigs.laws import HiddenEffect, summed
from benchmarks.hidden_effects.rigs.rig import GRAVITY, Rig
from benchmarks.hidden_effects.rigs.simulators.drive import Drive, Transmission
from benchmarks.hidden_effects.rigs.simulators.stick_slip import Motion, Source

LONGEST, SHORTEST = 0.25e-3, 0.01e-3
"""Longest and shortest step (s)."""

DRY_SHARE, MOST_DRY_STEPS = 0.1, 2e6
"""Share of the longest step that is taken with dry friction, and how many of them a file may have:
so many took 12 s on one core."""

RADIUS = 0.1
"""Of gyration of a slide's body (m); only its drag depends on it."""

FAR = 60.0
"""Where transverse springs are anchored, in half strokes: 0.02 % off a cube at the end of it."""


class NoMujoco(ImportError):
    """MuJoCo is not installed; the message has the command."""


def mujoco() -> ModuleType:
    """The library.

    Raises:
        NoMujoco: it is not installed.
    """
    try:
        import mujoco as library
    except ImportError:
        raise NoMujoco(
            "half of the cases of block rigs are simulated by MuJoCo, which is not installed; "
            "install the extra: pip install 'pma-gym[foreign]'"
        ) from None
    return library


def simulate(
    rig: Rig,
    effects: tuple[HiddenEffect, ...],
    transmission: Transmission,
    source: Source,
    rows: int,
    start: tuple[float, float] = (0.0, 0.0),
    longest: float = LONGEST,
) -> Motion:
    """The motion under commands that are joined linearly; as `stick_slip.simulate`.

    Args:
        rig: the rig.
        effects: what it hides.
        transmission: of the drive.
        source: of the commands.
        rows: of the log.
        start: position and speed.
        longest: step at most (s).
    """
    library, interval = mujoco(), 1.0 / rig.rate
    steps = max(1, int(np.ceil(interval / transmission.longest(longest) - 1e-9)))
    drive, h = Drive(transmission, interval), interval / steps
    world = World(library, rig, effects, h)
    table = np.empty((rows, 4))
    command = source(0, start[0])
    drive.begin(command)
    world.begin(*start, drive.at(0.0))
    rises = 0.5 * drive.at(0.0)
    for row in range(rows):
        if row:
            command = source(row, table[row - 1, 0])
            drive.push(command)
            for i in range(steps):
                before, (falls, rises) = rises, drive.halves(i * h, (i + 1) * h)
                world.step(before + falls)
                if i == 0:
                    # Only the step from a row on knows what accelerates there, but for its mean.
                    speed, acceleration = world.start()
                    there = (drive.at(0.0) - before - falls) / rig.inertia
                    table[row - 1, 1:3] = speed, acceleration + there
        table[row] = *world.state(), command
    return Motion(np.arange(rows) * interval, *table.T)


def step_within(error: float, acceleration: float) -> float:
    """Step whose error of position is at most so large (m, rad); returns s.

    The force of a step is that at its start: that moves a leapfrog's positions by about a sixth of
    acceleration times step squared, and a spring's period adds to it.

    Args:
        error: at most.
        acceleration: largest of the axis (m/s^2, rad/s^2).
    """
    return min(max(math.sqrt(3.0 * error / acceleration), SHORTEST), LONGEST)


def dry_step(step: float, duration: float) -> float:
    """Step where dry friction is hidden (s): a tenth, or what `MOST_DRY_STEPS` leave of that.

    Friction turns within a step, and the slope of its level jumps where the drive's force changes
    sign. That errs by order 1: of a slide of 44 kg by 1.2 um in 8 s at the longest step, by 0.1 um
    at a tenth of it.

    Args:
        step: that other forces ask for (s).
        duration: of a file (s).
    """
    return max(DRY_SHARE * step, min(step, duration / MOST_DRY_STEPS))


class World:
    """A model of MuJoCo with one axis, and the effects that change with its state."""

    def __init__(
        self, library: ModuleType, rig: Rig, effects: tuple[HiddenEffect, ...], h: float
    ) -> None:
        self.library, self.rig, self.h = library, rig, h
        native = [each for each in effects if _native(rig, each)]
        self.model = library.MjModel.from_xml_string(_document(rig, native, h))
        self.data: Any = library.MjData(self.model)
        rest = tuple(e for e in effects if e not in native)
        self.one_way = [e for e in rest if isinstance(e, laws.DirectionalDamping)]
        self.extra, self.kinetic, _ = summed(tuple(e for e in rest if e not in self.one_way))
        self.force = self.data.qfrc_applied
        self.friction, self.damping = self.model.dof_frictionloss, self.model.dof_damping

    def begin(self, q: float, v: float, u: float) -> None:
        """Start; the speed is that of half a step before."""
        self.data.qpos[0], self.data.qvel[0] = q, v
        self._apply(u)
        self.library.mj_forward(self.model, self.data)
        self.data.qvel[0] = v - 0.5 * self.h * self.data.qacc[0]

    def step(self, u: float) -> None:
        """One step under a mean force of the drive around its start (N, N m)."""
        self._apply(u)
        self.library.mj_step(self.model, self.data)

    def state(self) -> tuple[float, float, float]:
        """Position, speed and acceleration."""
        data = self.data
        return data.qpos[0], data.qvel[0] + 0.5 * self.h * data.qacc[0], data.qacc[0]

    def start(self) -> tuple[float, float]:
        """Speed and acceleration where the last step began."""
        data = self.data
        return data.qvel[0] - 0.5 * self.h * data.qacc[0], data.qacc[0]

    def inverse(self, q: float, v: float, a: float, u: float) -> float:
        """Force of the drive (N, N m) that such a motion takes; `u` is what laws are given."""
        data = self.data
        data.qpos[0], data.qvel[0] = q, v
        self._apply(u)
        data.ctrl[0] = 0.0
        data.qacc[0] = a
        self.library.mj_inverse(self.model, data)
        return float(data.qfrc_inverse[0] - self.force[0])

    def _apply(self, u: float) -> None:
        q, v = self.data.qpos[0], self.data.qvel[0]
        self.data.ctrl[0] = u
        self.force[0] = self.extra(q, v, u)
        self.friction[0] = self.kinetic(q, v, u)
        extra = sum(each.size for each in self.one_way) if v > 0.0 else 0.0
        self.damping[0] = self.rig.damping + extra


def _native(rig: Rig, effect: HiddenEffect) -> bool:
    """Whether MuJoCo has it itself."""
    if isinstance(effect, (laws.Spring, laws.EndBumper)):
        return True
    if rig.kind == "slide":
        return isinstance(effect, (laws.HardeningSpring, laws.QuadraticDrag))
    return not rig.gravity and isinstance(effect, laws.Gravity)


def _document(rig: Rig, effects: list[HiddenEffect], h: float) -> str:
    """MJCF of a rig: a slide along x, or a hinge about y that swings in the plane of gravity."""
    density, tendons, spring = 0.0, "", rig.stiffness
    weight, angle = rig.gravity, rig.gravity_angle
    for effect in effects:
        if isinstance(effect, laws.QuadraticDrag):
            # Of a box with the body's inertia: 2 density width height speed^2.
            density = effect.size / (3.0 * RADIUS**2)
        elif isinstance(effect, laws.Spring):
            spring += effect.size
        elif isinstance(effect, laws.HardeningSpring):
            tendons += _transverse(effect.size, rig.travel)
        elif isinstance(effect, laws.EndBumper):
            tendons += (
                f'<fixed stiffness="{effect.size!r}" springlength="-1e6 {effect.at!r}">'
                '<joint joint="axis" coef="1"/></fixed>'
            )
        elif isinstance(effect, laws.Gravity):
            weight, angle = effect.size, effect.angle
    anchors = "".join(
        f'<site name="{name}" pos="0 {sign * FAR * rig.travel!r} 0"/>'
        for name, sign in (("left", 1.0), ("right", -1.0))
    )
    down = -GRAVITY if rig.kind == "joint" else 0.0
    return f"""<mujoco>
  <compiler angle="radian" inertiafromgeom="false" boundmass="0" boundinertia="0"/>
  <option timestep="{h!r}" integrator="implicitfast" gravity="0 0 {down!r}"
          density="{density!r}" iterations="100" tolerance="1e-14"/>
  <worldbody>{anchors}
    <body>{_body(rig, weight, angle, h)}
      <joint name="axis" {_joint(rig, spring, h)}/><site name="pin"/>
    </body>
  </worldbody>
  <tendon>{tendons}</tendon>
  <actuator><motor joint="axis"/></actuator>
</mujoco>"""


def _joint(rig: Rig, spring: float, h: float) -> str:
    kind = 'type="slide" axis="1 0 0"' if rig.kind == "slide" else 'type="hinge" axis="0 1 0"'
    # Stuck, it creeps as slowly as MuJoCo allows.
    hard = f'solreffriction="{2.0 * h!r} 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"'
    return f'{kind} damping="{rig.damping!r}" stiffness="{spring!r}" {hard}'


def _body(rig: Rig, weight: float, angle: float, h: float) -> str:
    """Mass and inertia; half of a pendulum's inertia is that of a point mass."""
    inertia = _inertia(rig, h)
    if rig.kind == "slide":
        return _inertial("0 0 0", inertia, inertia * RADIUS**2)
    if not weight:
        return _inertial("0 0 0", 1.0, inertia)
    length = 0.5 * rig.inertia * GRAVITY / weight
    place = f"{-length * math.sin(angle)!r} 0 {-length * math.cos(angle)!r}"
    return _inertial(place, weight / GRAVITY / length, inertia - 0.5 * rig.inertia)


def _inertia(rig: Rig, h: float) -> float:
    return rig.inertia - 0.5 * h * rig.damping


def _inertial(place: str, mass: float, inertia: float) -> str:
    own = f"{inertia!r} {inertia!r} {inertia!r}"
    return f'<inertial pos="{place}" mass="{mass!r}" diaginertia="{own}"/>'


def _transverse(cubic: float, travel: float) -> str:
    """Two springs across the rail, without force in the middle: together a cube of the travel."""
    away = FAR * travel
    return "".join(
        f'<spatial stiffness="{cubic * away * away!r}" springlength="{away!r}">'
        f'<site site="{name}"/><site site="pin"/></spatial>'
        for name in ("left", "right")
    )
