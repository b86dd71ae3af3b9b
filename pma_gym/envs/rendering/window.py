"""A window that shows pictures in real time."""

import importlib
import time
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

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
