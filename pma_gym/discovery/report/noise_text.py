"""Nuisances that were fitted together with every candidate, and their names in the report."""

from collections.abc import Sequence

import numpy as np

from pma_gym.discovery.preparation.mains_lines import line_size
from pma_gym.discovery.report.figure_text import figure, listed, signal_name
from pma_gym.discovery.result.noise import Nuisance
from pma_gym.discovery.screening.residuals import simulated_less_measured
from pma_gym.discovery.screening.scan_statistic import autocorrelation
from pma_gym.discovery.thresholds import DRIFT_ENLARGED
from pma_gym.discovery.verdict.findings import Findings

LEAST_COLOUR = 0.2
"""Correlation from reading to reading below which the colour of noise is not worth a word."""

NUMBERS = {1: "one sensor", 2: "both sensors", 3: "all three sensors", 4: "all four sensors"}


def nuisances(findings: Findings) -> tuple[Nuisance, ...]:
    """Lines, drifts and colour of the noise, with their sizes in standard deviations of it."""
    problem, fit = findings.proposed
    whitened = problem.whitened_residuals(fit.model, findings.selection.chosen)
    held = whitened.readings(fit.values)
    assert held is not None
    left = simulated_less_measured(whitened, held)
    lines: dict[float, dict[str, float]] = {}
    drifts, colours = {}, {}
    for channel, noise in enumerate(findings.problem.noise):
        if not any(logged.measures[channel] for logged in whitened.logged):
            continue
        column = whitened.logged[0].signals[channel].column
        parts = [part[channel] for part in left]
        for hertz in noise.lines:
            size = line_size(hertz, whitened.logged, parts) / noise.level
            lines.setdefault(round(hertz, 6), {})[column] = size
        if noise.drift:
            drifts[column] = noise.drift / DRIFT_ENLARGED / noise.level
        if noise.coefficients:
            correlation = float(autocorrelation(noise, 2)[1])
            if abs(correlation) > LEAST_COLOUR:
                colours[column] = correlation
    listed_lines = [Nuisance("line", sizes, hertz) for hertz, sizes in sorted(lines.items())]
    others = [("drift", drifts), ("coloured noise", colours)]
    return (*listed_lines, *(Nuisance(kind, sizes) for kind, sizes in others if sizes))


def nuisance_text(known: Sequence[Nuisance], signals: int) -> str:
    """In words: `50 Hz in all four sensors, 1.2 sd; slow drift of pressure, 0.4 sd`.

    Args:
        known: the nuisances.
        signals: how many signals are measured.
    """
    return "; ".join(_words(each, signals) for each in known)


def _words(known: Nuisance, signals: int) -> str:
    where = listed([signal_name(each) for each in known.signals])
    if len(known.signals) == signals and signals > 1:
        where = NUMBERS.get(signals, f"all {signals} sensors")
    size = figure(float(np.median(list(known.signals.values()))), 2)
    if known.kind == "coloured noise":
        return f"coloured noise in {where}, correlation {size} from reading to reading"
    if known.kind == "clock":
        return f"the clock of {where}, fast by {size} of its time"
    what = f"{known.hertz:.4g} Hz" if known.hertz is not None else "slow drift"
    return f"{what} in {where}, {size} sd"
