"""What a diagnosis says: verdict, where, which effects, how large, what gap they close."""

import json
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.pages.document import Block, Callout, TextTable
from pma_gym.pages.notebook import notebook_html
from pma_gym.plant.model import Model

SCHEMA = 1
"""Version of `diagnosis.json`."""

Array = NDArray[np.float64]


def _renamed(of: object, old: str, new: str) -> Any:  # noqa: ANN401 - whatever it is
    """The attribute by its new name, with a warning that says it."""
    warnings.warn(
        f"{type(of).__name__}.{old} is now {new}; read it by that name",
        DeprecationWarning,
        stacklevel=3,
    )
    return getattr(of, new)


@dataclass(frozen=True)
class TrialState:
    """What belongs to one trial and not to the model.

    Attributes:
        zeros: what each signal reads where the model says 0, by column, in its unit.
        parameters: of the model in this trial alone, by path, in their units.
    """

    zeros: Mapping[str, float] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)


Verdict = Literal["effect", "parameters", "agrees", "unknown", "undecidable"]
"""`effect`: the catalogue has what is missing. `parameters`: known parameters were off. `agrees`:
nothing beyond noise. `unknown`: structure is missing that no effect of the catalogue carries.
`undecidable`: these data do not decide."""

ADDED = "added to the model"
"""Why a candidate is where it is, if it is in the proposed model."""

UNFITTED = "could not be fitted: its score promises more than any fit of it brings"
"""The same of a candidate that may carry the residual although its fits do not."""


@dataclass(frozen=True)
class Estimate:
    """A parameter's value with its 95 % interval, in its file unit.

    Attributes:
        value: the value.
        low: lower end of the interval; None where the data do not bound it.
        high: upper end.
        unit: the unit.
        limit: `lower` or `upper` where the value is at that end of what the fit allows, else empty.
    """

    value: float
    low: float | None
    high: float | None
    unit: str
    limit: str = ""


@dataclass(frozen=True)
class Moved:
    """A parameter of the model that the data ask to change.

    Attributes:
        start: its value in the model that was given.
        now: its estimate, together with whatever effects were added.
        significant: whether it is said to be off: its estimate is more than three standard errors
            away, or, where nothing but parameters is off, by odds of 20 to 1. Where the verdict is
            `agrees`, refitting changes the signals by less than a tenth of their noise.
    """

    start: float
    now: Estimate
    significant: bool


@dataclass(frozen=True)
class Place:
    """Where simulation and data disagree, before anything was refitted but parameters.

    Attributes:
        signal: column name of the measurement, `contraction_mm`.
        region: where, in words.
        share_of_gap: share of the signal's unexplained mean square that lies there.
        p_value: of so much there by chance, adjusted for all regions that were looked at.
    """

    signal: str
    region: str
    share_of_gap: float
    p_value: float


@dataclass(frozen=True)
class Undetermined:
    """A parameter of an effect that the data do not determine: it has left the effect's law.

    Attributes:
        above: value above which it lies (95 %), in its unit; None where nothing tells.
        below: the same from above.
        unit: the unit.
    """

    above: float | None
    below: float | None
    unit: str


@dataclass(frozen=True)
class NamedEffect:
    """An effect that the diagnosis adds to the model.

    Attributes:
        name: its name in the catalogue.
        confused_with: other candidates that explain these data as well.
        p_value: family-wise over the whole catalogue.
        parameters: estimates by column name.
        undetermined: parameters without an estimate, by column name (`nested_laws`).
    """

    name: str
    confused_with: tuple[str, ...]
    p_value: float
    parameters: Mapping[str, Estimate]
    undetermined: Mapping[str, Undetermined] = field(default_factory=dict)

    def document(self) -> dict[str, Any]:
        """The effect in `diagnosis.json`."""
        return {
            "name": self.name,
            "confused_with": list(self.confused_with),
            "p_value": self.p_value,
            "parameters": {name: vars(each) for name, each in self.parameters.items()},
            "not_determined": {name: vars(each) for name, each in self.undetermined.items()},
        }


@dataclass(frozen=True)
class Approximate:
    """Effects that carry most of what is missing by laws that fit only approximately.

    Attributes:
        effects: they, with their sizes: what the verdict `effect` names, or the best candidates of
            the verdict `unknown`.
        left: share of the misfit beyond noise (mean square, summed over signals in units of their
            noise) that they leave.
        held_out: whether it is that of readings which the fits had not seen.
    """

    effects: tuple[NamedEffect, ...]
    left: float
    held_out: bool


@dataclass(frozen=True)
class Gap:
    """How far simulation and measurement of one signal lie apart (root mean square, file units).

    Attributes:
        before: the model as it was given.
        parameters: its parameters refitted, nothing added.
        after: the amended model.
        floor: the noise of the measurement.
        held_out: whether `after` comes from fits that had not seen the trial.
    """

    before: float
    parameters: float
    after: float
    floor: float
    held_out: bool

    @property
    def closed(self) -> float | None:
        """(before - after) / (before - floor), at most 1; None where there was no gap."""
        gap = self.before - self.floor
        if gap <= 0.02 * self.floor or self.before == 0.0:
            return None
        return min(1.0, (self.before - self.after) / gap)


@dataclass(frozen=True)
class Candidate:
    """How one effect of the catalogue fared.

    Attributes:
        name: its name.
        delta_log_likelihood: gain in whitened log-likelihood over the refitted model.
        held_out_gain: the same on trials that it was not fitted to, per reading of theirs, from
            chi-square alone (the verdict also counts what the other trials leave open); None where
            it was not tried.
        p_value: family-wise, of so large a gain by chance.
        change: rms of what it changes in the signals beyond what parameters could, over noise.
        resolvable: smallest size that these data would have shown, as a share of its usual one;
            None where no size would show.
        fitted: whether it was fitted, or only screened.
        why: in words, why it was kept or dropped.
    """

    name: str
    delta_log_likelihood: float
    held_out_gain: float | None
    p_value: float
    change: float
    resolvable: float | None
    fitted: bool
    why: str


@dataclass(frozen=True)
class NextExperiment:
    """What to measure next.

    Attributes:
        excitation: its name and settings in words.
        separates: candidates that it tells apart.
        expected_odds: likelihood ratio to expect between the two that are hardest to tell.
        minutes: how long it takes.
        trial: its commands.
    """

    excitation: str
    separates: tuple[str, ...]
    expected_odds: float
    minutes: float
    trial: Trial

    @property
    def protocol(self) -> str:
        """Old name of `excitation`."""
        return _renamed(self, "protocol", "excitation")


@dataclass(frozen=True)
class ResidualLaw:
    """What a flexible law finds missing where no effect of the catalogue fits.

    Attributes:
        quantity: what is missing, `force on the slide (N)`.
        variable: what it depends on, with unit, `contraction (mm)`.
        at: values of the variable, shape (n,).
        law: the law there, shape (n,).
        low: lower end of its 95 % band.
        high: upper end.
        words: its shape in words.
    """

    quantity: str
    variable: str
    at: Array
    law: Array
    low: Array
    high: Array
    words: str


@dataclass(frozen=True)
class TrialRecord:
    """One trial's curves, for the report; SI, shape (rows, signals), NaN = gap.

    Attributes:
        name: the trial's file, or its number.
        time: (s), shape (rows,).
        measured: readings.
        before: simulated by the model as it was given.
        parameters: by the model with its parameters refitted.
        after: by the amended model; from a fit that had not seen the trial where `held_out`.
        gaps: by column name.
        held_out: see `after`.
        file: the log that it is a piece of, or its own name.
        columns: of the signals, in their order.
    """

    name: str
    time: Array
    measured: Array
    before: Array
    parameters: Array
    after: Array
    gaps: Mapping[str, Gap]
    held_out: bool
    file: str = ""
    columns: tuple[str, ...] = ()


@dataclass(frozen=True)
class Map:
    """A signal's residual over two conditions, for the report.

    Attributes:
        signal: column name.
        x_name: what runs along x, with unit.
        y_name: along y.
        x_edges: shape (n + 1,).
        y_edges: shape (m + 1,).
        residual: mean residual after the parameters were refitted, over the noise, shape (m, n);
            NaN where there are no data.
    """

    signal: str
    x_name: str
    y_name: str
    x_edges: Array
    y_edges: Array
    residual: Array


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


@dataclass(frozen=True)
class Nuisance:
    """What is neither the rig's nor white: fitted together with every candidate.

    Attributes:
        kind: `line` (of the mains), `drift` or `coloured noise`.
        signals: by column, its root mean square in standard deviations of the noise; of coloured
            noise the correlation from one reading to the next.
        hertz: frequency of a line; None of others.
    """

    kind: str
    signals: Mapping[str, float]
    hertz: float | None = None


@dataclass(frozen=True)
class Judgement:
    """What the proposed model leaves of one signal, in floors (`adequacy`).

    Attributes:
        floor: what it is judged against, in the column's unit; None where nothing tells.
        source: `repeats`, `tolerance`, `rest segments` or `standard errors`; empty without a floor.
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


@dataclass(frozen=True)
class Diagnosis:
    """The answer, with all its evidence.

    Attributes:
        verdict: see `Verdict`.
        sentence: the verdict as a person would say it.
        where: where they disagree, the largest share first.
        effects: what is missing; empty unless the verdict is `effect`.
        parameters: the model's own parameters that moved, by path; where nothing but parameters is
            off, only those that are named.
        gap: by column name, over all trials.
        candidates: the whole catalogue, the likeliest first.
        next_experiment: what to measure next, where that would tell more.
        model: the amended model.
        given: the model as it was given.
        not_identifiable: paths of parameters that these data do not determine, with the reason.
        not_detectable: effects that these data would not have shown at their usual size.
        approximate: effects whose law is only approximate, and what they leave; None where there
            are none, or where they leave too much for their size to mean anything.
        law: the residual law, where the verdict is `unknown` or the law of an effect approximate,
            and one explains enough.
        tones: where the verdict is `unknown`, the frequency (Hz) at which a signal's residual
            oscillates, for those that do.
        floors: noise by column name.
        nuisances: mains lines, drifts and coloured noise in the readings.
        adequacy: what is left of each signal, by its column.
        states: what belongs to each trial (zeros, starts) beside the amended model, by its name.
        written: misfit of the amended model with these, over all trials, by column in its unit:
            what `model.toml` and `trials.toml` give when both are read back.
        trials: curves of each trial.
        maps: residuals over conditions.
        steps: what was done, in order, a sentence each, with its figures.
        seconds: how long each step took, by its name; not written to the JSON.
        warnings: what the reader must know first.
        converged: whether the fit of the proposed model converged.
        worsened: signals (by column) and trials (by name) that the proposed model fits worse than
            the given one, by more than their intervals.
    """

    verdict: Verdict
    sentence: str
    where: tuple[Place, ...]
    effects: tuple[NamedEffect, ...]
    parameters: Mapping[str, Moved]
    gap: Mapping[str, Gap]
    candidates: tuple[Candidate, ...]
    next_experiment: NextExperiment | None
    model: Model
    given: Model
    not_identifiable: Mapping[str, str] = field(default_factory=dict)
    not_detectable: tuple[str, ...] = ()
    approximate: Approximate | None = None
    law: ResidualLaw | None = None
    tones: Mapping[str, float] = field(default_factory=dict)
    floors: Mapping[str, Floor] = field(default_factory=dict)
    nuisances: tuple[Nuisance, ...] = ()
    adequacy: Mapping[str, Judgement] = field(default_factory=dict)
    states: Mapping[str, TrialState] = field(default_factory=dict)
    written: Mapping[str, float] = field(default_factory=dict)
    trials: tuple[TrialRecord, ...] = ()
    maps: tuple[Map, ...] = ()
    steps: tuple[str, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    converged: bool = True
    worsened: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())

    @property
    def unfitted(self) -> tuple[str, ...]:
        """Candidates that could not be fitted, and may carry what is missing."""
        return tuple(each.name for each in self.candidates if each.why == UNFITTED)

    @property
    def blind(self) -> tuple[str, ...]:
        """Old name of `not_detectable`."""
        return _renamed(self, "blind", "not_detectable")

    def document(self) -> dict[str, Any]:
        """The content of `diagnosis.json`."""
        following = self.next_experiment
        return {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "sentence": self.sentence,
            "where": [vars(place) for place in self.where],
            "effects": [effect.document() for effect in self.effects],
            "approximate": self.approximate
            and {
                "effects": [effect.document() for effect in self.approximate.effects],
                "closed": 1.0 - self.approximate.left,
                "left": self.approximate.left,
                "held_out": self.approximate.held_out,
            },
            "parameters": {
                path: {
                    "from": moved.start,
                    "to": moved.now.value,
                    "low": moved.now.low,
                    "high": moved.now.high,
                    "unit": moved.now.unit,
                    "significant": moved.significant,
                }
                for path, moved in self.parameters.items()
            },
            "gap": {
                signal: {**vars(gap), "closed": gap.closed} for signal, gap in self.gap.items()
            },
            "candidates": [vars(candidate) for candidate in self.candidates],
            "next_experiment": following
            and {
                "protocol": following.excitation,
                "separates": list(following.separates),
                "expected_odds": following.expected_odds,
                "minutes": following.minutes,
                "file": "next.csv",
            },
            "not_identifiable": dict(self.not_identifiable),
            "blind": list(self.not_detectable),
            "written": dict(self.written),
            "converged": self.converged,
            "worsened": {"signals": list(self.worsened[0]), "trials": list(self.worsened[1])},
            "adequacy": {signal: vars(judged) for signal, judged in self.adequacy.items()},
            "law": self.law
            and {
                "quantity": self.law.quantity,
                "variable": self.law.variable,
                "at": self.law.at.tolist(),
                "law": self.law.law.tolist(),
                "low": self.law.low.tolist(),
                "high": self.law.high.tolist(),
                "words": self.law.words,
            },
            "tones": dict(self.tones),
            "nuisances": [
                {"kind": each.kind, "hertz": each.hertz, "signals": dict(each.signals)}
                for each in self.nuisances
            ],
            "floors": {
                signal: {
                    "value": floor.value,
                    "source": floor.source,
                    "by_source": dict(floor.by_source),
                    "step": floor.step,
                    "memory": list(floor.memory),
                }
                for signal, floor in self.floors.items()
            },
            "warnings": list(self.warnings),
        }

    def _repr_html_(self) -> str:
        """What a notebook shows: the verdict, the gap by signal, the effects and their sizes.

        `pma_gym.discovery.report.page.report_page` writes the whole page.
        """
        tone = {"agrees": "good", "effect": "good", "parameters": "good", "unknown": "bad"}
        blocks: list[Block] = [Callout(self.sentence, tone=tone.get(self.verdict, "open"))]
        if self.gap:
            blocks.append(
                TextTable("Misfit (rms)", _GAP_HEADER, [*map(_gap_row, self.gap.items())])
            )
        rows = [
            [effect.name, name, f"{size.value:.3g}", _interval_text(size), size.unit]
            for effect in self.effects
            for name, size in effect.parameters.items()
        ]
        if rows:
            header = ["Effect", "Parameter", "Estimate", "95 % interval", "Unit"]
            blocks.append(TextTable("Effects that are missing", header, rows, words=2))
        return notebook_html(blocks)

    def text(self) -> str:
        """`document` as JSON; the same diagnosis gives the same bytes.

        Raises:
            ValueError: a number that is not finite, which JSON does not know.
        """
        return json.dumps(self.document(), indent=1, allow_nan=False) + "\n"


_GAP_HEADER = ["Column", "Model as given", "Parameters refitted", "Model proposed", "Noise"]


def _gap_row(gap: tuple[str, Gap]) -> list[str]:
    signal, sizes = gap
    values = (sizes.before, sizes.parameters, sizes.after, sizes.floor)
    return [signal, *(f"{value:.3g}" for value in values)]


def _interval_text(size: Estimate) -> str:
    if size.low is None or size.high is None:
        return ""
    return f"{size.low:.3g} to {size.high:.3g}"
