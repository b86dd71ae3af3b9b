"""Executors by the names that commands know."""

from enum import StrEnum

from benchmarks.executors.executor import Executor, ThisProcess


class ExecutorName(StrEnum):
    """Values of `--executor`."""

    LOCAL = "local"
    RAY = "ray"


def executor_named(name: ExecutorName, jobs: int) -> Executor:
    """The executor of a name.

    Raises:
        ExecutorMissing: its library is not installed.
    """
    if name is ExecutorName.RAY:
        from benchmarks.executors.ray_cluster import RayCluster

        return RayCluster(jobs)
    return local(jobs)


def local(jobs: int) -> Executor:
    """This process for one job at a time, processes of this machine for more.

    Raises:
        ExecutorMissing: pebble is not installed.
    """
    if jobs == 1:
        return ThisProcess()
    from benchmarks.executors.local import LocalProcesses

    return LocalProcesses(jobs)
