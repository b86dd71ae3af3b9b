"""Model predictive control that respects the voltage limits, beside a PID that is clipped."""

# %%
from controllers import PID, Controller, PreviewMPC
from pma_gym import PMAEnv

env = PMAEnv("displacement", pressure_kpa=300, noise=True)


# %%
def run(controller: Controller) -> tuple[float, float, float]:
    """Run one trial: RMSE (mm), lowest and highest voltage that the controller asked for (V)."""
    env.reset(seed=1)
    controller.reset(env.reference, env.station)
    asked, ended = [], False
    while not ended:
        asked.append(controller.act(env.measurement, env.time))
        *_, terminated, truncated, info = env.step(env.action(asked[-1]))
        ended = terminated or truncated
    return info["rmse_mm"], min(asked), max(asked)


# %%
for controller in (PID(), PreviewMPC()):
    error, low, high = run(controller)
    print(f"{controller.name}: RMSE {error:.4f} mm, asked for {low:.2f} to {high:.2f} V")
assert low >= 0.0 and high <= 10.0
