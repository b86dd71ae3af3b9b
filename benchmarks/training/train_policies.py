"""`python -m benchmarks train`: from a preset to a policy file, with progress, to go on later."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from benchmarks.executors.executor import Executor, run_or_raise
from benchmarks.training.card import save_policy
from benchmarks.training.configuration.preset import Preset, PresetError, load_preset
from benchmarks.training.policy_export.product import policy_name, policy_of
from benchmarks.training.run import Order, Point, Trained, train
from benchmarks.training.validation import unit_of
from controllers.design.designs import kind_of
from controllers.policies.adapter import base_of
from pma_gym.envs import ENVIRONMENTS
from pma_gym.tasks import EXERCISES, named_task

ENVIRONMENT_OF = {task: name for name, task in ENVIRONMENTS.items()}
"""Id of the environment of a task."""

EXERCISE = "pma_gym/ResistiveExercise-v0"
"""Id of the environment of all exercises."""

SHORT = {"exercise": ENVIRONMENTS[EXERCISE]}
"""Tasks that have a shorter name here."""


def ordered(
    algorithm: str,
    task: str,
    preset: str,
    seed: int,
    steps: int | None,
    device: str,
    threads: int,
    patience: int,
) -> Order:
    """A checked order.

    Raises:
        PresetError: an unknown task, preset or algorithm, or a device that is absent.
    """
    from benchmarks.training.learner import check_device

    environment, options = _environment_of(task)
    settings = load_preset(preset, algorithm, environment)
    if options:
        settings = settings.changed(options={**settings.options, **options})
    _check_base(settings)
    check_device(device)
    if steps is not None:
        settings = settings.changed(steps=steps)
    return Order(settings, seed, device, threads, patience)


def _check_base(preset: Preset) -> None:
    """Refuse a residual on a controller that is not for the task."""
    made = named_task(preset.task)
    assert made is not None
    kinds = getattr(base_of(preset.form), "kinds", ()) if preset.form.base else ()
    if kinds and kind_of(made) not in kinds:
        raise PresetError(
            f"preset {preset.name} adds to the voltage of {preset.form.base}, which is for tasks "
            f"of kind {' and '.join(kinds)}, got {preset.task}, of kind {kind_of(made)}; take "
            "another task, or a preset whose form is no residual, such as increment"
        )


def _environment_of(task: str) -> tuple[str, dict[str, str]]:
    """Id of a task's environment, and the option that makes it this task where it needs one."""
    name = SHORT.get(task, task)
    if name in ENVIRONMENT_OF:
        return ENVIRONMENT_OF[name], {}
    known = named_task(name)
    if known is None or known.exercise is None:
        names = (*ENVIRONMENT_OF, *SHORT, *(one for one in EXERCISES if one not in ENVIRONMENT_OF))
        raise PresetError(f"task must be one of {', '.join(names)}, got {task!r}")
    return EXERCISE, {"task": name}


def run_train(order: Order, out: Path, console: Console, ship: bool = False) -> Path:
    """Train, and write the policy.

    Args:
        order: what is to be trained.
        out: folder of the policy, its checkpoints and logs.
        console: where progress is shown.
        ship: write the policy where the package's lie too.
    Returns:
        The policy's .json file.
    Raises:
        CheckpointError: see `train`.
    """
    out.mkdir(parents=True, exist_ok=True)
    unit = unit_of(order.preset.task)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        bar = progress.add_task(policy_name(order.preset), total=order.preset.steps)

        def on_progress(steps: int, point: Point | None) -> None:
            progress.update(bar, completed=min(steps, order.preset.steps))
            if point is not None:
                progress.console.print(_line(point, unit))

        trained = train(order, out, on_progress)
    path = save_policy(policy_of(order, trained), out, ship)
    console.print(_closing(trained, unit, path))
    return path


def run_seeds(
    trainings: Sequence[tuple[Order, Path]], executor: Executor, console: Console
) -> list[Path]:
    """Train several seeds, and write a policy each; one that is interrupted goes on later.

    Args:
        trainings: what is to be trained, and the folder of its policy, checkpoints and logs.
        executor: where; on other machines the folders must be the same ones.
        console: where a line for each is printed.
    Returns:
        The policies' .json files.
    Raises:
        CheckpointError: see `train`.
        KeyboardInterrupt: Ctrl-C; the checkpoints stay.
    """
    paths = [Path()] * len(trainings)

    def keep(index: int, result: tuple[Path, str]) -> None:
        paths[index], closing = result
        console.print(f"Seed {trainings[index][0].seed}: {closing}", highlight=False)

    run_or_raise([partial(_trained, order, out) for order, out in trainings], executor, keep)
    return paths


def _trained(order: Order, out: Path) -> tuple[Path, str]:
    """Train without a display; the policy's file and a line on it."""
    out.mkdir(parents=True, exist_ok=True)
    trained = train(order, out, lambda steps, point: None)
    path = save_policy(policy_of(order, trained), out)
    return path, _closing(trained, unit_of(order.preset.task), path)


def _line(point: Point, unit: str) -> str:
    broken = f", {point.broken} episodes broke a limit" if point.broken else ""
    at = f"{point.steps:9d} steps {point.wall_s:6.0f} s"
    return f"{at}   validation {point.error:.4g} {unit}{broken}"


def _closing(trained: Trained, unit: str, path: Path) -> str:
    course = trained.course
    rate = trained.model.num_timesteps / course.learning_s
    early = " (ended at a plateau)" if course.stopped else ""
    return (
        f"{trained.final.error:.4g} {unit} on validation stations after {course.wall_s:.0f} s, "
        f"{rate:.0f} steps/s while learning{early}\nPolicy: {path}"
    )
