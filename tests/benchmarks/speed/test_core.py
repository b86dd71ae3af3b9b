"""What a core can do, beside what a control step takes."""

import gymnasium as gym
import pytest

from benchmarks.speed.core import CHAINS, OPERATIONS, REPEATS, core, counted
from benchmarks.speed.report.tables import speed_tables
from benchmarks.speed.rows import CORE, EVALUATIONS
from pma_gym.codegen.graph import CHANGING
from pma_gym.codegen.machine.native import simd_lanes
from pma_gym.codegen.trace import order
from pma_gym.engine.cpu.step_writer import Writer


def row(key, per_second, facts=None, right_hand_sides=None):
    return {
        "key": key,
        "group": key.partition("/")[0],
        "title": key,
        "number": 1024 if key.startswith("batch") else None,
        "step": "",
        "rounds": [1],
        "median": per_second,
        "lower_quartile": per_second,
        "upper_quartile": per_second,
        "facts": facts or {},
        "right_hand_sides_per_step": right_hand_sides,
        "left_out": None,
    }


def test_every_sort_is_measured():
    assert set(CORE) == set(OPERATIONS)


@pytest.mark.parametrize("operation", OPERATIONS)
def test_a_core_counts_all_lanes_of_all_chains(operation):
    prepared = core(operation)
    assert prepared.chunk() == prepared.chunk() == REPEATS * CHAINS * simd_lanes()
    assert prepared.facts()["in_attempt"] == counted()[0][operation]


def test_the_instructions_are_the_graphs_operations():
    env = gym.make_vec(
        "pma_gym/IsokineticDisplacement-v0",
        num_envs=simd_lanes(),
        vectorization_mode="vector_entry_point",
    )
    writer = Writer(env.unwrapped.engine.kernel)
    outputs = [*writer.layout.outputs, *writer.extra]
    sorts = [v.operation for v in order(outputs) if v.level == CHANGING]
    instructions, flops = counted()
    assert instructions["divide"] == sorts.count("divide")
    assert instructions["square_root"] == sorts.count("square_root")
    real = [v for v in order(outputs) if v.level == CHANGING and v.kind == "real"]
    sums = sum(v.operation in ("add", "subtract", "multiply") for v in real)
    # A multiply-add is one instruction and two operations, whatever was put together.
    assert instructions["multiply_add"] < sums
    assert (
        instructions["multiply_add"] + instructions["divide"] + instructions["square_root"] < flops
    )
    env.close()


def test_the_longest_time_of_the_three_is_the_limit():
    attempts = 20.0
    rows = [
        row("batch/own/1024", 1e6, right_hand_sides=attempts * EVALUATIONS),
        row("core/multiply_add", 4e10, {"in_attempt": 700, "flops": 1000}),
        row("core/divide", 2e9, {"in_attempt": 10, "flops": 1000}),
    ]
    (table,) = (v for v in speed_tables({"rows": rows, "ratios": []}) if v.name == "arithmetic")
    times = [cells[4] for cells in table.rows]
    assert times == ["350 ns", "100 ns", "1000 ns"]
    assert table.rows[-1][-1] == "35 % of the limit"
    assert table.rows[-1][1:4] == ["1000", "20.0 k", "20.0 G"]


def test_there_is_no_such_table_without_the_batch():
    rows = [row("core/divide", 2e9, {"in_attempt": 10, "flops": 1000})]
    assert all(table.name != "arithmetic" for table in speed_tables({"rows": rows, "ratios": []}))
