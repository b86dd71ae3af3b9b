"""Bound by the data, not the method: the power of a test that knows everything else.

    python -m benchmarks.hidden_effects.bound --cases D

Of a case whose truth is known, what the hidden effect changes is set, without noise, beside the
lab's model with its parameters refitted, and beside that model with each rival of the catalogue,
fitted too. What is left, in units of the true noise made white, is the distance d between two
hypotheses; for Gaussian noise the log-likelihood ratio has mean d^2 / 2 and standard deviation d.
A test that knows effect, sizes and noise then detects with Phi(d - z) at an alarm rate of
Phi(-z), and tells it from its nearest rival with Phi(d / 2). No test does better that has to learn
any of it. Rivals that were not fitted count by their best probe, and fits end where they end, so
that a distance to a rival may be too large, never too small. Curves over r take distances in
proportion to r, which holds near the case's own r alone: what a delay and a lag differ by goes with
the square of their size.
"""

import itertools
import json
import os
import sys
import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from benchmarks.executors.choice import local
from benchmarks.executors.executor import run_or_raise
from benchmarks.runner.damaged_results import say_damaged
from pma_gym.cli.options import StrictTyper
from pma_gym.document_shape import check_shape
from pma_gym.documents import read_json
from pma_gym.terminal import safe_streams

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np  # noqa: E402
import typer  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from scipy.linalg import solve_toeplitz  # noqa: E402
from scipy.stats import norm  # noqa: E402

from benchmarks.hidden_effects.evaluation.measured import measured_now  # noqa: E402
from benchmarks.hidden_effects.generation.effect_size import simulate_variants  # noqa: E402
from benchmarks.hidden_effects.generation.groups import group  # noqa: E402
from benchmarks.hidden_effects.physics.rig import (  # noqa: E402
    NOISE,
    SENSORS,
    SIGNALS,
    UNITS,
    noise_levels,
)
from benchmarks.hidden_effects.physics.simulation import Commands  # noqa: E402
from pma_gym.data.datasets.dataset import Dataset, read_dataset  # noqa: E402
from pma_gym.data.trial import Trial  # noqa: E402
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted  # noqa: E402
from pma_gym.discovery.fitting.free_parameters import free_parameters  # noqa: E402
from pma_gym.discovery.preparation.noise import Whitening  # noqa: E402
from pma_gym.discovery.screening.candidates import candidate_effects  # noqa: E402
from pma_gym.discovery.screening.probe_scores import Baseline  # noqa: E402
from pma_gym.discovery.screening.score_test import screen  # noqa: E402
from pma_gym.discovery.screening.starting_points import starting_points  # noqa: E402
from pma_gym.files import replace_file  # noqa: E402
from pma_gym.plant.model import Model, load_model  # noqa: E402

Array = NDArray[np.float64]

ALARM = 0.005
"""Rate of false alarms of the ideal test."""

RATIOS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.4, 2.0)
"""Values of r at which the curves are given."""

ORDER = 6
"""Of the autoregression that stands for coloured noise and rounding together."""

FITTED = 4
"""Rivals that are fitted, those that look nearest."""

NOT_A_MEAN = ("sensor_quantisation",)
"""Effects that change no mean; a likelihood ratio of Gaussian noise says nothing of them."""

app = StrictTyper(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


def detected(distance: Array | float) -> Array:
    """Chance that the ideal test detects at a distance, at a rate of `ALARM` of false alarms.

    >>> [round(float(p), 3) for p in (detected(0.0), detected(2.576))]
    [0.005, 0.5]
    """
    return np.asarray(norm.cdf(np.asarray(distance) - norm.isf(ALARM)))


def identified(distance: Array | float) -> Array:
    """Chance that the likelier of two hypotheses at a distance is the true one.

    >>> [round(float(p), 3) for p in (told(0.0), told(2.0))]
    [0.5, 0.841]
    """
    return np.asarray(norm.cdf(0.5 * np.asarray(distance)))


def true_noise(truth: Mapping[str, Any]) -> tuple[Whitening, ...]:
    """Whitening of each output by the noise that the generator gave it, rounding included."""
    factors = np.array([truth["noise_factors"][sensor] for sensor in SENSORS])
    levels = noise_levels(factors)
    coloured = np.array(NOISE) * factors * np.array(UNITS)
    noise = []
    for channel, sensor in enumerate(SENSORS):
        lags = coloured[channel] ** 2 * truth["noise_memory"][sensor] ** np.arange(ORDER + 1)
        # Rounding of a moving signal is white (Widrow 1956).
        lags[0] = levels[channel] ** 2
        coefficients = solve_toeplitz(lags[:-1], lags[1:])
        innovation = np.sqrt(lags[0] - coefficients @ lags[1:])
        level = float(levels[channel])
        noise.append(Whitening(tuple(map(float, coefficients)), float(innovation), level))
    return tuple(noise)


def left_by(problem: FitProblem, fit: Fitted, extra: Sequence[CandidateEffect] = ()) -> float:
    """Distance that a fit leaves to readings without noise, what is assumed beforehand apart."""
    pieces = problem.whitened_residuals(fit.model, extra).pieces(fit.values, np.empty(0))
    return float("inf") if pieces is None else float(np.sqrt(pieces.total()[0, 0]))


def noiseless(
    dataset: Dataset, truth: Mapping[str, Any], initial_model: Model
) -> tuple[FitProblem, Model]:
    """Trials without noise, and the lab's model at the true rig's parameters.

    What the effect changes comes from the generator, and is added to what our own plant gives
    without it: two integrators differ by some hundredths of the noise, which is no effect.
    """
    trials = [named.trial for named in dataset.trials]
    commands = Commands(
        np.stack([trial.commands["motor_voltage"] for trial in trials]),
        np.stack([trial.commands["regulator_voltage"] for trial in trials]),
        np.arange(len(trials), dtype=float),
    )
    hidden = {effect["name"]: effect["parameters"] for effect in truth["effects"]}
    base, with_it = simulate_variants(commands, [(truth["base"], {}), (truth["base"], hidden)])
    noise = true_noise(truth)
    plain = FitProblem([_read(t, r) for t, r in zip(trials, base, strict=True)], initial_model,
                  free_parameters(initial_model), noise)  # fmt: skip
    fit = plain.careful_fit(initial_model)
    if fit is None:
        raise ValueError(f"model {initial_model.name} cannot be simulated on {dataset.title}")
    readings = plain.whitened_residuals(fit.model).readings(fit.values)
    assert readings is not None
    changed = [
        _read(trial, readings_of.T + after - before)
        for trial, readings_of, before, after in zip(trials, readings, base, with_it, strict=True)
    ]
    return FitProblem(changed, fit.model, free_parameters(fit.model), noise), fit.model


def _read(trial: Trial, readings: Array) -> Trial:
    """A trial that reads (SI), shape (rows, 4)."""
    return Trial(trial.time, trial.commands, dict(zip(SIGNALS, readings.T, strict=True)))


def distances(
    problem: FitProblem, model: Model, orders: Sequence[float], name: str
) -> dict[str, Any]:
    """How far a hidden effect is from nothing, from its likeness in the catalogue, from rivals.

    Args:
        problem: trials without noise, and the true noise.
        model: where the base parameters are true.
        orders: which repeat each trial is.
        name: of the effect, in the catalogue.
    """
    refitted = problem.fit(model)
    if refitted is None:
        raise ValueError(f"model {model.name} cannot be simulated")
    whole = left_by(problem, refitted)
    baseline = Baseline.at(
        problem.whitened_residuals(refitted.model), refitted.values, refitted.steps
    )
    catalogue = candidate_effects(model, orders)
    scores = screen(baseline, catalogue, 0, lambda each: problem.probed(refitted.model, each))
    scores.sort(key=lambda each: -each.gain)
    by_rival = {
        each.candidate.name: float(np.sqrt(max(whole**2 - each.gain, 0.0))) for each in scores
    }  # fmt: skip
    rivals = [each for each in scores if each.candidate.name != name and each.starts][:FITTED]
    for each in [
        *rivals,
        *(each for each in scores if each.candidate.name == name and each.starts),
    ]:
        whitened = problem.probed(refitted.model, each.candidate)
        start = starting_points(baseline, whitened, each)[0]
        fit = problem.fit(refitted.model, (each.candidate,), {each.candidate.name: start})
        if fit is not None:
            left = left_by(problem, fit, (each.candidate,))
            by_rival[each.candidate.name] = min(by_rival[each.candidate.name], left)
    others = {other: d for other, d in by_rival.items() if other != name}
    apart = {other: d for other, d in others.items() if other not in group(name)}
    return {
        "nothing": whole,
        "likeness": by_rival.get(name),
        "rival": min(others, key=lambda other: others[other]),
        "to_rival": min(others.values()),
        "rival_outside": min(apart, key=lambda other: apart[other]),
        "to_rival_outside": min(apart.values()),
    }


def bounded(folder: Path, case: str) -> dict[str, Any]:
    """Distances of one drawn case that hides one effect."""
    truth = read_json(folder / "truth" / f"{case}.json", "journal_mib", own=True, finite=False)
    dataset = read_dataset(folder / "cases" / case)
    problem, model = noiseless(dataset, truth, load_model(dataset.model or "station"))
    effect = truth["effects"][0]
    orders = [float(named.order or 0.0) for named in dataset.trials]
    entry = distances(problem, model, orders, effect["name"])
    about = {"case": case, "effect": effect["name"], "r": effect["r"]}
    return {**about, **entry, "measured": measured_now()}


def curves(some: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Medians over an effect's cases: distances at r = 1, and chances over r."""

    def at(ratio: float, what: str) -> Array:
        return np.array([each[what] * ratio / each["r"] for each in some])

    rivals = [each["rival"] for each in some]
    likeness = [each["likeness"] / each["r"] for each in some if each["likeness"] is not None]
    return {
        "n": len(some),
        "d_nothing": float(np.median(at(1.0, "nothing"))),
        "d_likeness": float(np.median(likeness)) if likeness else None,
        "d_rival": float(np.median(at(1.0, "to_rival"))),
        "d_rival_outside": float(np.median(at(1.0, "to_rival_outside"))),
        "rivals": sorted(set(rivals), key=lambda name: -rivals.count(name)),
        "r": list(RATIOS),
        "detected": [float(np.mean(detected(at(r, "nothing")))) for r in RATIOS],
        "told": [float(np.mean(identified(at(r, "to_rival")))) for r in RATIOS],
        "told_outside": [float(np.mean(identified(at(r, "to_rival_outside")))) for r in RATIOS],
    }


def table(by_effect: Mapping[str, Mapping[str, Any]]) -> str:
    """The curves as text."""
    shown = (0.1, 0.3, 0.5, 1.0, 2.0)
    places = [RATIOS.index(r) for r in shown]
    heads = "  ".join(f"{r:>5g}" for r in shown)
    lines = [
        "distance d at r = 1 to nothing, to the effect's likeness in the catalogue, to its nearest "
        "rival;",
        f"chance (%) to detect at r = 0.1, and to tell it from that rival at r = {heads}",
    ]
    for name, each in sorted(by_effect.items()):
        likeness = "    -" if each["d_likeness"] is None else f"{each['d_likeness']:5.1f}"
        chances = "  ".join(f"{100 * each['told'][k]:5.1f}" for k in places)
        lines.append(
            f"  {name:24s}n {each['n']:<3d}{each['d_nothing']:6.1f} {likeness} "
            f"{each['d_rival']:6.1f}   {100 * each['detected'][0]:5.1f}   {chances}"
            f"   {', '.join(each['rivals'][:2])}"
        )
    return "\n".join(lines)


@app.command()
def main(
    cases: Annotated[Path, typer.Option(help="Folder that `draw` or `take` wrote.", exists=True)],
    json_file: Annotated[Path | None, typer.Option("--json", help="Curves to a file.")] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 1,
) -> None:
    """Bound what can be told of cases that hide one effect; what is there is kept."""
    kept = cases / "bounds"
    kept.mkdir(exist_ok=True)
    names = [path.stem for path in sorted((cases / "truth").glob("case_*.json")) if _counts(path)]
    missing = [name for name in names if not _is_kept(kept / f"{name}.json")]
    start = time.monotonic()
    print(f"{len(names) - len(missing)} of {len(names)} cases are bounded", file=sys.stderr)
    done = itertools.count(1)

    def tell(_: int, name: str) -> None:
        took = time.monotonic() - start
        print(f"{next(done)}/{len(missing)}  {name}  ({took:.0f} s)", file=sys.stderr, flush=True)

    run_or_raise([partial(_bound_one, cases, name) for name in missing], local(jobs), tell)
    entries = [
        read_json(kept / f"{name}.json", "journal_mib", own=True, finite=False) for name in names
    ]
    by_effect = {
        effect: curves([each for each in entries if each["effect"] == effect])
        for effect in dict.fromkeys(each["effect"] for each in entries)
    }
    if json_file is not None:
        document = {"alarm": ALARM, "effects": by_effect, "cases": entries}
        replace_file(json_file, (json.dumps(document, indent=1) + "\n").encode())
    typer.echo(table(by_effect))


_KEPT = {"effect": str, "measured": {"commit": str, "date": str, "method": str}}
"""Shape of what another run needs of a bound."""


def _is_kept(path: Path) -> bool:
    """Whether a bound is there; a damaged one is computed anew."""
    if not path.is_file():
        return False
    try:
        check_shape(read_json(path, "journal_mib", own=True, finite=False), _KEPT)
    except ValueError as error:
        say_damaged(path, str(error))
        return False
    return True


def _counts(truth: Path) -> bool:
    effects = read_json(truth, "journal_mib", own=True, finite=False)["effects"]
    return len(effects) == 1 and effects[0]["name"] not in NOT_A_MEAN


def _bound_one(folder: Path, case: str) -> str:
    text = json.dumps(bounded(folder, case), indent=1) + "\n"
    replace_file(folder / "bounds" / f"{case}.json", text.encode())
    return case


if __name__ == "__main__":
    with safe_streams():
        app()
