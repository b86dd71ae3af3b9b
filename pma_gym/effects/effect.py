"""The class `Effect`: one phenomenon with its law, parameters, units, bounds and sources."""

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise
from types import MappingProxyType
from typing import Any, get_type_hints

from pma_gym.units import Quantity

Value = float | tuple[float, ...]

Parameters = Any
"""An effect's parameters in SI, a NamedTuple that each effect's file defines."""


@dataclass(frozen=True)
class Effect:
    """One phenomenon that a plant can have.

    A law is a plain function of floats. Its arguments are signals of its port by name, `memory`
    (the effect's own state), and `p`, the effect's parameters in SI.

    Attributes:
        name: name of the effect, and of its table in a model file.
        port: where it acts; `pma_gym.effects.ports` lists each port's signals and how results
            combine.
        parameters: NamedTuple class whose fields are Annotated with a `Quantity` each. A field's
            default (SI) applies where a file does not name it, so that old files stay valid when a
            law gets another parameter.
        law: the effect's contribution at its port; None for parameters that the plant reads
            directly.
        rate: rate law of the effect's state, returning (source, decay) for memory' = source - decay
            * memory; None without a state. It may be stiff: the integrator is implicit.
        rate_independent_law: law of a state that depends on the distance travelled and not on time:
            its value after `travel` without a reversal, from `memory`, `travel`, `direction` and
            `p`. It replaces `rate` and is exact, so the integrator has no equation to solve.
        path_breakpoint: distance (m) from the start of a travel, from `memory`, `direction` and
            `p`, to the point where the rate-independent law changes form; 0 or less if there is no
            such point. Steps end close to it.
        release_path: distance (m) until the state exerts no force any more, from `memory`,
            `direction` and `p`; with backlash before the effect, the gap is crossed from there on.
            None for an effect that backlash does not affect.
        event: event function: a signal at whose zero the law has a kink; steps end there.
        breakpoint: a signal, or a row of them, at whose zero the law changes form; steps end close
            to it. A slope that jumps elsewhere may do so behind the last point at which a step asks
            for its rates, and shows in none of them.
        signature: feature of measured data that distinguishes the effect.
        memories: number of states. With more than one, laws get `memory` as a tuple, and the rate
            law returns a (source, decay) for each.
        memory_scale: scale of the state for the integrator's error, roughly its range.
        memory_start: the parameter (field name) that gives the state at the start; empty for 0.
        held: parameters (field names) that a diagnosis leaves at their usual values when it fits
            the effect: geometry, and parameters that only switch the law on.
        scanned: those of them (field names) whose size no rig shares with another, such as the
            distance before a contact slips: a diagnosis holds them at the best value of a ladder.
        ties: simpler special cases of the law, each a row of parameters (field names): where the
            first equals the second, the others have no effect. The first is never the smaller one.
            A diagnosis prefers the simpler law unless the data reject it.
        terms: terms that the law may lack, each a row of parameters (field names): where the first
            is at its neutral value, the others have no effect. A diagnosis prefers the law without.
        replaces: the part of a model that the effect is one of several forms of: a force law, a
            damping, a person, or a law of free shape. Such an effect replaces another one and is
            not added to it, so a diagnosis never proposes it as missing; compare whole models
            instead.
        of: name of the effect that this one is at a second muscle; empty for any other.
    """

    name: str
    port: str
    parameters: Any
    law: Callable | None = None
    rate: Callable | None = None
    rate_independent_law: Callable | None = None
    path_breakpoint: Callable | None = None
    release_path: Callable | None = None
    event: Callable | None = None
    breakpoint: Callable | None = None
    signature: str = ""
    memory_scale: float = 1.0
    memories: int = 1
    memory_start: str = ""
    held: tuple[str, ...] = ()
    scanned: tuple[str, ...] = ()
    ties: tuple[tuple[str, ...], ...] = ()
    terms: tuple[tuple[str, ...], ...] = ()
    replaces: str = ""
    of: str = ""

    @cached_property
    def quantities(self) -> dict[str, Quantity]:
        """Unit, bounds and source of every parameter, keyed by field name."""
        hints = get_type_hints(self.parameters, include_extras=True)
        return {name: hint.__metadata__[0] for name, hint in hints.items()}

    @property
    def neutral(self) -> Parameters | None:
        """Parameters at which the law is exactly absent, or None if there are none.

        Parameters without a neutral value are at their usual one.
        """
        known = {n: q.to_si(q.neutral) for n, q in self.quantities.items() if q.neutral is not None}
        return self.start._replace(**(self._usual | known)) if known else None

    @property
    def usual(self) -> Parameters:
        """Parameters (SI) at their usual values, else at the neutral value, else at mid-bounds.

        >>> from pma_gym.effects import CATALOGUE
        >>> CATALOGUE["hysteresis"].usual
        Hysteresis(force=25.0, distance=0.0015, memory_at_start=0.0)
        """
        return (self.neutral or self.start)._replace(**self._usual)

    @property
    def _usual(self) -> dict[str, float]:
        quantities = self.quantities.items()
        return {name: q.to_si(q.usual) for name, q in quantities if q.usual is not None}

    @property
    def start(self) -> Parameters:
        """Parameters in the middle of their bounds, as a start for a fit."""
        middle = {n: q.to_si(0.5 * (q.lower + q.upper)) for n, q in self.quantities.items()}
        return self.parameters(**middle)

    @cached_property
    def rows(self) -> tuple[str, ...]:
        """Names of the parameters that are rows of numbers; the first row increases."""
        hints = get_type_hints(self.parameters)
        return tuple(name for name, hint in hints.items() if hint is not float)

    def names_in_files(self) -> Mapping[str, str]:
        """Map names in files, which end in the unit, to field names: slope_n_per_kpa -> slope."""
        return self._file_keys

    @cached_property
    def _file_keys(self) -> Mapping[str, str]:
        file_keys = {quantity.name(stem): stem for stem, quantity in self.quantities.items()}
        return MappingProxyType(file_keys)

    @cached_property
    def defaults(self) -> Mapping[str, float]:
        """Default values (file units) of the optional parameters, keyed by their names in files.

        >>> from pma_gym.effects import CATALOGUE
        >>> dict(CATALOGUE["drive_dead_zone"].defaults)
        {'slope': 2.0}
        """
        known = self.parameters._field_defaults
        stems = {file_key: stem for file_key, stem in self._file_keys.items() if stem in known}
        return MappingProxyType(
            {
                file_key: self.quantities[stem].from_si(known[stem])
                for file_key, stem in stems.items()
            }
        )

    def parse(self, values: Mapping[str, Value]) -> Parameters:
        """Convert values keyed by their names in files to parameters in SI; defaults fill the gaps.

        Raises:
            ValueError: an unknown, missing or out-of-bounds parameter, with its name, value and
                bounds.
        """
        names = self.names_in_files()
        missing = [name for name in names if name not in values and name not in self.defaults]
        unknown = [name for name in values if name not in names]
        if unknown or missing:
            raise ValueError(
                f"[{self.name}] takes {', '.join(names)}; unknown: {', '.join(unknown) or 'none'}, "
                f"missing: {', '.join(missing) or 'none'}"
                + "".join(
                    f"; {file_key} may be left out ({usual:g})"
                    for file_key, usual in self.defaults.items()
                )
            )
        si_values = {
            names[file_key]: self._si(file_key, names[file_key], values[file_key])
            for file_key in values
        }
        return self.checked(self.parameters(**si_values))

    def changed(self, parameters: Parameters, values: Mapping[str, Value]) -> Parameters:
        """Replace some parameters by values keyed by their names in files.

        Raises:
            ValueError: an unknown or out-of-bounds parameter.
        """
        names = self.names_in_files()
        si_values = {
            names[file_key]: self._si(file_key, names[file_key], values[file_key])
            for file_key in values
        }
        return self.checked(parameters._replace(**si_values))

    def checked(self, parameters: Parameters) -> Parameters:
        """Return the parameters after a check of their rows.

        Raises:
            ValueError: rows of different lengths, or a first row that does not increase.
        """
        rows = [getattr(parameters, name) for name in self.rows]
        if not rows:
            return parameters
        if len({len(row) for row in rows}) > 1 or len(rows[0]) < 2:
            lengths = ", ".join(f"{n} {len(r)}" for n, r in zip(self.rows, rows, strict=True))
            raise ValueError(
                f"rows of [{self.name}] must have one length, 2 or more; got {lengths}"
            )
        if any(after <= before for before, after in pairwise(rows[0])):
            raise ValueError(f"{self.rows[0]} of [{self.name}] must increase from entry to entry")
        return parameters

    def _si(self, file_key: str, stem: str, value: Value) -> Value:
        quantity, many = self.quantities[stem], isinstance(value, list | tuple)
        unit = "without a unit" if quantity.unit == "1" else f"in {quantity.unit}"
        if many != (stem in self.rows):
            expected = "a list of numbers" if stem in self.rows else "one number"
            raise ValueError(f"{self.name}.{file_key} must be {expected} {unit}, got {value!r}")
        numbers = value if isinstance(value, list | tuple) else (value,)
        for number in numbers:
            if isinstance(number, bool) or not isinstance(number, int | float):
                raise ValueError(f"{self.name}.{file_key} must be a number {unit}, got {number!r}")
            quantity.check(f"{self.name}.{file_key}", number)
        converted = tuple(quantity.to_si(float(number)) for number in numbers)
        return converted if many else converted[0]

    def values_in_files(self, parameters: Parameters) -> dict[str, Value]:
        """Convert parameters to values keyed by their names in files: the inverse of `parse`."""
        out: dict[str, Value] = {}
        for file_key, stem in self.names_in_files().items():
            value, quantity = getattr(parameters, stem), self.quantities[stem]
            many = isinstance(value, tuple)
            out[file_key] = tuple(map(quantity.from_si, value)) if many else quantity.from_si(value)
        return out

    @property
    def memory_names(self) -> tuple[str, ...]:
        """Names of the effect's states in the plant: `memory_creep`, `memory_drive_delay_1`."""
        if not (self.rate or self.rate_independent_law):
            return ()
        name = f"memory_{self.name}"
        return (
            (name,)
            if self.memories == 1
            else tuple(f"{name}_{i + 1}" for i in range(self.memories))
        )

    def shares_law(self, other: "Effect") -> bool:
        """Whether both are the same effect or terms of one law, with the same state."""
        path = self.rate_independent_law
        return self.name == other.name or (path is not None and path is other.rate_independent_law)

    def is_further_term(self, other: "Effect") -> bool:
        """Whether both are terms of one law at one place, as a seal's friction has them."""
        return self.name != other.name and self.port == other.port and self.shares_law(other)

    def laws(self) -> Iterator[Callable]:
        """All laws of the effect: its law, rate, path and event functions, those that it has."""
        of_memory = (
            self.rate,
            self.rate_independent_law,
            self.path_breakpoint,
            self.release_path,
        )
        every = (self.law, *of_memory, self.event, self.breakpoint)
        yield from (law for law in every if law is not None)


ANTAGONIST = "antagonist_"
"""Prefix of the effects, ports and signals of a second muscle."""


def antagonist(effect: Effect) -> Effect:
    """Return the effect at a second muscle: the same law with parameters and states of its own.

    >>> from pma_gym.effects import CATALOGUE
    >>> antagonist(CATALOGUE["pressure_transducer"]).port
    'sensor:antagonist_pressure'
    """
    kind, colon, place = effect.port.rpartition(":")
    names = {"name": f"{ANTAGONIST}{effect.name}", "of": effect.name}
    return replace(effect, **names, port=f"{kind}{colon}{ANTAGONIST}{place}")


@cache
def signals(law: Callable) -> tuple[str, ...]:
    """Names of a law's arguments, in order."""
    return tuple(inspect.signature(law).parameters)
