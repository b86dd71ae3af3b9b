"""How a policy's action becomes a voltage: as it is, as a change, or added to a controller's."""

import reprlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

FormKind = Literal["direct", "increment", "residual"]
FORM_KINDS: tuple[FormKind, ...] = ("direct", "increment", "residual")

MIDDLE_V, HIGHEST_V = 5.0, 10.0
"""Middle and upper end of an actuator's voltages (V)."""


@dataclass(frozen=True)
class ActionMapping:
    """What an action of -1 to 1 does to the voltage, which is held to 0-10 V.

        direct     V = 5 + 5 a
        increment  V = V_before + authority a
        residual   V = V_base + authority a

    An increment makes the policy's memory: integral action needs nothing else.

    Args:
        kind: one of these.
        authority_v: voltage of an action of 1 (V); 5 where it is direct.
        base: name of the controller that a residual is added to; none for the others.
    """

    kind: FormKind = "increment"
    authority_v: float = 0.5
    base: str | None = None

    def __post_init__(self) -> None:
        if self.kind not in FORM_KINDS:
            raise ValueError(f"form kind must be one of {', '.join(FORM_KINDS)}, got {self.kind!r}")
        authority = self.authority_v
        real = isinstance(authority, int | float) and not isinstance(authority, bool)
        if not real or not 0.0 < authority <= HIGHEST_V:
            raise ValueError(
                f"form authority_v must be a number above 0, up to {HIGHEST_V:g} V, "
                f"got {authority!r}"
            )
        if self.kind == "direct" and authority != MIDDLE_V:
            raise ValueError(f"a direct form has authority_v {MIDDLE_V:g}, got {authority:g} V")
        named = isinstance(self.base, str) and bool(self.base.strip())
        if not (named if self.kind == "residual" else self.base is None):
            raise ValueError(
                "a residual names its base, a text, the other forms have none; got kind "
                f"{self.kind!r} with base {reprlib.repr(self.base)}"
            )

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> "ActionMapping":
        """An action mapping from JSON.

        Raises:
            ValueError: a key that is unknown or missing, or a value out of range.
        """
        strange = sorted(set(given) ^ {"kind", "authority_v", "base"})
        if strange:
            raise ValueError(f"a form has kind, authority_v and base; check {', '.join(strange)}")
        return cls(**given)

    def to_json(self) -> dict[str, Any]:
        """The mapping as JSON."""
        return asdict(self)

    def wanted(self, action: Any, before: Any, base: Any) -> Any:  # noqa: ANN401
        """Voltage that an action asks for (V), not yet held to 0-10 V; of numbers or arrays.

        Args:
            action: -1 to 1.
            before: voltage commanded last (V).
            base: the base's (V), if there is one.
        """
        if self.kind == "direct":
            return MIDDLE_V + MIDDLE_V * action
        return (before if self.kind == "increment" else base) + self.authority_v * action
