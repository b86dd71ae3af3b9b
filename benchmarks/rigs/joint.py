"""Runs the suite `joint`: controllers of rigs, a policy, an oracle; makes what they need."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any
from zipfile import ZipFile, ZipInfo

import numpy as np
from rich.progress import Progress

from benchmarks.executors.executor import Executor, run_or_raise
from benchmarks.files import (
    UNREADABLE,
    csv_text,
    reason,
    say_damaged,
    toml_document,
    write_text,
)
from benchmarks.report.errors import PERCENT, Errors, Measure
from benchmarks.report.standings import Standings
from benchmarks.report.tables import pair_table, ranks_table, standings_table
from benchmarks.rigs.from_logs import settings_of
from benchmarks.rigs.policy import SEES, AnyReference, RigPolicy, train
from benchmarks.rigs.score import Score, info_of, run_episode, score_table
from benchmarks.rigs.suite import ORACLE, POLICY, RigCase, RigSuite, joint_suite
from benchmarks.runner.fingerprint import code_digest_with
from benchmarks.runner.journal import JOURNAL, Journal
from benchmarks.suites.suite import JOINT, Episode
from controllers.rigs import RIG_CONTROLLERS
from pma_gym.cli.terminal import print_table
from pma_gym.documents import read_toml
from pma_gym.envs import RigEnv
from pma_gym.pages.document import Block, Formula, Heading, Paragraph, to_html, to_markdown

FOLDER = Path(__file__).parent
SETTINGS = FOLDER / "joint_settings.toml"
"""Settings of controllers by rig, as `tune --suite joint` found them."""

SIGNAL = "angle"
"""What is to follow."""

STEPS = 500_000
"""Control steps of a policy's training."""

MISSED = 100.0
"""Error of an episode that a controller failed in (% of the range)."""

WHO = (
    "Controllers receive the nominal model. They were tuned, and the policies trained, on other "
    "stations. The oracle is whichever controller does best with the station's true numbers and "
    "without noise: a bound. Errors are root mean squares in percent of the reference's range; "
    "a failed case counts as the whole range. A drawn station rests off the nominal start, where "
    "the reference begins: much of a slow sine's error is of the first second."
)
"""What the page says of who is compared."""

SETTINGS_COMMENT = (
    "Settings of controllers on the rigs of `joint`: python -m benchmarks tune --suite joint"
)
"""First line of their file."""

Settings = Mapping[str, Mapping[str, float]]
"""Settings of every controller of a rig, by name."""


class AnySwing(AnyReference):
    """Draws a reference of any kind, every other one a sine as fast as any of the suite."""

    def __call__(self, generator: np.random.Generator) -> str:
        """Name of a task."""
        if generator.random() < 0.5:
            return f"{self.signal}_sine_{generator.uniform(0.0, 2.5):.2f}hz"
        return super().__call__(generator)


def policy_file(rig: str) -> Path:
    """File of the shipped policy of a rig."""
    return FOLDER / f"{JOINT}-{rig}.zip"


def _case(score: Score) -> RigCase:
    """The case of a score, whose seed is the station."""
    return RigCase(score.rig, score.task, score.seed)


def score_case(case: RigCase, names: Sequence[str], settings: Settings) -> list[Score]:
    """Score controllers on a case, of the oracle's the best."""
    every = (_scores(joint_suite(), case, name, settings) for name in names)
    return [min(scores, key=lambda score: score.percent) for scores in every]


def _scores(suite: RigSuite, case: RigCase, name: str, settings: Settings) -> list[Score]:
    """Scores of a controller, of the oracle's all; who raises an error misses the whole range."""
    options, nominal = suite.options(case), None
    rivals = [RIG_CONTROLLERS[each](settings[each]) for each in settings if name in (each, ORACLE)]
    if name == ORACLE:
        options |= {"noise": False}
        nominal = suite.station(case.rig, case.station)
    elif name == POLICY:
        options |= SEES
        rivals = [RigPolicy(policy_file(case.rig), options)]
    env = RigEnv(suite.tasks[case.task]["reference"], **options)
    scores = []
    for rival in rivals:
        try:
            info, _, spent = run_episode(env, rival, case.station, nominal)
            rmse = float(info[f"rmse_{env.task.schedule.suffix}"])
            figures = float(info["percent_of_range"]), rmse, env.ended_by, 1e6 * spent
        except (ArithmeticError, ValueError) as error:
            figures = MISSED, options["span"], reason(error), 0.0
        scores.append(Score(case.rig, name, *case[1:], *figures))
    return scores


def suite_settings(
    suite: RigSuite,
    rig: str,
    names: Sequence[str],
    shipped: Mapping[str, Settings],
    out: Path,
    progress: Progress,
) -> Settings:
    """Settings of the controllers that apply to a rig: the shipped ones, else by a search.

    Args:
        suite: the suite.
        rig: name of the rig's model.
        names: of the controllers; for an oracle all are needed.
        shipped: settings by rig and controller.
        out: folder in which those of a search are kept.
        progress: shows how far it is.
    """
    options, references = suite.training(rig), suite.document["training"]["references"]
    info, settings = info_of(RigEnv(references[0], **options)), {}
    for name, kind in RIG_CONTROLLERS.items():
        if kind.missing(info) or not {name, ORACLE} & set(names):
            continue
        known = shipped.get(rig, {}).get(name, {})
        if set(known) != set(kind.settings):
            folder = out / "tuning"
            known = settings_of(folder, f"{name}-{rig}", name, options, references, progress)
        settings[name] = known
    return settings


def _key(suite: RigSuite, rig: str, name: str, settings: Settings) -> str:
    """Fingerprint of what a controller's rows depend on."""
    files = [FOLDER / each for each in ("suite.py", "joint.py", "score.py", "policy.py")]
    files += [policy_file(rig)] if name == POLICY else []
    used = settings if name == ORACLE else settings.get(name)
    text = repr((suite.digest, code_digest_with(files), name, used))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def kept_rows(path: Path, keys: Mapping[tuple[str, str], str]) -> dict[Any, Score]:
    """Rows of a journal by case and controller, if they were computed with what there is now."""
    rows = {}
    for line in path.read_bytes().splitlines() if path.is_file() else []:
        try:
            row = json.loads(line)
            key, score = row.pop("key"), Score(**row)
            if keys.get((score.rig, score.controller)) == key:
                rows[_case(score), score.controller] = score
        except UNREADABLE as error:
            say_damaged(path, reason(error), "those cases run anew, the others stay")
    return rows


def run_joint(
    controllers: Sequence[str],
    stations: int | None,
    tasks: Sequence[str],
    out: Path,
    executor: Executor,
) -> list[Score]:
    """Run what the folder lacks of the suite, and write its report.

    Args:
        controllers: names; all of `RIG_CONTROLLERS`, a policy and the oracle if empty.
        stations: only the first ones of every rig; all if None.
        tasks: only these; all if empty.
        out: folder of the results.
        executor: where the cases run.
    Raises:
        ValueError: an unknown name.
        KeyboardInterrupt: Ctrl-C; what is done is kept.
    """
    suite = joint_suite()
    cases, names = suite.cases(stations, tasks), list(controllers) or suite.controllers
    for name in names:
        if name not in suite.controllers:
            known = ", ".join(suite.controllers)
            raise ValueError(f"suite {JOINT} has the controllers {known}, got {name!r}")
    with Progress() as progress:
        shipped = read_toml(SETTINGS)
        chosen = {
            rig: suite_settings(suite, rig, names, shipped, out, progress) for rig in suite.rigs
        }
        keys = {
            (rig, name): _key(suite, rig, name, settings)
            for rig, settings in chosen.items()
            for name in names
            if name in (*settings, POLICY, ORACLE)
        }
        rows, works = kept_rows(out / JOURNAL, keys), []
        for case in cases:
            left = [n for n in names if (case.rig, n) in keys and (case, n) not in rows]
            works += [partial(score_case, case, left, chosen[case.rig])] if left else []
        bar = progress.add_task(f"suite {JOINT}", total=len(works))
        with Journal(out / JOURNAL) as journal:

            def keep(index: int, scores: list[Score]) -> None:
                for score in scores:
                    rows[_case(score), score.controller] = score
                    key = keys[score.rig, score.controller]
                    journal.append({"key": key, **score._asdict()})
                progress.advance(bar)

            run_or_raise(works, executor, keep)
    scores = [rows[case, name] for case in cases for name in names if (case, name) in rows]
    if not scores:
        raise ValueError(f"{', '.join(names)} apply to no rig of suite {JOINT}; name another one")
    write_leaderboard(suite, scores, out)
    return scores


def standings_on(suite: RigSuite, scores: Sequence[Score], rigs: Sequence[str]) -> Standings:
    """Standings on some rigs together of the controllers that apply to all of them."""
    by_name: dict[str, dict[RigCase, Score]] = {}
    for score in scores:
        if score.rig in rigs:
            by_name.setdefault(score.controller, {})[_case(score)] = score
    cases = list(max(by_name.values(), key=len))
    whole = {name: rows for name, rows in by_name.items() if len(rows) == len(cases)}
    episodes = tuple(
        # Stations of two rigs are two.
        Episode(
            len(suite.rigs) * case.station + suite.rigs.index(case.rig), "/".join(case[:2]), 0, 0
        )
        for case in cases
    )
    values = np.array([[rows[case].percent for case in cases] for rows in whole.values()])
    failed = tuple(sum(bool(row.ended_by) for row in rows.values()) for rows in whole.values())
    name = rigs[0].replace("_", " ") if len(rigs) == 1 else "all rigs"
    return Standings(Errors(Measure(name, (), PERCENT), tuple(whole), episodes, values), failed)


def write_leaderboard(suite: RigSuite, scores: Sequence[Score], out: Path) -> None:
    """Write `scores.csv`, `report.html` and `report.md`, and print the ranks."""
    rigs = list(dict.fromkeys(score.rig for score in scores))
    standings = [standings_on(suite, scores, each) for each in (rigs, *([rig] for rig in rigs))]
    done, planned = len({_case(score) for score in scores}), len(suite.cases())
    ranks = ranks_table(standings, {})
    blocks: list[Block] = [
        Heading(suite.document["title"], 1),
        Paragraph(WHO),
        Formula(f"python -m benchmarks run --suite {JOINT}"),
        ranks,
        *(standings_table(each, {}) for each in standings),
        pair_table(standings[0], {}),
        score_table(scores),
        Paragraph(
            f"Version {suite.document['version']} ({suite.digest}), {done} of {planned} cases."
        ),
    ]
    write_text(out / "scores.csv", csv_text([Score._fields, *scores]))
    write_text(out / "report.html", to_html(blocks, {}))
    write_text(out / "report.md", to_markdown(blocks, {}, ""))
    print_table(ranks)
    print(f"Report: {out / 'report.html'}")


def tune_joint(out: Path, steps: int = STEPS) -> None:
    """Make what the suite ships: settings of all controllers, and a policy for every rig.

    What is done is kept in the folder, from which the same command goes on.

    Args:
        out: folder of the results.
        steps: control steps of a policy's training.
    """
    suite = joint_suite()
    with Progress() as progress:
        tables = {
            rig: suite_settings(suite, rig, [ORACLE], {}, out, progress) for rig in suite.rigs
        }
        write_text(SETTINGS, toml_document(SETTINGS_COMMENT, 1, tables))
        for rig in suite.rigs:
            file, bar = out / "tuning" / f"policy-{rig}.zip", progress.add_task(f"policy, {rig}")
            train(
                suite.training(rig),
                SIGNAL,
                file,
                lambda done, total, bar=bar: progress.update(bar, completed=done, total=total),
                steps,
                reference=AnySwing(SIGNAL),
            )
            with ZipFile(file) as whole, ZipFile(policy_file(rig), "w") as weights:
                # Without the optimiser's state and the time of day.
                weights.writestr(ZipInfo("policy.pth"), whole.read("policy.pth"))
