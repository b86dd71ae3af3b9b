"""How much one PID's error varies from station to station: a new one at every reset."""

# %%
import numpy as np

from controllers import PID
from pma_gym import PMAEnv

env = PMAEnv("displacement", randomisation="varied", pressure_kpa=300, noise=True)
pid = PID()
errors = []
for seed in range(20):
    env.reset(seed=seed)
    pid.reset(env.reference, env.station)
    ended = False
    while not ended:
        *_, terminated, truncated, info = env.step(env.action(pid.act(env.measurement, env.time)))
        ended = terminated or truncated
    errors.append(info["rmse_mm"])

# %%
print(f"RMSE {np.median(errors):.3f} mm (median), {min(errors):.3f} to {max(errors):.3f} mm")
assert max(errors) > 1.02 * min(errors)
