"""A leg pushes against the muscle: a controller holds the joint's speed by the pressure."""

# %%
from controllers import SpeedPID
from pma_gym import PMAEnv

env = PMAEnv("isokinetic_exercise")
env.reset(seed=1)
controller = SpeedPID()
controller.reset(env.reference, env.station)
ended = False
while not ended:
    action = env.action(controller.act(env.measurement, env.time))
    *_, terminated, truncated, info = env.step(action)
    ended = terminated or truncated

# %%
summary = env.episode_summary()
for name, value in summary.items():
    if isinstance(value, float):
        print(f"{name} {value:.4g}")
assert not terminated, summary["ended_by"]
