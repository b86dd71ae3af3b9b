"""The accuracy benchmark says what it measured."""

import io

from rich.console import Console

from benchmarks.accuracy import job


def test_the_report_names_states_prices_and_verdict(tmp_path, monkeypatch):
    monkeypatch.setattr(job, "MODELS", ("cascade",))
    monkeypatch.setattr(job, "PRESSURES", (350e3,))
    shown = io.StringIO()
    out = tmp_path / "accuracy.txt"
    assert job.run_accuracy(Console(file=shown, width=120), out)
    text = out.read_text(encoding="utf-8")
    assert text == shown.getvalue()
    for word in ("extension", "servo", "time (us)", "attempts", "one-mass form", "energy drift"):
        assert word in text
    for trial in ("demanding", "random", "gentle"):
        assert f"{trial}: right-hand sides" in text
    assert "Default tolerance" in text and ": limits met" in text
