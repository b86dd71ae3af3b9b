"""Environments on an NVIDIA GPU: one thread each, states in torch tensors, no copies to the host.

In double precision they are `Engine`'s environments bit for bit, as the arithmetic has no operation
but those that IEEE 754 rounds to the last bit, and GPUs keep to that. In single precision all is
computed and kept in 32 bits but what must be exact: counts and the words of random numbers are
integers, samples are whole numbers below 2^24, pressures are drawn and the rest is found in 64
bits, and so is the mean of the readings at rest. Against double precision, over whole episodes:

- positions within 1e-5 of the task's range, pressures within 0.1 Pa, rewards within 1e-3 (percent);
- readings within 1e-5, but one in some 2000 of another step of the 12-bit converter, where noise
  and rounding meet at its edge.

Experimental: it has not run on a GPU yet. Tests run the code of the threads on a processor
(`pma_gym.engine.cuda.cpu_device`) and hold these figures there; how threads share work, and the
launch, only a GPU can show: `python -m benchmarks.speed.gpu` does.
"""

import importlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.codegen.machine.cuda_driver import Arguments, Function, GpuError, driver, gpu
from pma_gym.engine.cuda.device_engine import DeviceEngine
from pma_gym.engine.cuda.kernel import ARGUMENTS, THREADS, CudaKernel, Name
from pma_gym.engine.options import Options
from pma_gym.tasks import Task


class CudaEngine(DeviceEngine):
    """Hold the state of n environments on a GPU and step them; see `DeviceEngine`.

    What goes in and comes out are torch tensors on the GPU, and work is put on torch's current
    stream: nothing waits for anything, and the tensors keep their places from step to step.

    Args:
        task: the task.
        options: the options, the same for all.
        count: how many environments.
        precision: `double` or `single`.
        device: torch's name of the GPU, such as `cuda` or `cuda:1`.
        seed: seed of the first environment, the others counting up from it; `reset` may give
            others.

    Attributes:
        device: where the tensors are; `device.device` is torch's name of it.
    Raises:
        GpuError: no torch, no driver or no GPU; says what to do.
    """

    def __init__(
        self,
        task: Task,
        options: Options,
        count: int,
        precision: str = "double",
        device: str = "cuda",
        seed: int | None = None,
    ) -> None:
        """Compile, allocate arrays and reset."""
        self.device = TorchDevice(device)
        super().__init__(task, options, count, precision, self.device)
        self.reset(seed)


def torch_with_gpu() -> Any:  # noqa: ANN401
    """Import torch and check that it has a GPU.

    Raises:
        GpuError: it is not installed, sees none, or there is no driver.
    """
    try:
        torch = importlib.import_module("torch")
    except ModuleNotFoundError as error:
        raise GpuError(
            "environments on a GPU are torch tensors, and PyTorch is not installed: "
            "pip install torch (a build with CUDA)"
        ) from error
    driver()
    if not torch.cuda.is_available():
        raise GpuError(
            f"this PyTorch ({torch.__version__}) does not use the GPU: install a build with CUDA, "
            "see https://pytorch.org/get-started"
        )
    return torch


class TorchDevice:
    """Keeps arrays as torch tensors and launches kernels on torch's current stream.

    Args:
        name: torch's name of the GPU.
    """

    def __init__(self, name: str = "cuda") -> None:
        """Import torch and find the GPU."""
        self._use(torch_with_gpu(), name)

    def _use(self, torch: Any, name: str) -> None:  # noqa: ANN401
        self._torch, self.device = torch, torch.device(name)
        self._types = {
            np.float64: torch.float64,
            np.float32: torch.float32,
            np.int64: torch.int64,
            np.int32: torch.int32,
            np.bool_: torch.bool,
        }

    def zeros(self, shape: tuple[int, ...], kind: type[np.generic]) -> Any:  # noqa: ANN401
        """A tensor of zeros."""
        return self._torch.zeros(shape, dtype=self._types[kind], device=self.device)

    def put(self, array: NDArray[Any]) -> Any:  # noqa: ANN401
        """An array on the GPU."""
        return self._torch.tensor(np.ascontiguousarray(array), device=self.device)

    def view(self, array: Any, kind: type[np.generic]) -> Any:  # noqa: ANN401
        """The same memory as another type of the same size."""
        return array.view(self._types[kind])

    def indices(self, flags: Any) -> NDArray[np.int64]:  # noqa: ANN401
        """Where flags are set; waits for the GPU."""
        return flags.nonzero().flatten().cpu().numpy()

    def actions(self, given: Any, shape: tuple[int, int], kind: type[np.generic]) -> Any:  # noqa: ANN401
        """Actions as the kernel reads them."""
        rule = f"actions must be a torch tensor of shape {shape} on {self.device}"
        if not isinstance(given, self._torch.Tensor):
            raise ValueError(f"{rule}, got {type(given).__name__}; torch.from_numpy makes one")
        if given.device.type != self.device.type:
            raise ValueError(f"{rule}, got one on {given.device}; tensor.to({self.device.type!r})")
        if tuple(given.shape) != shape:
            raise ValueError(f"{rule}, got shape {tuple(given.shape)}")
        return given.detach().to(self._types[kind]).contiguous()

    def address(self, array: Any) -> int:  # noqa: ANN401
        """Address of a tensor."""
        return array.data_ptr()

    def prepare(self, kernel: CudaKernel) -> None:
        """Compile a kernel for the GPU at hand; once a process."""
        with self._torch.cuda.device(self.device):
            number = self._torch.cuda.current_device()
        self._kernel, text = kernel, kernel.ptx(gpu(number).arch)
        self._functions: dict[str, Function] = {
            name: gpu(number).function(text, name, THREADS) for name in kernel.names
        }
        self._arguments: dict[str, Arguments] = {}

    def launch(self, name: Name, given: Mapping[str, int], table: NDArray[Any]) -> None:
        """Put a function of the kernel on the current stream."""
        if name not in self._arguments:
            numbers = self._kernel.shared_table(name, table)
            kind = np.ctypeslib.as_ctypes_type(numbers.dtype)
            self._arguments[name] = Arguments(len(ARGUMENTS), [kind(x) for x in numbers])
        function, arguments = self._functions[name], self._arguments[name]
        arguments.set(given[own] for own in ARGUMENTS)
        stream = self._torch.cuda.current_stream(self.device).cuda_stream
        function.launch(blocks_for(given["count"], function.resident), stream, arguments)

    def facts(self) -> dict[str, int]:
        """Registers, local bytes and resident threads of each function."""
        return {
            f"{name}_{what}": getattr(function, what)
            for name, function in self._functions.items()
            for what in ("registers", "local_bytes", "resident")
        }


def blocks_for(count: int, resident: int) -> int:
    """How many blocks share the environments.

    As many as the GPU holds at once, and every thread with as many environments as any other, so
    that all end at about the same time.

    >>> blocks_for(1000, 67584), blocks_for(262144, 67584)
    (8, 512)
    """
    each = -(-count // resident)
    return -(-count // (each * THREADS))
