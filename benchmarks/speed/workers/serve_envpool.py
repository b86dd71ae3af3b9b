"""EnvPool: batches of environments in C++, on one thread."""

# pyright: reportMissingImports=false
import envpool
import numpy as np

from benchmarks.speed.loops import BATCHES, Prepared, vector

PACKAGES = ("envpool", "gymnasium", "numpy")


def batch(name: str, count: int) -> Prepared:
    """A batch, stepped synchronously; EnvPool resets what has ended."""
    environment = envpool.make(
        name, env_type="gymnasium", num_envs=count, batch_size=count, num_threads=1, seed=0
    )
    space, generator = environment.action_space, np.random.default_rng(0)
    if hasattr(space, "n"):
        batches = generator.integers(space.n, size=(BATCHES, count), dtype=np.int32)
    else:
        shape = (BATCHES, count, *space.shape)
        batches = generator.uniform(space.low, space.high, shape).astype(np.float32)
    return vector(environment, batches, count)


ROWS = {"batch": batch}
