"""The package's library of safe experiments, as volts for the generator's rig."""

import tomllib
from functools import cache

import numpy as np

from benchmarks.hidden_effects.generation.files import lab_model
from benchmarks.hidden_effects.physics.rig import Array
from benchmarks.hidden_effects.physics.simulation import RATE
from pma_gym.discovery.experiments.excitation import RATE_HZ, Excitation, library
from pma_gym.plant.model import parse_model

Volts = tuple[Array, Array]
"""Motor and regulator voltages at `RATE`, shape (rows,) each."""


@cache
def safe_experiments() -> tuple[Excitation, ...]:
    """The whole library, as large as is safe by what the lab believes."""
    assert RATE_HZ == RATE, "the library and the generator count rows alike"
    return tuple(library([parse_model(tomllib.loads(lab_model()))]))


def named(words: str, g: np.random.Generator) -> tuple[str, Volts]:
    """Name and volts of an excitation whose name begins with words, at one of its settings.

    Raises:
        ValueError: there is none.
    """
    experiments = [each for each in safe_experiments() if each.name.startswith(words)]
    if not experiments:
        raise ValueError(f"the library has no excitation that begins with {words!r}")
    chosen = experiments[int(g.integers(len(experiments)))]
    return chosen.name, volts(chosen)


def random_experiment(g: np.random.Generator, rows: int) -> tuple[str, Volts]:
    """A random excitation, cut or repeated so that it takes as many rows as another."""
    every = safe_experiments()
    chosen = every[int(g.integers(len(every)))]
    motor, regulator = (np.resize(column, rows) for column in volts(chosen))
    return chosen.name, (motor, regulator)


def volts(excitation: Excitation) -> Volts:
    """Its commands, in whole millivolts as a lab sends them."""
    commands = excitation.trial.commands
    return (
        np.round(commands["motor_voltage"], 3),
        np.round(commands["regulator_voltage"], 3),
    )
