"""The frozen suites: what they run, on which stations."""

from benchmarks.runner.case import cases
from benchmarks.suites.frozen import frozen_suite, suite_names
from benchmarks.suites.suite import FrozenSuite
from generators.text import code, number, table


def suites() -> str:
    """Every frozen suite: version, stations, episodes, loop."""
    rows = []
    for name in suite_names():
        suite = frozen_suite(name)
        counts = (len(suite.stations), len(suite.episodes), len(cases(suite, suite.entries)))
        rows.append([code(name), suite.version, suite.title, *counts, _loop(suite)])
    header = ["Suite", "Version", "What", "Stations", "Episodes", "Cases", "Loop"]
    return table(header, rows, right=(1, 3, 4, 5))


def episode_plans(name: str) -> str:
    """Which trials the stations of a suite get."""
    rows = [
        [
            ", ".join(map(code, plan.tasks)),
            ", ".join(map(number, plan.pressures_kpa)),
            plan.per_station or "all",
            plan.repeats,
        ]
        for plan in frozen_suite(name).episode_plans
    ]
    return table(["Tasks", "Pressures (kPa)", "Trials a station", "Noise seeds"], rows, (2, 3))


def occasional() -> str:
    """What drawn stations may have that their model has not."""
    recipe = frozen_suite("robust").recipe
    assert recipe is not None
    rows = []
    for effect in recipe.effects:
        parts = [
            f"{code(file_key)} {number(low)} to {number(high)}"
            for file_key, (low, high) in effect.ranges.items()
            if low != high
        ]
        parts += [f"{code(d)} {factor:g} {code(to)}" for d, (to, factor) in effect.tied.items()]
        rows.append([code(effect.name), f"{effect.share:.0%}", "; ".join(parts)])
    return table(["Effect", "Stations that have it", "How strong"], rows)


def _loop(suite: FrozenSuite) -> str:
    words = [f"{suite.control_rate_hz:g} Hz"]
    delay = suite.environment.get("action_delay_s", 0.0)
    words += [f"commands {1e3 * delay:g} ms late"] if delay else []
    disturbances = suite.environment.get("disturbances", "none")
    words += [f"disturbed by {disturbances.replace('_', ' ')}"] if disturbances != "none" else []
    return ", ".join(words)
