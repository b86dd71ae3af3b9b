"""Rigs are objects: what is asked of one stands in its file, and nothing compares its name."""

import ast
from pathlib import Path

import numpy as np
import pytest

from pma_gym import Plant, load_model
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import ModelError
from pma_gym.plant.rigs import RIGS

ROOT = Path(__file__).parents[2]
MODELS = {
    "station": "station",
    "cascade": "cascade",
    "slide": str(ROOT / "tests/discovery/rigs/driven_slide/model.toml"),
}
"""A model of every rig, by the rig's name."""


def compared_names(path):
    """String constants that a file compares something with."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Compare):
            for side in (node.left, *node.comparators):
                for part in ast.walk(side):
                    if isinstance(part, ast.Constant) and isinstance(part.value, str):
                        yield part.value, node.lineno


def test_nothing_compares_a_rigs_name():
    files = [
        path
        for package in ("pma_gym", "controllers", "benchmarks")
        for path in (ROOT / package).rglob("*.py")
        if path.parent.name != "rigs"
    ]
    assert len(files) > 500
    there = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in files
        for name, line in compared_names(path)
        if name in RIGS
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
    assert set(rig.absent_outputs) <= set(plant.outputs)
    assert set(rig.refused_effects) <= set(CATALOGUE)
    assert (rig.fastest_oscillation(model.parameters) > 0.0) == rig.balances_loads


def test_an_unknown_rig_is_refused_with_those_there_are():
    model = load_model("station")
    with pytest.raises(ModelError, match="one of station, cascade, slide, got 'lift'"):
        type(model)("m", "m", "lift", dict(model.parameters))


def test_an_equilibrium_stands_still():
    for name in ("station", "cascade"):
        plant = Plant(name)
        regulator = plant.regulator_voltage(300e3)
        rest = plant.settle(1.0, regulator_voltage=regulator)
        rates = plant.derivative(rest.state, 1.0, regulator, rest.zero_contraction)
        assert np.all(np.abs(rates) < 1e-6 * np.maximum(1.0, np.abs(rest.state)))
