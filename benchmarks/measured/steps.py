"""Effect by effect: the error on whole pressures that took no part, and on other tables.

The printed validation under triangular pressure (figures 28 and 29), as a summary.

The dissertation prints how far its own model lay from what was measured, in millimetres and in
percent of the contraction that was measured. So its stroke, largest less smallest contraction, is
known to the rounding of the percentage; the curves themselves are pictures.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.files import write_text
from benchmarks.measured.held_out import AT_LOAD, FIGURES, Rig, limit_errors, rms, worked
from benchmarks.measured.rounds import Stages
from benchmarks.reproduction.replay import all_replay_errors, summarise
from benchmarks.reproduction.results import Results, scores_of
from benchmarks.runner.case import cases, run_case
from benchmarks.suites.frozen import load_suite
from pma_gym.data.datasets.dataset import Dataset
from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.journal import digest
from pma_gym.plant.model import Model, dump_model
from pma_gym.plant.plant import Plant
from pma_gym.units import SI_FACTORS

PHASE_NAMES = {
    "displacement": "displacement (tables 21, 22)",
    "I": "rotation I (tables 27, 30)",
    "II": "rotation II (tables 28, 30)",
    "III": "rotation III (tables 29, 30)",
}
"""Phases in words, with the tables that they are held against."""


def replays(model: Path) -> list[dict[str, object]]:
    """Replay the printed voltages on a model, open loop.

    Args:
        model: a TOML file.
    Returns:
        For each phase mean absolute errors of slope, intercept, mean position and RMSE, and the
        mean error of the mean position (mm, deg, s), over the trials that the model can be driven
        through.
    """
    suite = load_suite()
    replay = next(each for each in suite.controllers if each.name == suite.goals.replay)
    suite = suite.select([str(model)], [replay])
    rows = [run_case(case) for case in cases(suite, suite.entries)]
    results = Results(suite, scores_of(suite, rows))
    replayed = []
    for (task, phase), errors in all_replay_errors(results, str(model)).items():
        summary = summarise(errors)
        absolute = {name: summary.absolute[name] for name in ("slope", "intercept", "mean")}
        signed = {"mean_signed": summary.signed["mean"], "rmse": summary.absolute["rmse"]}
        place = {"task": task, "phase": phase}
        replayed.append({**place, **absolute, **signed, "trials": summary.trials})
    return replayed


AS_GIVEN, REFITTED = "as given", "parameters refitted"


@dataclass(frozen=True)
class Step:
    """A model on the way, and its errors.

    Attributes:
        name: what was added to the one before.
        effects: all effects that it has.
        seen: rms errors at the pressures that it was fitted to, by `FIGURES`.
        unseen: at whole pressures that it was not.
        replay: open-loop replay of the printed voltages, a phase each.
        model: the model as TOML.
    """

    name: str
    effects: tuple[str, ...]
    seen: Mapping[str, float]
    unseen: Mapping[str, float]
    replay: Sequence[Mapping[str, object]]
    model: str


def steps(
    initial_model: Model,
    amended: Model,
    effects: Sequence[str],
    data: tuple[Dataset, Dataset, Dataset],
    stages: Stages,
    jobs: int,
    progress: Callable[[int, int], None],
) -> list[Step]:
    """The model as given, refitted, and with one effect more at a time.

    Args:
        initial_model: the model to begin with.
        amended: with all effects, where fits begin.
        effects: in the order in which a diagnosis added them.
        data: what models are fitted to; I3's trials at those pressures; those at other pressures.
        stages: finished steps.
        jobs: threads.
        progress: called with what is done and the total.
    """
    fitted, seen, unseen = data
    rig = Rig.of(fitted, initial_model, jobs)
    names = [AS_GIVEN, REFITTED, *effects]
    trials = [each.trial for part in data for each in part.trials]
    done = []
    for number, name in enumerate(names):
        progress(number, len(names))
        some = tuple(effects[: max(number - 1, 0)])
        asked, stage = digest(trials, amended, f"steps {name} {some}"), f"step_{number}"
        step = stages.kept(stage, asked, Step)
        if step is None:
            model = initial_model if name == AS_GIVEN else _fitted(rig, some, amended)
            step = _judged(name, some, model, seen, unseen, stages.folder / f"{stage}.toml")
            stages.keep(stage, asked, asdict(step))
        done.append(step)
    progress(len(names), len(names))
    return done


def folds(
    initial_model: Model,
    amended: Model,
    effects: Sequence[str],
    data_of: Callable[[Sequence[float]], tuple[Dataset, Dataset]],
    groups: Sequence[Sequence[float]],
    jobs: int,
    progress: Callable[[int, int], None],
) -> dict[str, float]:
    """Rms errors with each group of pressures (kPa) left out once, all other pressures seen.

    Args:
        initial_model: the model to begin with.
        amended: with all effects, where fits begin.
        effects: what is added to the given model.
        data_of: what is fitted to, and what is judged on, with pressures left out.
        groups: the pressures that are left out together.
        jobs: threads.
        progress: called with what is done and the total.
    """
    names = (*FIGURES, AT_LOAD)
    squares, counts = dict.fromkeys(names, 0.0), dict.fromkeys(names, 0)
    for number, group in enumerate(groups):
        progress(number, len(groups))
        fitted, judged = data_of(group)
        model = _fitted(Rig.of(fitted, initial_model, jobs), effects, amended)
        for name, errors in limit_errors(model, judged).items():
            squares[name] += float(errors @ errors)
            counts[name] += len(errors)
    progress(len(groups), len(groups))
    return {name: (squares[name] / counts[name]) ** 0.5 for name in names}


def _fitted(rig: Rig, effects: Sequence[str], start_model: Model) -> Model:
    """The better of fits that begin at an amended model and at the given one."""
    fits = [
        fit
        for model in (start_model, rig.initial_model)
        if (fit := rig.fit(effects, model)) is not None
    ]
    if not fits:
        raise ValueError(
            f"{rig.initial_model.name} with {', '.join(effects) or 'no effect'} cannot be "
            "simulated on tables I2 and I3"
        )
    return min(fits, key=lambda fit: fit.chi_square).model


def _judged(
    name: str, effects: tuple[str, ...], model: Model, seen: Dataset, unseen: Dataset, path: Path
) -> Step:
    # The other tables' trials were made by a muscle that had been worked.
    write_text(path, dump_model(worked(model)))
    return Step(
        name,
        effects,
        {each: rms(errors) for each, errors in limit_errors(model, seen).items()},
        {each: rms(errors) for each, errors in limit_errors(model, unseen).items()},
        replays(path),
        dump_model(worked(model)),
    )


CYCLES, RATE_HZ = 3, 100.0


@dataclass(frozen=True)
class Triangle:
    """One validation trial.

    Attributes:
        figure: its number.
        low_kpa: lower pressure (kPa).
        high_kpa: upper pressure (kPa).
        load_n: load (N).
        period_s: period (s).
        rmse_mm: of the dissertation's model (mm).
        percent: the same, in percent of the contraction.
    """

    figure: int
    low_kpa: float
    high_kpa: float
    load_n: float
    period_s: float
    rmse_mm: float
    percent: float

    @property
    def stroke_mm(self) -> tuple[float, float]:
        """Least and largest stroke (mm) that the printed figures allow."""
        return (
            100.0 * self.rmse_mm / (self.percent + 0.5),
            100.0 * self.rmse_mm / (self.percent - 0.5),
        )

    def contraction(self, model: Model) -> np.ndarray:
        """Simulate the contraction in the last period (m), shape (n,)."""
        time = np.arange(round(CYCLES * self.period_s * RATE_HZ) + 1) / RATE_HZ
        share = 1.0 - np.abs(2.0 * np.mod(time / self.period_s, 1.0) - 1.0)
        pressure = self.low_kpa + (self.high_kpa - self.low_kpa) * share
        trial = Trial(
            time,
            {
                "pressure_command": pressure * SI_FACTORS["kPa"],
                "load_command": np.full(len(time), self.load_n),
            },
        )
        truth = Plant(model).simulate(trial, noise=False).truth["contraction"]
        return truth[time >= (CYCLES - 1) * self.period_s]


TRIANGLES = (
    Triangle(28, 150.0, 250.0, 150.0, 4.0, 1.94, 17.0),
    Triangle(29, 450.0, 550.0, 400.0, 10.0, 1.38, 25.0),
)
"""Serres 2008, section 5.1.5."""


@dataclass(frozen=True)
class ModelComparison:
    """A model held against one validation trial.

    Attributes:
        figure: its number.
        model: name of the model.
        stroke_mm: the model's stroke (mm).
        printed_mm: least and largest that the printed figures allow (mm).
        apart_mm: rms distance from the dissertation's model, their means taken out (mm).
        rmse_mm: what was printed of that model (mm).
    """

    figure: int
    model: str
    stroke_mm: float
    printed_mm: tuple[float, float]
    apart_mm: float
    rmse_mm: float


def compare_models(models: dict[str, Model], own: Model) -> list[ModelComparison]:
    """Models against both trials.

    Args:
        models: by name.
        own: the dissertation's model.
    """
    rows = []
    for triangle in TRIANGLES:
        theirs = triangle.contraction(own)
        for name, model in models.items():
            ours = triangle.contraction(model)
            apart = (ours - ours.mean()) - (theirs - theirs.mean())
            rows.append(
                ModelComparison(
                    triangle.figure,
                    name,
                    1e3 * float(np.ptp(ours)),
                    triangle.stroke_mm,
                    1e3 * float(np.sqrt(np.mean(apart**2))),
                    triangle.rmse_mm,
                )
            )
    return rows
