"""How long it takes from the start of Python to an environment's first step."""

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.speed.loops import Prepared

ROOT = Path(__file__).resolve().parents[2]

FIRST_STEP = """
import os, sys
import gymnasium as gym
import pma_gym
environment = gym.make(sys.argv[1])
environment.reset(seed=0)
environment.step(environment.action_space.sample())
os._exit(0)
"""
"""What a process does; how it would end is not measured."""


def start(name: str, cold: bool = False) -> Prepared:
    """New processes that make an environment, reset it and step it once.

    Python keeps what it made of the modules' text from one to the next, as it does of what is
    installed, even where this process was told not to.

    Args:
        name: environment.
        cold: whether the kernels are compiled anew each time.
    """
    folder = Path(tempfile.mkdtemp(prefix="pma_gym_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    kernels = folder / "kernels"
    given = os.environ | {
        "PYTHONPATH": str(ROOT),
        "PYTHONPYCACHEPREFIX": str(folder / "bytecode"),
        "PMA_GYM_CACHE": str(kernels),
    }
    given.pop("PYTHONDONTWRITEBYTECODE", None)

    def chunk() -> int:
        if cold:
            shutil.rmtree(kernels, ignore_errors=True)
        command = [sys.executable, "-c", FIRST_STEP, name]
        made = subprocess.run(
            command, cwd=folder, env=given, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE
        )
        if made.returncode:
            last = made.stderr.decode(errors="replace").strip().splitlines()[-1:]
            raise RuntimeError(f"no first step: {' '.join(last) or made.returncode}")
        return 1

    return Prepared(chunk)
