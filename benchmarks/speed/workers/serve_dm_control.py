"""Tasks of DeepMind's control suite."""

# pyright: reportMissingImports=false
import os

import numpy as np

from benchmarks.speed.loops import ACTIONS, Prepared

# Nothing is drawn, and the machine may have no screen.
os.environ.setdefault("MUJOCO_GL", "disabled")

PACKAGES = ("dm_control", "mujoco", "numpy")


def task(domain: str, name: str) -> Prepared:
    """One task, begun anew when its episode ends."""
    from dm_control import suite

    environment = suite.load(domain, name, task_kwargs={"random": 0})
    limits = environment.action_spec()
    generator = np.random.default_rng(0)
    actions = generator.uniform(limits.minimum, limits.maximum, (ACTIONS, *limits.shape))
    environment.reset()

    def chunk() -> int:
        for action in actions:
            if environment.step(action).last():
                environment.reset()
        return len(actions)

    return Prepared(chunk)


ROWS = {"task": task}
