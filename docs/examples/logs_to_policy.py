"""Measured logs of a geared servo become controllers: diagnose, tune, train, score."""

# %%
import subprocess
import sys
from pathlib import Path

import gymnasium as gym

import pma_gym  # noqa: F401 - registers the environments

HERE, DATA, OUT = Path(__file__).parent, "servo_pendulum_data", "servo_pendulum_controllers"
STEPS = sys.argv[1] if len(sys.argv) > 1 else "200000"

# %% Logs with their volts rebuilt, and a model that has no gravity.
subprocess.run([sys.executable, HERE / "servo_pendulum.py", DATA], check=True)

# %% One command; interrupted, it goes on where it stopped. Best with --steps 1000000.
command = [sys.executable, "-m", "benchmarks", "from-logs", DATA, "--out", OUT, "--steps", STEPS]
subprocess.run(command, check=True)

# %% The amended model is an environment like any other.
env = gym.make(
    "pma_gym/Rig-v0",
    model=f"{OUT}/amended.toml",
    task="angle_steps",
    limits={"winding_voltage": [-7.4, 7.4]},
)
observation, info = env.reset(seed=1)
print(env.unwrapped.table.describe())
