"""gymnax: toys in JAX, many at a time in one compiled loop, on one thread of the CPU."""

# pyright: reportMissingImports=false
import os

import jax

from benchmarks.speed.loops import Missing, Prepared

PACKAGES = ("gymnax", "jax", "jaxlib", "numpy")

_STEPS_IN_ALL = 1 << 20
"""Environment steps of a compiled loop, about."""


def _start_on_one_thread() -> None:
    """XLA makes as many threads as it may use processors when it starts."""
    if not hasattr(os, "sched_setaffinity"):
        raise Missing("this system has no way to hold JAX to one thread")
    usual = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(usual)})
    jax.devices("cpu")
    os.sched_setaffinity(0, usual)


def loop(name: str, count: int) -> Prepared:
    """A compiled loop over steps that resets what has ended, actions drawn beforehand.

    Random numbers are drawn by the fastest generator that JAX has.
    """
    _start_on_one_thread()
    import gymnax

    jax.config.update("jax_default_prng_impl", "unsafe_rbg")
    environment, parameters = gymnax.make(name)
    length = min(1000, max(4, _STEPS_IN_ALL // count))
    keys = jax.random.split(jax.random.key(0), (length, count))
    actions = jax.vmap(jax.vmap(environment.action_space(parameters).sample))(keys)
    _, state = jax.vmap(environment.reset, (0, None))(keys[0], parameters)
    stepped = jax.vmap(environment.step, (0, 0, 0, None))

    @jax.jit
    def run(state, keys, actions):  # noqa: ANN001, ANN202 - JAX's own trees
        def one(state, inputs):  # noqa: ANN001, ANN202
            key, action = inputs
            observation, state, reward, *ends, _ = stepped(key, state, action, parameters)
            return state, (observation, reward, ends)

        return jax.lax.scan(one, state, (keys, actions))

    def chunk() -> int:
        nonlocal state
        state, seen = run(state, keys, actions)
        jax.block_until_ready(seen)
        return length * count

    return Prepared(chunk)


ROWS = {"loop": loop}
