"""What an effect is: one phenomenon, with its law, parameters, units, bounds and sources."""

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise
from types import MappingProxyType
from typing import Any, get_type_hints

from pma_gym.renamed_keywords import old_keywords
from pma_gym.units import Quantity

Value = float | tuple[float, ...]

Parameters = Any
"""An effect's parameters in SI: its own NamedTuple, which no annotation can name here."""


@old_keywords(
    {
        "path": "rate_independent_law",
        "path_bend": "path_breakpoint",
        "switch": "event",
        "bend": "breakpoint",
    }
)
@dataclass(frozen=True)
class Effect:
    """One phenomenon that a plant can have.

    A law is a plain function of floats. Its arguments are signals of its port by name, `memory`
    (the effect's own state), and `p`, the effect's parameters in SI.

    Attributes:
        name: name of the effect, and of its table in a model file.
        port: where it acts; `pma_gym.plant` says which signals a port has and what it adds up.
        parameters: NamedTuple class whose fields are Annotated with a `Quantity` each. A field's
            default (SI) is what a file means that does not name it: a law that gets a parameter
            more keeps its old files.
        law: what the effect contributes at its port; None for a part that the plant reads.
        rate: rate law of the memory, returning (source, decay) for memory' = source - decay *
            memory; None without memory. It may be fast: the integrator is implicit.
        rate_independent_law: law of a memory that depends on the distance travelled alone, not on
            time: its value after `travel` without turning, from `memory`, `travel`, `direction`
            and `p`. Exact, so it costs the integrator nothing; instead of `rate`.
        path_breakpoint: distance (m) from where a travel begins, by `memory`, `direction` and `p`,
            to where the rate-independent law changes form; not above 0 where it does so nowhere.
            Steps end close to it.
        release_path: way (m) until the memory exerts no force any more, by `memory`, `direction`
            and `p`; where backlash lies before the effect, its gap is crossed then. None for an
            effect that backlash does not reach.
        event: event function: a signal at whose zero the law has a kink; steps end there.
        breakpoint: a signal at whose zero the law changes form smoothly; steps end close to it.
        signature: what sets the effect apart in measured data.
        memories: how many numbers the memory has. Of more than one, laws get `memory` as a tuple,
            and the rate law returns a (source, decay) for each.
        memory_scale: what an error of the memory is counted against, roughly its range.
        memory_start: the parameter (field name) that the memory equals where a trial begins; empty
            where it begins at 0.
        held: parameters (field names) that a diagnosis leaves at their usual values when it fits
            the effect: geometry, and what only switches the law on.
        ties: simpler laws in it, each a row of parameters (field names): where the first equals the
            second, the others do nothing. A diagnosis takes the simpler law where its data do not
            refuse it.
        replaces: what it is one of several forms of, so that it stands in place of another effect
            and not beside it: a model's force law or damping (compare such models as models), a
            person, or a law of free shape. A diagnosis proposes none of these as missing.
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
    ties: tuple[tuple[str, ...], ...] = ()
    replaces: str = ""

    @cached_property
    def quantities(self) -> dict[str, Quantity]:
        """Unit, bounds and source of every parameter, by field name."""
        hints = get_type_hints(self.parameters, include_extras=True)
        return {name: hint.__metadata__[0] for name, hint in hints.items()}

    @property
    def neutral(self) -> Parameters | None:
        """Parameters at which the law is exactly absent, or None if there are none such.

        Those that have no neutral value are at their usual one.
        """
        known = {n: q.to_si(q.neutral) for n, q in self.quantities.items() if q.neutral is not None}
        return self.start._replace(**(self._usual | known)) if known else None

    @property
    def usual(self) -> Parameters:
        """Parameters (SI) at their usual values; neutral, else mid-bounds, for one without.

        >>> from pma_gym.effects import CATALOGUE
        >>> CATALOGUE["hysteresis"].usual
        Hysteresis(force=25.0, distance=0.0015, memory_at_start=0.0)
        """
        return (self.neutral or self.start)._replace(**self._usual)

    @property
    def _usual(self) -> dict[str, float]:
        given = self.quantities.items()
        return {name: q.to_si(q.usual) for name, q in given if q.usual is not None}

    @property
    def start(self) -> Parameters:
        """Parameters in the middle of their bounds, a place to start a fit from."""
        middle = {n: q.to_si(0.5 * (q.lower + q.upper)) for n, q in self.quantities.items()}
        return self.parameters(**middle)

    @cached_property
    def rows(self) -> tuple[str, ...]:
        """Names of the parameters that are rows of numbers; the first one's increase."""
        hints = get_type_hints(self.parameters)
        return tuple(name for name, hint in hints.items() if hint is not float)

    def names_at_the_door(self) -> Mapping[str, str]:
        """Field name by its name in files, which ends in the unit: slope_n_per_kpa -> slope."""
        return self._doors

    @cached_property
    def _doors(self) -> Mapping[str, str]:
        doors = {quantity.name(stem): stem for stem, quantity in self.quantities.items()}
        return MappingProxyType(doors)

    @cached_property
    def defaults(self) -> Mapping[str, float]:
        """Values in file units of the parameters that need not be named, by their names there.

        >>> from pma_gym.effects import CATALOGUE
        >>> dict(CATALOGUE["drive_dead_zone"].defaults)
        {'slope': 2.0}
        """
        known = self.parameters._field_defaults
        stems = {door: stem for door, stem in self._doors.items() if stem in known}
        return MappingProxyType(
            {door: self.quantities[stem].from_si(known[stem]) for door, stem in stems.items()}
        )

    def parse(self, values: Mapping[str, Value]) -> Parameters:
        """Parameters in SI from values by their names in files; defaults for what has one.

        Raises:
            ValueError: an unknown, missing or out-of-bounds parameter, naming all of it.
        """
        names = self.names_at_the_door()
        missing = [name for name in names if name not in values and name not in self.defaults]
        unknown = [name for name in values if name not in names]
        if unknown or missing:
            raise ValueError(
                f"[{self.name}] takes {', '.join(names)}; unknown: {', '.join(unknown) or 'none'}, "
                f"missing: {', '.join(missing) or 'none'}"
                + "".join(
                    f"; {door} may be left out ({usual:g})" for door, usual in self.defaults.items()
                )
            )
        given = {names[door]: self._si(door, names[door], values[door]) for door in values}
        return self.checked(self.parameters(**given))

    def changed(self, parameters: Parameters, values: Mapping[str, Value]) -> Parameters:
        """The parameters, some of them given anew by their names in files.

        Raises:
            ValueError: an unknown or out-of-bounds parameter.
        """
        names = self.names_at_the_door()
        given = {names[door]: self._si(door, names[door], values[door]) for door in values}
        return self.checked(parameters._replace(**given))

    def checked(self, parameters: Parameters) -> Parameters:
        """The parameters, if their rows belong together.

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

    def _si(self, door: str, stem: str, value: Value) -> Value:
        quantity, many = self.quantities[stem], isinstance(value, list | tuple)
        unit = "without a unit" if quantity.unit == "1" else f"in {quantity.unit}"
        if many != (stem in self.rows):
            wanted = "a list of numbers" if stem in self.rows else "one number"
            raise ValueError(f"{self.name}.{door} must be {wanted} {unit}, got {value!r}")
        numbers = value if isinstance(value, list | tuple) else (value,)
        for number in numbers:
            if isinstance(number, bool) or not isinstance(number, int | float):
                raise ValueError(f"{self.name}.{door} must be a number {unit}, got {number!r}")
            quantity.check(f"{self.name}.{door}", number)
        converted = tuple(quantity.to_si(float(number)) for number in numbers)
        return converted if many else converted[0]

    def at_the_door(self, parameters: Parameters) -> dict[str, Value]:
        """Values by their names in files: the inverse of `parse`."""
        out: dict[str, Value] = {}
        for door, stem in self.names_at_the_door().items():
            value, quantity = getattr(parameters, stem), self.quantities[stem]
            many = isinstance(value, tuple)
            out[door] = tuple(map(quantity.from_si, value)) if many else quantity.from_si(value)
        return out

    @property
    def memory_names(self) -> tuple[str, ...]:
        """Names of the states that hold its memory: `memory_creep`, `memory_drive_delay_1`."""
        if not (self.rate or self.rate_independent_law):
            return ()
        name = f"memory_{self.name}"
        return (
            (name,)
            if self.memories == 1
            else tuple(f"{name}_{i + 1}" for i in range(self.memories))
        )

    def shares_law(self, other: "Effect") -> bool:
        """Whether it is another, or both are terms of one law: their memories follow one path."""
        path = self.rate_independent_law
        return self.name == other.name or (path is not None and path is other.rate_independent_law)

    def laws(self) -> Iterator[Callable]:
        """The law and those beside it, where there are any."""
        of_memory = (
            self.rate,
            self.rate_independent_law,
            self.path_breakpoint,
            self.release_path,
        )
        every = (self.law, *of_memory, self.event, self.breakpoint)
        yield from (law for law in every if law is not None)


@cache
def signals(law: Callable) -> tuple[str, ...]:
    """Names of a law's arguments, in order."""
    return tuple(inspect.signature(law).parameters)
