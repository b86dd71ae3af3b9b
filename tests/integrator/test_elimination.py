"""Small systems of linear equations of a known structure."""

import numpy as np

from pma_gym.codegen.graph import CHANGING, Graph
from pma_gym.codegen.text import evaluate
from pma_gym.integrator.exponential_rosenbrock import solver


def test_elimination_solves_what_numpy_solves():
    generator = np.random.default_rng(2)
    for _ in range(20):
        graph, count = Graph(), 7
        part = float(10.0 ** generator.uniform(-7.0, 0.0))
        numbers = 0.3 * generator.standard_normal((count, count)) / count / part
        full = generator.uniform(size=(count, count)) < 0.4
        jacobian = [
            [graph.input(f"{i},{j}", CHANGING) if full[i, j] else None for j in range(count)]
            for i in range(count)
        ]
        right = [graph.input(f"{i}", CHANGING) if i % 3 else None for i in range(count)]
        solution = solver(jacobian, graph.input("part", CHANGING))(right)
        values = generator.standard_normal(count)
        given = {f"{i},{j}": numbers[i, j] for i in range(count) for j in range(count)}
        given |= {f"{i}": values[i] for i in range(count)} | {"part": part}
        matrix = np.eye(count) - part * np.where(full, numbers, 0.0)
        expected = np.linalg.solve(matrix, np.where(np.arange(count) % 3 > 0, values, 0.0))
        computed = [float(v) for v in evaluate(solution, given)]
        np.testing.assert_allclose(computed, expected, rtol=1e-12, atol=1e-14)
