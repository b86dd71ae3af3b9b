"""The accuracy benchmark says what it measured."""

import io

from rich.console import Console

from benchmarks import accuracy


def test_the_report_names_states_steps_and_verdict(tmp_path, monkeypatch):
    monkeypatch.setattr(accuracy, "MODELS", ("cascade",))
    monkeypatch.setattr(accuracy, "PRESSURES", (350e3,))
    shown = io.StringIO()
    out = tmp_path / "accuracy.txt"
    assert accuracy.run_accuracy(Console(file=shown, width=120), out)
    text = out.read_text(encoding="utf-8")
    assert text == shown.getvalue()
    for word in ("extension", "servo", "us per 10 ms", "0.1 ms", "one-mass form", "energy drift"):
        assert word in text
    assert "Default step 0.1 ms: limits met" in text
    # A step four times as large misses, and says so.
    limits = next(line for line in text.splitlines() if "limits" in line and "met" in line)
    assert limits.index("missed") < limits.index(" met")
