"""Display of an environment's pictures, as arrays or in a window."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pma_gym.envs.rendering.history import History
from pma_gym.envs.rendering.scene import Scene
from pma_gym.envs.rendering.window import Window
from pma_gym.tasks import Task

if TYPE_CHECKING:
    from pma_gym.envs.rendering.picture import Picture


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
            from pma_gym.envs.rendering.picture import Picture

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
