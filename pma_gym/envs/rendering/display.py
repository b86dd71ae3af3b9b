"""Display of an environment's pictures, as arrays or in a window.

A window that shows pictures in real time.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pma_gym.envs.rendering.scene import History, Scene
from pma_gym.tasks import Task, TrackingTask

if TYPE_CHECKING:
    from pma_gym.envs.rendering.picture import Picture
import importlib
import time

import gymnasium as gym

FRAME_S = 1.0 / 30.0
"""Shortest time between two pictures (s), as in a film; 100 pictures a second would take a core."""

LONGEST_WAIT_S = 0.05
"""Longest sleep between two checks of the window's events (s)."""


class Window:
    """Show pictures in a window on the screen.

    Args:
        title: the window's title.
    Raises:
        gymnasium.error.DependencyNotInstalled: pygame is missing; with the command to install it.

    Attributes:
        closed: whether the user has closed the window, by its button, Escape or q.
    """

    def __init__(self, title: str) -> None:
        """Import pygame; the window opens with the first picture."""
        try:
            self._pygame = importlib.import_module("pygame")
        except ModuleNotFoundError as error:
            raise gym.error.DependencyNotInstalled(
                'render_mode="human" opens a window by pygame, which is not installed: '
                'pip install "pma-gym[view]"'
            ) from error
        self._title = title
        self._screen: Any = None
        self._started = self._shown = -np.inf
        self.closed = False

    def start(self, simulated: float = 0.0) -> None:
        """Start the clock at a simulated time (s)."""
        self._started = time.perf_counter() - simulated

    def wait(self, simulated: float) -> bool:
        """Wait until a simulated time (s), and return whether a picture is due."""
        if self._started == -np.inf:
            self.start(simulated)
        while not self.closed:
            self._follow_events()
            left = self._started + simulated - time.perf_counter()
            if left <= 0.0:
                break
            time.sleep(min(left, LONGEST_WAIT_S))
        return not self.closed and time.perf_counter() - self._shown >= FRAME_S

    def show(self, picture: NDArray[np.uint8]) -> None:
        """Show a picture, RGB of shape (height, width, 3)."""
        if self.closed:
            return
        size = picture.shape[1], picture.shape[0]
        if self._screen is None:
            self._pygame.display.init()
            self._pygame.display.set_caption(self._title)
            self._screen = self._pygame.display.set_mode(size)
        surface = self._pygame.surfarray.make_surface(picture.swapaxes(0, 1))
        self._screen.blit(surface, (0, 0))
        self._pygame.display.flip()
        self._shown = time.perf_counter()

    def _follow_events(self) -> None:
        """Close where the user asks for it; a window that follows none counts as hung."""
        if self._screen is None:
            return
        keys = self._pygame.K_ESCAPE, self._pygame.K_q
        for event in self._pygame.event.get():
            quits = event.type == self._pygame.QUIT
            if quits or (event.type == self._pygame.KEYDOWN and event.key in keys):
                self.close()
                return

    def close(self) -> None:
        """Close the window; a second call has no effect."""
        self.closed = True
        if self._screen is not None:
            self._screen = None
            self._pygame.display.quit()


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
            from pma_gym.envs.rendering.any_rig import RigPicture
            from pma_gym.envs.rendering.picture import Picture

            made = self._task, self._width
            is_any = isinstance(self._task, TrackingTask)
            self._picture = RigPicture(*made, scene.options) if is_any else Picture(*made)
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
