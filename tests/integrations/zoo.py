"""RL Baselines3 Zoo: `train` and `enjoy` by id, with a configuration of a few lines."""

import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

ID = "pma_gym/IsokineticDisplacement-v0"
SETTINGS = f"""
{ID}:
  n_envs: 2
  n_timesteps: 1024
  policy: MlpPolicy
  n_steps: 256
  batch_size: 128
  normalize: true
  env_kwargs: {{control_rate_hz: 20.0, pressure_kpa: 300.0}}
"""


def call(module: str, folder: Path, *arguments: str) -> str:
    """Run a command of the zoo in a folder; what it printed."""
    common = ["--algo", "ppo", "--env", ID, "--gym-packages", "pma_gym", "--device", "cpu"]
    command = [sys.executable, "-m", f"rl_zoo3.{module}", *common, *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stdout + done.stderr)
    return done.stdout


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "ppo.yml").write_text(SETTINGS, encoding="utf-8")
        call("train", folder, "--conf-file", "ppo.yml", "-f", "logs", "--eval-freq", "512")
        printed = call("enjoy", folder, "-f", "logs", "-n", "250", "--no-render")
    assert "Mean reward:" in printed, printed
    print(f"train and enjoy by id, Stable-Baselines3 {version('stable_baselines3')}")
