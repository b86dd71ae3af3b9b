"""Picture of the station: the rig on the left, the trial so far on the right.

Only this module of the environments imports matplotlib; `PMAEnv.render` imports it on first use.
The static background is drawn once; each picture restores it and draws the moving parts on top.

Size of pictures.

Display of an environment's pictures, as arrays or in a window.
"""

import math
from collections.abc import Callable
from numbers import Integral
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pma_gym.envs.rendering.history import History
from pma_gym.envs.rendering.rig_drawing import FAINT, INK, REFERENCE, RigDrawing
from pma_gym.envs.rendering.scene import Scene
from pma_gym.envs.rendering.window import Window
from pma_gym.tasks import Task
from pma_gym.units import SI_FACTORS

if TYPE_CHECKING:
    from pma_gym.envs.rendering.picture import Picture


USUAL_WIDTH = 800
"""Usual width of a picture (pixels); every picture is half as high as wide."""

LEAST_WIDTH, MOST_WIDTH = 400, 3200


def check_render_width(width: object) -> int:
    """Check the width of pictures and return it.

    It must be a multiple of 4, so that the height is even, as H.264 videos need.

    Raises:
        ValueError: with the rule, the unit and the invalid value.
    """
    whole = isinstance(width, Integral) and not isinstance(width, bool)
    if not whole or not LEAST_WIDTH <= int(width) <= MOST_WIDTH or int(width) % 4:  # type: ignore[call-overload]
        raise ValueError(
            f"render_width must be a multiple of 4 in {LEAST_WIDTH}-{MOST_WIDTH} pixels (a picture "
            f"is half as high), got {width!r}; leave it out for {USUAL_WIDTH}"
        )
    return int(width)  # type: ignore[call-overload]


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

    def __init__(self, task: Task, width: int = USUAL_WIDTH) -> None:
        """Draw the static background."""
        self._factor = SI_FACTORS[task.schedule.unit]
        self._figure = Figure(
            figsize=(USUAL_WIDTH / DPI, 0.5 * USUAL_WIDTH / DPI),
            dpi=DPI * width / USUAL_WIDTH,
            facecolor="white",
        )
        self._canvas = FigureCanvasAgg(self._figure)
        self._rig = RigDrawing(self._figure.add_axes((0.0, 0.0, 0.47, 1.0)), task)
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
        stride = _stride(history.time)
        self._actual.set_data(history.time[::stride], history.position[::stride] / self._factor)
        self._now.set_data([scene.time], [scene.position / self._factor])
        volts = np.append(history.voltages, history.voltages[-1:])
        self._volts.set_data(np.arange(len(volts)) * scene.options.period, volts)
        self._canvas.restore_region(self._still)
        for axes, artist in self._moving:
            axes.draw_artist(artist)
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    def _add_position_plot(self, task: Task) -> None:
        schedule = task.schedule
        axes = self._plot((0.545, 0.46, 0.435, 0.44), task)
        time = np.linspace(0.0, schedule.duration, 301)
        axes.plot(
            time,
            schedule.reference(time) / self._factor,
            "--",
            color=REFERENCE,
            lw=1.4,
            label="prescribed" if schedule.followed.is_force else "reference",
        )
        (self._actual,) = axes.plot([], [], color=ACTUAL, lw=1.8, label=f"true {schedule.quantity}")
        (self._now,) = axes.plot([], [], "o", color=ACTUAL, ms=5)
        # An excess lies on either side of what is prescribed.
        lowest, highest = (-1.2, 2.4) if schedule.followed.is_force else (-0.12, 1.2)
        span = schedule.span / self._factor
        axes.set_ylim(lowest * span, highest * span)
        axes.set_ylabel(f"{_AXIS.get(schedule.quantity, schedule.quantity)} ({schedule.unit})")
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
        self._moving += [(axes, self._actual), (axes, self._now)]

    def _add_voltage_plot(self, task: Task) -> None:
        axes = self._plot((0.545, 0.13, 0.435, 0.27), task)
        axes.set_ylim(-0.5, 10.5)
        axes.set_yticks([0, 5, 10])
        axes.set_ylabel(f"{task.actuator} (V)")
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


class Pictured(Protocol):
    """Interface of an environment with pictures."""

    @property
    def time(self) -> float:
        """Time since the trial began (s)."""
        ...

    def picture(self) -> NDArray[np.uint8]:
        """The present picture, RGB of shape (height, width, 3)."""
        ...


class Display:
    """Draw pictures of a task's environments, and show them in a window at simulated time.

    Args:
        task: the task.
        width: width of the pictures (pixels); they are half as high.
        windowed: whether there is a window.
    Raises:
        gymnasium.error.DependencyNotInstalled: a window without pygame.
    """

    def __init__(self, task: Task, width: int, windowed: bool = False) -> None:
        self._task, self._width = task, width
        self._picture: Picture | None = None
        self._window = Window(task.title) if windowed else None

    @property
    def has_window(self) -> bool:
        """Whether the display has a window, open or closed."""
        return self._window is not None

    @property
    def window_closed(self) -> bool:
        """Whether the window was closed, by its user or by `close`."""
        return self._window is not None and self._window.closed

    def draw(self, scene: Scene, history: History) -> NDArray[np.uint8]:
        """Return the present picture of an environment, see `Picture.draw`."""
        if self._picture is None:
            # Imported here: an environment without pictures needs no matplotlib.

            self._picture = Picture(self._task, self._width)
        return self._picture.draw(scene, history)

    def show(self, environment: Pictured) -> None:
        """Draw in the window, if there is one, after a wait for the simulated time."""
        if self._window is None:
            return
        self._window.wait(environment.time)
        if not self._window.closed:
            self._window.show(environment.picture())

    def begin(self, environment: Pictured) -> None:
        """Show the start of an episode, and start the clock."""
        self.show(environment)
        if self._window is not None:
            # Drawing for the first time takes a while.
            self._window.start()

    def shown(self, step: Callable[[Any], Any], environment: Pictured) -> Callable[[Any], Any]:
        """Show a step in the window, except the one that ends an episode, and return it.

        Args:
            step: as `Engine.advance` returns it: a tuple, or a code without a regular result.
            environment: the environment of the step.
        """
        window = self._window
        assert window is not None

        def advance(action: object) -> Any:  # noqa: ANN401 - as `Engine.advance` has it
            result = step(action)
            if type(result) is tuple and window.wait(environment.time):
                self.show(environment)
            return result

        return advance

    def close(self) -> None:
        """Free the picture and close the window."""
        self._picture = None
        if self._window is not None:
            self._window.close()
