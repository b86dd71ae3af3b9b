"""Picture of the station: the rig on the left, the trial so far on the right.

Only this module of the environments imports matplotlib; `PMAEnv.render` imports it on first use.
The static background is drawn once; each picture restores it and draws the moving parts on top.
"""

import math

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pma_gym.envs.rendering.rig_drawing import FAINT, INK, REFERENCE, RigDrawing
from pma_gym.envs.rendering.scene import USUAL_WIDTH, History, Scene
from pma_gym.tasks import Task
from pma_gym.units import SI_FACTORS

DPI = 100
"""Pixels per inch at the usual width; wider pictures show the same, enlarged."""

ACTUAL, VOLTAGE = "#1565c0", "#4a7c3a"
MOST_RATE_HZ = 100.0
"""Largest rate (Hz) of drawn positions, more than there are pixels."""


_AXIS = {"excess": "moment's excess"}
"""Axis labels of quantities whose name needs an explanation."""


class Picture:
    """Draw pictures of an environment, one per call.

    Args:
        task: the task, which defines the axes of the plot.
        width: width of the picture (pixels); it is half as high.
    """

    _unit, _ends, _line = "", (), (1.0, 0.0)
    _command, _command_ends = "", (0.0, 10.0)

    def __init__(self, task: Task, width: int = USUAL_WIDTH) -> None:
        """Draw the static background."""
        self._factor = SI_FACTORS[self._unit or task.schedule.unit]
        self._figure = Figure(
            figsize=(USUAL_WIDTH / DPI, 0.5 * USUAL_WIDTH / DPI),
            dpi=DPI * width / USUAL_WIDTH,
            facecolor="white",
        )
        self._canvas = FigureCanvasAgg(self._figure)
        self._rig = self._drawing(self._figure.add_axes((0.0, 0.0, 0.47, 1.0)), task)
        self._moving: list[tuple[Axes, Artist]] = [(self._rig.axes, a) for a in self._rig.moving]
        self._add_position_plot(task)
        self._add_voltage_plot(task)
        for _, artist in self._moving:
            artist.set_animated(True)
        self._canvas.draw()
        self._still = self._canvas.copy_from_bbox(self._figure.bbox)

    def draw(self, scene: Scene, history: History) -> NDArray[np.uint8]:
        """Return the present picture.

        Args:
            scene: an environment of the task, in or after an episode.
            history: the course of its episode.
        Returns:
            RGB of shape (width / 2, width, 3), a new array each time.
        """
        self._rig.update(scene)
        self._reference.set_ydata(scene.task.schedule.reference(self._times) / self._factor)
        stride = _stride(history.time)
        self._actual.set_data(history.time[::stride], history.position[::stride] / self._factor)
        self._now.set_data([scene.time], [scene.position / self._factor])
        volts = np.append(history.voltages, history.voltages[-1:])
        gain, offset = self._line
        self._volts.set_data(np.arange(len(volts)) * scene.options.period, gain * volts + offset)
        self._canvas.restore_region(self._still)
        for axes, artist in self._moving:
            axes.draw_artist(artist)
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    def _drawing(self, axes: Axes, task: Task) -> RigDrawing:
        return RigDrawing(axes, task)

    def _add_position_plot(self, task: Task) -> None:
        schedule = task.schedule
        axes = self._plot((0.545, 0.46, 0.435, 0.44), task)
        self._times = np.linspace(0.0, schedule.duration, 301)
        (self._reference,) = axes.plot(
            self._times,
            self._times,
            "--",
            color=REFERENCE,
            lw=1.4,
            label="prescribed" if schedule.followed.is_force else "reference",
        )
        (self._actual,) = axes.plot([], [], color=ACTUAL, lw=1.8, label=f"true {schedule.quantity}")
        (self._now,) = axes.plot([], [], "o", color=ACTUAL, ms=5)
        # An excess lies on either side of what is prescribed.
        shares = (-1.2, 2.4) if schedule.followed.is_force else (-0.12, 1.2)
        ends = self._ends or [share * schedule.span for share in shares]
        axes.set_ylim(*(end / self._factor for end in ends))
        unit = self._unit or schedule.unit
        axes.set_ylabel(f"{_AXIS.get(schedule.quantity, schedule.quantity)} ({unit})")
        axes.tick_params(labelbottom=False)
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            ncols=2,
            frameon=False,
            fontsize=8,
            labelcolor=INK,
            borderaxespad=0.1,
        )
        self._moving += [(axes, one) for one in (self._reference, self._actual, self._now)]

    def _add_voltage_plot(self, task: Task) -> None:
        axes = self._plot((0.545, 0.13, 0.435, 0.27), task)
        low, high = self._command_ends
        axes.set_ylim(1.05 * low - 0.05 * high, 1.05 * high - 0.05 * low)
        axes.set_yticks([low, 0.5 * (low + high), high])
        axes.set_ylabel(self._command or f"{task.actuator} (V)")
        axes.set_xlabel("time (s)")
        (self._volts,) = axes.plot([], [], color=VOLTAGE, lw=1.2, drawstyle="steps-post")
        self._moving.append((axes, self._volts))

    def _plot(self, place: tuple[float, float, float, float], task: Task) -> Axes:
        axes = self._figure.add_axes(place)
        axes.set_xlim(0.0, 1.01 * task.schedule.duration)
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(FAINT)
        axes.tick_params(labelsize=8, color=FAINT, labelcolor=INK)
        axes.grid(color=FAINT, lw=0.5, alpha=0.6)
        axes.xaxis.label.set(size=8, color=INK)
        axes.yaxis.label.set(size=8, color=INK)
        return axes


def _stride(time: NDArray[np.float64]) -> int:
    """One in how many positions is drawn.

    >>> _stride(np.arange(9) / 384.0), _stride(np.arange(9) / 100.0), _stride(np.zeros(1))
    (4, 1, 1)
    """
    return math.ceil(0.999 / (MOST_RATE_HZ * (time[1] - time[0]))) if len(time) > 1 else 1
