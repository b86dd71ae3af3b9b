"""The noise of each signal, what disturbs it, and what the proposed model leaves of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Floor:
    """The noise of one signal and where it is known from.

    Attributes:
        value: standard deviation in file units.
        source: `repeats`, `rest segments`, `autoregression` or `the model's sensor`.
        by_source: what each source that there was says.
        step: smallest step between readings (quantisation), in file units; 0 if none shows.
        memory: coefficients of the autoregression that whitens it.
    """

    value: float
    source: str
    by_source: Mapping[str, float]
    step: float
    memory: tuple[float, ...]

    def document(self) -> dict[str, Any]:
        """The noise in `diagnosis.json`."""
        return {
            "value": self.value,
            "source": self.source,
            "by_source": dict(self.by_source),
            "step": self.step,
            "memory": list(self.memory),
        }


@dataclass(frozen=True)
class Nuisance:
    """What is neither the rig's nor white: fitted together with every candidate.

    Attributes:
        kind: `line` (of the mains), `drift`, `coloured noise` or `clock`.
        signals: by column, its root mean square in standard deviations of the noise; of coloured
            noise the correlation from one reading to the next; of a clock the share by which it
            runs fast beside that of the commands.
        hertz: frequency of a line; None of others.
    """

    kind: str
    signals: Mapping[str, float]
    hertz: float | None = None

    def document(self) -> dict[str, Any]:
        """The nuisance in `diagnosis.json`."""
        return {"kind": self.kind, "hertz": self.hertz, "signals": dict(self.signals)}


@dataclass(frozen=True)
class Judgement:
    """What the proposed model leaves of one signal, in floors (`adequacy`).

    Attributes:
        floor: what it is judged against, in the column's unit; None where nothing tells.
        source: `repeats`, `tolerance`, `readings' noise`, `rest segments` or `standard errors`;
            empty without a floor.
        misfit: root mean square on readings that the fits had not seen; None where unknown.
        explained: of it by a flexible regression on state, command and its history.
        bound: upper 95 % bound of that.
        fitted: root mean square on the readings that the model was fitted to.
        fault: why the signal does not speak for the model; None where it does.
    """

    floor: float | None
    source: str
    misfit: float | None
    explained: float | None
    bound: float | None
    fitted: float | None
    fault: str | None
