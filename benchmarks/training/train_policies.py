"""`python -m benchmarks train`: from a preset to a policy file, with progress, to go on later."""

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

from benchmarks.training.card import policy_name, policy_of, save_policy
from benchmarks.training.export import weights_from_state
from benchmarks.training.preset import PresetError, load_preset
from benchmarks.training.run import Order, train
from benchmarks.training.validation import Point, unit_of
from pma_gym.envs import ENVIRONMENTS
from pma_gym.tasks import EXERCISES, named_task

EXERCISE = "pma_gym/ResistiveExercise-v0"
"""Id of the environment of all exercises."""

ENVIRONMENT_OF = {task: name for name, task in ENVIRONMENTS.items()} | {"exercise": EXERCISE}
"""Id of the environment of a task."""


def ordered(
    algorithm: str, task: str, preset: str, seed: int, steps: int | None, threads: int
) -> Order:
    """A checked order.

    Raises:
        PresetError: an unknown task, preset or algorithm, or one that does not fit the others.
    """
    if task in ENVIRONMENT_OF:
        settings = load_preset(preset, algorithm, ENVIRONMENT_OF[task], steps=steps)
        return Order(settings, seed, threads)
    known = named_task(task)
    if known is None or known.exercise is None:
        names = dict.fromkeys((*ENVIRONMENT_OF, *EXERCISES))
        raise PresetError(f"task must be one of {', '.join(names)}, got {task!r}")
    return Order(load_preset(preset, algorithm, EXERCISE, task, steps), seed, threads)


def run_train(order: Order, out: Path, console: Console, ship: bool = False) -> Path:
    """Train, and write the policy.

    Args:
        order: what is to be trained.
        out: folder of the policy, its checkpoint and logs.
        console: where progress is shown.
        ship: write the policy where the package's lie too.
    Returns:
        The policy's .json file.
    Raises:
        CheckpointError: see `train`.
    """
    out.mkdir(parents=True, exist_ok=True)
    preset, unit = order.preset, unit_of(order.preset.task)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        bar = progress.add_task(policy_name(preset), total=preset.n_timesteps)

        def on_progress(steps: int, point: Point | None) -> None:
            progress.update(bar, completed=min(steps, preset.n_timesteps))
            if point is not None:
                broken = f", {point.broken} episodes broke a limit" if point.broken else ""
                at = f"{point.steps:9d} steps {point.wall_s:6.0f} s"
                progress.console.print(f"{at}   validation {point.error:.4g} {unit}{broken}")

        model, curve, best = train(order, out, on_progress)
    activation = model.policy.activation_fn.__name__
    weights = weights_from_state(preset.algorithm, model.policy.state_dict(), activation)
    policy = policy_of(preset, order.seed, weights, model.num_timesteps, curve, best)
    path = save_policy(policy, out, ship)
    console.print(
        f"Seed {order.seed}: {best.error:.4g} {unit} on validation stations after {best.steps} of "
        f"{model.num_timesteps} steps, {curve[-1].wall_s:.0f} s in all\nPolicy: {path}",
        highlight=False,
    )
    return path
