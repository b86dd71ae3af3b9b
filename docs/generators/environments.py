"""Environments, tasks and controllers, and the suites that score them."""

import inspect
from dataclasses import MISSING, fields
from pathlib import Path

from benchmarks.rigs.suite import joint_suite
from benchmarks.runner.case import cases
from benchmarks.suites.frozen import frozen_suite, load_suite, suite_names
from benchmarks.suites.suite import FrozenSuite
from benchmarks.tuning import tune
from controllers import CONTROLLERS
from generators.text import code, entries, number, sections, summary, table
from pma_gym.envs import Options, PMAEnv
from pma_gym.tasks import DISTURBANCES, EVERY_TASK, PULSE_S, RANDOMISATIONS
from pma_gym.units import SI_FACTORS


def docstring() -> str:
    """The environment's own description: action, observation, reward, ends, info."""
    return sections(PMAEnv)[""].partition("\n\n")[2]


def options() -> str:
    """Keyword arguments, their defaults and meanings."""
    meanings = entries(sections(Options)["Attributes"])
    rows = [
        [
            code(option.name),
            "" if option.default is MISSING else code(repr(option.default)),
            meanings[option.name],
        ]
        for option in fields(Options)
    ]
    return table(["Option", "Default", "Meaning"], rows)


def randomisations() -> str:
    """Randomisations by name, with all that their docstrings say."""
    rows = [
        [code(name), " ".join(sections(draw)[""].split())] for name, draw in RANDOMISATIONS.items()
    ]
    return table(["Randomisation", "What is drawn at every reset"], rows)


def disturbances() -> str:
    """Disturbances by name, and their sizes."""
    rows = []
    for name, sizes in DISTURBANCES.items():
        said = []
        if sizes.regulator_step:
            said.append(f"jumps of the regulator by {sizes.regulator_step / 1e3:g} kPa")
        if sizes.hand_push_force:
            said.append(
                f"pulses of {sizes.hand_push_force:g} N at the slide, {PULSE_S[0]:g} to "
                f"{PULSE_S[1]:g} s long"
            )
        rows.append([code(name), ", ".join(said)])
    return table(["Disturbances", "What comes at random times, with a random sign"], rows)


def tasks() -> str:
    """All tasks: who moves, what follows, how long, at which pressures and loads."""
    rows = []
    for name, task in EVERY_TASK.items():
        schedule = task.schedule
        low, high = (f"{pressure / 1e3:g}" for pressure in task.starts)
        rows.append(
            [
                code(name),
                task.actuator,
                schedule.quantity,
                f"{schedule.span / SI_FACTORS[schedule.unit]:g} {schedule.unit}",
                f"{schedule.duration:g} s",
                ", ".join(phase.name for phase in schedule.phases),
                low if low == high else f"{low}-{high}",
                f"{task.load:g} N" if task.load else "",
            ]
        )
    header = ["Task", "Actuator", "Quantity", "Range", "Duration", "Phases"]
    return table([*header, "Begins at (kPa)", "Load"], rows)


EXAMPLES = Path(__file__).parent.parent / "examples"


def example(name: str) -> str:
    """A file of `docs/examples`."""
    text = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8").rstrip()
    return f'```python title="docs/examples/{name}.py"\n{text}\n```'


def controllers() -> str:
    """Every controller that comes with the project."""
    scored = {spec.name for spec in load_suite().controllers}
    rows = [
        [code(name), summary(made), "yes" if name in scored else "no"]
        for name, made in CONTROLLERS.items()
    ]
    return table(["Name", "What", "In the suite"], rows)


def tuning() -> str:
    """How the gains of the PIDs are found, as the script that finds them says."""
    return f"```text\n{inspect.cleandoc(tune.__doc__ or '').partition(chr(10) * 2)[2]}\n```"


def trials() -> str:
    """Pressures of the suite's trials, by task."""
    rows = [
        [task, len(pressures), ", ".join(number(pressure) for pressure in pressures)]
        for task, pressures in load_suite().pressures_kpa.items()
    ]
    return table(["Task", "Trials", "Pressures (kPa)"], rows, right=(1,))


def suites() -> str:
    """Every frozen suite: version, stations, episodes, loop."""
    rows = []
    for name in suite_names():
        suite = frozen_suite(name)
        counts = (len(suite.stations), len(suite.episodes), len(cases(suite, suite.entries)))
        rows.append([code(name), suite.version, suite.title, *counts, _loop(suite)])
    rigs = joint_suite().summary()
    counts = [rigs[name] for name in ("stations", "episodes", "cases")]
    rows.append([code(rigs["name"]), rigs["version"], rigs["title"], *counts, rigs["loop"]])
    return table(
        ["Suite", "Version", "What", "Stations", "Episodes", "Cases", "Loop"],
        rows,
        right=(1, 3, 4, 5),
    )


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
