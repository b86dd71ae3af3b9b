"""The commands of a rig: what its drives take, between which limits."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pma_gym.data.signals import SIGNALS, VOLTAGE_RANGE, Signal
from pma_gym.integrator.equations import COMMANDS
from pma_gym.plant.model import Model
from pma_gym.plant.sensors import direct_command

Limits = Mapping[str, Sequence[float]]
"""Lowest and highest value of commands (SI) by name."""


Line = tuple[str, float, float, tuple[float, float]]
"""Place of a command, gain and offset of its line, lowest and highest input."""


@dataclass(frozen=True)
class Command:
    """A command of a rig: signal = gain * input + offset.

    Attributes:
        signal: what is commanded.
        place: name of the input in the equations of motion.
        gain: of the drive's line (SI per unit of the input).
        offset: of the line (SI).
        low: lowest input.
        high: highest.
    """

    signal: Signal
    place: str
    gain: float
    offset: float
    low: float
    high: float

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest command (SI)."""
        return self.gain * self.low + self.offset, self.gain * self.high + self.offset

    def at(self, value: float) -> float:
        """Input for a command (SI), within its limits."""
        return min(max((value - self.offset) / self.gain, self.low), self.high)


def commands(model: Model, limits: Limits | None = None) -> list[Command]:
    """Return the commands of a model's rig, in the order of an action.

    Args:
        model: the model.
        limits: lowest and highest command (SI) by name, where the model has none or wider ones.
    Raises:
        ValueError: no command, no limits, limits of an unknown one, or limits that are no interval.
    """
    known, lines = dict(limits or {}), _lines(model)
    if not lines:
        drives = ", ".join(f"[{each.effect}]" for each in model.rig.commands)
        raise ValueError(f"model {model.name} takes no command: give it one of {drives}")
    for name in known:
        if name not in lines:
            raise ValueError(
                f"limits name {name!r}, and model {model.name} commands {', '.join(lines)}"
            )
    return [_limited(model, SIGNALS[name], *line, known.get(name)) for name, line in lines.items()]


def _lines(model: Model) -> dict[str, Line]:
    """Place, gain, offset and ends of the input of every command, by its signal."""
    endless = -math.inf, math.inf
    if model.rig.commands:
        lines = {}
        for each in model.rig.commands:
            if each.effect not in model.parameters:
                continue
            place, line = COMMANDS[each.slot], model.parameters[each.effect]
            lines[each.wish or each.name] = (
                _line(place, line, each.is_signed)
                if each.wish
                else (place, 1.0, 0.0, SIGNALS[each.name].limits or endless)
            )
        return lines
    direct, line = direct_command(model), model.parameters.get("regulator_line")
    drive = model.parameters.get("two_way_drive") or model.parameters.get("drive")
    if direct:
        lines = {direct: (COMMANDS[0], 1.0, 0.0, endless)}
    elif drive:
        lines = {"load_command": _line(COMMANDS[0], drive, "two_way_drive" in model.parameters)}
    else:
        lines = {"motor_voltage": (COMMANDS[0], 1.0, 0.0, VOLTAGE_RANGE)}
    if line is not None:
        lines["pressure_command"] = _line(COMMANDS[1], line, False)
    return lines


def _line(place: str, line: Any, is_signed: bool) -> Line:  # noqa: ANN401 - its parameters
    low, high = VOLTAGE_RANGE
    least = low if is_signed else max(low, -line.offset / line.gain)
    return place, line.gain, line.offset, (least, high)


def _limited(
    model: Model,
    signal: Signal,
    place: str,
    gain: float,
    offset: float,
    ends: tuple[float, float],
    limits: Sequence[float] | None,
) -> Command:
    low, high = ends
    if limits is not None:
        asked = _interval(signal, limits)
        low, high = (min(max((end - offset) / gain, low), high) for end in asked)
    if not math.isfinite(high - low):
        raise ValueError(
            f"model {model.name} has no limits of {signal.name}, which actions of -1 and 1 stand "
            f"for: give limits={{{signal.name!r}: [lowest, highest]}} in {signal.si_unit}, what "
            "the drive of the rig gives"
        )
    return Command(signal, place, gain, offset, low, high)


def _interval(signal: Signal, limits: Sequence[float]) -> tuple[float, float]:
    low, high = limits if len(limits) == 2 else (math.nan, math.nan)
    if not -math.inf < low < high < math.inf:
        raise ValueError(
            f"limits of {signal.name} must be two numbers in {signal.si_unit}, the lower first, "
            f"got {limits!r}"
        )
    return float(low), float(high)
