import os

from hypothesis import settings

# Drawing needs no screen. Set before pygame or matplotlib is first imported.
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
os.environ.setdefault("MPLBACKEND", "Agg")

# No deadline: the first example of a test may compile a kernel.
settings.register_profile("pma_gym", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("pma_gym")
