"""Open loop against closed loop: the voltages of 2008 beside a PID, on the same station."""

# %%
from controllers import PID, Controller, SerresReplay
from pma_gym import PMAEnv

env = PMAEnv("rotation", pressure_kpa=350)


# %%
def error_of(controller: Controller) -> float:
    """Run one trial and give its RMSE (deg)."""
    env.reset(seed=1)
    controller.reset(env.reference, env.station)
    ended = False
    while not ended:
        action = env.action(controller.act(env.measurement, env.time))
        *_, terminated, truncated, info = env.step(action)
        ended = terminated or truncated
    return info["rmse_deg"]


# %%
errors = {each.name: error_of(each) for each in (SerresReplay(), PID())}
for name, error in errors.items():
    print(f"{name}: RMSE {error:.3f} deg")
assert errors["pid"] < errors["serres_replay"]
