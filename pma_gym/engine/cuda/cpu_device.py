"""Emulation of a GPU: the code of its threads, compiled for the processor, for tests."""

import ctypes
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.engine.cuda.kernel import ARGUMENTS, CudaKernel, Name


class CpuDevice:
    """Run the threads of a kernel on the processor, one after another, for tests without a GPU.

    Args:
        threads: how many threads share the environments; one each if not given.
    """

    def __init__(self, threads: int | None = None) -> None:
        self._threads = threads

    def zeros(self, shape: tuple[int, ...], kind: type[np.generic]) -> NDArray[Any]:
        """An array of zeros."""
        return np.zeros(shape, kind)

    def put(self, array: NDArray[Any]) -> NDArray[Any]:
        """A copy of an array."""
        return array.copy()

    def view(self, array: NDArray[Any], kind: type[np.generic]) -> NDArray[Any]:
        """The same memory as another type of the same size."""
        return array.view(kind)

    def indices(self, flags: NDArray[Any]) -> NDArray[np.int64]:
        """Indices of set flags."""
        return np.flatnonzero(flags)

    def actions(
        self, given: object, shape: tuple[int, int], kind: type[np.generic]
    ) -> NDArray[Any]:
        """Actions as an array, checked for shape."""
        array = np.ascontiguousarray(np.asarray(given), kind)
        if array.shape != shape:
            raise ValueError(f"actions must have shape {shape}, got {array.shape}")
        return array

    def address(self, array: NDArray[Any]) -> int:
        """Address of an array."""
        return array.ctypes.data

    def prepare(self, kernel: CudaKernel) -> None:
        """Compile a kernel."""
        self._kernel = kernel
        library = kernel.cpu_library()
        kinds = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64]
        self._functions = {name: library.function(name, kinds) for name in kernel.names}

    def launch(self, name: Name, given: Mapping[str, int], table: NDArray[Any]) -> None:
        """Run a function of the kernel for all environments."""
        arguments = np.array([given[n] for n in ARGUMENTS], np.int64)
        shared = self._kernel.shared_table(name, table)
        threads = self._threads or given["count"]
        self._functions[name](arguments.ctypes.data, shared.ctypes.data, threads)
