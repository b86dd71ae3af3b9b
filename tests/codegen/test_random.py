"""Random numbers: published vectors, exact functions, and the distributions."""

import math

import numpy as np
import pytest
from scipy import stats

from pma_gym.codegen.graph import CHANGING, Graph
from pma_gym.codegen.random import logarithm, normals, philox, sine_cosine, uniforms
from pma_gym.codegen.text import evaluate
from pma_gym.codegen.trace import operation_counts

FULL = 0xFFFFFFFF
# Random123's kat_vectors: counter, key, result.
VECTORS = [
    ((0,) * 4, (0,) * 2, (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((FULL,) * 4, (FULL,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]
COUNT = 100_000


@pytest.mark.parametrize(("counter", "key", "expected"), VECTORS)
def test_philox_gives_the_published_words(counter, key, expected):
    assert philox(counter, key) == expected
    arrays = philox(tuple(np.array([c], np.uint64) for c in counter), key)
    assert tuple(int(word[0]) for word in arrays) == expected


@pytest.fixture(scope="module")
def traced():
    """Words and normals of a counter, traced."""
    graph = Graph()
    counter = tuple(graph.input(name, CHANGING, "integer") for name in "abcd")
    words = philox(counter, (graph.input("k", CHANGING, "integer"), 7))
    return [*words, *normals(words)]


@pytest.fixture(scope="module")
def counters():
    draw = np.random.default_rng(3)
    return {name: draw.integers(0, 2**32, 64, np.uint64) for name in "abcdk"}


@pytest.mark.parametrize("width", [1, 8])
def test_python_and_compiled_code_draw_the_same_numbers(traced, counters, width, run_columns):
    columns = run_columns(traced, counters, width)
    for column, expected in zip(columns, evaluate(traced, counters), strict=True):
        np.testing.assert_array_equal(column, expected)
    plain = {name: [int(number) for number in numbers] for name, numbers in counters.items()}
    for i in range(64):
        words = philox(tuple(plain[name][i] for name in "abcd"), (plain["k"][i], 7))
        assert words == tuple(int(column[i]) for column in columns[:4])
        assert normals(words) == tuple(column[i] for column in columns[4:])


def test_drawing_calls_no_library_and_divides_twice(traced):
    counts = operation_counts(traced)
    assert (counts["divide"], counts["square_root"]) == (2, 2)


def test_the_logarithm_is_exact_to_1e_14():
    draw = np.random.default_rng(0)
    numbers = [*(1.0 - draw.uniform(0, 1, 2000) ** 6), *(2.0 ** -draw.uniform(0, 40, 2000))]
    numbers += [math.sqrt(2.0), math.sqrt(0.5), 1.0 - 2.0**-33, 2.0**-33, 2.0, 1e300, 1e-300]
    numbers = [number for number in numbers if number > 0.0]
    for number in numbers:
        assert logarithm(number) == pytest.approx(math.log(number), rel=1e-14, abs=1e-300)
    assert logarithm(1.0) == 0.0


def test_sine_and_cosine_are_exact_to_1e_14():
    turns = np.linspace(0.0, 1.0, 4097)
    sine, cosine = sine_cosine(turns)
    for i, turn in enumerate(turns):
        expected = math.sin(2.0 * math.pi * turn), math.cos(2.0 * math.pi * turn)
        np.testing.assert_allclose((sine[i], cosine[i]), expected, rtol=0, atol=1e-15)
        small = min(turn, abs(turn - 0.5), 1.0 - turn)
        assert abs(sine[i]) == pytest.approx(math.sin(2.0 * math.pi * small), rel=1e-14)
        small = min(abs(turn - 0.25), abs(turn - 0.75))
        if small < 0.125:
            assert abs(cosine[i]) == pytest.approx(math.sin(2.0 * math.pi * small), rel=1e-14)
    assert [float(v[0]) for v in sine_cosine(np.array([0.0]))] == [0.0, 1.0]
    np.testing.assert_allclose(sine**2 + cosine**2, 1.0, rtol=1e-15)


@pytest.fixture(scope="module")
def words():
    counter = (np.arange(COUNT, dtype=np.uint64), 1, 2, 3)
    return philox(counter, (12345, 678))


def test_uniforms_lie_between_0_and_1(words):
    assert uniforms((0, FULL, 0, FULL))[:2] == (2.0**-33, 1.0 - 2.0**-33)
    for column in uniforms(words):
        assert stats.kstest(column, "uniform").pvalue > 1e-3


def test_normals_are_normal_and_independent(words):
    columns = np.array(normals(words))
    for column in columns:
        assert stats.kstest(column, "norm").pvalue > 1e-3
    together = columns.ravel()
    size = together.size
    assert abs(together.mean()) < 4.0 / size**0.5
    assert abs(together.var() - 1.0) < 4.0 * (2.0 / size) ** 0.5
    assert abs(stats.skew(together)) < 4.0 * (6.0 / size) ** 0.5
    assert abs(stats.kurtosis(together)) < 4.0 * (24.0 / size) ** 0.5
    for bound in (3.0, 4.0):
        share = 2.0 * stats.norm.sf(bound)
        beyond = (np.abs(together) > bound).sum()
        assert abs(beyond - share * size) < 4.0 * (share * size) ** 0.5
    correlation = np.corrcoef(columns)
    assert np.abs(correlation - np.eye(4)).max() < 4.5 / COUNT**0.5
    assert np.abs(np.corrcoef(columns[:, 1:], columns[:, :-1])[:4, 4:]).max() < 4.5 / COUNT**0.5


def test_the_tails_end_where_the_words_do():
    far = normals((0, 0, 0, 0))[0]
    assert far == pytest.approx(math.sqrt(-2.0 * math.log(2.0**-33)), rel=1e-14)
    assert far < 6.77
