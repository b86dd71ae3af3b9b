"""NVIDIA's driver through ctypes, in front of a stand-in that notes what it is asked."""

import ctypes

import pytest

from pma_gym.codegen.machine import cuda_driver
from pma_gym.codegen.machine.cuda_driver import Arguments, Driver, Gpu, GpuError

ATTRIBUTES = {16: 132, 75: 9, 76: 0}


class Library:
    """A driver that does nothing but answer."""

    def __init__(self, **statuses):
        self.statuses, self.asked = statuses, []

    def __getattr__(self, name):
        if name.startswith("_"):
            return lambda *_: None

        def call(*arguments):
            self.asked.append((name, arguments))
            getattr(self, f"_{name}")(*arguments)
            return self.statuses.get(name, 0)

        return call

    def _cuGetErrorName(self, status, text):
        text._obj.value = b"CUDA_ERROR_SOME"

    def _cuGetErrorString(self, status, text):
        text._obj.value = b"some sentence"

    def _cuDeviceGetAttribute(self, value, number, device):
        value._obj.value = ATTRIBUTES[number]

    def _cuOccupancyMaxActiveBlocksPerMultiprocessor(self, blocks, *others):
        blocks._obj.value = 4

    def _cuModuleLoadDataEx(self, module, image, count, options, values):
        if "cuModuleLoadDataEx" in self.statuses:
            ctypes.memmove(values[0], b"line 3: no such thing", 21)

    def names(self):
        return [name for name, _ in self.asked]


@pytest.fixture
def gpu(monkeypatch):
    library = Library()
    monkeypatch.setattr(cuda_driver, "driver", lambda: Driver(library))
    return Gpu(0), library


def test_a_kernel_is_compiled_once_and_launched(gpu):
    made, library = gpu
    assert (made.arch, made.processors) == ("sm_90", 132)
    functions = [made.function("text", name, 128) for name in ("step", "begin")]
    assert library.names().count("cuModuleLoadDataEx") == 1
    assert functions[0].resident == 4 * 128 * 132
    arguments = Arguments(2, [ctypes.c_float(0.5)])
    arguments.set([3, 1 << 40])
    functions[0].launch(7, 99, arguments)
    (launched,) = [given for name, given in library.asked if name == "cuLaunchKernel"]
    assert [n.value for n in launched[1:8]] == [7, 1, 1, 128, 1, 1, 0]
    assert launched[8].value == 99
    read = [
        ctypes.cast(place, ctypes.POINTER(kind)).contents.value
        for place, kind in zip(
            launched[9], (ctypes.c_int64, ctypes.c_int64, ctypes.c_float), strict=True
        )
    ]
    assert read == [3, 1 << 40, 0.5]
    assert library.names().count("cuCtxPushCurrent_v2") == library.names().count(
        "cuCtxPopCurrent_v2"
    )


def test_no_gpu_is_said_so():
    with pytest.raises(GpuError, match=r"no NVIDIA GPU is there \(100, CUDA_ERROR_SOME.*make_vec"):
        Driver(Library(cuInit=100))


def test_failures_have_the_drivers_words():
    made = Driver(Library(cuDeviceGet=1, cuModuleLoadDataEx=218))
    with pytest.raises(GpuError, match="cuDeviceGet of NVIDIA's driver failed: 1, .*some sentence"):
        made("cuDeviceGet", None, 0)
    with pytest.raises(GpuError, match="some sentence\nline 3: no such thing"):
        made.load("nonsense")
