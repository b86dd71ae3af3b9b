"""Code and pages use the words of their fields, in identifiers and in prose."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

WORDS = {
    "march": "integrate",
    "crew": "thread pool",
    "marching": "integration",
    "Attempt": "StepAttempt",
    "Switch": "Event",
    "Bend": "Breakpoint",
    "followers": "cascaded_states",
    "Lanes": "SimdEmitter",
    "Crew": "ThreadPool",
    "Hand": "Worker",
    "bell": "wake event",
    "rest_search": "equilibrium",
    "station_rest": "equilibrium",
    "Circuit": "ControlStepGraph",
    "stand_in": "cpu_device",
    "guard": "safety_filter",
    "Pace": "ThreadTuner",
    "of_y": "grad_output",
    "derive": "backward",
    "Look": "ScreeningScore",
    "Evidence": "WhitenedResiduals",
    "Memory": "AutocorrelationTest",
    "predicting": "predictive_density",
    "slowness": "residual_fraction",
    "constancy": "homogeneity_test",
    "own_rules": "user_effect_checks",
    "hollow": "local_minimum",
    "hears": "receives",
    "told": "receives, nominal_model",
    "heard": "delayed, measured",
    "obstacle": "infeasibility_reason",
    "let_through": "safety_filter",
    "Pilot": "PolicyAdapter",
    "Pilots": "BatchPolicyAdapter",
    "Form": "ActionMapping",
    "View": "ObservationSpec",
    "Lags": "LagDeadTimeModel",
    "LagObserver": "ExtendedStateObserver",
    "see": "update, receive, record",
    "agitation": "process_noise",
    "surprise": "innovation",
    "rehearsal": "nominal_rollout",
    "rehearsed": "nominal_rollout",
    "foresight": "prediction",
    "lifted": "lifted_model",
    "practised": "learned, iterative learning",
    "Practice": "LearningTrials",
    "Deal": "EpisodePlan",
    "deal": "EpisodePlan",
    "Contender": "ControllerSpec",
    "Human": "Operator",
    "Plan": "a name for each",
    "Search": "a name for each",
    "Suspect": "CandidateEffect",
    "Bench": "FitProblem",
    "bursts": "scan_statistic",
    "foretelling": "predictive_density",
    "blind_spots": "detectability",
    "relearnt": "reestimated_noise",
    "found": "fit, verdict, row",
    "Reading": "Measurement",
    "Station": "StationInfo",
    "BEND": "BREAKPOINT, CURVATURE",
    "BLIND_HEADER": "NOT_DETECTABLE_HEADER",
    "FEWEST": "LEAST",
    "FOUND": "DIAGNOSIS, VERDICT",
    "HOLDS": "Interpolation",
    "Hold": "Interpolation",
    "Own": "FreeParameters",
    "POOR": "LOW_EXCITATION",
    "PoorBlock": "LowExcitationBlock",
    "Record": "StateLayout, CaseRecord, SuiteRecord",
    "Rehearsals": "RepeatedExercise",
    "Told": "OnProgress",
    "WAYS": "BASELINES",
    "WILD": "OUTLIER",
    "Way": "Baseline",
    "at_bend": "at_breakpoint",
    "at_rest": "equilibrium, step_start_values, rest_readings",
    "bend": "breakpoint, deflect, curvature",
    "blind_rows": "not_detectable_rows",
    "draw_poor": "draw_low_excitation",
    "exercised": "exercise_step",
    "fewest": "backward_elimination, least",
    "friction_bend": "friction_breakpoint",
    "kinks": "events",
    "leftovers": "residuals",
    "load_bend": "load_breakpoint",
    "march_all": "integrate_all",
    "mend": "fix",
    "parameters_told": "parameters_reported",
    "poor": "low_excitation",
    "practice": "learning trial",
    "practice_seed": "learning_seed",
    "stribeck_bend": "stribeck_breakpoint",
    "told_of": "on_progress",
    "unknown_words": "unknown_sentence",
    "verdict_words": "verdict_text",
    "wild": "adversarial, outlier",
    "wild_readings": "outliers",
    "write_advance": "write_python_step",
    "Protocol": "TrialSchedule, excitation, LoadCycleReadings; typing's is allowed",
    "PROTOCOLS": "SCHEDULES, EXCITATIONS",
    "protocol": "schedule, excitation, load cycle",
    "protocols": "schedules, excitations",
}
"""Identifiers that are not used, exactly as they would stand, and what stands in their place."""

VAGUE = {
    "given": "initial_model, arguments, requested, table",
    "wanted": "target, prescription, expected, planned",
    "came": "actual, value",
    "begun": "start, started",
}
"""Identifiers that do not say what they name, and are gone from all folders but `WITH_VAGUE`."""

WITH_VAGUE = (
    *("benchmarks/training", "pma_gym/discovery"),
    *("pma_gym/engine", "pma_gym/envs", "pma_gym/plant/exercise_device", "pma_gym/sb3", "tests"),
)

CLEAN = ("benchmarks", "controllers", "docs", "pma_gym", "tests")
"""Folders whose identifiers are held to `WORDS`."""

PHRASES = (
    "remembers itself",
    "at the door",
    "hears late",
    "caught in a hollow",
    "silence says nothing",
    "what came of it",
    "led out of",
    "rings at",
)
"""Phrases that are never right, in code and pages."""

TEXTS = ("pma_gym", "controllers", "benchmarks", "docs", "README.md")
EXEMPT = ("docs/notebook",)
"""Notes of what was thought then stay as they were written."""


def identifiers(tree):
    """Every identifier of a module with its line."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            yield node.id, node.lineno
        elif isinstance(node, ast.Attribute):
            yield node.attr, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.keyword) and node.arg:
            yield node.arg, node.value.lineno
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name, node.lineno
        elif isinstance(node, ast.alias):
            yield (node.asname or node.name).rpartition(".")[2], node.lineno


def violations(text, words=WORDS):
    """Identifiers of a text that are not used, as messages."""
    private = {name.lstrip("_"): better for name, better in words.items()}
    if re.search(r"^from typing import .*\bProtocol\b", text, re.MULTILINE):
        private.pop("Protocol", None)
    return [
        f"line {line}: {name} is not used here; take {private[name.lstrip('_')]}"
        for name, line in identifiers(ast.parse(text))
        if name.lstrip("_") in private
    ]


def files(names, endings):
    for name in names:
        path = ROOT / name
        each = [path] if path.is_file() else sorted(path.rglob("*"))
        yield from (file for file in each if file.suffix in endings)


@pytest.mark.parametrize("folder", CLEAN)
def test_identifiers_are_the_fields_words(folder):
    wrong = []
    for path in files([folder], {".py"}):
        name = path.relative_to(ROOT).as_posix()
        words = WORDS if name.startswith(WITH_VAGUE) else WORDS | VAGUE
        messages = violations(path.read_text(encoding="utf-8"), words)
        wrong += [f"{name} {message}" for message in messages]
    assert not wrong, "\n".join(wrong)


def test_phrases_that_are_never_right_stand_nowhere():
    wrong = []
    for path in files(TEXTS, {".py", ".md", ".toml", ".html", ".js"}):
        name = path.relative_to(ROOT).as_posix()
        text = re.sub(r"\s+", " ", path.read_text(encoding="utf-8").lower())
        if not name.startswith(EXEMPT):
            wrong += [
                f"{name}: {phrase!r}" for phrase in PHRASES if re.search(rf"\b{phrase}\b", text)
            ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    "text",
    [
        "found = 1",
        "class View: pass",
        "def f(told): pass",
        "x._heard",
        "f(see=2)",
        "import m as Plan",
        "class Protocol: pass",
    ],
)
def test_a_private_word_is_seen_wherever_it_stands(text):
    assert len(violations(text)) == 1
