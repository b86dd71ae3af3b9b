"""The file of a rig: line, rate, limits, safe state."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from pma_gym.bench.rig import RigError
from pma_gym.data.trial_columns import BY_QUANTITY, suggestion
from pma_gym.document_shape import ANY, check_shape, shape_of
from pma_gym.documents import read_toml

SAFE = ("vent", "hold", "ramp")
LOWEST_MS, HIGHEST_MS = 2, 1000
"""Shortest and longest time without a command after which a watchdog acts."""

COLUMNS = {
    kind: [column.name for column in BY_QUANTITY.values() if column.kind == kind]
    for kind in ("command", "measurement")
}


@dataclass(frozen=True)
class MeasurementLimits:
    """Limits of a measurement, in the unit of its column; beyond them the rig is made safe.

    Attributes:
        range: lowest and highest value.
        rate: largest change in a second, from one measurement to the next; 0 for any.
    """

    range: Sequence[float]
    rate: float = 0.0


@dataclass(frozen=True)
class CommandLimits:
    """Limits of a command, in the unit of its column; what is asked for beyond is clipped.

    Attributes:
        range: lowest and highest value.
        rate: largest change in a second.
        rest: value without danger: in which the rig waits, and to which it vents or ramps.
        start: value with which trials begin, or that is constant; that of rest if None.
    """

    range: Sequence[float]
    rate: float
    rest: float
    start: float | None = None


@dataclass(frozen=True)
class SafeState:
    """What the rig does at the end, on Ctrl-C and without commands.

    Attributes:
        action: "vent": commands go to rest at once; "hold": they stay; "ramp": they go to rest.
        seconds: how long a ramp takes.
    """

    action: str
    seconds: float = 0.0

    @property
    def ramp_ms(self) -> int:
        """As firmware takes it: how long commands take to rest (ms); -1 where they stay."""
        return {"hold": -1, "vent": 0}.get(self.action, round(self.seconds * 1e3))


@dataclass(frozen=True)
class RigFile:
    """The content of a rig's file.

    Attributes:
        model: shipped name or file of the nominal model, which controllers receive.
        port: name of the serial port, or "emulator".
        rate_hz: control rate.
        watchdog_ms: time without a command or an answer after which both sides make the rig safe.
        commands: limits of every command, by column.
        measurements: limits of every measurement, by column.
        safe: the safe state.
        title: a line for people.
        baud: of the line.
        settle_s: how long the start commands act before a trial.
        emulated_model: shipped name or file of the model that the emulator runs; the nominal one
            if empty.
        seed: of the emulator's noise.
    """

    model: str
    port: str
    rate_hz: float
    watchdog_ms: int
    commands: Mapping[str, CommandLimits]
    measurements: Mapping[str, MeasurementLimits]
    safe: SafeState
    title: str = "Trials of a rig"
    baud: int = 115200
    settle_s: float = 0.0
    emulated_model: str = ""
    seed: int = 0

    @property
    def start(self) -> list[float]:
        """Commands with which trials begin."""
        return [c.rest if c.start is None else c.start for c in self.commands.values()]

    @property
    def rest(self) -> list[float]:
        """Commands without danger."""
        return [each.rest for each in self.commands.values()]


def read_rig_file(path: Path) -> RigFile:
    """Read and check a rig's file; models count from its folder.

    Raises:
        ValueError: no TOML, an unknown or missing key, or a value that breaks a rule.
    """
    document = read_toml(path)
    models = {
        key: str(path.parent / name)
        for key in ("model", "emulated_model")
        if (name := str(document.get(key))).endswith(".toml")
    }
    try:
        _check_keys(RigFile, document)
        for key, kind in (("commands", CommandLimits), ("measurements", MeasurementLimits)):
            check_shape(document, {key: {ANY: dict}})
            for table in document[key].values():
                _check_keys(kind, table)
        _check_keys(SafeState, document.get("safe"))
        check_shape(document, shape_of(RigFile))
        commands = {name: CommandLimits(**t) for name, t in document["commands"].items()}
        measurements = {
            name: MeasurementLimits(**t) for name, t in document["measurements"].items()
        }
        known = {"commands": commands, "measurements": measurements}
        rig = RigFile(**{**document, **known, **models, "safe": SafeState(**document["safe"])})
        _check(rig)
    except ValueError as error:
        raise RigError(f"{path}: {error}") from None
    return rig


def _check_keys(kind: type, table: object) -> None:
    # A key with a slip of the pen must not take a limit away.
    known = [field.name for field in fields(kind)]
    for key in table if isinstance(table, dict) else ():
        if key not in known:
            raise RigError(f"keys are {', '.join(known)}, got {key!r}{suggestion(key, known)}")


def _check(rig: RigFile) -> None:
    for kind, limits in (("command", rig.commands), ("measurement", rig.measurements)):
        for name, each in limits.items():
            place, (low, high) = f"{kind}s.{name}", _pair(f"{kind}s.{name}", each.range)
            if name not in COLUMNS[kind]:
                near = suggestion(name, COLUMNS[kind])
                raise RigError(f"{kind}s are columns of trials, got {name!r}{near}")
            levels = (each.rest, each.start) if isinstance(each, CommandLimits) else ()
            if each.rate < 0.0 or (levels and not each.rate):
                raise RigError(f"{place}.rate must be positive, got {each.rate:g} a second")
            for value in levels:
                if value is not None and not low <= value <= high:
                    raise RigError(f"{place}: {value:g} must lie in its range, {low:g} to {high:g}")
    if rig.safe.action not in SAFE or rig.safe.seconds < 0.0:
        raise RigError(
            f"safe.action must be {', '.join(SAFE)}, with seconds of 0 or more for a ramp, got "
            f"{rig.safe.action!r} and {rig.safe.seconds:g} s"
        )
    least = max(LOWEST_MS, 2e3 / rig.rate_hz) if rig.rate_hz > 0.0 else HIGHEST_MS
    if not (rig.rate_hz <= 1000.0 and least <= rig.watchdog_ms <= HIGHEST_MS):
        raise RigError(
            f"rate_hz must lie in 2 to 1000 and watchdog_ms in two periods to {HIGHEST_MS} ms, got "
            f"{rig.rate_hz:g} Hz and {rig.watchdog_ms} ms"
        )


def _pair(place: str, ends: Sequence[float]) -> tuple[float, float]:
    low, high = ends if len(ends) == 2 else (0.0, 0.0)
    if not low < high:
        raise RigError(f"{place}.range must be two numbers, the lower first, got {list(ends)}")
    return low, high
