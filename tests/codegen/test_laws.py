"""Every law of the catalogue: one graph, the same bits everywhere, and exact slopes."""

import platform

import numpy as np
import pytest

from pma_gym.codegen.derivative import derivatives
from pma_gym.codegen.graph import CHANGING, FIXED, Graph
from pma_gym.codegen.machine import native
from pma_gym.codegen.text import evaluate, python_text
from pma_gym.codegen.trace import operation_counts, order


def defined(text, name="law"):
    namespace = {}
    exec(compile(text, name, "exec"), namespace)
    return namespace[name]


def test_all_texts_and_all_widths_have_the_same_bits(case, run_columns):
    expected = evaluate(case.outputs, case.given)
    assert all(np.isfinite(column).all() for column in expected)
    if case.law is case.effect.rate:
        # Of each memory a source and a decay: none grows by itself.
        assert all((decay >= 0.0).all() for decay in expected[1::2])
    columns = [case.given[value.data] for value in case.inputs]
    one = defined(python_text(case.outputs, case.inputs, "law"))
    plain = [one(*map(float, row)) for row in zip(*columns, strict=True)]
    np.testing.assert_array_equal(np.transpose(plain), expected)
    many = defined(python_text(case.outputs, case.inputs, "law", arrays=True))
    np.testing.assert_array_equal(many(*columns), expected)
    for width in (1, 8, 16):
        np.testing.assert_array_equal(run_columns(case.outputs, case.given, width), expected)


def test_an_old_processor_gives_the_same_bits(case, run_columns, monkeypatch):
    if platform.machine().lower() not in ("x86_64", "amd64"):
        pytest.skip("names an x86 processor")
    monkeypatch.setattr(native, "host", lambda: ("x86-64", ""))
    monkeypatch.setattr(native, "_machine", native._new_machine)
    columns = run_columns(case.outputs, case.given, 8)
    np.testing.assert_array_equal(columns, evaluate(case.outputs, case.given))


def test_the_graph_is_the_law_to_a_few_roundings(case):
    computed = evaluate(case.outputs, case.given)
    for i in range(case.count):
        for output, expected in zip(computed, case.plain(i), strict=True):
            # Sums cancel; what they are made of is known from the largest of them.
            scale = np.abs(output).max()
            assert output[i] == pytest.approx(expected, rel=1e-12, abs=1e-13 * scale)


def test_divisions_by_parameters_happen_once_for_a_model(case):
    for value in order(case.outputs):
        if value.operation == "divide":
            assert value.operands[1].level == value.level


def test_derivatives_are_central_differences(case):
    slopes = derivatives(case.outputs, case.inputs)
    conditions = [value for value in order(case.outputs) if value.kind == "truth"]
    known = [[s for s in row if s is not None] for row in slopes]
    flat = [s for row in known for s in row]
    numbers = dict(
        zip((s.id for s in flat), evaluate(flat, case.given), strict=True) if flat else ()
    )
    for j, by in enumerate(case.inputs):
        at = case.given[by.data]
        # Of a ripple a step is a small part of a period.
        fine = 1e-2 if any("periods" in name for name in case.given) else 1.0
        step = 1e-4 * fine * np.maximum(np.abs(at), 1e-3 * np.abs(at).max())
        shifted = [{**case.given, by.data: at + k * step} for k in (-2, -1, 1, 2)]
        runs = [evaluate([*case.outputs, *conditions], given) for given in shifted]
        truths = np.array([r[len(case.outputs) :] for r in runs])
        # Where a choice falls the same way on all sides.
        smooth = (truths == truths[0]).all(axis=(0, 1)) if conditions else np.ones(case.count, bool)
        assert smooth.sum() > case.count / 2
        for i, slope in enumerate(row[j] for row in slopes):
            a, b, c, d = (r[i] for r in runs)
            # Roundings of x + h count too.
            expected = (a - 8.0 * b + 8.0 * c - d) / (12.0 * step)
            noise = 1e-11 * np.maximum.reduce([np.abs(r[i]) for r in runs]) / step
            computed = np.zeros(case.count) if slope is None else numbers[slope.id]
            computed = np.broadcast_to(computed, case.count)
            wrong = np.abs(computed - expected) - 1e-7 * np.abs(expected) - noise
            assert (wrong[smooth] <= 1e-12 * np.abs(expected).max()).all(), (by.data, i)


def test_fused_code_is_near_and_the_same_in_every_width(case, run_columns):
    exact = evaluate(case.outputs, case.given)
    scalar, vector = (run_columns(case.outputs, case.given, w, fused=True) for w in (1, 8))
    np.testing.assert_array_equal(scalar, vector)
    for computed, expected in zip(scalar, exact, strict=True):
        np.testing.assert_allclose(
            computed, expected, rtol=1e-9, atol=1e-10 * np.abs(expected).max()
        )


def test_single_precision_is_near(case, run_columns):
    exact = evaluate(case.outputs, case.given)
    scalar, vector = (run_columns(case.outputs, case.given, w, real="float") for w in (1, 16))
    np.testing.assert_array_equal(scalar, vector)
    for computed, expected in zip(scalar, exact, strict=True):
        bound = 2e-3 * np.abs(expected).max()
        assert np.median(np.abs(computed - expected)) <= bound


def test_counts_are_of_each_operation_once():
    graph = Graph()
    x, p = graph.input("x", CHANGING), graph.input("p", FIXED)
    outputs = [x / p + x * x, (x * x) ** 0.5, abs(x)]
    assert operation_counts(outputs, CHANGING) == {
        "add": 1,
        "multiply": 2,
        "divide": 0,
        "square_root": 1,
        "choose": 1,
        "integer": 0,
    }
    assert operation_counts(outputs)["divide"] == 1
    assert operation_counts(outputs, FIXED)["divide"] == 1
