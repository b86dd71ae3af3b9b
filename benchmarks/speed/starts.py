"""Time from the start of Python to an environment's first step."""

import os
import shutil
import subprocess
import sys
import tempfile
import weakref
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


LONGEST_S = 120.0
"""How long a process may take (s)."""


def start(name: str, cold: bool = False) -> Prepared:
    """New processes that make an environment, reset it and step it once.

    Each process finds the bytecode that the one before has kept, even where this process was told
    to keep none: whoever installs a package finds it too.

    Args:
        name: environment.
        cold: whether the kernels are compiled anew each time.
    """
    folder = Path(tempfile.mkdtemp(prefix="pma_gym_"))
    kernels = folder / "kernels"
    given = os.environ | {
        "PYTHONPATH": os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH")))),
        "PYTHONPYCACHEPREFIX": str(folder / "bytecode"),
        "PMA_GYM_CACHE": str(kernels),
    }
    given.pop("PYTHONDONTWRITEBYTECODE", None)

    def chunk() -> int:
        if cold:
            shutil.rmtree(kernels, ignore_errors=True)
        command = [sys.executable, "-c", FIRST_STEP, name]
        made = subprocess.run(
            command,
            cwd=folder,
            env=given,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=LONGEST_S,
        )
        if made.returncode:
            last = made.stderr.decode(errors="replace").strip().splitlines()[-1:]
            raise RuntimeError(f"no first step: {' '.join(last) or made.returncode}")
        return 1

    weakref.finalize(chunk, shutil.rmtree, folder, ignore_errors=True)
    return Prepared(chunk)
