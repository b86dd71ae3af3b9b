"""`python -m benchmarks hidden-effects`: goes on where it stopped, the same on two processes."""

import json
import re

import pytest
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.hidden_effects import run_blocks
from benchmarks.hidden_effects.evaluation import scoring
from benchmarks.hidden_effects.evaluation.records import measured_text, method_digest
from benchmarks.hidden_effects.evaluation.targets import RATES
from benchmarks.hidden_effects.evaluation.verdicts import compare, no_answer
from benchmarks.hidden_effects.generation.cases import BLOCKS, Block
from benchmarks.hidden_effects.generation.effects import KINDS
from benchmarks.hidden_effects.run_blocks import JobError, Order, run_block
from tests.benchmarks.hidden_effects.cheap_diagnosis import by_size, document

TINY = Block("nothing", trials=3, seconds=2.0)


class Interrupting:
    """A diagnosis that Ctrl-C stops at some case."""

    def __init__(self, last):
        self.left = last

    def __call__(self, folder):
        self.left -= 1
        if self.left < 0:
            raise KeyboardInterrupt
        return by_size(folder)


def order(folder, **more):
    return Order(
        **({"block": TINY, "count": 3, "seed": 4, "folder": folder, "judge": by_size} | more)
    )


def timeless(figures):
    """Figures without how long it took, which alone may differ."""
    return {
        **figures,
        "blocks": {k: {**v, "seconds": None} for k, v in figures["blocks"].items()},
    }


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A set that ran through in one process: its folder and figures."""
    folder = tmp_path_factory.mktemp("whole")
    return folder, run_block(order(folder))


def test_an_interrupted_run_keeps_its_cases_and_goes_on_to_the_same_figures(
    whole, tmp_path, capsys
):
    assert run_block(order(tmp_path, judge=Interrupting(2))) is None
    assert "2 of 3 cases" in capsys.readouterr().err
    kept = sorted((tmp_path / "cases").iterdir())
    assert [path.name for path in kept] == ["case_0001.json", "case_0002.json"]
    before = [path.stat().st_mtime_ns for path in kept]
    again = run_block(order(tmp_path))
    assert [path.stat().st_mtime_ns for path in kept] == before
    assert again is not None and timeless(again) == timeless(whole[1])
    assert timeless(json.loads((tmp_path / "score.json").read_text("utf-8"))) == timeless(again)


def test_a_larger_set_has_the_same_first_cases(whole, tmp_path):
    run_block(order(tmp_path, count=1))
    first = json.loads((tmp_path / "cases" / "case_0001.json").read_text("utf-8"))
    there = json.loads((whole[0] / "cases" / "case_0001.json").read_text("utf-8"))
    assert first["truth"] == there["truth"] and first["answer"] == there["answer"]


def test_what_raises_counts_as_unanswered_and_is_shown(whole, capsys):
    figures = whole[1]["blocks"]["nothing"]
    run_block(order(whole[0]))
    assert "3 are done" in capsys.readouterr().err
    silent = figures["unanswered"]
    assert silent and all(each["sentence"] == "ValueError: an odd file" for each in silent)
    alarm = figures["rates"]["false alarm"]
    assert alarm["n"] == 3 and alarm["hits"] == 3 - len(silent)


def test_trials_are_kept_on_demand(tmp_path):
    run_block(order(tmp_path, count=1, keep=True))
    assert (tmp_path / "data" / "cases" / "case_0001" / "dataset.toml").is_file()


def code_of_first(folder):
    return json.loads((folder / "cases" / "case_0001.json").read_text("utf-8"))["code"]


def test_records_of_other_code_are_used_unless_made_anew(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(run_blocks, "fingerprint", lambda: "older")
    run_block(order(tmp_path, count=1))
    monkeypatch.setattr(run_blocks, "fingerprint", lambda: "newer")
    records = run_block(order(tmp_path, count=1))
    assert records is not None and code_of_first(tmp_path) == "older"
    assert "1 of them by other code" in capsys.readouterr().err
    records = run_block(order(tmp_path, count=1, recompute=True))
    assert records is not None and code_of_first(tmp_path) == "newer"


def test_a_folder_holds_one_set(whole):
    with pytest.raises(JobError, match="holds block nothing of seed 4, not nothing of seed 5"):
        run_block(order(whole[0], seed=5))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--block", "sinlge", "--n", "1"], "--block sinlge: no such block; choose single, faint"),
        (["--block", "single", "--n", "0"], "greater than or equal to 1"),
        (["--block", "single", "--n", "1", "--out", "{0}/file"], "file is a file; name a folder"),
    ],
)
def test_refuses_before_anything_is_computed(arguments, message, tmp_path):
    (tmp_path / "file").touch()
    given = [each.format(tmp_path) for each in arguments]
    done = CliRunner().invoke(app, ["hidden-effects", *given])
    assert done.exit_code == 2
    assert message.format(tmp_path) in re.sub(r"\s*[│\n]\s*", " ", done.output)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def truth(block, *effects, **more):
    hidden = [{"name": n, "parameters": p, "r": r} for n, p, r in effects]
    return {"block": block, "effects": hidden, "base_factors": {}, "number": 1} | more


def test_rates_stand_beside_their_targets():
    creep = ("creep", {"time_constant_s": 2.0, "stiffness_n_per_mm": 0.5}, 1.0)
    fitted = {"time_constant_s": {"value": 2.2, "low": 1.9, "high": 2.5}}
    right = compare(truth("single", creep), document("effect", ("creep", fitted)))
    wrong = compare(truth("single", creep), document("effect", ("filling", {})))
    weak = compare(truth("single", (*creep[:2], 0.2)), document("agrees"))
    silent = compare(truth("single", creep), no_answer("ValueError: no"))
    figures = scoring.count([right] * 96 + [wrong, weak, silent, silent])["blocks"]["single"]
    named = figures["rates"]["named right"]
    assert (named["hits"], named["n"], named["target"], named["met"]) == (96, 100, ">= 0.92", True)
    assert figures["rates"]["right or in its group"]["met"] is False
    assert figures["rates"]["confidently wrong"]["met"] is True
    assert figures["sizes"]["median_error"]["value"] == pytest.approx(0.1)
    assert figures["sizes"]["median_error"]["met"] is False
    assert figures["sizes"]["covered"]["hits"] == 96
    assert [miss["said"] for miss in figures["misses"]] == ["filling", "agrees", *["no answer"] * 2]


def test_parameters_count_as_named_only_where_they_moved():
    off = truth("parameters", base_factors={"radius": 1.12})
    named = document("parameters") | {"parameters": {"rotor.radius_mm": {"significant": True}}}
    other = document("parameters") | {"parameters": {"slide.mass_kg": {"significant": True}}}
    answer = document("parameters") | {"not_identifiable": {"rotor.radius_mm": "constant"}}
    first, second, third = (compare(off, each) for each in (named, other, answer))
    assert first.parameters and not first.parameters_spurious
    assert second.parameters is False and second.parameters_spurious
    assert third.parameters is False and third.parameters_reported


def test_every_block_has_its_rates_and_effects_take_turns():
    assert list(BLOCKS) == list(RATES)
    assert BLOCKS["single"].turns == tuple(KINDS) == BLOCKS["faint"].turns


def test_a_page_has_every_block_once(whole, tmp_path):
    score = whole[0] / "score.json"
    call = ["hidden-effects-report", str(whole[0])]
    text = CliRunner().invoke(app, call).stdout
    alarm = whole[1]["blocks"]["nothing"]["rates"]["false alarm"]
    assert re.search(
        rf"nothing *\| *false alarm *\| .*{alarm['hits']} of 3 *\| *<= 0.01 *\| *missed", text
    )
    assert CliRunner().invoke(app, [*call, "--out", str(tmp_path / "page.html")]).exit_code == 0
    assert "false alarm" in (tmp_path / "page.html").read_text("utf-8")
    # As JSON it can be read again, and says the same.
    kept = tmp_path / "kept.json"
    assert CliRunner().invoke(app, [*call, "--out", str(kept)]).exit_code == 0
    assert CliRunner().invoke(app, ["hidden-effects-report", str(kept)]).stdout == text
    twice = CliRunner().invoke(app, [*call, str(score)])
    assert twice.exit_code == 2 and "block nothing is in 2 of the files" in twice.stderr
    torn = CliRunner().invoke(app, ["hidden-effects-report", str(tmp_path / "page.html")])
    assert torn.exit_code == 2 and "page.html is no JSON file" in torn.stderr
    nowhere = CliRunner().invoke(app, ["hidden-effects-report", str(tmp_path)])
    assert nowhere.exit_code == 2 and "there is no such file" in nowhere.stderr


def test_figures_say_what_measured_them_and_that_the_method_has_changed_since(whole, tmp_path):
    old, new = ({"commit": "1234abcd", "date": "2026-11-22", "method": m} for m in "ab")
    same = "Measured by `1234abcd` on 2026-11-22"
    assert measured_text([old, old], "a") == f"{same}."
    for some in ([old], [old, new]):
        assert measured_text(some, "b").endswith(
            " on 2026-11-22; **the method has changed since**."
        )
    (now,) = whole[1]["blocks"]["nothing"]["measured"]
    assert now["method"] == method_digest() and "changed" not in measured_text([now])
    source = tmp_path / "pma_gym" / "discovery" / "fit.py"
    source.parent.mkdir(parents=True)
    source.write_text("a = 1")
    before = method_digest(tmp_path)
    source.write_text("a = 2")
    assert method_digest(tmp_path) != before
