"""A Ray cluster: the one at `RAY_ADDRESS`, else one on this machine that ends with this process."""

import importlib
import os
import socket
import subprocess
import sys
import time
from collections.abc import Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import TYPE_CHECKING, Any

from benchmarks.executors.executor import (
    ExecutorMissing,
    OnEnd,
    OtherProcesses,
    ProcessDied,
    run_packed,
)
from benchmarks.executors.local import end_with

if TYPE_CHECKING:
    from ray import ObjectRef

ADDRESS = "RAY_ADDRESS"
"""Environment variable with a cluster's address (Ray's own)."""

_PATIENCE_S, _STOPPING_S = 5.0, 1.0
"""How often the cluster is looked at while no piece ends, and how long it takes to stop (s)."""

_END_AGENTS = """
import os, signal, sys
sys.stdin.read()
for pid in map(int, sys.argv[1:]):
    try:
        os.kill(pid, signal.SIGKILL)
    except OSError:
        pass
"""
"""Program that waits for the end of its standard input, then ends the processes that it names."""


class RayCluster(OtherProcesses):
    """Runs pieces of work on Ray, one CPU each.

    Every machine of a cluster needs this version of the package and the files that pieces name.

    Args:
        jobs: how many at a time: processes of a cluster on this machine; on one that `RAY_ADDRESS`
            names, the most pieces in flight.
    Raises:
        ExecutorMissing: Ray is not installed.
    """

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

    def run_packed(self, works: Mapping[int, bytes], on_end: OnEnd, alone: bool) -> None:
        """See `OtherProcesses`.

        Raises:
            ConnectionError: the cluster is lost.
        """
        if not works:
            return
        ray, most = self._ray, 1 if alone else self.jobs
        self._connect()
        task: Any = ray.remote(num_cpus=1, max_retries=0)(_run_beside)
        # Ray ends the processes of a cluster on this machine some seconds after this one.
        driver = None if os.environ.get(ADDRESS) else os.getpid()
        left, running = list(works.items())[::-1], dict[Future[bytes], tuple[int, "ObjectRef"]]()
        try:
            while left or running:
                while left and len(running) < most:
                    index, work = left.pop()
                    reference = task.remote(work, driver)
                    running[reference.future()] = index, reference
                # Not by ray.wait, which waits for a lost head whatever its timeout.
                done, _ = wait(running, _PATIENCE_S, FIRST_COMPLETED)
                if not done and self._lost():
                    raise self._loss()
                for future in done:
                    on_end(running.pop(future)[0], self._end(future))
        except ConnectionError:
            running.clear()
            raise
        finally:
            for _, reference in running.values():
                ray.cancel(reference, force=True)

    def _connect(self) -> None:
        if self._ray.is_initialized():
            return
        quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
        if os.environ.get(ADDRESS):
            self._ray.init(**quiet)
        else:
            self._ray.init(num_cpus=self.jobs, include_dashboard=False, **quiet)
            _end_agents_with_this_process()

    def _end(self, future: "Future[bytes]") -> bytes | ProcessDied:
        try:
            return future.result()
        except self._ray.exceptions.LocalRayletDiedError:
            raise self._loss() from None
        except self._ray.exceptions.RayError:
            # Exceptions of the work itself travel packed: what Ray raises is the loss of a process,
            # or of all of them: a cluster that is stopped ends its workers first.
            time.sleep(_STOPPING_S)
            if self._lost():
                raise self._loss() from None
            return ProcessDied(None)

    @property
    def _head(self) -> str:
        return self._ray.get_runtime_context().gcs_address

    def _lost(self) -> bool:
        """Whether the cluster's head or all of its nodes are gone."""
        host, _, port = self._head.rpartition(":")
        try:
            socket.create_connection((host, int(port)), _PATIENCE_S).close()
        except OSError:
            # Ray itself would wait a minute, and then end this process.
            return True
        return not any(node["Alive"] for node in self._ray.nodes())

    def _loss(self) -> ConnectionError:
        return ConnectionError(
            f"the Ray cluster at {self._head} is lost; what is done stays: start the cluster "
            "again and repeat the same command"
        )


def _end_agents_with_this_process() -> None:
    """Ray's agents outlive a driver that is killed by a minute: another process ends them."""
    psutil = importlib.import_module("psutil")  # Ray brings it.
    nodes = [child for child in psutil.Process().children() if "raylet" in child.name()]
    agents = [str(agent.pid) for node in nodes for agent in node.children()]
    # This process alone holds the other end of the pipe.
    subprocess.Popen(
        [sys.executable, "-c", _END_AGENTS, *agents], stdin=subprocess.PIPE, start_new_session=True
    )


def _run_beside(work: bytes, driver: int | None) -> bytes:
    """Run a packed piece of work in a process that ends with the driver's, if it has a number."""
    if driver is not None:
        end_with(driver)
    return run_packed(work)
