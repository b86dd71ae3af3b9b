"""Ships the best policy of every task and loop, chosen on validation stations, with its card."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.training.stations import TRAINING, VALIDATION
from benchmarks.training.study.operators import table_of
from benchmarks.training.study.scored_policies import seed_folders
from controllers.design.designs import EXERCISE_KINDS
from controllers.policies.policy_file import PolicyFile, load_policy_file, save_policy_file
from controllers.policy import POLICIES
from pma_gym.envs import ENVIRONMENTS


def best_policies(groups: Sequence[Path]) -> list[Path]:
    """Of each task and loop the policy with the least mean error over validation episodes.

    Of all episodes: an interquartile mean would not see a policy that loses one station in twenty.
    Where some were trained before that mean was kept, it is the interquartile mean after all.

    Args:
        groups: folders of seeds; of several the best of all.
    """
    candidates: dict[str, list[Path]] = {}
    for group in groups:
        for folder in seed_folders(group):
            for path in folder.glob("*.json"):
                candidates.setdefault(path.stem.rpartition("-")[0], []).append(path)
    return [
        _best({path: load_policy_file(path) for path in sorted(paths)})
        for _, paths in sorted(candidates.items())
    ]


def ship(
    groups: Sequence[Path],
    figures: Mapping[str, Any],
    folder: Path = POLICIES,
) -> list[Path]:
    """Copy the best policies to the folder that ships, each with its card.

    What another algorithm of these groups shipped for the same task and loop goes.

    Args:
        groups: folders of seeds, of which the best of all ships; some may not be there.
        figures: of each group by name, from `study_figures`: suites' scores go into the files.
        folder: where to.
    Returns:
        The .json files.
    """
    folder.mkdir(exist_ok=True)
    algorithms = {group.name.partition("-")[0] for group in groups}
    there = [group for group in groups if group.is_dir()]
    paths = []
    for best in best_policies(there):
        policy, own = load_policy_file(best), figures[best.parent.parent.name]
        kept = _by_operators(best, folder / best.name)
        scores = dict(policy.training["scores"]) | kept | {"suites": _scores(policy, own)}
        stem, _, own_algorithm = best.stem.rpartition("-")
        training = dict(policy.training) | {"scores": scores}
        shipped = replace(policy, name=best.stem, training=training)
        path = save_policy_file(shipped, folder / f"{best.stem}.json")
        for algorithm in algorithms - {own_algorithm}:
            for old in folder.glob(f"{stem}-{algorithm}.*"):
                old.unlink()
        path.with_suffix(".md").write_text(card(shipped, own["seeds"]), encoding="utf-8")
        paths.append(path)
    return paths


def _by_operators(best: Path, shipped: Path) -> dict[str, Any]:
    """What operators said of the very weights that ship by now: scores of minutes, kept."""
    weights = [path.with_suffix(".safetensors") for path in (best, shipped)]
    if not shipped.exists() or weights[0].read_bytes() != weights[1].read_bytes():
        return {}
    scores = load_policy_file(shipped).training["scores"]
    return {"operators": scores["operators"]} if "operators" in scores else {}


def _best(policies: Mapping[Path, PolicyFile]) -> Path:
    scores = {path: one.training["scores"]["validation"] for path, one in policies.items()}
    key = "mean" if all("mean" in each for each in scores.values()) else "error"
    return min(scores, key=lambda path: float(scores[path][key]))


def _scores(policy: PolicyFile, figures: dict[str, Any]) -> dict[str, Any]:
    """Interquartile means of the shipped seed, and of all seeds with their interval."""
    seed = policy.training["seed"]
    loop = policy.name.partition("-")[2].rpartition("-")[0]
    by_suite: dict[str, Any] = {}
    for suite, measures in figures["judged"].items():
        if (suite == "hard") != ("delay" in loop):
            continue
        for measure, pooled in measures.items():
            if policy.task in measure:
                by_suite[f"{suite}: {measure}"] = {
                    "this": pooled["by_seed"][seed],
                    "all_seeds": pooled["mean"],
                    "unit": pooled["unit"],
                }
    return by_suite


def card(policy: PolicyFile, seeds: int) -> str:
    """The model card of a policy, as Markdown."""
    training, kwargs = policy.training, policy.environment["kwargs"]
    validation = training["scores"]["validation"]
    preset = training["preset"]
    command = (
        f"python -m benchmarks train --algo {training['algorithm']} --task {_task(policy)} "
        f"--preset {preset} --seed {training['seed']}"
    )
    curve = [
        f"| {int(steps)} | {wall:.0f} | {error:.4g} |" for steps, wall, error in training["curve"]
    ]
    layers = "-".join(map(str, policy.weights.sizes))
    return "\n".join(
        [
            f"# {policy.name}",
            "",
            f"{policy.title}: a network of {layers} ({policy.weights.activation}) for "
            f"`{policy.environment['id']}` at {kwargs['control_rate_hz']:g} Hz, commands "
            f"{1e3 * kwargs['action_delay_s']:g} ms late.",
            "",
            f"- **Sees**: {len(policy.observation)} entries, listed in the .json file.",
            f"- **Does**: {_does(policy)}",
            f"- **Trained on**: {TRAINING} stations drawn by the recipe of suite `robust` with its "
            f"training seed; {training['steps']} control steps, {training['wall_s']:.0f} s on one "
            f"core of a machine that did other things too; seed {training['seed']}, the best of "
            f"{seeds} on {VALIDATION} validation stations ({_validated(validation)}).",
            f"- **Code**: {training['code']}",
            f"- **Made again by**: `{command}`",
            "",
            *_operators(training["scores"]),
            *_suites(training["scores"]),
            "Learning curve:",
            "",
            "| Control steps | Wall time (s) | Validation error |",
            "| --: | --: | --: |",
            *curve,
            "",
            "Limits: for this control rate and delay alone (others are refused), for stations like "
            "those of the recipe; at a limit of the rig it knows no more than its training showed "
            "it. How busy its voltage is stands in docs/policies.md. Never run on a real rig.",
            "",
        ]
    )


def _validated(validation: Mapping[str, Any]) -> str:
    """Errors on validation stations; by which one the policy was chosen."""
    error, unit = f"{validation['error']:.4g}", validation["unit"]
    if "mean" not in validation:
        return f"{error} {unit}"
    return f"mean {validation['mean']:.4g} {unit}, interquartile mean {error} {unit}"


def _suites(scores: Mapping[str, Any]) -> list[str]:
    rows = [
        f"| {name} | {one['this']:.4g} {one['unit']} | {one['all_seeds'][0]:.4g} "
        f"[{one['all_seeds'][1]:.4g}, {one['all_seeds'][2]:.4g}] |"
        for name, one in scores.get("suites", {}).items()
    ]
    if not rows:
        return []
    return [
        "Interquartile means of the RMSE; in brackets 95 % intervals over all seeds and the "
        "suite's stations:",
        "",
        "| Suite | This policy | All seeds |",
        "| :-- | --: | --: |",
        *rows,
        "",
    ]


def _operators(scores: Mapping[str, Any]) -> list[str]:
    """Of an exercise: by operators whom no policy was trained with."""
    if "operators" not in scores:
        return []
    figures, broken = scores["operators"], scores["validation"]["broken"]
    return [
        f"Mean RMSE over {figures['count']} random operators (`python -m "
        "benchmarks.training.study.operators`), by phase; `Ended` counts episodes that a limit "
        "or an unsafe moment or speed ended:",
        "",
        *table_of(figures),
        "",
        f"Of {2 * VALIDATION} validation episodes {broken} ended so.",
        "",
    ]


def _task(policy: PolicyFile) -> str:
    """Name of the task that it was trained on."""
    environment = policy.environment
    return environment["kwargs"].get("task") or ENVIRONMENTS[environment["id"]]


def _does(policy: PolicyFile) -> str:
    form = policy.form
    actuator = "regulator" if policy.task in EXERCISE_KINDS else "motor"
    if form.kind == "increment":
        return f"its action changes the {actuator} voltage by up to {form.authority_v:g} V a step."
    if form.kind == "residual":
        return f"its action adds up to {form.authority_v:g} V to the voltage of {form.base}."
    return f"its action is the {actuator} voltage, 0-10 V."
