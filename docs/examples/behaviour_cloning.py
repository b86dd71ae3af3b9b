"""Offline learning: a policy that imitates the PID, from recorded episodes alone."""

# %% Record five episodes of the PID at each of nine pressures, a Parquet file each.
import subprocess
import sys
from pathlib import Path

import numpy as np

from benchmarks.runner.episodes import read_record
from pma_gym import PMAEnv

out = Path("episodes")
command = [sys.executable, "-m", "benchmarks", "record", "nominal", "--to", "parquet"]
options = ["--controllers", "pid", "--stations", "1", "--task", "displacement", "--out", str(out)]
subprocess.run([*command, *options], check=True)
records = [read_record(path) for path in sorted(out.glob("*.parquet"))]


# %% Least squares: the next action from the last three observations.
def features(observations: np.ndarray) -> np.ndarray:
    """The last three observations of each step, the oldest first, and a constant."""
    padded, steps = np.concatenate([observations[[0, 0]], observations]), len(observations)
    return np.hstack([*(padded[i : i + steps] for i in range(3)), np.ones((steps, 1))])


inputs = np.concatenate([features(each.observations[:-1]) for each in records])
weights, *_ = np.linalg.lstsq(inputs, np.concatenate([each.actions for each in records]))

# %% The clone drives an episode that it has not seen.
env = PMAEnv("displacement", pressure_kpa=310)
observation, info = env.reset(seed=7)
seen, ended = [observation], False
while not ended:
    action = features(np.array(seen[-3:]))[-1] @ weights
    observation, reward, terminated, truncated, info = env.step(action)
    seen.append(observation)
    ended = terminated or truncated
print(f"{len(records)} episodes, clone's RMSE {info['rmse_mm']:.2f} mm")
