"""Gymnasium's MuJoCo tasks."""

from benchmarks.speed.workers.serve_classic import one

PACKAGES = ("mujoco", "gymnasium", "numpy")

ROWS = {"one": one}
