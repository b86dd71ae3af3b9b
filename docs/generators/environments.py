"""The environments' tables: spaces, rewards, options."""

from dataclasses import MISSING, fields

from generators.text import code, entries, sections, summary, table
from pma_gym.envs import Options, PMAEnv
from pma_gym.tasks import RANDOMISATIONS, REWARDS


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


def rewards() -> str:
    """Rewards by name."""
    return table(["Reward", "What"], [[code(n), summary(r)] for n, r in REWARDS.items()])


def randomisations() -> str:
    """Randomisations by name, with all that their docstrings say."""
    rows = [
        [code(name), " ".join(sections(draw)[""].split())] for name, draw in RANDOMISATIONS.items()
    ]
    return table(["Randomisation", "What is drawn at every reset"], rows)
