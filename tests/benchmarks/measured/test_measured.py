"""The dissertation's tables as trials and their diagnosis in rounds."""

from io import StringIO
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.measured import diagnose_tables
from benchmarks.measured import rounds as of_rounds
from benchmarks.measured.diagnose_tables import (
    DIAGNOSED_KPA,
    UNSEEN_KPA,
    Measured,
    diagnosed,
    write_trials,
)
from benchmarks.measured.held_out import (
    limit_errors,
    repeat_scatter,
    rms,
    worked,
)
from benchmarks.measured.pages import measured_page, print_measured
from benchmarks.measured.rounds import Round, Stages, rounds
from benchmarks.measured.steps import Step
from benchmarks.measured.tables import COLUMNS
from benchmarks.measured.trials import measured_dataset
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.data.files.trial_files import TrialWarning
from pma_gym.data.serres2008 import load_table
from pma_gym.discovery.result.candidate import ADDED
from pma_gym.plant.model import load_model


@pytest.fixture(scope="module")
def every():
    return measured_dataset()


def named(data, name):
    return next(each for each in data.trials if each.name == name)


def test_every_row_is_a_trial_and_every_no_load_contraction_is_in_one(every):
    kinds = [each.name.split("_")[0:2] for each in every.trials]
    walks = [each for each in every.trials if "noload" in each.name]
    assert len(kinds) == 396 + 116 + 36
    read = np.concatenate([each.trial.measurements["contraction"] for each in walks])
    printed = load_table("I3")["no_load_contraction_mm"]
    assert np.sort(read[np.isfinite(read)]) == pytest.approx(np.sort(printed) * 1e-3)


def test_a_row_is_read_where_it_was(every):
    """150 kPa, 75 N, first repeat: 27.5 mm, pulled out by 4.7 mm at 10 s, all back at 15 s."""
    each = named(every, "I3_150kPa_75N_1.csv")
    contraction = each.trial.measurements["contraction"] * 1e3
    assert contraction[[0, 2, 3]] == pytest.approx([27.5, 22.8, 27.5])
    assert np.isnan(contraction[1])
    assert np.rad2deg(each.trial.measurements["rotation"][[0, 2, 3]]) == pytest.approx(
        [0.0, 11.2, 0.9]
    )
    assert each.trial.time.tolist() == [0.0, 5.0, 10.0, 15.0]
    assert each.trial.commands["motor_voltage"].tolist() == [0.0, 0.76, 0.76, 0.0]
    third = named(every, "I3_150kPa_75N_3.csv")
    assert (each.order, each.repeat_of) == (0.0, None)
    assert (third.order, third.repeat_of) == (2.0, each.name)


def test_the_three_element_model_misses_extension_by_a_centimetre(every):
    """physics.md, section 4: 9.9 mm, against 0.65 mm between repeats."""
    errors = limit_errors(load_model("serres2008"), every)
    assert rms(errors["extension_mm"]) == pytest.approx(9.9, abs=0.1)
    assert len(errors["extension_mm"]) == 396
    assert repeat_scatter(every)["extension_mm"] == pytest.approx(0.62, abs=0.05)
    assert rms(limit_errors(load_model("station"), every)["extension_mm"]) < 1.2


def test_what_is_diagnosed_holds_no_pressure_that_it_is_judged_on():
    assert not set(DIAGNOSED_KPA) & set(UNSEEN_KPA)
    assert len(DIAGNOSED_KPA) + len(UNSEEN_KPA) == 11
    for each in diagnosed(DIAGNOSED_KPA).trials:
        assert not any(f"_{pressure:.0f}kPa" in each.name for pressure in UNSEEN_KPA)


def test_written_trials_are_read_again(tmp_path):
    count = write_trials(tmp_path / "trials")
    with pytest.warns(TrialWarning, match="not measured"):
        data = read_dataset(tmp_path / "trials")
    assert len(data) == count == 6 * 18 + 18 + 5
    assert data.model == "serres2008"
    one = named(data, "I3_150kPa_150N_3.csv")
    assert one.repeat_of == "I3_150kPa_150N_1.csv"
    ours = named(diagnosed(DIAGNOSED_KPA), one.name).trial.measurements["contraction"]
    assert one.trial.measurements["contraction"] == pytest.approx(ours, nan_ok=True)


def candidate(name, why=ADDED):
    return SimpleNamespace(name=name, why=why, p_value=0.001, delta_log_likelihood=9.0)


def answer(model, effect=None, verdict="effect"):
    return SimpleNamespace(
        verdict=verdict,
        sentence="",
        effects=[],
        candidates=[candidate("creep", "chance")] + ([candidate(effect)] if effect else []),
        not_detectable=("creep",),
        next_experiment=None,
        gap={},
        seconds={},
        model=model,
    )


@pytest.fixture
def asked(monkeypatch):
    """Diagnoses of which the first finds slack, the second nothing; and who asked with what."""
    models = []

    def diagnose(data, model, **_):
        models.append(model)
        if model.parameters["cable"].slack == 0.0:
            return answer(model.replace({"cable.slack_mm": 1.0}), "cable_slack")
        return answer(model, verdict="agrees")

    monkeypatch.setattr(of_rounds, "diagnose", diagnose)
    return models


def diagnose_small(folder, code="this", recompute=False):
    """Rounds of a few trials, by some code; and what it took."""

    def silent(*_):
        """No progress."""

    data = measured_dataset((150.0,), (75.0,), steps=0)
    stages = Stages(folder, recompute, code)
    messages = stages.others()
    return (
        *rounds((data,), load_model("serres2008"), stages, 0, 1, lambda _: silent),
        stages,
        messages,
    )


def test_each_round_begins_with_what_the_one_before_amended(tmp_path, asked):
    rounds, model, _, messages = diagnose_small(tmp_path)
    assert [each.effects for each in rounds] == [("cable_slack",), ()]
    assert model.parameters["cable"].slack == pytest.approx(1e-3)
    assert len(asked) == 2 and not messages
    again, same, stages, messages = diagnose_small(tmp_path)
    assert len(asked) == 2, "a finished round is not asked again"
    assert (again[0].effects, again[1].verdict) == (["cable_slack"], "agrees")
    assert same.parameters == model.parameters
    assert stages.codes == {"this": 2} and not messages


def test_rounds_of_other_code_are_told_and_used_unless_made_anew(tmp_path, asked):
    diagnose_small(tmp_path, "older")
    *_, stages, messages = diagnose_small(tmp_path, "newer")
    assert len(asked) == 2 and stages.codes == {"older": 2}
    assert messages == (
        f"2 of 2 stages kept in {tmp_path} are by other code than this "
        "(--recompute makes those anew)"
    )
    *_, stages, messages = diagnose_small(tmp_path, "newer", recompute=True)
    assert len(asked) == 4 and stages.codes == {"newer": 2} and not messages
    *_, stages, messages = diagnose_small(tmp_path, "newer", recompute=True)
    assert len(asked) == 4 and stages.codes == {"newer": 2}, "an interrupted --recompute goes on"


def test_a_stage_answers_its_own_question_and_has_what_it_needs(tmp_path):
    stages = Stages(tmp_path, code="this")
    stages.keep("step_1", "question", {"fitted": 1.5})

    def made(fitted):
        return fitted

    def made_otherwise(fitted, judged):
        """A stage of which other code keeps more."""

    assert stages.kept("step_1", "question", made) == 1.5
    assert stages.kept("step_1", "another", made) is None
    assert stages.kept("step_2", "question", made) is None
    assert stages.kept("step_1", "question", made_otherwise) is None


def test_fits_of_other_code_do_not_go_into_a_diagnosis(tmp_path):
    older, newer = Stages(tmp_path, code="older"), Stages(tmp_path, code="newer")
    assert older.journal != newer.journal


def test_the_command_says_what_is_to_be_made_anew(tmp_path, monkeypatch):
    orders = []
    monkeypatch.setattr(
        diagnose_tables, "run_measured", lambda *_, recompute: orders.append(recompute)
    )
    for options in ([], ["--recompute"]):
        done = CliRunner().invoke(app, ["measured", "--out", str(tmp_path), *options])
        assert done.exit_code == 0, done.output
    assert orders == [False, True]


def test_a_worked_muscle_has_no_warmth_left():
    warm = {"force_n": 100.0, "fade_kpa": 100.0, "repeats": 1.0, "repeat": 0.0}
    model = load_model("serres2008").with_effects({"warm_up": warm})
    assert worked(model).parameters["warm_up"].repeat == 1000.0
    assert worked(load_model("station")).parameters == load_model("station").parameters


def step(name, effects, error):
    figures = {key: error for key, _ in COLUMNS}
    phases = [
        {"phase": phase, "slope": 0.1, "intercept": 0.2, "mean": error, "mean_signed": -error,
         "rmse": 0.3, "trials": 9}
        for phase in ("displacement", "I", "II", "III")
    ]  # fmt: skip
    return Step(name, effects, figures, figures, phases, "")


def test_the_page_and_the_tables_say_what_was_found():
    result = Measured(
        rounds=[
            Round(47, "effect", "It is creep.", ("creep",), {"creep": 0.001},
                  [("hysteresis", 5.0, 0.001, "explains these data as well as creep")],
                  (), None, {}),
            Round(47, "agrees", "Nothing more.", (), {}, [], (), None, {}),
        ],
        steps=[step("as given", (), 9.9), step("creep", ("creep",), 0.7)],
        folds={key: 0.8 for key, _ in COLUMNS},
        floors={key: 0.6 for key, _ in COLUMNS},
        seconds=1.0,
        settings={"model": "serres2008"},
    )  # fmt: skip
    said = StringIO()
    print_measured(result, Console(file=said))
    page = measured_page(result)
    for text in (said.getvalue(), page):
        assert "target 1 mm: met" in text
        assert "hysteresis" in text
