"""`python -m benchmarks train`: from a preset to a policy file, with progress, to go on later.

A trained policy's files: the policy, and a card that says how it was trained.
"""

from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from benchmarks.report.errors import task_of
from benchmarks.runner.provenance import ROOT, git_state
from benchmarks.training.export import weights_from_state
from benchmarks.training.policy_batch import Point
from benchmarks.training.preset import Preset, PresetError, load_preset
from benchmarks.training.run import Order, train
from benchmarks.training.stations import TRAINING, VALIDATION
from controllers.design.designs import EXERCISE_KINDS, loop_name, task_kind
from controllers.policies.network import Weights
from controllers.policies.policy_file import PolicyFile, save_policy_file
from controllers.policy import POLICIES
from pma_gym.envs import ENVIRONMENTS
from pma_gym.tasks import EXERCISES, named_task


def policy_name(preset: Preset) -> str:
    """Return the name of a preset's policies: kind of task, loop, algorithm."""
    station = preset.env.rig.station
    return f"{task_kind(station)}-{loop_name(station)}-{preset.algorithm}"


def policy_of(
    preset: Preset, seed: int, weights: Weights, steps: int, curve: list[Point], best: Point
) -> PolicyFile:
    """A trained policy with its provenance.

    Args:
        preset: with what it was trained.
        seed: of the training.
        weights: its network.
        steps: control steps of the training.
        curve: its validations.
        best: that of the weights.
    """
    view, form, station = preset.env.adapter.view, preset.env.adapter.form, preset.env.rig.station
    task = (preset.wrapper.get("options") or {}).get("task")
    loop: dict[str, Any] = {
        "control_rate_hz": 1.0 / station.period,
        "action_delay_s": station.action_delay,
        "observation_delay_s": station.observation_delay,
        "model": station.model.name,
    }
    state = git_state(ROOT)
    validated = {key: getattr(best, key) for key in ("error", "mean", "broken", "reward")}
    return PolicyFile(
        policy_name(preset),
        f"{preset.algorithm.upper()}, {preset.name}",
        weights,
        task_kind(station),
        {
            "id": preset.environment,
            "kwargs": {**preset.options, **({"task": task} if task else {}), **loop},
        },
        view,
        tuple(view.rows(station, form.base)),
        form,
        {
            "algorithm": preset.algorithm,
            "preset": preset.name,
            "seed": seed,
            "steps": steps,
            "wall_s": round(curve[-1].wall_s, 1),
            "code": str(state["commit"])[:12] + ("+" if state["dirty"] else ""),
            "curve": [[point.steps, point.wall_s, point.error] for point in curve],
            "scores": {"validation": {**validated, "unit": task_of(preset.task).schedule.unit}},
        },
    )


def save_policy(policy: PolicyFile, out: Path, ship: bool = False) -> Path:
    """Write a policy with its card.

    Args:
        policy: the policy.
        out: folder.
        ship: write both where the package's policies lie too; another algorithm's stays.
    Returns:
        The .json file in the folder.
    """
    for folder in (out, POLICIES) if ship else (out,):
        path = save_policy_file(policy, folder / policy.name)
        path.with_suffix(".md").write_text(card(policy), encoding="utf-8")
    return out / f"{policy.name}.json"


def train_words(policy: PolicyFile) -> list[str]:
    """The command, after Python's name, that trains a policy again."""
    environment, training = policy.environment, policy.training
    task = environment["kwargs"].get("task") or ENVIRONMENTS[environment["id"]]
    how = {"algo": training["algorithm"], "task": task, "preset": training["preset"]}
    how["seed"] = training["seed"]
    options = [word for key, value in how.items() for word in (f"--{key}", str(value))]
    return ["-m", "benchmarks", "train", *options]


def card(policy: PolicyFile) -> str:
    """The model card of a policy, as Markdown."""
    training, kwargs, form = policy.training, policy.environment["kwargs"], policy.form
    scores = training["scores"]["validation"]
    actuator = "regulator" if policy.task in EXERCISE_KINDS else "motor"
    does = {
        "increment": f"its action changes the {actuator} voltage by up to {form.authority_v:g} V a "
        "step.",
        "residual": f"its action adds up to {form.authority_v:g} V to the voltage of {form.base}.",
        "direct": f"its action is the {actuator} voltage, 0-10 V.",
    }
    curve = [
        f"| {step:.0f} | {wall:.0f} | {error:.4g} |" for step, wall, error in training["curve"]
    ]
    return f"""# {policy.name}

{policy.title}: a network of {"-".join(map(str, policy.weights.sizes))} \
({policy.weights.activation}) for `{policy.environment["id"]}` at \
{kwargs["control_rate_hz"]:g} Hz, commands {1e3 * kwargs["action_delay_s"]:g} ms late.

- **Sees**: {len(policy.observation)} entries, listed in the .json file.
- **Does**: {does[form.kind]}
- **Trained on**: {TRAINING} stations drawn by a suite's recipe with its training seed, or the \
nominal one, as the preset says; {training["steps"]} control steps, {training["wall_s"]:.0f} s; on \
{VALIDATION} validation stations mean {scores["mean"]:.4g} {scores["unit"]}, interquartile mean \
{scores["error"]:.4g} {scores["unit"]}.
- **Code**: {training["code"]}
- **Made again by**: `python {" ".join(train_words(policy))}`

Learning curve:

| Control steps | Wall time (s) | Validation error |
| --: | --: | --: |
{chr(10).join(curve)}

Limits: for this control rate and delay alone (others are refused), for stations like those of the \
recipe; at a limit of the rig it knows no more than its training showed it. Never run on a real rig.
"""


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
    preset, unit = order.preset, task_of(order.preset.task).schedule.unit
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
    weights = weights_from_state(
        preset.algorithm, model.policy.state_dict(), model.policy.activation_fn.__name__
    )
    policy = policy_of(preset, order.seed, weights, model.num_timesteps, curve, best)
    path = save_policy(policy, out, ship)
    console.print(
        f"Seed {order.seed}: {best.error:.4g} {unit} on validation stations after {best.steps} of "
        f"{model.num_timesteps} steps, {curve[-1].wall_s:.0f} s in all\nPolicy: {path}",
        highlight=False,
    )
    return path
