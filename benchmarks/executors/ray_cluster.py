"""A Ray cluster: the one at `RAY_ADDRESS`, else one on this machine that ends with this process."""

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from benchmarks.executors.executor import ExecutorMissing, OnEnd
from benchmarks.executors.failures import ProcessDied
from benchmarks.executors.lifetime import end_with
from benchmarks.executors.work import run_packed

if TYPE_CHECKING:
    from ray import ObjectRef

ADDRESS = "RAY_ADDRESS"
"""Environment variable with a cluster's address (Ray's own)."""


class RayCluster:
    """Runs pieces of work on Ray, one CPU each.

    Every machine of a cluster needs this version of the package and the files that pieces name.

    Args:
        jobs: how many at a time: processes of a cluster on this machine; on one that `RAY_ADDRESS`
            names, the most pieces in flight.
    Raises:
        ExecutorMissing: Ray is not installed.
    """

    isolates = True

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs
        try:
            import ray
            import ray.exceptions
        except ImportError:
            raise ExecutorMissing(
                "--executor ray needs Ray, which is not installed; run: "
                "pip install -c constraints.txt -e '.[scale]'"
            ) from None
        self._ray = ray

    def run(self, works: Mapping[int, bytes], on_end: OnEnd, alone: bool) -> None:
        """See `Executor`."""
        if not works:
            return
        ray, most = self._ray, 1 if alone else self.jobs
        self._connect()
        task: Any = ray.remote(num_cpus=1, max_retries=0)(_run_beside)
        # Ray ends the processes of a cluster on this machine some seconds after this one.
        driver = None if os.environ.get(ADDRESS) else os.getpid()
        left, running = list(works.items())[::-1], dict["ObjectRef", int]()
        try:
            while left or running:
                while left and len(running) < most:
                    index, work = left.pop()
                    running[task.remote(work, driver)] = index
                done, _ = ray.wait(list(running))
                for reference in done:
                    on_end(running.pop(reference), self._end(reference))
        finally:
            for reference in running:
                ray.cancel(reference, force=True)

    def _connect(self) -> None:
        if self._ray.is_initialized():
            return
        quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
        if os.environ.get(ADDRESS):
            self._ray.init(**quiet)
        else:
            self._ray.init(num_cpus=self.jobs, include_dashboard=False, **quiet)

    def _end(self, reference: "ObjectRef") -> bytes | ProcessDied:
        try:
            return self._ray.get(reference)
        except self._ray.exceptions.RayError:
            # Exceptions of the work itself travel packed: what Ray raises is the loss of a process.
            return ProcessDied(None)


def _run_beside(work: bytes, driver: int | None) -> bytes:
    """Run a packed piece of work in a process that ends with the driver's, if it has a number."""
    if driver is not None:
        end_with(driver)
    return run_packed(work)
