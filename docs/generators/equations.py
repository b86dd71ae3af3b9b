"""The plants' balances, and the equations that a model makes of them."""

import re

from generators.text import code, sections, table
from pma_gym.plant.compose import Equations
from pma_gym.plant.model import PLANTS, load_model


def equations(plant: str) -> str:
    """What a plant's module says of its balances."""
    return sections(PLANTS[plant])[""].partition("\n\n")[2]


def ports(plant: str) -> str:
    """The plant's ports and what becomes of the effects there."""
    rows = [[code(name), port.takes, port.result] for name, port in PLANTS[plant].PORTS.items()]
    return table(["Port", "Takes", "What the effects there give"], rows)


def written(model: str) -> str:
    """A model's right-hand side, as it is compiled: assignments, then the rate of each state."""
    loaded = load_model(model)
    text = Equations(effects=loaded.effects)
    PLANTS[loaded.plant].write_equations(text)
    lines = [*text.lines, ""]
    for state in text.states:
        decay = f" - {state.decay} * {state.name}" if state.decay else ""
        lines.append(f"d({state.name})/dt = {state.source}{decay}")
    return "```text\n" + "\n".join(_readable(line) for line in lines) + "\n```"


def _readable(line: str) -> str:
    """Parameters as `effect.name` instead of `p_effect.name`."""
    return re.sub(r"\bp_(\w+)", r"\1", line)
