"""What an effect is: one phenomenon, with its law, parameters, units, bounds and sources."""

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, get_type_hints

from pma_gym.units import Quantity

Value = float | tuple[float, ...]


@dataclass(frozen=True)
class Effect:
    """One phenomenon that a plant can have.

    A law is a plain function of floats. Its arguments are signals of its port by name, `memory`
    (the effect's own state), and `p`, the effect's parameters in SI.

    Attributes:
        name: name of the effect, and of its table in a model file.
        port: where it acts; `pma_gym.plant` says which signals a port has and what it adds up.
        parameters: NamedTuple class whose fields are Annotated with a `Quantity` each.
        law: what the effect contributes at its port; None for a part that the plant reads.
        rate: rate law of the memory, returning (source, decay) for memory' = source - decay *
            memory; None without memory. The decay is integrated exactly, so it may be fast.
        signature: what sets the effect apart in measured data.
    """

    name: str
    port: str
    parameters: Any
    law: Callable | None = None
    rate: Callable | None = None
    signature: str = ""

    @property
    def quantities(self) -> dict[str, Quantity]:
        """Unit, bounds and source of every parameter, by field name."""
        hints = get_type_hints(self.parameters, include_extras=True)
        return {name: hint.__metadata__[0] for name, hint in hints.items()}

    @property
    def neutral(self) -> Any:
        """Parameters at which the law is exactly absent, or None if there are none such."""
        values = {name: q.neutral for name, q in self.quantities.items()}
        if all(value is None for value in values.values()):
            return None
        start = self.start
        given = {k: self.quantities[k].to_si(v) for k, v in values.items() if v is not None}
        return start._replace(**given)

    @property
    def start(self) -> Any:
        """Parameters in the middle of their bounds, a place to start a fit from."""
        middle = {n: q.to_si(0.5 * (q.lower + q.upper)) for n, q in self.quantities.items()}
        return self.parameters(**middle)

    def names_at_the_door(self) -> dict[str, str]:
        """Field name by its name in files, which ends in the unit: slope_n_per_kpa -> slope."""
        return {quantity.name(stem): stem for stem, quantity in self.quantities.items()}

    def parse(self, values: Mapping[str, Value]) -> Any:
        """Parameters in SI from values by their names at the door.

        Raises:
            ValueError: an unknown, missing or out-of-bounds parameter, naming all of it.
        """
        names = self.names_at_the_door()
        missing = [name for name in names if name not in values]
        unknown = [name for name in values if name not in names]
        if unknown or missing:
            raise ValueError(
                f"[{self.name}] takes {', '.join(names)}; "
                + f"unknown: {', '.join(unknown) or 'none'}, missing: {', '.join(missing) or 'none'}"
            )
        return self.parameters(**{stem: self._si(door, values[door]) for door, stem in names.items()})

    def _si(self, door: str, value: Value) -> Value:
        quantity = self.quantities[self.names_at_the_door()[door]]
        many = isinstance(value, list | tuple)
        for one in value if many else (value,):
            if isinstance(one, bool) or not isinstance(one, int | float):
                raise ValueError(f"{self.name}.{door} must be a number in {quantity.unit}, got {one!r}")
            quantity.check(f"{self.name}.{door}", one)
        return tuple(map(quantity.to_si, value)) if many else quantity.to_si(value)  # type: ignore[arg-type]

    def at_the_door(self, parameters: Any) -> dict[str, Value]:
        """Values by their names at the door: the inverse of `parse`."""
        out: dict[str, Value] = {}
        for door, stem in self.names_at_the_door().items():
            value, quantity = getattr(parameters, stem), self.quantities[stem]
            many = isinstance(value, tuple)
            out[door] = tuple(map(quantity.from_si, value)) if many else quantity.from_si(value)
        return out

    def laws(self) -> Iterator[Callable]:
        """The law and the rate law, where there are any."""
        yield from (law for law in (self.law, self.rate) if law is not None)


def signals(law: Callable) -> list[str]:
    """Names of a law's arguments, in order."""
    return list(inspect.signature(law).parameters)
