"""Small simulated laboratories: a station without friction, a few short trials, hidden effects."""

from functools import cache

import numpy as np

from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import FreeParameters, free_parameters
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.workflow import diagnose
from pma_gym.plant import sensors
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant

_SERRES = load_model("serres2008")
STATION = Model(
    "lab",
    _SERRES.title,
    _SERRES.plant,
    {name: values for name, values in _SERRES.parameters.items() if name != "coulomb_friction"},
    _SERRES.notes,
)
OFF = {"drive.gain_n_per_v": 101.0, "contractile_force.slope_n_per_kpa": 2.8}
HYSTERESIS = {"hysteresis": {"force_n": 6.0, "distance_mm": 1.0}}
DELAY = {"regulator_delay": {"share": 1.0, "delay_ms": 20.0}}
BUMP = {
    "residual_force_of_contraction": {"first_mm": 0.0, "reach_mm": 64.0}
    | {f"h{k}_n": 10.0 * (k == 3) for k in range(9)}
}
LEVELS = sensors.deviations(STATION)


def commanded(number, rate=64.0, seconds=5.0, seed=3, kinds=(0, 1, 2), kpa=(220.0, 520.0)):
    """Triangles of load, steps of load and pressure, and sums of sines, in turn."""
    generator = np.random.default_rng(seed)
    plant, simulated = Plant(STATION), []
    time = np.arange(round(seconds * rate) + 1) / rate
    along = np.clip((time - 0.5) / (seconds - 1.5), 0.0, 1.0)
    moving = (time > 0.5) & (time < seconds - 1.0)
    for k in range(number):
        held = plant.regulator_voltage(1e3 * generator.uniform(*kpa)) + 0.0 * time
        waves = sum(
            np.sin(2 * np.pi * hertz * time + generator.uniform(0.0, 6.0))
            for hertz in (0.2, 0.5, 1.1, 2.3)
        )
        motor, regulator = [
            (1.0 + 3.5 * (1.0 - np.abs(2.0 * along - 1.0)), held),
            (
                1.0 + 2.0 * ((time > 1.0) & (time < 4.0)),
                held + 1.0 * ((time > 2.0) & (time < 3.2)) - 0.8 * ((time > 3.2) & moving),
            ),
            (2.5 + 0.4 * np.where(moving, waves, 0.0), held),
        ][kinds[k % len(kinds)]]
        simulated.append(Trial(time, {"motor_voltage": motor, "regulator_voltage": regulator}))
    return simulated


def measured(model, number=4, rate=64.0, seconds=5.0, seed=3, noise=True, **kinds):
    """What a model's sensors read in such trials."""
    plant = Plant(model)
    return [
        plant.simulate(trial, seed=100 * seed + k, noise=noise)
        for k, trial in enumerate(commanded(number, rate, seconds, seed, **kinds))
    ]


@cache
def laboratory(case, number=3, rate=64.0, seed=3):
    """Trials in which something is hidden, one of each kind, and the model that made them."""
    effects, moved = {
        "nothing": ({}, {}),
        "parameters": ({}, OFF),
        "hysteresis": (HYSTERESIS, OFF),
        "pair": (HYSTERESIS | DELAY, OFF),
        "bump": (BUMP, OFF),
    }[case]
    truth = STATION.with_effects(effects).replace(moved)
    return measured(truth, number, rate, seed=seed), truth


@cache
def diagnosed(case, number=3, rate=64.0, seed=3):
    """The diagnosis of such trials with the station's model; it proposes no experiment."""
    return diagnose(laboratory(case, number, rate, seed)[0], STATION, propose=False)


def fit_problem(trials, model=STATION):
    """What fits share, with the noise that the sensors have."""
    return FitProblem(trials, model, free_parameters(model), tuple(map(white_noise, LEVELS)))


def fitted(model, trials, free, threads=1):
    """A fit of some parameters alone, of which nothing is assumed, with the sensors' noise."""
    own = FreeParameters(tuple(free), np.full(len(free), np.inf))
    noise = tuple(map(white_noise, sensors.deviations(model)))
    return FitProblem(trials, model, own, noise, threads).fit(model)


def only(trial, *names):
    """A trial of which only some signals were measured."""
    return Trial(trial.time, trial.commands, {name: trial.measurements[name] for name in names})
