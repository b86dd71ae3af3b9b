"""Rows as a run leaves them, with errors drawn from known distributions: data of tests alone."""

import numpy as np

from benchmarks.suites.frozen import parse_suite
from pma_gym.tasks import EVERY_TASK
from pma_gym.units import SI_FACTORS

LEVELS = {
    "oracle": 0.5,
    "mpc": 0.9,
    "feedforward_pid": 1.0,
    "pid": 1.0,
    "improved_feedforward": 8.0,
}
"""Median error of each controller, in tenths of a percent of the range."""


def simulated_suite(stations=16, controllers=tuple(LEVELS), targets=(), delay=0.0, tasks=()):
    """A small suite of drawn stations."""
    episode_plans = [
        {"tasks": ["displacement"], "pressures_kpa": [150, 350, 550], "per_station": 2},
        {"tasks": ["rotation"], "pressures_kpa": [275, 400, 575], "per_station": 2},
        *({"tasks": [task], "pressures_kpa": [300], "per_station": 1} for task in tasks),
    ]
    return parse_suite(
        "simulated",
        {
            "schema": 2,
            "name": "simulated",
            "title": "Rows drawn for a test",
            "version": 3,
            "seed": 5,
            "model": "station",
            "environment": {
                "control_rate_hz": 100.0,
                "noise": True,
                "action_delay_s": delay,
            },
            "stations": {
                "count": stations,
                "seed": 1,
                "training_seed": 2,
                "widening": 1.0,
                "variation": 0.2,
                "reach_v": 9.5,
                "trials": {},
            },
            "episodes": episode_plans,
            "controllers": [{"name": name, "title": name.upper()} for name in controllers],
            "targets": list(targets),
        },
    )


def simulated_row(suite, name, episode, percent, failure=""):
    """A row of a case whose error is so many percent of the range in all phases."""
    schedule = EVERY_TASK[episode.task].schedule
    row = {
        "suite": suite.name,
        "version": suite.version,
        "controller": name,
        **episode._asdict(),
        "seed": suite.seed_of(episode),
        "failure": failure,
    }
    if failure:
        return row
    error = percent / 100.0 * schedule.span / SI_FACTORS[schedule.unit]
    phase = {"rmse": error, "percent_of_range": percent, "largest_error": 3.0 * error}
    return row | {
        "unit": schedule.unit,
        "phases": {each.name: dict(phase) for each in schedule.phases},
        "rmse": error,
        "start_rmse": 2.0 * error,
        "steady_rmse": 0.9 * error,
        "effort_v": 1.0,
        "variation_v_per_s": 2.0,
        "saturation_share": 0.01,
        "violation": 0.0,
        "act_us": 10.0,
        "act_us_worst": 20.0,
    }


def simulated_rows(suite, seed=0, levels=LEVELS):
    """A row for every case: a station's own difficulty times a controller's level and luck."""
    generator = np.random.default_rng(seed)
    names = [entry.spec.name for entry in suite.entries]
    hard = {station: np.exp(0.4 * generator.normal()) for station in suite.stations}
    return [
        simulated_row(
            suite,
            name,
            episode,
            0.1 * levels[name] * hard[episode.station] * np.exp(0.1 * generator.normal()),
        )
        for episode in suite.episodes
        for name in names
    ]
