"""Picture of any rig: a slide on its rail, or an arm with the muscles that turn it."""

import math
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon, Rectangle

from pma_gym.effects.effect import ANTAGONIST
from pma_gym.envs.rendering.picture import Picture
from pma_gym.envs.rendering.rig_drawing import (
    BROKEN,
    FAINT,
    INK,
    LENGTH,
    REFERENCE,
    RUBBER,
    SHARE,
    STEEL,
    TAPER,
    RigDrawing,
    bulged_radius,
)
from pma_gym.tasks import Task
from pma_gym.units import SI_FACTORS

ARM, ANCHOR, SCALE, LEAST_SIDE = 130.0, 165.0, 0.5, 16.0
"""Length of the drawn arm, height of the muscles' fixed ends, scale of the muscles and least
distance of their middle from the axis (all but the scale in the drawing's unit)."""

HALF_RAIL, PAD, LEAST_PART = 150.0, 0.15, 0.2
"""Half the length of a drawn rail; share of the reference's range that a plot has beyond its ends,
and the least share of the task's range that counts for it."""


TURNED = ("rotation", "contraction")
"""Signals of what `RigDrawing` draws: a muscle that turns a motor's shaft."""


class RigPicture(Picture):
    """Draw pictures of an environment of any rig; see `Picture`.

    Args:
        task: the task.
        width: width of the picture (pixels).
        options: the environment's `RigOptions`.
    """

    def __init__(self, task: Task, width: int, options: Any) -> None:  # noqa: ANN401
        """Find the units and ranges of the plots, then draw the static background."""
        self._options, schedule = options, task.schedule
        self._unit = schedule.followed.unit
        times = np.linspace(0.0, schedule.duration, 301)
        course = schedule.reference(times)
        drawn = course[0] + np.array([0.0, schedule.span])
        ends = np.append(course, drawn) if options.reference is not None else course
        pad = PAD * max(float(np.ptp(ends)), LEAST_PART * schedule.span)
        self._ends = float(ends.min()) - pad, float(ends.max()) + pad
        first = options.commands[0]
        factor = SI_FACTORS[first.signal.unit]
        self._line = first.gain / factor, first.offset / factor
        self._command = f"{first.signal.name} ({first.signal.unit})"
        self._command_ends = tuple(end / factor for end in first.limits)
        super().__init__(task, width)

    def _drawing(self, axes: Axes, task: Task) -> Any:  # noqa: ANN401
        if set(TURNED) <= set(self._options.nominal.rig.outputs):
            return RigDrawing(axes, task)
        return PartDrawing(axes, task, self._options, self._ends)


class PartDrawing:
    """Drawing of what a rig moves, with its numbers below.

    Args:
        axes: the axes to draw in.
        task: the task.
        options: the environment's `RigOptions`.
        ends: values of the task's signal (SI) at the ends of a rail.

    Attributes:
        axes: the axes of the drawing.
        moving: artists that `update` moves.
    """

    def __init__(
        self,
        axes: Axes,
        task: Task,
        options: Any,  # noqa: ANN401
        ends: tuple[float, float],
    ) -> None:
        """Draw the fixed parts, and create the moving ones."""
        self.axes, self._options, self._ends = axes, options, ends
        self._position = next(each for each in options.outputs if each.is_position)
        self._follows = task.schedule.quantity == self._position.name
        axes.set_xlim(-200.0, 200.0)
        axes.set_ylim(-240.0, 187.0)
        axes.set_axis_off()
        axes.text(-185.0, 172.0, task.title, size=13, color=INK, weight="bold", va="top")
        (self._mark,) = axes.plot([], [], color=REFERENCE, lw=2.6, solid_capstyle="round")
        self._numbers = axes.text(-185.0, -235.0, "", size=8, color=INK, va="bottom")
        self._ended = axes.text(185.0, -235.0, "", size=9, color=BROKEN, weight="bold", ha="right")
        self.moving: list[Artist] = [self._numbers, self._ended, self._mark]
        self._muscles: list[tuple[float, Any, Any, Polygon, Any]] = []
        if self._position.is_angle:
            self._make_arm()
        else:
            axes.add_patch(Rectangle((-HALF_RAIL, -8.0), 2.0 * HALF_RAIL, 8.0, fc=FAINT, ec=STEEL))
            self._block = Rectangle((0.0, 0.0), 40.0, 34.0, fc=STEEL, ec=INK)
            self.moving.append(axes.add_patch(self._block))

    def update(self, scene: Any) -> None:  # noqa: ANN401
        """Move all parts to where a scene has them."""
        position = scene.truth[self._position.name]
        reference = scene.position - scene.error
        if self._position.is_angle:
            self._move_arm(position)
            ray = np.array([1.06, 1.22]) * ARM
            mark = math.sin(reference) * ray, -math.cos(reference) * ray
        else:
            self._block.set_x(self._along(position) - 20.0)
            mark = np.full(2, self._along(reference)), [-24.0, -10.0]
        self._mark.set_data(*(mark if self._follows else ([], [])))
        known = {each: scene.truth[each.name] for each in self._options.outputs} | scene.commanded
        lines = [
            f"{round(v / SI_FACTORS[s.unit], 3):g} {s.unit}   {s.name}" for s, v in known.items()
        ]
        self._numbers.set_text("\n".join([*lines, f"{scene.time:.2f} s"]))
        self._ended.set_text(f"ended: {scene.ended_by}" if scene.ended_by else "")

    def _along(self, position: float) -> float:
        low, high = self._ends if self._follows else (-0.05, 0.05)
        return float(np.clip(2.0 * (position - low) / (high - low) - 1.0, -1.0, 1.0)) * HALF_RAIL

    def _make_arm(self) -> None:
        model, axes, radius = self._options.nominal, self.axes, LEAST_SIDE
        for side, prefix in ((1.0, ""), (-1.0, ANTAGONIST)):
            for name in (f"{prefix}pulley", f"{prefix}lever"):
                if name in model.parameters:
                    values = model.parameters[name]
                    arm = 1e3 * SCALE * getattr(values, "radius", getattr(values, "arm", 0.0))
                    radius = max(arm, LEAST_SIDE)
                    body = Polygon([(0, 0)], fc=RUBBER, ec=INK, lw=1.2)
                    (cable,) = axes.plot([], [], color=INK, lw=1.6)
                    axes.plot([side * radius - 14, side * radius + 14], [ANCHOR] * 2, color=INK)
                    self._muscles.append((side, model.effects[name].law, values, body, cable))
                    self.moving += [axes.add_patch(body), cable]
        self._radius = radius
        (self._arm,) = axes.plot([], [], color=STEEL, lw=8.0, solid_capstyle="round")
        wheel = axes.add_patch(Circle((0.0, 0.0), radius, fc="#e9ecf1", ec=INK, lw=1.4))
        hub = axes.add_patch(Circle((0.0, 0.0), 4.0, fc=INK, ec=INK))
        self.moving += [self._arm, wheel, hub]

    def _move_arm(self, angle: float) -> None:
        self._arm.set_data([0.0, ARM * math.sin(angle)], [0.0, -ARM * math.cos(angle)])
        for side, law, values, body, cable in self._muscles:
            contraction, _ = law(side * angle, values)
            along = ANCHOR - SCALE * SHARE * (LENGTH - 1e3 * contraction)
            width = SCALE * (8.0 + TAPER * (bulged_radius(contraction) - 8.0))
            middle = side * self._radius
            x = np.append(middle + width, (middle - width)[::-1])
            body.set_xy(np.column_stack([x, np.append(along, along[::-1])]))
            cable.set_data([middle, middle], [along[-1], 0.0])
