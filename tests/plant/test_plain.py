"""The step in plain Python: what is compiled, to be read and debugged."""

import numpy as np
import pytest

from pma_gym.integrator.step_attempt import first_size
from pma_gym.plant.forms.plain import PlainPlant
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import FIRST_S

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


def test_an_attempt_tells_what_it_was(both):
    plant, plain = both
    rest = plant.settle(1.0, 350e3)
    made = list(plain.attempts(rest, 4.0, 6.0, 0.01))
    rejected = [one for one in made if not one.accepted]
    assert 2 < len(made) < 60
    assert made[0].proposed == first_size(FIRST_S, 3.0)
    assert made[0].left == 0.01
    for before, after in zip(made[:-1], made[1:], strict=True):
        assert after.proposed == before.size
        if not before.accepted:
            assert after.left == before.left
            assert after.proposed < before.length
    assert len(rejected) < len(made) / 2
    assert sum(one.length for one in made if one.accepted) == pytest.approx(0.01)
