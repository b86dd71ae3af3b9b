"""The class `Engine`: one or many environments as arrays, stepped together."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.codegen.machine import control
from pma_gym.codegen.machine.native import builtin
from pma_gym.codegen.threads.thread_pool import ThreadPool
from pma_gym.engine.cpu.block_memory import ARGUMENTS
from pma_gym.engine.cpu.python_step import BOUND
from pma_gym.engine.option_checks import Pressure
from pma_gym.engine.options import Options
from pma_gym.engine.reset.episodes import FIRST, LAST, SETTLES, Episodes
from pma_gym.engine.snapshot import Snapshot, put, take
from pma_gym.tasks import Task

LEAST_BLOCKS = 2
"""Blocks of lanes that are not divided among threads: a part is taken by a few atomic operations,
and a block steps in some microseconds."""

LEAST_BEGUN = 32
"""Episodes that begin at once that threads share: each takes about a microsecond."""

BEGUN_PARTS = 8
"""Parts of a thread's share of these."""

_RESET = 1
"""The pool's second work; the first is a step."""


class ActionError(ValueError):
    """Invalid actions; no step was made."""


class Engine(Episodes):
    """Hold the state of n environments and step them.

    The results of an environment depend only on its seed, episode and actions, not on the other
    environments, their number or the number of threads.

    Args:
        task: the task.
        options: the options, the same for all.
        count: number of environments.
        threads: number of threads.
        single: integrate in single precision: faster, see `PMAVectorEnv`.
        pressures: one value of the option `pressure_kpa` per environment, if they differ.

    Attributes:
        count: number of environments.
        threads: number of threads.
        state_layout: offsets of an environment's numbers.
        table: the observation's entries.
        width: environments that share a block, one lane each.
        nominal_model: the nominal model that controllers receive.
        nominal: the Plant of the nominal model, with the effects that `disturbances` need.
        models: the Model of every environment's episode.
        tasks: the Task of every environment's episode.
        pressures: gauge pressure at the start of every episode (Pa), shape (n,).
        horizon: control steps after which an episode is truncated.
        observations: observations of the last step or reset, float32, shape (n, entries).
        rewards: rewards of the last step, shape (n,).
        terminated: flags of the last step, bool, shape (n,).
        truncated: flags of the last step, bool, shape (n,).
        trace: true position at k / 384 s of a single environment (m or rad).
        voltages: voltage of the task's actuator in every step of a single environment (V).
        rest_motor: motor voltage at the start of episodes (V); with the nominal drive it holds the
            load of a regulator's task.
    """

    def __init__(
        self,
        task: Task,
        options: Options,
        count: int = 1,
        threads: int = 1,
        single: bool = False,
        pressures: Sequence[Pressure] | None = None,
    ) -> None:
        """Compile, allocate arrays and start the threads."""
        super().__init__(task, options, count, single, pressures)
        self.threads = threads = max(1, min(threads, self.blocks))
        self._beginnings = np.tile(self._reset_arguments, (threads * BEGUN_PARTS, 1))
        shares = [list(share) for share in np.split(self._beginnings, threads)]
        address = self.kernel.library.address
        self._steps = self._parts(threads)
        self._threads = ThreadPool((address("step"), self._steps), (address("begin"), shares))
        self._least_shared = LEAST_BEGUN if threads > 1 else count + 1

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle by construction: addresses and compiled code belong to one process."""
        made_with = self.task, self.options, self.count, self.threads, self.kernel.single
        return type(self), (*made_with, self.wanted), take(self)

    def __setstate__(self, state: Snapshot) -> None:
        """Continue from the state of `__reduce__`."""
        put(self, state)

    def _parts(self, threads: int) -> list[list[NDArray[np.int64]]]:
        """The arguments of a step, of every part of each thread's share of the blocks."""
        edges = np.linspace(0, self.blocks, threads + 1).round().astype(int).tolist()
        shares = [_halves(*ends) if threads > 1 else [ends] for ends in pairwise(edges)]
        self._count_attempts(sum(map(len, shares)))
        rows = iter(self._attempts)
        return [[self._part(*ends, next(rows)) for ends in share] for share in shares]

    def _part(self, first: int, last: int, attempts: NDArray[np.int64]) -> NDArray[np.int64]:
        part = self._arguments.copy()
        given = {"first": first, "last": last, "attempts": attempts.ctypes.data}
        for name, number in given.items():
            part[ARGUMENTS.index(name)] = number
        return part

    def limit_steps(self, steps: int) -> None:
        """Truncate episodes after a number of control steps, but not after the task's end."""
        self.options = replace(self.options, max_episode_steps=steps)
        self.horizon = self.options.horizon(self.task)
        for part in (self._arguments, *(part for share in self._steps for part in share)):
            part[ARGUMENTS.index("horizon")] = self.horizon

    def step(self) -> int:
        """Step all environments with `actions`; the attributes contain the results.

        Returns:
            0 while no episode ended, else the sum of 1 if any terminated and 2 if any was
            truncated.
        Raises:
            ActionError: an action that is not finite; the environments are unchanged then.
        """
        if self.kernel.check(self._address):
            raise ActionError("actions must be finite")
        if self._has_idle_lanes:
            self._idle_lanes[:] = 0
        return self._threads.run()

    def _begin(self, count: int, settles: bool) -> None:
        if count < self._least_shared:
            super()._begin(count, settles)
            return
        parts = self._beginnings
        edges = np.arange(len(parts) + 1) * count // len(parts)
        parts[:, FIRST], parts[:, LAST], parts[:, SETTLES] = edges[:-1], edges[1:], settles
        self._threads.run(_RESET)

    def close(self) -> None:
        """Stop the threads."""
        self._threads.close()

    def advance(
        self, copy: Callable[[], Any], given: NDArray[np.float64], constants: Mapping[str, Any]
    ) -> Callable[[Any], Any]:
        """Return the step of a single environment as a fast Python callable.

        Args:
            copy: makes the observation that is handed out.
            given: the row of `actions`.
            constants: values of further keys of the info.
        Returns:
            What takes an action, or `given` with the action in it, and gives observation, reward,
            False, False and info, or 1 where the episode was terminated and 2 where it was
            truncated. With nothing done it gives BAD_ACTION for an action that is not finite, and
            NOT_READ for one that is no array of as many numbers in single or double precision.
        """
        keys, known = self.state_layout.info, control.are_known()
        bound = {
            "arguments": self._address,
            "infos": dict.fromkeys(keys) | dict(constants),
            "keys": tuple(keys),
            "copy": copy,
            "no": False,
            "number": np.float64,
            "given": given,
            "array": np.ndarray if known else None,
            "single": np.dtype(np.float32),
            "double": np.dtype(np.float64),
        }
        address = self.kernel.library.address("advance")
        return builtin(address, "advance", tuple(bound[name] for name in BOUND))

    @property
    def attempts(self) -> int:
        """Number of attempted internal steps in the last step; a block's lanes count as one."""
        return int(self._attempts[:, 0].sum())


def _halves(first: int, last: int) -> list[tuple[int, int]]:
    """A thread's blocks in parts: half of what is left, over and over.

    The last parts, which another thread may take, are small.

    >>> _halves(0, 16)
    [(0, 8), (8, 12), (12, 14), (14, 16)]
    """
    halves = []
    while last - first >= 2 * LEAST_BLOCKS:
        middle = (first + last) // 2
        halves.append((first, middle))
        first = middle
    return [*halves, (first, last)]
