"""Rigs are objects: what is asked of one stands in its file, and nothing compares its name."""

import ast
from pathlib import Path

import numpy as np
import pytest

from pma_gym import Plant, load_model
from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import ModelError
from pma_gym.plant.rigs import RIGS
from tests.plant.test_imposed import imposed
from tests.plant.test_joint import joint

ROOT = Path(__file__).parents[2]
MODELS = {
    "station": "station",
    "cascade": "cascade",
    "joint": joint(torque_drive=True),
    "imposed": imposed(),
    "slide": str(ROOT / "tests/discovery/rigs/driven_slide/model.toml"),
    "muscle_joint": "muscle_joint",
    "muscle_pair": "muscle_pair",
}
"""A model of every rig, by the rig's name."""

_STATION = {"motor_voltage": np.full(3, 1.0), "regulator_voltage": np.full(3, 5.0)}
FIRST = {
    "station": Trial(np.arange(3) * 0.01, _STATION),
    "cascade": Trial(np.arange(3) * 0.01, _STATION),
    "joint": Trial(np.arange(3) * 0.01, {"torque_command": np.full(3, 0.1)}),
    "imposed": Trial(np.arange(3) * 0.01, {"contraction_command": np.full(3, 0.01)}),
    "slide": Trial(np.arange(3) * 0.01, {"load_command": np.full(3, 1.0)}),
    "muscle_joint": Trial(np.arange(3) * 0.01, {"pressure_command": np.full(3, 2e5)}),
    "muscle_pair": Trial(
        np.arange(3) * 0.01,
        {"pressure_command": np.full(3, 2e5), "antagonist_pressure_command": np.full(3, 1e5)},
    ),
}
"""A trial of every rig."""


@pytest.fixture(scope="module")
def compared():
    """What every module of the project compares with: its path, line, and the string."""
    packages = ("pma_gym", "controllers", "benchmarks")
    files = [path for package in packages for path in (ROOT / package).rglob("*.py")]
    assert len(files) > 500
    return [
        (file.relative_to(ROOT), line, name)
        for file in files
        for name, line in compared_names(file)
    ]


def compared_names(path):
    """String constants that a file compares something with; a key of a mapping is none."""
    for node in ast.walk(ast.parse(path.read_text())):
        sides = (node.left, *node.comparators) if isinstance(node, ast.Compare) else ()
        if isinstance(node, ast.MatchValue):
            sides = (node.value,)
        for side in sides:
            parts = side.elts if isinstance(side, ast.Tuple | ast.List | ast.Set) else (side,)
            for part in parts:
                if isinstance(part, ast.Constant) and isinstance(part.value, str):
                    yield part.value, node.lineno


def test_nothing_compares_a_rigs_name(compared):
    """Beside the rigs' own folder, and that of the campaign that simulates rigs of its own."""
    there = [
        f"{path}:{line}"
        for path, line, name in compared
        if "rigs" not in path.parts and name in RIGS
    ]
    assert there == []


@pytest.mark.parametrize("name", RIGS)
def test_a_rig_says_what_its_equations_have(name):
    model = load_model(MODELS[name])
    plant, rig = Plant(model), model.rig
    assert rig.name == name
    assert set(rig.parts) <= set(model.parameters)
    assert set(rig.position_tolerances) <= set(plant.states)
    assert set(rig.moving_lags.values()) <= set(plant.states)
    assert rig.outputs == plant.outputs == tuple(signal.name for signal in rig.signals)
    measured = plant.simulate(FIRST[name], noise=False).measurements
    assert tuple(measured) == rig.outputs
    assert set(rig.refused_effects) <= set(CATALOGUE)


def test_at_most_ten_comparisons_name_a_signal(compared):
    """All that is asked of a signal stands in its row: see `pma_gym.data.signals`."""
    names = (
        set(SIGNALS) | {s.column for s in SIGNALS.values()} | {s.sensor for s in SIGNALS.values()}
    )
    there = [
        f"{path}:{line}"
        for path, line, name in compared
        if path.name != "signals.py" and name in names - {""}
    ]
    assert len(there) <= 10, "\n".join(there)


def test_an_unknown_rig_is_refused_with_those_there_are():
    model = load_model("station")
    known = ", ".join(RIGS)
    with pytest.raises(ModelError, match=f"one of {known}, got 'lift'"):
        type(model)("m", "m", "lift", dict(model.parameters))
