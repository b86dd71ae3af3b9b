"""Compiled plants: one program a structure, any parameters, any number of trials at once.

The step in plain Python: what is compiled, to be read and debugged.
"""

import os
import subprocess
import sys

import numpy as np
import pytest

from pma_gym.codegen.machine.native import compiled, simd_lanes
from pma_gym.plant import program as program_module
from pma_gym.plant.forms.plain import PlainPlant
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.simulation import FEW, Batch, Run, simulate_all, simulate_batches

CHANGES = ("slide.mass_kg", "rotor.inertia_kg_m2", "cable.stiffness_n_per_mm")


def trials(count, model="station"):
    """Trials of different plants of one structure, of different lengths and commands."""
    nominal, generator = load_model(model), np.random.default_rng(count)
    values = {
        name: nominal.values_in_files(name.split(".")[0])[name.split(".")[1]] for name in CHANGES
    }
    runs = []
    for k in range(count):
        factors = 1.0 + 0.2 * generator.uniform(-1.0, 1.0, len(CHANGES))
        changed = {n: v * f for (n, v), f in zip(values.items(), factors, strict=True)}
        plant = Plant(nominal.replace(changed), tolerance=(1.5e-4, 1e-5)[k % 2])
        rest = plant.settle(0.0, 300e3)
        rows = int(generator.integers(1, 30))
        motor, regulator = generator.uniform(0.0, 6.0, rows), generator.uniform(4.0, 8.0, rows)
        when = np.cumsum(generator.uniform(0.002, 0.02, rows))
        interpolation = "foh" if k % 3 else "zoh"
        given = (rest.state, rest.zero_contraction)
        runs.append(Run(when, motor, regulator, interpolation, plant.table, *given))
    return runs


@pytest.mark.parametrize(("count", "threads"), [(1, 1), (4, 2), (5, 1), (16, 1), (17, 2), (40, 2)])
def test_many_trials_at_once_have_the_bits_of_each_alone(count, threads):
    program = Plant("station").program
    together, alone = trials(count), trials(count)
    simulate_all(program, together, threads)
    for run in alone:
        simulate_all(program, [run])
    for one, other in zip(together, alone, strict=True):
        np.testing.assert_array_equal(one.states, other.states)
        assert one.size == other.size
        assert one.states.shape == (len(one.time), len(program.states))
        assert np.all(np.isfinite(one.states))


@pytest.mark.parametrize(("counts", "threads"), [((1,), 1), ((5, 12, 1, 20), 2)])
def test_a_trial_at_many_parameters_has_the_bits_of_its_runs(counts, threads):
    program = Plant("station").program
    batches, runs = [], []
    for k, count in enumerate(counts):
        given = trials(count)
        # The second is one row: its states are those that it begins in.
        columns = [each[: 1 if k == 1 else 20] for each in _columns(20, k)]
        starts = np.stack([run.state for run in given])
        zeros = np.array([run.zero_contraction for run in given])
        tables = np.stack([run.table for run in given])
        out = np.full((count, len(columns[0]), len(program.states)), np.nan)
        batches.append(Batch(*columns, "foh", tables, starts, zeros, out))
        for run in given:
            alone = Run(*columns, "foh", run.table, run.state, run.zero_contraction)
            simulate_all(program, [alone])
            runs.append(alone)
    simulate_batches(program, batches, threads)
    together = [states for batch in batches for states in batch.states]
    for one, other in zip(together, runs, strict=True):
        np.testing.assert_array_equal(one, other.states)


def _columns(rows, seed):
    generator = np.random.default_rng(seed)
    motor, regulator = generator.uniform(0.0, 6.0, rows), generator.uniform(4.0, 8.0, rows)
    return np.cumsum(generator.uniform(0.002, 0.02, rows)), motor, regulator


def test_only_what_is_asked_for_is_compiled(monkeypatch):
    asked = []

    def noted(key, build, name, brief):
        asked.append(key[0])
        return compiled(key, build, name, brief)

    made = Plant("station").program
    monkeypatch.setattr(program_module, "compiled", noted)
    program = program_module.Program(made.model)
    assert asked == ["plant"]
    simulate_all(program, trials(FEW))
    assert asked == ["plant", f"trials {simd_lanes()}"]
    simulate_all(program, trials(1))
    assert asked == ["plant", f"trials {simd_lanes()}", "trials 1"]
    simulate_all(program, trials(FEW + 1))
    assert len(asked) == 3


def test_a_trial_of_another_structure_is_refused():
    station, runs = Plant("station"), trials(2, "serres2008")
    with pytest.raises(ValueError, match="models of one structure .*simulate the other models in"):
        simulate_all(station.program, runs)
    (run,) = trials(1)
    run.motor = np.append(run.motor, 1.0)
    with pytest.raises(ValueError, match="must have one length; got "):
        simulate_all(station.program, [run])


def test_parameters_and_tolerance_compile_nothing():
    nominal = Plant("station")
    changed = Plant(load_model("station").replace({"slide.mass_kg": 0.7}), tolerance=1e-6)
    assert changed.program is nominal.program
    assert Plant("serres2008").program is not nominal.program
    assert np.any(changed.table != nominal.table)


def test_a_duration_that_means_nothing_is_refused():
    plant = Plant("station")
    rest = plant.settle(0.0, 300e3)
    for duration in (0.0, -0.01, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="duration must be a positive time in s"):
            plant.step(rest, 0.0, 5.0, duration)
    with pytest.raises(ValueError, match="motor_voltage must lie in 0 to 10 V, got nan"):
        plant.step(rest, float("nan"), 5.0, 0.01)


def run(code, **environment):
    """Standard output and error of a fresh interpreter, which must succeed."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


def test_a_cache_that_cannot_be_written_is_replaced_with_one_warning():
    code = (
        "from pma_gym.plant.plant import Plant\n"
        "for name in ('serres2008', 'station'):\n"
        "    plant = Plant(name)\n"
        "    print(plant.settle(0.0, 300e3).zero_contraction)\n"
        "import pma_gym.codegen.cache.compile_cache as c; print(c._store().folder.parent)"
    )
    out, error = run(code, PMA_GYM_CACHE="/proc/nope")
    first, _, folder = out.split()
    assert float(first) == pytest.approx(0.039774599, rel=1e-6)
    assert error.count("cannot write compiled plants to /proc/nope") == 1
    assert "set PMA_GYM_CACHE to a writable folder" in error
    assert not os.path.exists(folder)


def test_the_cache_is_where_it_was_asked_for_is_used_again_and_loads_nothing_heavy(tmp_path):
    code = (
        "import sys\n"
        "from pma_gym.plant.plant import Plant\n"
        "print(Plant('serres2008').program.library.was_kept)\n"
        "print([m for m in ('torch', 'matplotlib', 'control', 'sympy', 'stable_baselines3', "
        "'pandas', 'pyarrow', 'numba') if m in sys.modules])"
    )
    folder = tmp_path / "a" / "b"
    assert run(code, PMA_GYM_CACHE=str(folder))[0].split() == ["False", "[]"]
    kept = sorted(path for path in folder.rglob("*") if path.is_file())
    assert kept
    assert run(code, PMA_GYM_CACHE=str(folder))[0].split() == ["True", "[]"]
    assert sorted(path for path in folder.rglob("*") if path.is_file()) == kept


MODELS = ("serres2008", "station", "cascade")


@pytest.fixture(scope="module", params=MODELS)
def both(request):
    plant = Plant(request.param)
    return plant, PlainPlant(plant)


def test_rates_have_the_same_bits(both):
    plant, plain = both
    rest, generator = plant.settle(3.0, 330e3), np.random.default_rng(3)
    for _ in range(20):
        state = rest.state * (1.0 + 0.05 * generator.standard_normal(rest.state.shape))
        state += 1e-3 * generator.standard_normal(rest.state.shape)
        given = (state, *generator.uniform(0.0, 10.0, 2), rest.zero_contraction)
        np.testing.assert_array_equal(plain.derivative(*given), plant.derivative(*given))


def test_the_attempts_are_the_compiled_ones(both):
    plant, plain = both
    slow, fast = plant.settle(1.0, 350e3), plant.settle(1.0, 350e3)
    size = np.abs(fast.state) + 1e-6
    for motor in (1.5, 5.0, 0.3, 4.0):
        for _ in range(3):
            attempts = plain.attempts(slow, motor, 6.0, 0.01)
            lengths = [made.length for made in attempts if made.accepted]
            plant.step(fast, motor, 6.0, 0.01)
            assert sum(lengths) == pytest.approx(0.01, rel=1e-12)
            assert slow.time == pytest.approx(fast.time, rel=1e-12)
            # The same sizes, and so the same attempts.
            assert slow.size == pytest.approx(fast.size, rel=1e-5)
            size = np.maximum(size, np.abs(fast.state))
            assert np.all(np.abs(slow.state - fast.state) <= 1e-7 * size)


def test_the_text_is_plain_readable_python(both):
    _, plain = both
    compile(plain.text, "plain", "exec")
    for name in ("rates", "attempt"):
        assert f"def {name}(" in plain.text
        assert callable(getattr(plain.module, name))
    lines = plain.text.splitlines()
    assert max(len(line) for line in lines if not line.startswith(("def", "    return"))) < 200
