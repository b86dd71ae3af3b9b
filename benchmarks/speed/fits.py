"""Fits of many candidate models to many trials: `python -m benchmarks.speed.fits [--quick]`.

What a diagnosis does: 20 candidate models are to explain 60 trials of 10 s that were logged at
384 Hz; the station that they came from is one of them. Every candidate has other effects, so
each is compiled anew. Its parameters are fitted jointly to all trials and all four sensors, from a
start 20-30 % off. The machine may be shared, so processor time is told beside the clock.
"""

import os
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any
from unittest.mock import patch

import numpy as np
import typer
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.estimation.fitting import Fit, fit
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import program

RATE_HZ = 384.0
SEED = 2008
THREADS, LIMIT_S = 2, 15.0
"""What the project wants of all fits together, on two cores."""

Array = NDArray[np.float64]

_LAG, _HYSTERESIS = "regulator_lag.time_constant_s", "hysteresis.force_n"
_SLOPE, _SOFTENING = "sarosi_force.slope_n_per_bar", "sarosi_force.softening_n_per_bar_per_percent"
_DAMPING = "symmetric_damping.slope_n_s_per_mm_per_kpa"
_STATION = (_SLOPE, _SOFTENING, _LAG)
_REPPERGER = (
    "repperger_damping.viscous_n_s_per_mm",
    "repperger_damping.speed_slope_n_s2_per_mm2",
)


@dataclass(frozen=True)
class Candidate:
    """A model to be fitted: the station without some effects, with some of other shipped models.

    Attributes:
        title: what it is.
        free: its free parameters.
        without: effects that it has not.
        given: effects that it has, each with the shipped model whose values it takes.
        off: where its parameters start, as shares of their values, in turn.
    """

    title: str
    free: tuple[str, ...]
    without: tuple[str, ...] = ()
    given: Mapping[str, str] | None = None
    off: tuple[float, ...] = (1.25, 0.75, 1.3, 0.8, 1.2)

    def model(self) -> Model:
        """The model, its free parameters off."""
        base = load_model("station")
        groups = {n: p for n, p in base.parameters.items() if n not in self.without}
        for effect, source in (self.given or {}).items():
            groups[effect] = load_model(source).parameters[effect]
        made = Model(self.title, self.title, base.plant, groups)
        known = {
            f"{effect}.{name}": value
            for effect in made.parameters
            for name, value in made.values_in_files(effect).items()
            if isinstance(value, float | int)
        }
        return made.replace(
            {p: known[p] * self.off[i % len(self.off)] for i, p in enumerate(self.free)}
        )


def _more(title: str, source: str, free: tuple[str, ...], *effects: str) -> Candidate:
    return Candidate(title, (*_STATION, *free), given=dict.fromkeys(effects, source))


def _other_force(title: str, source: str, free: tuple[str, ...], *effects: str) -> Candidate:
    given = dict.fromkeys(effects or (f"{source}_force",), source)
    without = ("sarosi_force", "pressure_curvature")
    return Candidate(title, (*free, _LAG), without, given, off=(1.2, 1.2, 0.8, 1.25))


CANDIDATES = (
    Candidate("station", (*_STATION, _HYSTERESIS)),
    Candidate("no hysteresis", _STATION, ("hysteresis",)),
    Candidate("no friction", (*_STATION, _HYSTERESIS), ("coulomb_friction",)),
    Candidate("neither", _STATION, ("coulomb_friction", "hysteresis")),
    Candidate("no regulator asymmetry", (*_STATION, _DAMPING), ("regulator_asymmetry",)),
    Candidate(
        "no pressure curvature",
        (*_STATION, _HYSTERESIS),
        ("pressure_curvature",),
        off=(0.8, 1.3, 1.25, 0.75),
    ),
    Candidate(
        "two-way damping",
        (*_STATION, "damping.contracting_n_s_per_mm", "damping.relaxing_n_s_per_mm"),
        ("symmetric_damping",),
        {"damping": "serres2008"},
    ),
    Candidate(
        "Repperger's damping",
        (*_STATION, *_REPPERGER),
        ("symmetric_damping",),
        {"repperger_damping": "repperger"},
    ),
    _more("two-way damping added", "serres2008", ("damping.contracting_n_s_per_mm",), "damping"),
    _more("Repperger's damping added", "repperger", _REPPERGER, "repperger_damping"),
    _more(
        "stiffness added",
        "serres2008",
        ("stiffness.low_intercept_n_per_mm", "stiffness.high_intercept_n_per_mm"),
        *("stiffness", "contractile_force"),
    ),
    _more(
        "Colbrunn's spring added",
        "colbrunn",
        ("colbrunn_spring.stiffness_n_per_mm",),
        "colbrunn_spring",
    ),
    _other_force(
        "lines of the dissertation",
        "serres2008",
        ("contractile_force.slope_n_per_kpa", "stiffness.low_intercept_n_per_mm"),
        *("contractile_force", "stiffness"),
    ),
    _other_force(
        "Repperger's spring",
        "repperger",
        ("contractile_force.slope_n_per_kpa", "repperger_spring.stiffness_n_per_mm"),
        *("contractile_force", "repperger_spring"),
    ),
    _other_force(
        "Colbrunn's spring",
        "colbrunn",
        ("colbrunn_spring.stiffness_n_per_mm", "colbrunn_spring.reach_mm"),
        "colbrunn_spring",
    ),
    *(
        _other_force(
            name.replace("_", " and ").title(),
            name,
            tuple(f"{name}_force.{parameter}" for parameter in ("scale", "turns", *further)),
        )
        for name, further in {
            "schulte": (),
            "schulz": ("elasticity_n_per_mm",),
            "chou_hannaford": (),
            "caldwell": (),
            "tondu_lopez": ("end_factor",),
        }.items()
    ),
)
"""All of different structures."""


def trials(count: int, seconds: float) -> list[Trial]:
    """Trials of the station: ramps, steps and sines of pressure and load, with sensor noise."""
    plant = Plant("station")
    random = np.random.Generator(np.random.Philox(SEED))
    when = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    line = plant.model.parameters["regulator_line"]

    def signal(kind: int, low: float, high: float) -> Array:
        first, last = sorted(random.uniform(low, high, 2))
        if kind == 0:
            return first + (last - first) * when / seconds
        if kind == 1:
            return np.where((when // random.uniform(0.5, 2.0)) % 2 > 0, first, last)
        sine = np.sin(2.0 * np.pi * random.uniform(0.2, 2.0) * when)
        return 0.5 * (first + last) + 0.5 * (last - first) * sine

    made = []
    for i in range(count):
        pressure, motor = signal(i % 3, 150e3, 575e3), signal(i // 3 % 3, 0.5, 3.5)
        commands = {
            "motor_voltage": motor,
            "regulator_voltage": (pressure - line.offset) / line.gain,
        }
        made.append(plant.simulate(Trial(when, commands), seed=i))
    return made


def measure(quick: bool = False, say: Callable[[str], None] | None = None) -> dict[str, Any]:
    """Compile and fit all candidates.

    Args:
        quick: 4 candidates, 16 trials of 2 s: to see that all works.
        say: told of every candidate when it is done.
    Returns:
        Seconds in total by the clock and of the processor (`compile_s`, `fit_s`, `fit_cpu_s`, and
        with one thread `fit_one_s`, `fit_one_cpu_s`), `trials_per_s`, whether both gave the same
        bits (`same`), whether all converged, and `candidates`, the same for each.
    """
    candidates = CANDIDATES[:: len(CANDIDATES) // 4] if quick else CANDIDATES
    compiled = [_compiled(candidate.model()) for candidate in candidates]
    logged = trials(16, 2.0) if quick else trials(60, 10.0)
    rows = [
        _measured(candidate, seconds, logged, say)
        for candidate, seconds in zip(candidates, compiled, strict=True)
    ]
    sums = ("compile_s", "fit_s", "fit_cpu_s", "fit_one_s", "fit_one_cpu_s", "simulated")
    total: dict[str, Any] = {name: sum(row[name] for row in rows) for name in sums}
    return total | {
        "trials": len(logged),
        "trial_s": len(logged[0].time) / RATE_HZ,
        "threads": THREADS,
        "limit_s": LIMIT_S,
        "trials_per_s": total["simulated"] / total["fit_s"],
        "converged": all(row["converged"] for row in rows),
        "same": all(row["same"] for row in rows),
        "candidates": rows,
    }


def _compiled(model: Model) -> float:
    """How long it takes to compile a model's structure (s): nothing, if this process has it."""
    with tempfile.TemporaryDirectory() as folder, patch.dict(os.environ, PMA_GYM_CACHE=folder):
        begin = time.perf_counter()
        _ = program(model).simulate_many
        return time.perf_counter() - begin


def _measured(
    candidate: Candidate,
    compiled: float,
    logged: Sequence[Trial],
    say: Callable[[str], None] | None,
) -> dict[str, Any]:
    model = candidate.model()
    one, one_s, one_cpu_s = _timed(model, logged, candidate.free, 1)
    both, both_s, both_cpu_s = _timed(model, logged, candidate.free, THREADS)
    row = {
        "title": candidate.title,
        "free": len(candidate.free),
        "compile_s": compiled,
        "fit_s": both_s,
        "fit_cpu_s": both_cpu_s,
        "fit_one_s": one_s,
        "fit_one_cpu_s": one_cpu_s,
        "rounds": both.rounds,
        "simulated": both.simulated,
        "converged": both.converged,
        "reduced_chi_square": both.reduced_chi_square,
        "same": one.values == both.values and one.chi_square == both.chi_square,
    }
    if say is not None:
        say(_line(row))
    return row


def _timed(
    model: Model, logged: Sequence[Trial], free: Sequence[str], threads: int
) -> tuple[Fit, float, float]:
    begin, busy = time.perf_counter(), time.process_time()
    result = fit(model, logged, free, threads=threads)
    return result, time.perf_counter() - begin, time.process_time() - busy


_HEAD = (
    f"{'candidate':26}{'free':>5}{'compile':>9}{'fit':>8}{'(cpu)':>8}{'1 thread':>9}{'(cpu)':>8}"
)
_HEAD += f"{'rounds':>7}{'trials':>7}{'chi2/n':>10}"


def _line(row: Mapping[str, Any]) -> str:
    times = [row[f"{name}_s"] for name in ("compile", "fit", "fit_cpu", "fit_one", "fit_one_cpu")]
    cells = "".join(
        f"{value:{width}.2f}" for value, width in zip(times, (9, 8, 8, 9, 8), strict=True)
    )
    end = "" if row["converged"] else "  not converged"
    end += "" if row["same"] else "  other bits with one thread"
    return (
        f"{row['title']:26}{row['free']:5}{cells}{row['rounds']:7}"
        f"{row['simulated']:7}{row['reduced_chi_square']:10.3g}{end}"
    )


def main(quick: Annotated[bool, typer.Option(help="To see that all works.")] = False) -> None:
    """Print what `measure` finds."""
    print(_HEAD)
    run = measure(quick, say=lambda line: print(line, flush=True))
    print(
        f"{len(run['candidates'])} candidates, {run['trials']} trials of "
        f"{run['trial_s']:g} s, full joint fits on {THREADS} threads: {run['fit_s']:.1f} s "
        f"({run['fit_cpu_s']:.1f} s of processor time; wanted: {LIMIT_S:g} s) and "
        f"{run['compile_s']:.1f} s to compile; on one thread {run['fit_one_s']:.1f} s "
        f"({run['fit_one_cpu_s']:.1f} s); {run['trials_per_s']:.0f} trials simulated a second"
    )


if __name__ == "__main__":
    typer.run(main)
