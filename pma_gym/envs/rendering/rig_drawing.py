"""Drawing of the rig to scale: muscle, slide, cable, pulley and measured values."""

import math

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import Circle, Polygon, Rectangle
from numpy.typing import NDArray

from pma_gym.envs.rendering.scene import Scene
from pma_gym.tasks import PACE, Task

INK, FAINT, STEEL = "#2b2f36", "#c9ced6", "#8d96a3"
RUBBER, BRAID, BROKEN, REFERENCE = "#3b4654", "#a9b6c6", "#c62828", "#e07b00"
LEG, LEG_LENGTH = "#b9775a", 2.2
"""Colour of an operator's leg on the lever, and its length in radii of the pulley: not to scale."""

LENGTH, RADIUS = 250.0, 12.0
"""Size of the muscle at rest (mm): a MAS-20-250N, wall included."""
BRAID_ANGLE = math.radians(25.0)
"""Angle of the braid to the axis at rest, which sets the bulge of the drawn muscle."""
PULLEY_RADIUS, PULLEY_X, SLIDE_WIDTH = 25.4, 318.0, 16.0
SHARE = np.linspace(0.0, 1.0, 61)
TAPER = np.minimum(1.0, np.minimum(SHARE, 1.0 - SHARE) / 0.13)
TAPER = TAPER * TAPER * (3.0 - 2.0 * TAPER)
"""Length of the transition from the end fittings, of constant width, to the full bulge."""


def bulged_radius(contraction: float) -> float:
    """Radius (mm) of a braided muscle at a contraction (m).

    Its threads keep their length: length = b cos(angle), radius ~ b sin(angle).

    >>> bulged_radius(0.0), round(bulged_radius(0.0625), 1)
    (12.0, 20.8)
    """
    cosine = min(1.0, math.cos(BRAID_ANGLE) * (1.0 - contraction * 1e3 / LENGTH))
    return RADIUS * math.sqrt(1.0 - cosine * cosine) / math.sin(BRAID_ANGLE)


class RigDrawing:
    """Drawing of the rig in axes with millimetres.

    Args:
        axes: the axes to draw in.
        task: the task, whose reference is marked on the slide's rail or on the pulley.

    Attributes:
        axes: the axes of the drawing.
        moving: artists that `update` moves.
    """

    def __init__(self, axes: Axes, task: Task) -> None:
        """Draw the fixed parts, and create the moving ones."""
        self.axes, self._task = axes, task
        axes.set_xlim(-22.0, 361.0)
        axes.set_ylim(-240.0, 160.0)
        axes.set_axis_off()
        self.moving: list[Artist] = []
        self._draw_frame()
        self._make_muscle()
        self._make_cable_and_pulley()
        self._make_gauges()

    def update(self, scene: Scene) -> None:
        """Move all parts to the positions of a scene."""
        truth = scene.truth
        end = LENGTH - 1e3 * truth["contraction"]
        self._move_muscle(end, bulged_radius(truth["contraction"]))
        self._move_pulley(end, truth["rotation"], truth["load"])
        self._move_mark(scene, end)
        motor = self._task.actuator == "motor"
        volts = scene.motor_voltage if motor else scene.regulator_voltage
        gauges = (truth["pressure"] / 1e3, truth["load"], volts, scene.time)
        for text, form, value in zip(self._gauges, GAUGES.values(), gauges, strict=True):
            text.set_text(form.format(value))
        self._ended.set_text(f"ended: {scene.ended_by}" if scene.ended_by else "")

    def _draw_frame(self) -> None:
        axes = self.axes
        axes.text(-8, 125, self._task.title, size=13, color=INK, weight="bold")
        axes.add_patch(Rectangle((-22, -52), 14, 104, fc=FAINT, ec=STEEL, hatch="////", lw=1))
        axes.add_patch(Rectangle((165, -42), 118, 5, fc=FAINT, ec=STEEL, lw=0.8))
        foot = [
            (PULLEY_X - 7, -27),
            (PULLEY_X + 7, -27),
            (PULLEY_X + 24, -72),
            (PULLEY_X - 24, -72),
        ]
        axes.add_patch(Polygon(foot, fc=FAINT, ec=STEEL, lw=0.8))
        axes.plot([-22, 361], [-72, -72], color=STEEL, lw=1.2)
        for i, name in enumerate(GAUGES):
            shown = self._task.actuator if name == "actuator" else name
            axes.text(_gauge_x(i), -128, shown, size=8, color=STEEL, ha="center")

    def _make_muscle(self) -> None:
        self._body = Polygon([(0, 0)], fc=RUBBER, ec=INK, lw=1.2)
        self._braid = LineCollection([], colors=BRAID, linewidths=0.6, alpha=0.7)
        self._fittings = [Rectangle((x, -9), 14, 18, fc=STEEL, ec=INK, lw=1) for x in (-8, 0)]
        self._slide = Rectangle((0, -37), SLIDE_WIDTH, 48, fc=STEEL, ec=INK, lw=1)
        for patch in (self._body, self._slide, *self._fittings):
            self.axes.add_patch(patch)
        self.axes.add_collection(self._braid)
        self.moving += [self._body, self._braid, *self._fittings, self._slide]

    def _make_cable_and_pulley(self) -> None:
        centre = (PULLEY_X, -PULLEY_RADIUS)
        (self._cable,) = self.axes.plot([], [], color=INK, lw=1.6)
        wheel = Circle(centre, PULLEY_RADIUS, fc="#e9ecf1", ec=INK, lw=1.4)
        hub = Circle(centre, 4.0, fc=INK, ec=INK)
        self.axes.add_patch(wheel)
        self.axes.add_patch(hub)
        (self._spokes,) = self.axes.plot([], [], color=STEEL, lw=1.6)
        (self._dot,) = self.axes.plot([], [], "o", color=INK, ms=5)
        (self._mark,) = self.axes.plot([], [], color=REFERENCE, lw=2.2, solid_capstyle="round")
        self.moving += [self._cable, wheel, self._spokes, hub, self._dot, self._mark]
        (self._leg,) = self.axes.plot([], [], color=LEG, lw=7.0, alpha=0.55, solid_capstyle="round")
        self.moving += [self._leg] if self._task.exercise else []

    def _make_gauges(self) -> None:
        self._gauges = [
            self.axes.text(_gauge_x(i), -153, "", size=12, color=INK, ha="center")
            for i in range(len(GAUGES))
        ]
        self._ended = self.axes.text(-8, -205, "", size=9, color=BROKEN, weight="bold")
        self.moving += [*self._gauges, self._ended]

    def _move_muscle(self, end: float, bulge: float) -> None:
        x = 6.0 + SHARE * (end - 12.0)
        width = 8.0 + TAPER * (bulge - 8.0)
        self._body.set_xy(np.column_stack([np.append(x, x[::-1]), np.append(width, -width[::-1])]))
        self._braid.set_segments(_helices(x, width))
        self._fittings[1].set_x(end - 6.0)
        self._slide.set_x(end)

    def _move_pulley(self, end: float, rotation: float, load: float) -> None:
        start = end + SLIDE_WIDTH
        share = np.linspace(0.0, 1.0, 15)
        # A cable without tension hangs; how far is for the eye only.
        sag = 7.0 * share * (1.0 - share) * (load < 0.5)
        self._cable.set_data(start + share * (PULLEY_X - start), -4.0 * sag / 7.0)
        self._cable.set_color(STEEL if load < 0.5 else INK)
        angles = -rotation + np.arange(6) * math.pi / 3.0
        spokes = np.exp(1j * angles)[:, None] * np.array([0.0, 1.0, np.nan])
        x, y = _on_pulley(spokes.ravel(), 0.92)
        self._spokes.set_data(x, y)
        x, y = _on_pulley(np.exp(1j * (angles[:1] + math.pi / 2)), 0.72)
        self._dot.set_data(x, y)
        # It hangs at 0 deg and is straight at 90 deg.
        x, y = _on_pulley(np.array([0.0, LEG_LENGTH]) * np.exp(-1j * (rotation + math.pi / 2)), 1.0)
        self._leg.set_data(x, y)

    def _move_mark(self, scene: Scene, end: float) -> None:
        if self._task.schedule.followed.is_travel:
            outwards = -1.0 if self._task.schedule.followed.shortens else 1.0
            x = end - 1e3 * outwards * scene.error + 0.5 * SLIDE_WIDTH
            self._mark.set_data([x, x], [-64.0, -45.0])
        elif self._task.exercise or self._task.schedule.followed.is_angle:
            excess = self._task.schedule.followed.is_force
            reference = PACE.at(scene.time) if excess else scene.truth["rotation"] - scene.error
            radii = np.array([1.08, 1.38]) * np.exp(1j * (math.pi / 2 - reference))
            self._mark.set_data(*_on_pulley(radii, 1.0))


GAUGES = {
    "pressure": "{:.0f} kPa",
    "cable tension": "{:.0f} N",
    "actuator": "{:.2f} V",
    "time": "{:.2f} s",
}
"""Displayed measurements with their formats."""


def _gauge_x(index: int) -> float:
    return 30.0 + 93.0 * index


def _on_pulley(points: NDArray[np.complex128], scale: float) -> tuple[NDArray, NDArray]:
    """Points about the pulley's axis, in its radii."""
    placed = PULLEY_RADIUS * scale * points
    return PULLEY_X + placed.real, placed.imag - PULLEY_RADIUS


def _helices(x: NDArray[np.float64], width: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """The threads of the braid that face the viewer."""
    turns = 2.0 * math.pi * 1.5 * SHARE
    phases = np.arange(10) * (2.0 * math.pi / 10.0)
    angles = [sign * turns + phase for sign in (1.0, -1.0) for phase in phases]
    near = [np.where(np.cos(angle) >= 0.0, width * np.sin(angle), np.nan) for angle in angles]
    return [np.column_stack([x, y]) for y in near]
