"""Effect by effect: the error on whole pressures that took no part, and on other tables."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.files import write_text
from benchmarks.measured.held_out import AT_LOAD, FIGURES, Rig, limit_errors, rms, worked
from benchmarks.measured.rounds import Stages
from benchmarks.reproduction.replay import all_replay_errors, summarise
from benchmarks.reproduction.results import Results, scores_of
from benchmarks.runner.case import cases, run_case
from benchmarks.suites.frozen import load_suite
from pma_gym.data.datasets.dataset import Dataset
from pma_gym.discovery.fitting.journal import digest
from pma_gym.plant.model import Model, dump_model

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
