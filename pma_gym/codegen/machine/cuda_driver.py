"""Interface to NVIDIA's driver: compile PTX for the present GPU and launch it.

No CUDA toolkit is needed. Kernels run in PyTorch's context, so that both share memory.
"""

import ctypes
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

from pma_gym.codegen.cache.compile_cache import digest

_LIBRARIES = {"win32": ("nvcuda.dll",)}
_ELSEWHERE = ("libcuda.so.1", "libcuda.so")

_NO_DEVICE, _STUB = 100, 34
_LOG_BYTES = 16384
_ERROR_LOG, _ERROR_BYTES = 5, 6
"""Options of `cuModuleLoadDataEx`."""

_PROCESSORS, _MAJOR, _MINOR = 16, 75, 76
"""Attributes of a device."""

_LOCAL_BYTES, _REGISTERS = 3, 4
"""Attributes of a function."""

INSTEAD = (
    "without one the processor does the same: gym.make_vec(id, num_envs=n, "
    'vectorization_mode="vector_entry_point", threads=8)'
)
"""Fix for a missing GPU, for messages."""


class GpuError(RuntimeError):
    """No usable GPU, or an error of one; the message has the cause and the fix."""


class Driver:
    """The driver's functions, each of which raises `GpuError` where it fails.

    Args:
        library: the driver's library, loaded.
    """

    def __init__(self, library: Any) -> None:  # noqa: ANN401
        self._library = library
        status = library.cuInit(0)
        if status in (_NO_DEVICE, _STUB):
            raise GpuError(f"no NVIDIA GPU is there ({self._text(status)}); {INSTEAD}")
        self._check("cuInit", status)

    def __call__(self, name: str, *arguments: Any) -> None:
        """Call a function of the driver by its name."""
        self._check(name, getattr(self._library, name)(*arguments))

    def _check(self, name: str, status: int, log: str = "") -> None:
        if status:
            raise GpuError(f"{name} of NVIDIA's driver failed: {self._text(status)}{log}")

    def _text(self, status: int) -> str:
        said = []
        for function in ("cuGetErrorName", "cuGetErrorString"):
            text = ctypes.c_char_p()
            getattr(self._library, function)(status, ctypes.byref(text))
            said.append((text.value or b"unknown").decode())
        return f"{status}, {said[0]}: {said[1]}"

    def attribute(self, device: int, number: int) -> int:
        """An attribute of a device, by the driver's own number."""
        value = ctypes.c_int()
        self("cuDeviceGetAttribute", ctypes.byref(value), number, device)
        return value.value

    def load(self, text: str) -> ctypes.c_void_p:
        """Compile PTX for the current context's GPU."""
        log = ctypes.create_string_buffer(_LOG_BYTES)
        options = (ctypes.c_int * 2)(_ERROR_LOG, _ERROR_BYTES)
        values = (ctypes.c_void_p * 2)(ctypes.addressof(log), _LOG_BYTES)
        module, image = ctypes.c_void_p(), ctypes.create_string_buffer(text.encode())
        status = self._library.cuModuleLoadDataEx(ctypes.byref(module), image, 2, options, values)
        said = log.value.decode(errors="replace").strip()
        self._check("cuModuleLoadDataEx", status, f"\n{said}" if said else "")
        return module


@cache
def driver() -> Driver:
    """The driver.

    Raises:
        GpuError: no driver or no GPU is there.
    """
    names = _LIBRARIES.get(sys.platform, _ELSEWHERE)
    for name in names:
        try:
            return Driver(ctypes.CDLL(name))
        except OSError:
            continue
    raise GpuError(
        f"NVIDIA's driver is not there ({names[0]} is not found): this needs an NVIDIA GPU and "
        f"its driver; {INSTEAD}"
    )


class Gpu:
    """One GPU, in the context that PyTorch uses.

    Args:
        number: its number, as the driver counts.

    Attributes:
        number: its number.
        arch: architecture to write PTX for.
        processors: how many multiprocessors it has.
    """

    def __init__(self, number: int = 0) -> None:
        self.number, self._driver = number, driver()
        device = ctypes.c_int()
        self._driver("cuDeviceGet", ctypes.byref(device), number)
        attribute = self._driver.attribute
        capability = 10 * attribute(device.value, _MAJOR) + attribute(device.value, _MINOR)
        # Nothing newer is used, and what is written for this one runs on all that came after.
        self.arch = f"sm_{min(capability, 90)}"
        self.processors = attribute(device.value, _PROCESSORS)
        self._context = ctypes.c_void_p()
        self._driver("cuDevicePrimaryCtxRetain", ctypes.byref(self._context), device)
        self._modules: dict[str, ctypes.c_void_p] = {}

    @contextmanager
    def _current(self) -> Iterator[None]:
        self._driver("cuCtxPushCurrent_v2", self._context)
        try:
            yield
        finally:
            self._driver("cuCtxPopCurrent_v2", ctypes.byref(ctypes.c_void_p()))

    def function(self, text: str, name: str, threads: int) -> "Function":
        """A kernel of PTX text, compiled once a process.

        Args:
            text: PTX.
            name: the kernel's name in it.
            threads: threads of a block.
        """
        key, handle = digest([text]), ctypes.c_void_p()
        with self._current():
            if key not in self._modules:
                self._modules[key] = self._driver.load(text)
            module = self._modules[key]
            self._driver("cuModuleGetFunction", ctypes.byref(handle), module, name.encode())
        return Function(self, handle, threads)

    def call(self, name: str, *arguments: Any) -> None:
        """Call a function of the driver in this GPU's context."""
        with self._current():
            self._driver(name, *arguments)


class Function:
    """A kernel that can be launched.

    Args:
        gpu: where.
        handle: the driver's name for it.
        threads: threads of a block.

    Attributes:
        threads: threads of a block.
        registers: 32-bit registers of a thread.
        local_bytes: bytes of a thread that found no register.
        resident: how many threads the GPU holds at once.
    """

    def __init__(self, gpu: Gpu, handle: ctypes.c_void_p, threads: int) -> None:
        self._gpu, self._handle, self.threads = gpu, handle, threads
        self.registers = self._attribute(_REGISTERS)
        self.local_bytes = self._attribute(_LOCAL_BYTES)
        blocks = ctypes.c_int()
        gpu.call(
            "cuOccupancyMaxActiveBlocksPerMultiprocessor",
            *(ctypes.byref(blocks), handle, threads, ctypes.c_size_t(0)),
        )
        self.resident = max(blocks.value, 1) * threads * gpu.processors

    def _attribute(self, number: int) -> int:
        value = ctypes.c_int()
        self._gpu.call("cuFuncGetAttribute", ctypes.byref(value), number, self._handle)
        return value.value

    def launch(self, blocks: int, stream: int, arguments: "Arguments") -> None:
        """Launch it; returns at once.

        Args:
            blocks: how many blocks of `threads`.
            stream: address of the stream, 0 for the default one.
            arguments: its arguments.
        """
        one = ctypes.c_uint(1)
        self._gpu.call(
            "cuLaunchKernel",
            *(self._handle, ctypes.c_uint(blocks), one, one),
            *(ctypes.c_uint(self.threads), one, one, ctypes.c_uint(0)),
            *(ctypes.c_void_p(stream), arguments.pointers, None),
        )


class Arguments:
    """Arguments of a kernel, of which the first may change from launch to launch.

    Args:
        whole: how many integers and addresses come first.
        others: the numbers behind them, as ctypes has them.

    Attributes:
        pointers: where they are, as the driver wants it.
    """

    def __init__(self, whole: int, others: Sequence[Any] = ()) -> None:
        self._whole = [ctypes.c_int64() for _ in range(whole)]
        self._all = [*self._whole, *others]
        self.pointers = (ctypes.c_void_p * len(self._all))(*map(ctypes.addressof, self._all))

    def set(self, whole: Iterable[int]) -> None:
        """Give the integers and addresses values."""
        for place, value in zip(self._whole, whole, strict=True):
            place.value = value


@cache
def gpu(number: int = 0) -> Gpu:
    """A GPU, one object each."""
    return Gpu(number)
