"""Duration of a diagnosis: three sizes of data set, simulated by the package's station.

Each data set hides hysteresis in the station without dry friction. The kernels of all structures
are compiled, or read from the disk, before the clock starts: that is paid once on a machine, and
printed apart.
"""

import time
from dataclasses import dataclass

import numpy as np

from pma_gym.data.trial import Trial
from pma_gym.discovery import Diagnosis, diagnose
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant


@dataclass(frozen=True)
class Size:
    """A size of data set.

    Attributes:
        trials: how many.
        seconds: how long each is (s).
        rate_hz: of its rows.
        target_s: how long its diagnosis may take on two cores.
    """

    trials: int
    seconds: float
    rate_hz: float
    target_s: float


SIZES = (Size(6, 8.0, 128.0, 6.0), Size(12, 10.0, 384.0, 60.0), Size(60, 10.0, 384.0, 300.0))
"""The three of the issue: small, usual, large."""


def lab_model() -> Model:
    """What the lab believes: serres2008 without dry friction."""
    model = load_model("serres2008")
    kept = {k: v for k, v in model.parameters.items() if k != "coulomb_friction"}
    return Model("lab", model.title, model.plant, kept, model.notes)


def data_set(size: Size, seed: int = 0) -> list[Trial]:
    """Trials of a station with hysteresis and a few parameters off."""
    truth = (
        lab_model()
        .replace({"drive.gain_n_per_v": 100.0, "contractile_force.slope_n_per_kpa": 2.8})
        .with_effects({"hysteresis": {"force_n": 3.0, "distance_mm": 1.2}})
    )
    plant, generator = Plant(truth), np.random.default_rng(seed)
    return [plant.simulate(_asked(size, k, generator), seed=k) for k in range(size.trials)]


def measure(size: Size, jobs: int) -> tuple[float, float, str, list[str]]:
    """Seconds of a first and a second diagnosis, the verdict, and the effects named."""
    trials = data_set(size)
    first, _ = _timed(trials, jobs)
    again, diagnosis = _timed(trials, jobs)
    return first, again, diagnosis.verdict, [effect.name for effect in diagnosis.effects]


def _timed(trials: list[Trial], jobs: int) -> tuple[float, Diagnosis]:
    start = time.perf_counter()
    diagnosis = diagnose(trials, lab_model(), jobs=jobs)
    return time.perf_counter() - start, diagnosis


def _asked(size: Size, number: int, generator: np.random.Generator) -> Trial:
    """A triangle of load, steps of pressure, or a multisine of load; held at both ends."""
    rows = np.arange(round(size.seconds * size.rate_hz) + 1) / size.rate_hz
    share = np.clip((rows - 0.5) / (size.seconds - 1.5), 0.0, 1.0)
    regulator = np.full(rows.size, 0.34 + generator.uniform(230.0, 480.0) / 59.9)
    motor = np.full(rows.size, 1.5)
    if number % 3 == 0:
        motor = 1.0 + generator.uniform(2.5, 4.0) * (1.0 - np.abs(2.0 * share - 1.0))
    elif number % 3 == 1:
        regulator = regulator + 1.0 * ((share > 0.2) & (share < 0.6)) - 0.5 * (share >= 0.6)
    else:
        waves = [
            np.sin(2.0 * np.pi * f * rows + generator.uniform(0.0, 6.28)) for f in (0.2, 0.5, 1.1)
        ]
        motor = 2.5 + 0.5 * np.sum(waves, axis=0) * np.sin(np.pi * share)
    return Trial(rows, {"motor_voltage": motor, "regulator_voltage": regulator})
