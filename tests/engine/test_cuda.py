"""Environments for a GPU: what each thread does, run by a stand-in on the processor."""

import ctypes
import re

import numpy as np
import pytest
from llvmlite import ir

from pma_gym.codegen.machine import cuda_driver
from pma_gym.codegen.machine.control import INTEGER, function
from pma_gym.codegen.machine.native import Library
from pma_gym.engine.cuda import engine
from pma_gym.engine.cuda.cpu_device import CpuDevice
from pma_gym.engine.cuda.device_engine import DeviceEngine
from pma_gym.engine.cuda.kernel import CudaKernel, shared_job
from pma_gym.engine.engine import Engine
from pma_gym.engine.options import Options
from pma_gym.tasks import TASKS

EVERYTHING = {
    "regulator_action": True,
    "action_delay_s": 0.02,
    "observation_delay_s": 0.01,
    "history": 2,
    "preview": 3,
    "reward": "smooth",
    "pressure_kpa": [300.0, 400.0, 500.0],
}


class Pair:
    """The same environments twice: on the processor, and as threads."""

    def __init__(self, task, options, count, precision="double", threads=None):
        self.task, options = TASKS[task], Options(**options)
        self.own = Engine(self.task, options, count)
        self.other = DeviceEngine(self.task, options, count, precision, CpuDevice(threads))
        every = np.arange(count)
        self.own.seed(every, [7 + i for i in every.tolist()])
        self.own.reset(every)
        self.other.reset(7)

    def scores(self):
        sums = [f"sum_{phase.name}" for phase in self.task.schedule.phases]
        return np.array([self.own.numbers(name) for name in ("sample", "ended", *sums)])

    def states(self):
        """Numbers of both by name."""
        names = [*self.own.state_layout.states, "size", "tare_contraction"]
        return {n: (self.own.numbers(n), self.other.numbers(n)) for n in names}

    def step(self, actions):
        """What each returned: observations, last observations where over, rewards."""
        own, count = self.own, self.own.count
        own.actions[:count] = actions
        own.step()
        seen, rewards, terminated, truncated = self.other.step(actions)
        assert np.array_equal(own.terminated, terminated)
        assert np.array_equal(own.truncated, truncated)
        over = np.flatnonzero(terminated | truncated)
        last, paid, scores = own.observations[over].copy(), own.rewards.copy(), self.scores()
        if len(over):
            own.reset(over)
            assert np.array_equal(scores[:2, over], self.other.scores[:2, over])
        return {
            "observations": (own.observations, seen),
            "last": (last, self.other.final_observations[over]),
            "rewards": (paid, rewards),
            "scores": (scores[:, over], self.other.scores[:, over]),
        }


def actions_of(generator, pair, step, rough):
    """Random volts, or a swing around a pull that is not let go."""
    shape = pair.own.count, pair.own.state_layout.actions
    if rough:
        return generator.uniform(-1.0, 1.0, shape).astype(np.float32)
    swing = -0.65 + 0.2 * np.sin(0.05 * step + np.arange(shape[0]))
    return np.repeat(swing[:, None], shape[1], axis=1).astype(np.float32)


@pytest.mark.parametrize(
    ("task", "options", "steps", "rough", "threads"),
    [
        ("displacement", {}, 300, True, None),
        ("displacement", {"control_rate_hz": 50.0, "tolerance": 5e-3}, 320, False, 3),
        ("displacement", {"model": "serres2008"}, 60, True, 32),
        ("rotation", EVERYTHING, 60, False, 8),
        (
            "displacement",
            {"noise": False, "reward": "gaussian", "pressure_kpa": 300.0},
            60,
            True,
            1,
        ),
        ("displacement", {"randomisation": "varied", "control_rate_hz": 10.0}, 55, True, None),
        ("rotation", {"model": "cascade", "control_rate_hz": 5.0}, 80, True, 2),
    ],
)
def test_threads_have_the_bits_of_the_processor(task, options, steps, rough, threads):
    pair = Pair(task, options, 13, threads=threads)
    generator = np.random.default_rng(1)
    for step in range(steps):
        stepped = pair.step(actions_of(generator, pair, step, rough)) | pair.states()
        for name, (one, other) in stepped.items():
            assert np.array_equal(one, other), (name, step)
    assert pair.other.attempts.sum() > 13


@pytest.mark.parametrize("rate", [100.0, 384.0])
@pytest.mark.parametrize("rough", [True, False])
def test_single_precision_stays_near_double(rate, rough):
    pair = Pair("displacement", {"control_rate_hz": rate}, 16, "single", threads=6)
    generator, seen, ends = np.random.default_rng(2), [], 0
    for step in range(pair.task.steps(rate) + 5):
        stepped = pair.step(actions_of(generator, pair, step, rough))
        seen.append(np.abs(np.subtract(*stepped["observations"])))
        assert np.allclose(*stepped["rewards"], atol=1e-3)
        assert np.allclose(*stepped["scores"], rtol=1e-4)
        states = pair.states()
        assert np.allclose(*states["contraction"], atol=1e-5 * 25e-3, rtol=0.0)
        assert np.allclose(*states["angle"], atol=1e-5 * np.pi / 2, rtol=0.0)
        assert np.allclose(*states["pressure"], atol=0.1, rtol=0.0)
        ends += stepped["last"][0].shape[0]
    assert ends == 16
    # One step of the converter is 0.2 % of the range of what is read, or less.
    assert np.max(seen) < 5e-3
    assert np.mean(np.array(seen) > 1e-5) < 2e-3


def test_an_action_that_is_no_number_holds_up_nobody():
    pair = Pair("displacement", {}, 4)
    actions = np.full((4, 1), -0.5)
    for _ in range(3):
        pair.step(actions)
    broken = actions.copy()
    broken[2] = np.nan
    pair.own.actions[:4] = actions
    pair.own.step()
    seen, *_ = pair.other.step(broken)
    assert np.array_equal(pair.own.observations, seen)
    with pytest.raises(ValueError, match="actions must be finite"):
        pair.other.check()
    pair.other.check()


def test_some_environments_begin_anew():
    pair = Pair("displacement", {}, 6)
    actions = np.full((6, 1), -0.2)
    for _ in range(5):
        pair.step(actions)
    mask = np.array([True, False, False, True, False, False])
    pair.own.reset(np.flatnonzero(mask))
    assert np.array_equal(pair.other.reset(mask=mask), pair.own.observations)
    assert pair.other.numbers("episode").tolist() == [1, 0, 0, 1, 0, 0]
    stepped = pair.step(actions)
    assert np.array_equal(*stepped["observations"])
    unseeded = DeviceEngine(pair.task, Options(), 3, "single", CpuDevice())
    first = unseeded.reset().copy()
    assert len({row.tobytes() for row in first}) == 3
    assert not np.array_equal(first, unseeded.reset())


def test_mistakes_are_named():
    task = TASKS["displacement"]
    with pytest.raises(ValueError, match="precision must be double or single, got 'half'"):
        DeviceEngine(task, Options(), 2, "half", CpuDevice())
    engine = DeviceEngine(task, Options(), 2, "double", CpuDevice())
    with pytest.raises(RuntimeError, match="call reset"):
        engine.step(np.zeros((2, 1)))
    with pytest.raises(ValueError, match="one for each of the 2 environments; got 3"):
        engine.reset([1, 2, 3])
    engine.reset(0)
    with pytest.raises(ValueError, match=r"shape \(2, 1\), got \(2,\)"):
        engine.step(np.zeros(2))


@pytest.fixture(scope="module", params=["double", "single"])
def kernel(request) -> CudaKernel:
    engine = DeviceEngine(TASKS["displacement"], Options(), 2, request.param, CpuDevice())
    return engine.kernel


def test_gpu_text_needs_nothing_else(kernel):
    text = kernel.ptx()
    assert re.findall(r"\.visible \.entry (\w+)\(", text) == ["step", "begin"]
    assert text.count(".maxntid 128") == 2
    # No library is called, and all numbers have registers.
    assert not re.search(r"\bcall\b|\.extern|\.local", text)


def test_gpu_text_rounds_as_the_processor(kernel):
    step = kernel.ptx().split(".entry begin")[0]
    kind = "f32" if kernel.single else "f64"
    matches = set(re.findall(rf"\b((?:add|sub|mul|fma|div|rcp|sqrt)\S*\.{kind})\b", step))
    assert {f"fma.rn.{kind}", f"div.rn.{kind}", f"sqrt.rn.{kind}"} <= matches
    assert all(".rn" in name and ".ftz" not in name and "approx" not in name for name in matches)
    # What is wide in single precision: times since the trial began.
    wide = len(re.findall(r"(?:add|sub|mul|fma|div)\.rn\.f64", step))
    assert wide <= 7 if kernel.single else wide > 500


def test_threads_of_a_warp_stay_together(kernel):
    step = kernel.ptx().split(".entry begin")[0]
    assert step.count("vote.sync.any") == 1 and step.count("atom.shared.add.u32") == 1
    assert step.count("bar.warp.sync") == 3


def test_a_warp_marches_what_its_threads_command_and_sense():
    module = ir.Module()
    names = [(name, INTEGER) for name in ("turn", "first", "threads")]
    builder, arguments = function(module, "job", names, INTEGER)
    builder.ret(shared_job(builder, *arguments))
    job = Library(module).function("job", [ctypes.c_int64] * 3, ctypes.c_int64)
    threads = 4 * 32
    for first in range(0, threads, 32):
        jobs = [job(turn, first, threads) for turn in range(3 * 32)]
        assert jobs == sorted(jobs)
        assert set(jobs) == {k * threads + first + i for k in range(3) for i in range(32)}


def test_blocks_share_the_environments_evenly():
    assert engine.blocks_for(1, 67584) == 1
    assert engine.blocks_for(1 << 20, 33792) == 256
    for count in (1000, 67584, 67585, 262144):
        threads = engine.blocks_for(count, 67584) * 128
        assert threads <= 67584 and -(-count // threads) == -(-count // 67584)


def test_without_torch_or_gpu_a_sentence_says_what_to_do(monkeypatch):
    def missing(name):
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(engine.importlib, "import_module", missing)
    with pytest.raises(cuda_driver.GpuError, match="pip install torch"):
        engine.CudaEngine(TASKS["displacement"], Options(), 4)
    monkeypatch.setattr(engine.importlib, "import_module", lambda name: None)
    monkeypatch.setattr(cuda_driver, "_ELSEWHERE", ("libnothing.so.0",))
    monkeypatch.setattr(cuda_driver, "_LIBRARIES", {})
    cuda_driver.driver.cache_clear()
    with pytest.raises(cuda_driver.GpuError, match=r"libnothing.so.0 is not found.*gym.make_vec"):
        engine.torch_with_gpu()
