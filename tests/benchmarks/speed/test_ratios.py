"""Ratios are taken within rounds; rows, peers, pins and targets fit together."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.speed.measure import Measured, spread
from benchmarks.speed.peers import PEERS
from benchmarks.speed.report.ratios import (
    CHECKS,
    TARGETS,
    Target,
    judge,
    judge_all,
    neighbours,
    wanted_rows,
)
from benchmarks.speed.report.tables import rate, three
from benchmarks.speed.rows import all_rows, matches, select

WORKERS = Path(__file__).parents[3] / "benchmarks" / "speed" / "workers"


def rows_of(rates):
    """Measured rows from rates by round."""
    by_key = {row.key: row for row in all_rows()}
    return {k: Measured(by_key[k], dict(enumerate(values))) for k, values in rates.items()}


def test_a_ratio_is_taken_within_rounds():
    target = Target("t", ("single/own",), 2.0, ("single/CartPole",))
    # A slow second round slows both; medians of the rates alone would say 30 / 12.
    rows = rows_of({"single/own": [30.0, 3.0, 40.0], "single/CartPole": [12.0, 1.0, 20.0]})
    verdict = judge(target, list(rows.values()))
    assert verdict.got == (2.25, 2.5, 2.75)
    assert (verdict.own, verdict.other) == ("single/own", "single/CartPole")
    assert verdict.word == "met"
    assert judge(replace(target, limit=2.6), list(rows.values())).word == "missed"


def test_rounds_that_only_one_row_has_do_not_count():
    rows = rows_of({"single/own": [2.0, 9.0], "single/CartPole": [1.0]})
    target = Target("t", ("single/own",), 2.0, ("single/CartPole",))
    assert judge(target, list(rows.values())).got == (2.0, 2.0, 2.0)


def test_the_fastest_of_several_is_what_counts():
    rows = rows_of(
        {"single/own": [60.0], "single/gem_Cont-CC-PMSM": [2.0], "single/gem_Finite-CC-PMSM": [3.0]}
    )
    verdict = judge(Target("t", ("single/own",), 30, ("single/gem_*",)), list(rows.values()))
    assert verdict.got == (20.0, 20.0, 20.0) and verdict.other == "single/gem_Finite-CC-PMSM"


def test_right_hand_sides_count_those_of_a_step():
    rows = rows_of({"batch/own/1024": [10.0], "batch/gymnax_CartPole/64": [100.0]})
    rows["batch/own/1024"].facts["right_hand_sides"] = 400.0
    target = Target("t", ("batch/own/1024",), 6, ("batch/gymnax_*",), "right_hand_sides")
    assert judge(target, list(rows.values())).got == (40.0, 40.0, 40.0)
    rows["batch/own/1024"].facts.clear()
    verdict = judge(target, list(rows.values()))
    assert verdict.word == "not measured" and "right-hand sides unknown" in verdict.absence


def test_a_time_has_an_upper_limit():
    target = Target("t", ("fits/own",), 15, (), "seconds")
    rows = rows_of({"fits/own": [0.1, 0.1]})
    assert judge(target, list(rows.values())).got == (10.0, 10.0, 10.0)
    assert judge(target, list(rows.values())).word == "met"
    assert judge(replace(target, limit=9), list(rows.values())).word == "missed"


def test_a_target_without_rows_is_not_told_one_without_figures_is():
    rows = rows_of({"single/own": [1.0], "single/CartPole": []})
    rows["single/CartPole"].give_up("no peer", broke=False)
    (verdict,) = judge_all(TARGETS, rows)
    assert verdict.word == "not measured" and verdict.absence == "CartPole-v1: no peer"


def test_spread_and_figures():
    assert spread([3.0]) == (3.0, 3.0, 3.0)
    assert spread([4.0, 1.0, 2.0, 3.0, 5.0]) == (2.0, 3.0, 4.0)
    assert [rate(x) for x in (1.234567e9, 999.6, 20e3, 0.5)] == [
        "1.23 G",
        "1.00 k",
        "20.0 k",
        "0.500",
    ]
    assert [three(x) for x in (1234.0, 99.96, 9.996, 0.0)] == ["1234", "100", "10.0", "0"]


def test_rows_peers_pins_and_targets_fit_together():
    rows = all_rows()
    keys = [row.key for row in rows]
    assert len(set(keys)) == len(keys)
    for row in rows:
        assert row.worker in PEERS
    for peer in PEERS.values():
        text = (WORKERS / f"serve_{peer.name}.py").read_text()
        for row in rows:
            if row.worker == peer.name:
                assert f'"{row.row}"' in text.partition("ROWS = ")[2]
        if peer.pins:
            pins = peer.pins.read_text().split()
            assert pins and all(re.fullmatch(r"[\w.-]+==[\w.]+", pin) for pin in pins)
    for target in (*TARGETS, *CHECKS):
        for pattern in (*target.own, *target.others):
            assert any(matches(key, pattern) for key in keys), pattern


def test_rows_are_chosen_by_what_their_keys_begin_with():
    rows = all_rows()
    assert {row.group for row in select("single, plant", rows)} == {"single", "plant"}
    assert [row.number for row in select("batch/own", rows)][:3] == [1, 4, 16]
    assert [row.key for row in select("single/own", rows)] == ["single/own"]
    assert len(select("", rows)) == len(rows)
    with pytest.raises(ValueError, match="--only: no row 'singel'; there are single/own, "):
        select("single,singel", rows)


def test_a_check_measures_only_what_it_compares():
    keys = wanted_rows(CHECKS, [row.key for row in all_rows()])
    assert {"batch/own/1024", "batch/own_two/1024", "single/own"} <= set(keys)
    assert all(key.split("/")[1].startswith("own") for key in keys)


def test_rows_whose_steps_are_compared_are_neighbours():
    keys = [row.key for row in all_rows()]
    groups = neighbours(TARGETS, keys)
    for target in TARGETS:
        if target.others and target.quantity == "steps":
            assert any(set(wanted_rows([target], keys)) <= set(group) for group in groups)
    grouped = [key for group in groups for key in group]
    assert len(grouped) == len(set(grouped))
    assert "batch/own_two/1024" in grouped and "batch/own/64" not in grouped
