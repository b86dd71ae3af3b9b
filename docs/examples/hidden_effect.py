"""Hide friction of 30 N in simulated trials and let the diagnosis find it."""

# %%
import numpy as np

from pma_gym import Plant, Trial, load_model
from pma_gym.discovery import diagnose

model = load_model("serres2008")
rig = Plant(model.with_effects({"coulomb_friction": {"static_n": 30.0, "dynamic_n": 30.0}}))


# %% Five trials at five pressures: the motor rests, swings wider and wider, and rests.
def trial(pressure: float, seed: int) -> Trial:
    """One trial of sixteen seconds on the rig with the hidden effect."""
    time = np.arange(0.0, 16.0, 0.01)
    swing = np.clip(time - 2.0, 0.0, 12.0)
    # Readings at rest tell the noise, which a misfit is judged by.
    volts = 2.5 + (0.5 + 0.16 * swing) * np.sin(2.0 * np.pi * 0.5 * swing)
    commands = {"motor_voltage": volts, "pressure_command": np.full(time.size, pressure)}
    return rig.simulate(Trial(time, commands), noise=True, seed=seed)


pressures = (200e3, 275e3, 350e3, 425e3, 500e3)
trials = [trial(pressure, seed) for seed, pressure in enumerate(pressures)]

# %%
diagnosis = diagnose([Trial(t.time, t.commands, t.measurements) for t in trials], model)
print(diagnosis.verdict)
print(diagnosis.sentence)
assert abs(diagnosis.parameters["coulomb_friction.static_n"].now.value - 30.0) < 1.0
diagnosis  # noqa: B018 - a notebook shows it
