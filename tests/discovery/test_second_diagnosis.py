"""A second diagnosis, of the amended model: it finds nothing more, and moves nothing."""

import pytest

from pma_gym.discovery.workflow import diagnose
from pma_gym.plant.model import dump_model, load_model
from tests.discovery.laboratory import diagnosed, laboratory


def test_a_second_diagnosis_changes_nothing_beyond_the_first_ones_intervals(tmp_path):
    first = diagnosed("hysteresis")
    (tmp_path / "model.toml").write_text(dump_model(first.model), encoding="utf-8")
    amended = load_model(tmp_path / "model.toml")
    second = diagnose(laboratory("hysteresis")[0], amended, propose=False)
    assert first.verdict == "effect"
    assert second.verdict == "agrees", second.sentence
    assert second.effects == () and second.model == amended
    for path, moved in second.parameters.items():
        note = first.model.notes[path]
        assert note.low <= moved.now.value <= note.high, path
    for signal, gap in second.gap.items():
        assert gap.after == pytest.approx(first.written[signal], rel=0.01), signal
