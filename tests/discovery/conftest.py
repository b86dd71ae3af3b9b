"""Diagnoses made up from simulated trials: what each part of the page needs, for each verdict."""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.result.candidate import Candidate
from pma_gym.discovery.result.estimates import Estimate, Moved, NamedEffect
from pma_gym.discovery.result.misfit import Gap, Map, Place, ResidualLaw, TrialRecord
from pma_gym.discovery.result.next_experiment import NextExperiment
from pma_gym.discovery.result.noise import Floor
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.rigs import RIGS
from pma_gym.units import SI_FACTORS

SIGNALS = {quantity: BY_QUANTITY[quantity] for quantity in RIGS["station"].outputs}


def commands(pressure, period):
    time = np.arange(0.0, 8.0, 1 / 64)
    pull = 2.5 * (1.0 - np.cos(2 * np.pi * time / period))
    return Trial(time, {"motor_voltage": pull, "pressure_command": np.full(time.size, pressure)})


def outputs(trial, group="measurements"):
    held = getattr(trial, group)
    return np.column_stack([held[quantity] for quantity in RIGS["station"].outputs])


def rms(values):
    return float(np.sqrt(np.mean(values**2)))


def record(name, trial, given, refitted, truth):
    """A trial's curves of three models, with its gaps."""
    measured = outputs(Plant(truth).simulate(trial, seed=1))
    curves = [
        outputs(Plant(each).simulate(trial, noise=False)) for each in (given, refitted, truth)
    ]
    gaps = {}
    for index, column in enumerate(SIGNALS.values()):
        factor = SI_FACTORS[column.unit]
        misses = [rms(measured[:, index] - curve[:, index]) / factor for curve in curves]
        gaps[column.name] = Gap(*misses, floor=0.97 * misses[-1], held_out=True)
    columns = tuple(column.name for column in SIGNALS.values())
    return TrialRecord(name, trial.time, measured, *curves, gaps, held_out=True, columns=columns)


@pytest.fixture(scope="session")
def example():
    """A diagnosis that names Coulomb friction, with every part that a page can show."""
    given = load_model("serres2008")
    truth = given.replace({"coulomb_friction.static_n": 25.0, "coulomb_friction.dynamic_n": 20.0})
    refitted = given.replace({"drive.gain_n_per_v": 95.0})
    trials = [commands(p, t) for p, t in ((200e3, 4.0), (300e3, 2.0), (450e3, 4.0))]
    names = ("slow_200.csv", "fast_300.csv", "slow_450.csv")
    records = tuple(
        record(name, trial, given, refitted, truth)
        for name, trial in zip(names, trials, strict=True)
    )
    gap = {
        column.name: Gap(
            *(
                rms(np.array([getattr(each.gaps[column.name], part) for each in records]))
                for part in ("before", "parameters", "after", "floor")
            ),
            held_out=True,
        )
        for column in SIGNALS.values()
    }
    rng = np.random.default_rng(1)
    residual = 3.0 * np.sign(np.linspace(-1, 1, 12))[None, :] + rng.normal(size=(8, 12))
    residual[:2, 9:] = np.nan
    friction = {
        "static_n": Estimate(24.61, 23.2, 26.1, "N"),
        "dynamic_n": Estimate(20.32, 19.1, 21.4, "N"),
        "stribeck_speed_mm_per_s": Estimate(4.0, None, 22.0, "mm/s"),
    }
    return Diagnosis(
        verdict="effect",
        sentence=(
            "Coulomb friction of 20.3 N (95 %: 19.1 to 21.4) is missing from the model; with it, "
            "the contraction of trials that were not fitted is predicted to within the noise."
        ),
        where=(
            Place("contraction_mm", "0-0.2 s after reversals, above 300 kPa", 0.71, 0.001),
            Place("rotation_deg", "0-0.2 s after reversals", 0.46, 0.004),
        ),
        effects=(NamedEffect("coulomb_friction", ("hysteresis",), 0.0004, friction),),
        parameters={
            "drive.gain_n_per_v": Moved(97.84, Estimate(95.02, 94.1, 95.9, "N/V"), True),
            "damping.contracting_n_s_per_mm": Moved(
                0.5, Estimate(0.52, 0.4, 0.63, "N s/mm"), False
            ),
        },
        gap=gap,
        candidates=(
            Candidate("coulomb_friction", 812.3, 0.41, 0.0004, 3.1, 0.08, True, "named"),
            Candidate("hysteresis", 809.9, 0.4, 0.0004, 3.0, 0.1, True, "as good: confused"),
            Candidate("creep", 12.1, -0.01, 0.31, 0.2, 0.4, True, "gain within chance"),
            Candidate("torque_ripple", 2.1, None, 1.0, 0.1, None, False, "gain within chance"),
        ),
        next_experiment=NextExperiment(
            "Staircase of reversals between 1 and 4 V at 300 kPa",
            ("coulomb_friction", "hysteresis"),
            40.0,
            1.5,
            commands(300e3, 1.0),
        ),
        model=truth,
        given=given,
        not_identifiable={"rotor.inertia_kg_m2": "no trial is fast enough: 4 Hz at most"},
        not_detectable=("torque_ripple", "slow_creep"),
        floors={
            column.name: Floor(
                gap[column.name].floor,
                "repeats",
                {"repeats": 0.1, "autoregression": 0.12},
                0.05,
                (0.4,),
            )
            for column in SIGNALS.values()
        },
        trials=records,
        maps=tuple(
            Map(
                name,
                "speed (mm/s)",
                "pressure (kPa)",
                np.linspace(-30, 30, 13),
                np.linspace(150, 550, 9),
                residual,
            )
            for name in ("contraction_mm", "rotation_deg")
        ),
        steps=(
            "Noise: 0.05 mm from two repeats.",
            "Parameters: drive.gain 97.8 to 95.0 N/V; the misfit fell from 0.84 to 0.62 mm.",
            "Catalogue: 31 effects screened, 6 fitted; Coulomb friction gains 812.",
        ),
        seconds={"noise": 0.2, "parameters": 3.1},
        warnings=("Two of the three trials lie at one pressure.",),
    )


def bare(example, verdict, sentence, **kept):
    """A diagnosis with nothing but what is given."""
    return Diagnosis(
        verdict=verdict,
        sentence=sentence,
        where=(),
        effects=(),
        parameters=kept.pop("parameters", {}),
        gap=kept.pop("gap", {}),
        candidates=(),
        next_experiment=kept.pop("next_experiment", None),
        model=example.given,
        given=example.given,
        **kept,
    )


@pytest.fixture(scope="session")
def diagnoses(example):
    """One of each verdict."""
    at = np.linspace(0, 40, 50)
    bump = 8.0 * np.exp(-(((at - 20) / 6) ** 2))
    law = ResidualLaw(
        "force on the slide (N)",
        "contraction (mm)",
        at,
        bump,
        bump - 1,
        bump + 1,
        "A bump of 8 N around 20 mm; no dependence on speed or pressure was found.",
    )
    parameters = replace(
        example,
        verdict="parameters",
        sentence="The drive pulls 3 % less than the model says; no effect is missing.",
        effects=(),
        next_experiment=None,
    )
    return {
        "effect": example,
        "parameters": parameters,
        "agrees": bare(
            example,
            "agrees",
            "Model and data agree to within the noise.",
            not_detectable=("creep",),
        ),
        "unknown": bare(example, "unknown", "A force is missing that no effect has.", law=law),
        "undecidable": bare(
            example,
            "undecidable",
            "These trials hold still: they cannot tell one effect from another.",
            next_experiment=example.next_experiment,
        ),
    }
