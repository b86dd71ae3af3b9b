"""One text of each law, plain, compiled and in lanes; and where compiled code is kept."""

import os
import subprocess
import sys

import numpy as np
import pytest

from pma_gym.plant import compiled
from pma_gym.plant.plant import Plant


@pytest.mark.parametrize("model", ["serres2008", "station", "cascade"])
def test_plain_python_and_compiled_code_give_the_same_bits(model):
    fast, slow = Plant(model), Plant(model, compiled=False)
    when = 0.01 * np.arange(12)
    motor = np.array([1.0, 4.0, 4.0, 0.0, 0.0, 0.0, 6.0, 6.0, 5.0, 5.0, 5.5, 3.0])
    regulator = np.linspace(5.0, 7.0, 12)
    samples = np.zeros((2, 50, len(fast.states)))
    runs = [
        plant.run(when, motor, regulator, period=0.0026, samples=into)
        for plant, into in zip((fast, slow), samples, strict=True)
    ]
    assert runs[0][1] == runs[1][1]
    np.testing.assert_array_equal(runs[0][0], runs[1][0])
    np.testing.assert_array_equal(samples[0], samples[1])
    seen = [plant.observe(runs[0][0], runs[0][1]) for plant in (fast, slow)]
    for name in seen[0]:
        np.testing.assert_array_equal(seen[0][name], seen[1][name])


def run(code, **environment):
    """Standard error and output of a fresh interpreter, which must succeed."""
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
        "    plant = Plant(name, compiled=False)\n"
        "    print(plant.settle(0.0, 300e3).zero_contraction)\n"
        "import pma_gym.plant.compiled as c; print(c.cache_directory())"
    )
    out, error = run(code, PMA_GYM_CACHE="/proc/nope")
    first, _, folder = out.split()
    assert float(first) == pytest.approx(0.039774599, rel=1e-6)
    assert error.count("cannot write compiled plants to /proc/nope") == 1
    assert "set PMA_GYM_CACHE to a writable folder" in error
    assert not os.path.exists(folder)


def test_the_cache_is_where_it_was_asked_for_and_is_used_again(tmp_path):
    code = (
        "from pma_gym.plant.plant import Plant\n"
        "plant = Plant('serres2008')\n"
        "plant.derivative(plant.settle(0.0, 3e5).state, 0.0, 5.0, 0.0)\n"
        "print(sum(plant._module.derivative.stats.cache_hits.values()))"
    )
    assert run(code, PMA_GYM_CACHE=str(tmp_path / "a" / "b"))[0].split() == ["0"]
    kept = list((tmp_path / "a" / "b").glob("plant_*/plant_*.py"))
    assert len(kept) == 1
    assert run(code, PMA_GYM_CACHE=str(tmp_path / "a" / "b"))[0].split() == ["1"]
    assert list((tmp_path / "a" / "b").glob("plant_*/plant_*.py")) == kept


@pytest.mark.parametrize(
    "module",
    ["stiffness", "rotor", "sensors", "arithmetic"],
    ids=["a law", "a part without law", "a rate law", "arithmetic"],
)
def test_an_edit_of_any_text_that_a_plant_uses_makes_a_new_key(module, monkeypatch):
    station, cascade = (Plant(name, compiled=False).text for name in ("serres2008", "cascade"))
    before = compiled.key(station), compiled.key(cascade)
    assert before == (compiled.key(station), compiled.key(cascade))
    original = compiled._source

    def edited(source):
        changed = source.__name__ == f"pma_gym.effects.{module}"
        return original(source) + ("\n# edited" if changed else "")

    monkeypatch.setattr(compiled, "_source", edited)
    assert compiled.key(station) != before[0]
    # The cascade has no rotor.
    assert (compiled.key(cascade) == before[1]) == (module == "rotor")


def test_an_edit_elsewhere_keeps_the_key(monkeypatch):
    station = Plant("serres2008", compiled=False).text
    before, original = compiled.key(station), compiled._source
    monkeypatch.setattr(
        compiled,
        "_source",
        lambda module: original(module) + ("\n# edited" if "sarosi" in module.__name__ else ""),
    )
    assert compiled.key(station) == before


def test_importing_the_library_loads_nothing_heavy():
    code = (
        "import sys, pma_gym\n"
        "print([m for m in ('torch', 'matplotlib', 'control', 'sympy', 'stable_baselines3', "
        "'pandas', 'pyarrow') if m in sys.modules])"
    )
    assert run(code)[0].strip() == "[]"


def test_the_generated_module_is_plain_readable_python():
    plant = Plant("serres2008", compiled=False)
    compile(plant.text, "plant", "exec")
    assert max(len(line) for line in plant.text.splitlines()) < 1500
    assert "T = " not in plant.text
    assert plant.plain.rate.__name__ == "rate"
