"""Control steps on a GPU: how many a second, and whether they are those of the processor.

python -m benchmarks.speed.gpu
"""

import json
import time
from typing import Any

import numpy as np

from benchmarks.speed.loops import Prepared
from pma_gym.codegen.machine.cuda_driver import GpuError
from pma_gym.engine.cuda.engine import CudaEngine, torch_with_gpu
from pma_gym.engine.engine import Engine
from pma_gym.engine.options import Options
from pma_gym.tasks import TASKS

COUNTS = (262144, 1048576)
PRECISIONS = {"float32": "single", "float64": "double"}
BATCHES = 16
"""Batches of actions drawn beforehand, used over and over."""

HELD = -0.4
"""The action of rows that glide: 3 V, held."""

_WARM_UP = 20
_CHECKED, _CHECKED_STEPS = 256, 520


def measure_gpu(seconds: float = 0.5) -> dict[str, Any] | str:
    """Steps a second for each precision, count and policy, and differences from the processor.

    Args:
        seconds: least time of a measurement (s).
    Returns:
        `gpu`, its name; `rates` (steps/s) and `facts` by "float32/262144/random"; `differences` by
        precision. In words why not, where no GPU or no torch is.
    """
    try:
        torch = torch_with_gpu()
    except GpuError as error:
        return str(error)
    rates, facts = {}, {}
    for precision in PRECISIONS:
        for count in COUNTS:
            for policy in ("random", "held"):
                key = f"{precision}/{count}/{policy}"
                prepared = prepare("displacement", count, precision, policy == "held")
                prepared.chunk()
                begun, steps = time.perf_counter(), 0
                while time.perf_counter() - begun < seconds:
                    steps += prepared.chunk()
                rates[key] = steps / (time.perf_counter() - begun)
                facts[key] = dict(prepared.facts())
    return {
        "gpu": torch.cuda.get_device_name(),
        "rates": rates,
        "facts": facts,
        "differences": {precision: differences(precision) for precision in PRECISIONS},
    }


def prepare(task: str, count: int, precision: str, held: bool = False) -> Prepared:
    """Environments on the GPU, ready to be stepped; a chunk waits for its end.

    Args:
        task: `displacement` or `rotation`.
        count: how many.
        precision: `float32` or `float64`.
        held: whether the action is held, or random and new in every step.
    Raises:
        GpuError: there is no GPU to be used.
    """
    torch = torch_with_gpu()
    envs = CudaEngine(TASKS[task], Options(), count, PRECISIONS[precision], seed=0)
    generator = torch.Generator(envs.device.device).manual_seed(0)
    shape = BATCHES, count, 1
    actions = torch.rand(shape, generator=generator, device=envs.device.device) * 2.0 - 1.0
    if held:
        actions.fill_(HELD)
    actions = actions.to(envs.rewards.dtype)
    for k in range(_WARM_UP):
        envs.step(actions[k % BATCHES])
    torch.cuda.synchronize()

    def chunk() -> int:
        for action in actions:
            envs.step(action)
        torch.cuda.synchronize()
        return BATCHES * count

    def facts() -> dict[str, Any]:
        attempts = float(envs.attempts.sum()) / count
        return {"attempts": attempts, "right_hand_sides": 3.0 * attempts} | envs.device.facts()

    return Prepared(chunk, facts)


def differences(precision: str) -> dict[str, float]:
    """Greatest differences from the processor over an episode and its end.

    Args:
        precision: `float32`, held against the processor in double precision; or `float64`.
    Returns:
        By what it is of: states in SI by name, `observation`, `reward`; 0 for the same bits.
    """
    torch = torch_with_gpu()
    task, options, n = TASKS["displacement"], Options(), _CHECKED
    own = Engine(task, options, n)
    every = np.arange(n)
    own.seed(every, range(n))
    own.reset(every)
    envs = CudaEngine(task, options, n, PRECISIONS[precision], seed=0)
    names = [*own.state_layout.states, "size"]
    largest = dict.fromkeys([*names, "observation", "reward"], 0.0)
    generator = np.random.default_rng(0)
    for _ in range(_CHECKED_STEPS):
        actions = generator.uniform(-1.0, 1.0, (n, 1)).astype(np.float32)
        own.actions[:n] = actions
        own.step()
        rewards = own.rewards.copy()
        over = np.flatnonzero(own.terminated | own.truncated)
        if len(over):
            own.reset(over)
        seen, paid, *_ = envs.step(torch.from_numpy(actions).to(envs.device.device))
        pairs = {name: (own.numbers(name), envs.numbers(name)) for name in names}
        pairs |= {"observation": (own.observations, seen), "reward": (rewards, paid)}
        for name, (one, other) in pairs.items():
            apart = np.abs(one - other.double().cpu().numpy()).max()
            largest[name] = max(largest[name], float(apart))
    return largest


if __name__ == "__main__":
    made = measure_gpu()
    print(made if isinstance(made, str) else json.dumps(made, indent=2))
