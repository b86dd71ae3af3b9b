"""The leaderboard: what it reads from rows, what it says of them, and what it refuses."""

import csv
import json
import math
import random

import numpy as np
import pytest
from typer.testing import CliRunner

import benchmarks.bounds as module
from benchmarks.__main__ import app
from benchmarks.report.errors import Measure, SuiteRecord, measures, pooled_measure
from benchmarks.report.leaderboard import Leaderboard, read_leaderboard
from benchmarks.report.page import page_blocks
from benchmarks.report.plots import profile_plot, styles_of
from benchmarks.report.publish import NUMBERS, PAGE, PAIRS, TEXT, numbers_csv, pairs_csv, run_report
from benchmarks.report.tables import spending
from benchmarks.runner.journal import JOURNAL, Journal
from benchmarks.runner.provenance import RUN
from benchmarks.suites.suite import Episode, SuiteError, parse_target
from controllers import CONTROLLERS
from pma_gym.pages.document import to_markdown
from pma_gym.pages.figures import picture_files
from tests.benchmarks.report.simulated_rows import (
    LEVELS,
    simulated_row,
    simulated_rows,
    simulated_suite,
)

RUN_AT = {"started": "today", "command": "python -m benchmarks run"}

INFO = {
    "contenders": {
        name: {"title": name.upper(), "source": name, "key": f"key-{name}", **RUN_AT}
        for name in LEVELS
    },
    "git": {"commit": "0123", "dirty": False},
    "versions": {"python": "3"},
    "platform": "somewhere",
    "processors": 2,
    "code": "abc",
}


@pytest.fixture(autouse=True)
def bounds(monkeypatch):
    """An oracle that may see, and a bound of phase III that takes no time."""
    monkeypatch.setitem(CONTROLLERS, "oracle", type("Seer", (), {"receive": None}))
    monkeypatch.setattr(module, "achievable_bound", lambda *given: {"III": 0.02})


def board(suite, rows):
    return Leaderboard(SuiteRecord.of(suite, rows), INFO)


def test_measures_keep_the_way_back_and_unseen_references_apart():
    named = measures(["displacement", "rotation", "rotation_sine", "isotonic", "triangle_low"])
    assert [(m.name, m.tasks, m.unit) for m in named] == [
        ("displacement", ("displacement",), "mm"),
        ("rotation I, II", ("rotation",), "deg"),
        ("rotation III", ("rotation",), "deg"),
        ("unseen rotation", ("rotation_sine",), "deg"),
        ("contraction", ("isotonic", "triangle_low"), "mm"),
    ]
    assert named[1].phases("rotation") == ["I", "II"]
    assert named[2].phases("rotation") == ["III"]
    # A regulator vents: its way back is like any other phase.
    assert named[4].phases("isotonic") == ["I", "II", "III"]


def test_error_of_a_row_is_the_rmse_of_its_phases_together():
    suite = simulated_suite()
    episode = Episode(0, "rotation", 275.0, 0)
    row = simulated_row(suite, "pid", episode, 1.0)
    row["phases"]["I"]["rmse"], row["phases"]["II"]["rmse"] = 0.3, 0.4
    there, back = (m for m in measures(["rotation"]))
    assert there.of_row(row) == pytest.approx(math.sqrt((0.3**2 + 0.4**2) / 2))
    assert back.of_row(row) == pytest.approx(0.9)
    assert pooled_measure(["rotation"]).of_row(row) == pytest.approx(there.of_row(row) / 0.9)


def test_a_failed_case_is_off_by_the_whole_range():
    suite = simulated_suite()
    for task, unit_range in (("displacement", 25.0), ("rotation", 90.0)):
        row = simulated_row(suite, "pid", Episode(0, task, 275.0, 0), 1.0, "it broke")
        assert measures([task])[0].of_row(row) == pytest.approx(unit_range)
        assert pooled_measure([task]).of_row(row) == pytest.approx(100.0)


@pytest.mark.campaign
def test_figures_do_not_depend_on_the_order_of_the_rows():
    suite = simulated_suite()
    rows = simulated_rows(suite)
    shuffled = random.Random(1).sample(rows, len(rows))
    boards = board(suite, rows), board(suite, shuffled)
    assert len({numbers_csv(each) for each in boards}) == 1
    assert len({pairs_csv(each) for each in boards}) == 1
    styles = styles_of(boards[0].labels)
    standings = [list(each.standings.values()) for each in boards]
    pictures = [picture_files({"": profile_plot(each, styles)}, vector=True) for each in standings]
    assert pictures[0] == pictures[1]
    assert [pictures[0][name][:5] for name in (".png", ".svg", ".pdf")] == [
        b"\x89PNG\r",
        b"<?xml",
        b"%PDF-",
    ]


def test_standings_find_who_is_better_and_by_how_much():
    suite = simulated_suite(stations=48)
    ranking = board(suite, simulated_rows(suite)).standings["displacement"]
    by_name = {row.name: row for row in ranking.rows}
    # The bound is last and has no rank; 0.9 and 1.0 are told apart, equals are not.
    assert ranking.rows[-1].name == "oracle"
    assert by_name["oracle"].rank is None
    assert by_name["mpc"].rank == (1, 1)
    assert by_name["pid"].rank == by_name["feedforward_pid"].rank == (2, 3)
    assert by_name["improved_feedforward"].rank == (4, 4)
    assert by_name["pid"].to_best.low < 1.0 / 0.9 < by_name["pid"].to_best.high
    assert by_name["pid"].to_bound.low < 2.0 < by_name["pid"].to_bound.high
    assert by_name["mpc"].to_best == (1.0, 1.0, 1.0)
    assert by_name["pid"].percent == pytest.approx(4.0 * by_name["pid"].mean.estimate)


def test_missing_and_incomplete_controllers_are_named_and_not_ranked():
    suite = simulated_suite()
    rows = [row for row in simulated_rows(suite) if row["controller"] != "mpc"]
    half = [row for row in rows if row["controller"] == "pid"][::2]
    kept = [row for row in rows if row["controller"] != "pid"] + half
    ranking = board(suite, kept)
    assert [entry.spec.name for entry in ranking.missing] == ["mpc"]
    ((entry, done, wanted),) = ranking.incomplete
    assert (entry.spec.name, done, wanted) == ("pid", len(half), len(suite.episodes))
    names = ranking.standings["displacement"].errors.names
    assert names == ("oracle", "feedforward_pid", "improved_feedforward")
    text = to_markdown(page_blocks(ranking), {}, "plots")
    assert "**Not run: MPC.**" in text
    assert f"PID ({len(half)} of {wanted} cases)" in text


def test_an_interrupted_run_compares_the_cases_that_all_have():
    suite = simulated_suite(targets=[{"figure": "best", "measure": "displacement", "most": 9.0}])
    rows = simulated_rows(suite)
    ranking = board(suite, rows[: len(rows) // 2 + 2])
    standings = ranking.standings["displacement"]
    assert standings.errors.names == tuple(LEVELS)
    assert 0 < len(standings.errors.episodes) < len(suite.episodes)
    # No verdict rests on a part of the cases.
    assert [check.word for check in ranking.verdicts] == ["no figure"]


def test_margins_and_bode_plots_are_of_what_ran():
    suite = simulated_suite()
    ran = [r for r in simulated_rows(suite) if r["controller"] == "pid" and r["task"] == "rotation"]
    ranking = board(suite, ran)
    assert list(ranking.loops) == ["rotation"]
    for condition in ranking.loops["rotation"]:
        assert {loop.name for loop in condition.everywhere} == {"pid"}
    text = to_markdown(page_blocks(ranking), {}, "plots")
    assert "Displacement: least margins" not in text and "Who differs" not in text


def test_rows_of_other_versions_and_unknown_episodes_do_not_count():
    suite = simulated_suite()
    rows = simulated_rows(suite)
    other = [row | {"version": 2} for row in rows] + [row | {"repeat": 7} for row in rows]
    assert not SuiteRecord.of(suite, other).rows
    assert len(SuiteRecord.of(suite, rows + other).rows) == len(rows)


def test_somebody_s_own_controller_is_ranked_with_the_others():
    suite = simulated_suite()
    mine = [simulated_row(suite, "Mine", episode, 0.01) for episode in suite.episodes]
    ranking = board(suite, simulated_rows(suite) + mine)
    assert ranking.standings["rotation III"].rows[0].name == "Mine"
    assert ranking.labels["Mine"] == "Mine"


def test_verdicts_say_what_was_asked_and_got():
    targets = [
        {"figure": "best", "measure": "displacement", "most": 0.03},
        {"figure": "largest", "measure": "rotation I, II", "most": 1e-3, "controllers": ["pid"]},
        {"figure": "best_to_bound", "measure": "all tasks", "most": 2.5},
        {"figure": "to_bound", "measure": "all tasks", "controllers": ["pid"]},
        {"figure": "above_bound", "measure": "rotation III", "most": 1, "controllers": ["pid"]},
        {"figure": "half_width", "measure": "displacement", "most": 1e-3},
        {"figure": "best", "measure": "contraction", "most": 1.0},
        {"figure": "ratio_half_width", "measure": "displacement", "most": 20.0},
    ]
    suite = simulated_suite(targets=targets)
    ranking = board(suite, simulated_rows(suite))
    words = [check.word for check in ranking.verdicts]
    assert words == ["met", "missed", "met", "—", "met", "missed", "no figure", "met"]
    assert "MPC" in ranking.verdicts[0].what
    ratio = ranking.verdicts[3].got
    assert ratio.low < 2.0 < ratio.high
    # Of those up to twice the best alone: not the feed-forward, which is far off.
    assert not ranking.verdicts[7].what.endswith("IMPROVED_FEEDFORWARD")
    assert [check.unit for check in ranking.verdicts[4:]] == ["deg", "%", "", "%"]
    # The bound is taken off at every pressure.
    largest = max(
        np.mean(ranking.standings["rotation III"].errors.of("pid")[at])
        for at in _by_pressure(ranking.standings["rotation III"].errors.episodes)
    )
    assert ranking.verdicts[4].got.estimate == pytest.approx(largest - 0.02)


def _by_pressure(episodes):
    pressures = sorted({episode.pressure_kpa for episode in episodes})
    return [[i for i, e in enumerate(episodes) if e.pressure_kpa == p] for p in pressures]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"figure": "smallest", "measure": "displacement"}, "figure must be one of"),
        ({"figure": "best", "measure": "x", "controllers": ["pid"]}, "must not name controllers"),
        ({"figure": "largest", "measure": "x"}, "must name controllers"),
        ({"figure": "best", "measure": "x", "limit": 1.0}, "unknown limit"),
    ],
)
def test_a_target_that_nobody_understands_is_refused(given, words):
    with pytest.raises(ValueError, match=words):
        parse_target(given)


def test_spending_leaves_failed_cases_out_and_counts_them():
    suite = simulated_suite()
    rows = simulated_rows(suite)
    ours = [row for row in rows if row["controller"] == "pid"]
    first = next(row for row in ours if row["task"] == "displacement")
    first["failure"] = "it broke"
    first["act_us"] = 1e9
    (spent,) = spending(SuiteRecord.of(suite, rows), Measure("", ("displacement",), "mm"), ["pid"])
    assert spent["failures"] == 1
    assert spent["act_us"] == 10.0
    # 10 ms of control period, 20 us of computing.
    assert spent["real_time_factor"] == pytest.approx(500.0)
    assert spent["saturated_percent"] == pytest.approx(1.0)


def write_run(tmp_path):
    """Write results of the simulated suite as a run leaves them, with a failed case."""
    suite = simulated_suite(targets=[{"figure": "best", "measure": "displacement", "most": 1.0}])
    rows = simulated_rows(suite)
    rows[3] = simulated_row(
        suite, "pid", Episode(*(rows[3][f] for f in Episode._fields)), 0.0, "it broke"
    )
    with Journal(tmp_path / JOURNAL) as journal:
        for row in rows:
            journal.append({"key": f"key-{row['controller']}"} | row)
    info = INFO | {"suite": {"name": suite.name, "digest": suite.digest, "version": 3}}
    (tmp_path / RUN).write_text(json.dumps(info))
    return suite, tmp_path


@pytest.fixture
def folder(tmp_path):
    """Results of the simulated suite."""
    return write_run(tmp_path)


def test_page_and_numbers_are_written(folder, tmp_path, monkeypatch):
    # Pictures of a third of the size are drawn in half the time.
    monkeypatch.setattr("pma_gym.pages.figures.DPI", 50)
    suite, results = folder
    out = tmp_path / "page"
    page, ranks, incomplete = run_report(suite, results, out, vector=True)
    assert page == out / PAGE and not incomplete
    assert "Displacement (mm)" in ranks.header
    column = ranks.header.index("Displacement (mm)")
    assert {row[column].partition(" [")[2] for row in ranks.rows} >= {"bound]"}
    written = {p.name: p.read_bytes() for p in out.rglob("*") if p.is_file()}
    names = {"distributions.png", "profiles.png", "pressures.png"}
    assert names <= set(written)
    assert {"loops_displacement.png", "loops_rotation.png", NUMBERS, PAIRS, TEXT} <= set(written)
    assert {name.replace(".png", form) for name in names for form in (".svg", ".pdf")} <= set(
        written
    )
    page = written[PAGE].decode()
    assert 'src="http' not in page
    assert page.count("data:image/png;base64") == 5
    assert "it broke" in page
    assert "digest abc, changed since" in page
    rows = list(csv.DictReader(written[NUMBERS].decode().splitlines()))
    assert {row["measure"] for row in rows} >= {"displacement", "rotation III", "all tasks"}
    pid = next(r for r in rows if (r["measure"], r["controller"]) == ("displacement", "pid"))
    standing = next(
        row
        for row in read_leaderboard(suite, results).standings["displacement"].rows
        if row.name == "pid"
    )
    assert float(pid["mean"]) == standing.mean.estimate
    assert float(pid["mean_low"]) == standing.mean.low


def test_results_of_another_suite_or_of_none_are_refused(folder, tmp_path):
    suite, results = folder
    with pytest.raises(SuiteError, match=r"has no results of suite simulated; make some"):
        read_leaderboard(suite, tmp_path / "nowhere")
    changed = simulated_suite(stations=17)
    with pytest.raises(SuiteError, match=r"with other numbers than simulated version 3 has now"):
        read_leaderboard(changed, results)


def test_command_says_what_is_missing():
    result = CliRunner().invoke(app, ["report", "nominal", "--results", "/nonexistent"])
    assert result.exit_code == 2
    assert "has no results of suite nominal" in result.stderr
