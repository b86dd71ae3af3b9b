import os
import sys

import pytest
from hypothesis import settings

from pma_gym.effects import CATALOGUE, user_effects

# Drawing needs no screen. Set before pygame or matplotlib is first imported.
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
os.environ.setdefault("MPLBACKEND", "Agg")

# The tests are run in as many processes as there are cores: threads of linear algebra would wait
# for each other. Set before NumPy or PyTorch is first imported, and handed on to other processes.
for _threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")

# No deadline: the first example of a test may compile a kernel. A run of the suite draws the same
# examples as any other; `pytest --hypothesis-profile search` draws new ones.
settings.register_profile("search", deadline=None)
settings.register_profile("pma_gym", deadline=None, derandomize=True)
settings.load_profile("pma_gym")


@pytest.fixture
def forget_user_effects(monkeypatch):
    """Return a function that takes out the effects that users' files added; called at the end."""
    monkeypatch.delenv(user_effects.NAMED, raising=False)
    shipped = dict(CATALOGUE)

    def forget():
        CATALOGUE.clear()
        CATALOGUE.update(shipped)
        user_effects._sources.clear()
        user_effects._named = ""
        os.environ.pop(user_effects.NAMED, None)

    yield forget
    forget()


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Runs `pma-gym` in a folder of its own: exit code, output, errors."""
    from pma_gym.cli import main

    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        words = [str(argument) for argument in arguments]
        monkeypatch.setattr(sys, "argv", ["pma-gym", *words])
        with pytest.raises(SystemExit) as caught:
            main(words)
        printed = capsys.readouterr()
        return caught.value.code or 0, printed.out, printed.err

    return run
