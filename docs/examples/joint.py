"""A pendulum on a torque drive: hide dry friction in its logs and let the diagnosis name it."""

# %%
from pathlib import Path

import numpy as np

from pma_gym import Plant, Trial, load_model
from pma_gym.discovery import diagnose

MODEL = """
schema = 1
name = "pendulum"
title = "0.2 kg on 0.1 m"
plant = "joint"

[torque_drive]
gain = 1.0

[joint_weight]
moment_n_m = 0.2
offset_deg = 0.0

[joint_damping]
coefficient_n_m_s = 0.02

[inertia]
inertia_kg_m2 = 0.0049

[joint_start]
angle_deg = 0.0
spin_deg_per_s = 0.0

[encoder]
bandwidth_hz = 2000
noise_deg = 0.02
"""
Path("pendulum.toml").write_text(MODEL, encoding="utf-8")
model = load_model("pendulum.toml")
friction = {
    "static_n_m": 0.03,
    "dynamic_n_m": 0.03,
    "stribeck_speed_deg_per_s": 5.0,
    "presliding_deg": 0.02,
}
rig = Plant(model.with_effects({"joint_friction": friction}))


# %% Logs of torque and angle: the drive swings the pendulum with four periods, from rest.
def log(period: float, seed: int) -> Trial:
    """One trial of four seconds at 200 Hz on the rig with the hidden friction."""
    time = np.arange(0.0, 4.0, 1.0 / 200.0)
    torque = 0.15 * np.sin(2.0 * np.pi * time / period)
    return rig.simulate(Trial(time, {"torque_command": torque}), noise=True, seed=seed)


trials = [log(period, seed) for seed, period in enumerate((0.9, 1.3, 2.1, 3.2))]

# %% The diagnosis is given angles and torques, and a model without friction.
diagnosis = diagnose(
    [Trial(t.time, t.commands, {"angle": t.measurements["angle"]}) for t in trials], model
)
print(diagnosis.verdict)
print(diagnosis.sentence)
assert [effect.name for effect in diagnosis.effects] == ["joint_friction"]
assert abs(diagnosis.effects[0].parameters["dynamic_n_m"].value - 0.03) < 0.001
diagnosis  # noqa: B018 - a notebook shows it
