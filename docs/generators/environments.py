"""The environments' tables: spaces, rewards, options."""

from dataclasses import MISSING, fields

from generators.text import code, entries, sections, table
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
