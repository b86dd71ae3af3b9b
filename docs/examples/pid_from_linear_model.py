"""A PI controller designed with python-control from the linearised station, then run on it."""

# %%
import control
import numpy as np

from pma_gym import Plant, PMAEnv

PERIOD = 0.01
system = Plant("station").linearize(pressure=300e3, contraction=0.030)
output = system.output_labels.index("contraction")
motor = system.input_labels.index("motor_voltage")
# The motor pulls the muscle longer: extension falls as contraction rises.
plant = -control.ss(system[output, motor])
sampled = control.sample_system(plant, PERIOD, method="zoh")

# %% The integral gain that leaves a phase margin of 60 degrees and a gain margin of 3.
for gain in np.geomspace(10.0, 1e5, 200)[::-1]:
    loop = sampled * control.tf([gain * PERIOD, 0.0], [1.0, -1.0], PERIOD)
    gain_margin, phase_margin, *_ = control.margin(loop)
    if gain_margin > 3.0 and phase_margin > 60.0:
        break
print(f"integral gain {gain:.0f} V/(m s), phase margin {phase_margin:.0f} deg")

# %%
env = PMAEnv("displacement", pressure_kpa=300)
env.reset(seed=1)
volts, ended = 0.0, False
while not ended:
    error = env.reference(env.time) - env.measurement.extension
    volts = min(max(volts + gain * PERIOD * error, 0.0), 10.0)
    *_, terminated, truncated, info = env.step(env.action(volts))
    ended = terminated or truncated
print(f"RMSE {info['rmse_mm']:.3f} mm")
assert info["rmse_mm"] < 5.0
