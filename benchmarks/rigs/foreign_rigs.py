"""Whether a diagnosis pays: controllers made on amended and given models, on foreign rigs."""

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, count, islice, product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.progress import Progress

from benchmarks.executors.choice import local
from benchmarks.executors.executor import run_all
from benchmarks.files import csv_text, write_text
from benchmarks.hidden_effects.evaluation.scoring import wilson
from benchmarks.hidden_effects.rigs.drawing import SIMULATORS, catalogue_name, drawn, turn_of
from benchmarks.hidden_effects.rigs.driven_campaign import DrivenCampaign
from benchmarks.hidden_effects.rigs.laws import HiddenEffect
from benchmarks.rigs.foreign import foreign_error
from benchmarks.rigs.from_logs import TUNED, controller_of, environments
from benchmarks.rigs.score import run_episode
from benchmarks.rigs.suite import VARIATION, varied
from pma_gym.cli.terminal import print_table
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.discovery import diagnose
from pma_gym.envs import RigEnv
from pma_gym.pages.document import Block, Heading, Paragraph, TextTable, to_html, to_markdown
from pma_gym.plant.model import dump_model

PID = "feedforward_pid"
"""The controller with settings that is compared: a model enters it by its feed-forward too."""

BASELINES = {
    "given": "given",
    "varied": f"given, drawn by {100 * VARIATION:.0f} %",
}
"""Controllers with which the amended model's is compared, by what they are made on: the model as it
is, and one whose parameters are drawn about it, as `benchmarks run --model` does."""

LEAST_CHANGE, LEAST_PREDICTED = 0.02, 0.1
"""Shares of the error by which a mean must change to count, and that a model must predict."""


def joints(cases: int) -> list[int]:
    """Numbers of cases with a joint that hides something; MuJoCo computes every second of them."""

    def of(simulator: str) -> Any:  # noqa: ANN401 - an endless generator
        for number in count(1):
            rig, kind, by = turn_of(number)
            if rig == "joint" and "effect" in kind and by == simulator:
                yield number

    return list(islice(chain.from_iterable(zip(*map(of, SIMULATORS), strict=True)), cases))


@dataclass(frozen=True)
class ForeignCase:
    """One controller made twice for one foreign rig; a call makes, runs and records it.

    Attributes:
        seed: of the set.
        number: of the case in block `rigs`.
        out: folder of all cases.
        controller: its name, or `policy`.
        seeds: how many references and noises.
        steps: control steps of a policy's training.
    """

    seed: int
    number: int
    out: Path
    controller: str
    seeds: int
    steps: int

    @property
    def folder(self) -> Path:
        """Folder of the case: logs, diagnosis, settings, policies, records."""
        return self.out / f"case-{self.seed}-{self.number:03d}"

    def diagnosis(self, campaign: DrivenCampaign, effects: Sequence[HiddenEffect]) -> Path:
        """Folder of the diagnosis, which is made of the logs and the lab's model alone."""
        logs, answer = self.folder / "logs", self.folder / "diagnosis"
        if not (answer / "diagnosis.json").exists():
            for name, text in campaign.texts(effects).items():
                write_text(logs / name, text)
            made = diagnose(read_dataset(logs))
            write_text(answer / "model.toml", dump_model(made.model))
            write_text(answer / "diagnosis.json", made.text())
        return answer

    def __call__(self) -> dict[str, Any]:
        """The record of the case, from its folder if it is there."""
        file = self.folder / f"{self.controller}.json"
        asked = {"seeds": self.seeds, "steps": self.steps}
        if file.exists():
            kept = json.loads(file.read_text(encoding="utf-8"))
            if kept["asked"] == asked:
                return kept
        start = time.monotonic()
        campaign, effects = drawn(self.seed, self.number)
        assert isinstance(campaign, DrivenCampaign)
        answer = self.diagnosis(campaign, effects)
        answered = json.loads((answer / "diagnosis.json").read_text(encoding="utf-8"))
        record = {
            "asked": asked,
            "number": self.number,
            "controller": self.controller,
            "simulator": campaign.simulator,
            "hidden": [catalogue_name("joint", each.name) for each in effects],
            "verdict": answered["verdict"],
            "named": [each["name"] for each in answered["effects"]],
            "errors": self.errors(campaign, effects, answer),
            "seconds": round(time.monotonic() - start),
        }
        write_text(file, json.dumps(record, indent=1, allow_nan=False) + "\n")
        return record

    def errors(
        self, campaign: DrivenCampaign, effects: Sequence[HiddenEffect], answer: Path
    ) -> dict[str, dict[str, list[float]]]:
        """Errors (% of the range) by seed, foreign and predicted, by model of the controller."""
        rigs, signal = environments(read_dataset(self.folder / "logs"), None, answer)
        if self.controller == PID:
            lab = rigs["given"]
            rigs["varied"] = {**lab, "randomisation": varied(lab["model"])}
        with Progress(disable=True) as silent:
            made = {
                name: controller_of(
                    self.folder, self.controller, name, options, signal, silent, self.steps
                )
                for name, options in rigs.items()
            }
        errors = {where: {name: [] for name in rigs} for where in ("foreign", "predicted")}
        for seed in range(1, self.seeds + 1):
            # The lab's model begins where the rig does.
            task = RigEnv(f"{signal}_{TUNED[seed % len(TUNED)]}_{seed}", **rigs["given"]).task
            for name, (controller, sees) in made.items():
                env = RigEnv(task, **rigs[name], **sees)
                error = foreign_error(campaign, effects, env, controller, seed)
                errors["foreign"][name].append(error)
                info, *_ = run_episode(
                    RigEnv(task, **rigs["amended"], **sees), controller, seed, rigs[name]["model"]
                )
                errors["predicted"][name].append(float(info["percent_of_range"]))
        return errors


class Comparison(NamedTuple):
    """How the amended model's controller compares with another.

    Attributes:
        before: mean error of the other one (% of the range).
        after: the same of the amended model's.
        change: mean of the paired differences, after less before.
        spread: standard error of that mean.
        predicted: change as a share of the error before, by the amended model.
    """

    before: float
    after: float
    change: float
    spread: float
    predicted: float

    @property
    def outcome(self) -> str:
        """`worse` or `better` where the change is sure and counts; else `same`."""
        if abs(self.change) <= max(2.0 * self.spread, LEAST_CHANGE * self.before):
            return "same"
        return "worse" if self.change > 0.0 else "better"

    @property
    def differs(self) -> bool:
        """Whether the amended model predicts another error."""
        return abs(self.predicted) > LEAST_PREDICTED


def comparison(
    errors: Mapping[str, Mapping[str, Sequence[float]]], baseline: str = "given"
) -> Comparison:
    """Compare paired errors of a record with those of a baseline."""
    before, after = (np.array(errors["foreign"][name]) for name in (baseline, "amended"))
    change = after - before
    spread = change.std(ddof=1) / len(change) ** 0.5 if len(change) > 1 else 0.0
    expected = {name: float(np.mean(each)) for name, each in errors["predicted"].items()}
    predicted = expected["amended"] / expected[baseline] - 1.0
    means = float(before.mean()), float(after.mean()), float(change.mean())
    return Comparison(*means, float(spread), predicted)


def report_blocks(seed: int, records: Sequence[Mapping[str, Any]]) -> list[Block]:
    """Counts with intervals, and a row a case, for each controller and baseline."""
    tables: list[Block] = []
    counts: list[list[str]] = []
    for controller, key in product((PID, "policy"), BASELINES):
        own = [
            (record, comparison(record["errors"], key))
            for record in records
            if record["controller"] == controller and key in record["errors"]["foreign"]
        ]
        differ = [each for _, each in own if each.differs]
        for label, hits, n in (
            ("not worse", sum(each.outcome != "worse" for _, each in own), len(own)),
            ("better", sum(each.outcome == "better" for _, each in own), len(own)),
            (
                "better where the prediction differs by > 10 %",
                sum(each.outcome == "better" for each in differ),
                len(differ),
            ),
        ):
            ends = " to ".join(f"{100 * end:.0f}" for end in wilson(hits, n))
            counts += [[controller, BASELINES[key], label, f"{hits} of {n}", f"{ends} %"]] * bool(n)
        title = f"{controller}: RMSE in % of the range, before on the model {BASELINES[key]}"
        header = ["Case", "Simulator", "Hidden", "Answer", "before", "amended", "change"]
        rows = [_row(record, each) for record, each in own]
        table = TextTable(title, [*header, "predicted change", "outcome"], rows, 4)
        tables += [table] * bool(rows)
    header = ["Controller", "Before on the model", "On the amended one", "Cases", "95 % (Wilson)"]
    summary = TextTable("All cases", header, counts, 3)
    return [Heading("Controllers on foreign rigs", 1), Paragraph(f"Seed {seed}."), summary, *tables]


def _row(record: Mapping[str, Any], each: Comparison) -> list[str]:
    return [
        str(record["number"]),
        record["simulator"],
        ", ".join(record["hidden"]),
        f"{record['verdict']}: {', '.join(record['named'])}".removesuffix(": "),
        f"{each.before:.3g}",
        f"{each.after:.3g}",
        f"{each.change:+.2g} ± {each.spread:.1g}",
        f"{100.0 * each.predicted:+.0f} %",
        each.outcome,
    ]


def run_foreign_rigs(
    cases: int, policies: int, seeds: int, seed: int, steps: int, out: Path, jobs: int
) -> int:
    """Make, run and compare; see `python -m benchmarks foreign-rigs`.

    Returns:
        Exit code: 0, 1 if a case failed, 130 if interrupted.
    Raises:
        ValueError: the folder of the results is a file.
    """
    if out.exists() and not out.is_dir():
        raise ValueError(f"--out {out} is a file; name a folder for the results")
    executor, records, failures = local(jobs), list[dict[str, Any]](), list[str]()
    for controller, number in ((PID, cases), ("policy", min(policies, cases))):
        trained = steps if controller == "policy" else 0
        works = [ForeignCase(seed, n, out, controller, seeds, trained) for n in joints(number)]
        with Progress() as progress:
            bar = progress.add_task(controller, total=len(works))

            def on_done(index: int, result: object, works: Any = works, bar: Any = bar) -> None:  # noqa: ANN401
                if isinstance(result, dict):
                    records.append(result)
                    row = _row(result, comparison(result["errors"]))
                    progress.console.print(", ".join(row), markup=False)
                else:
                    failures.append(f"case {works[index].number}: {result!r}")
                    progress.console.print(failures[-1], markup=False)
                progress.advance(bar)

            if not run_all(works, executor, on_done):
                print(f"Interrupted; the same command goes on in {out}")
                return 130
    records.sort(key=lambda record: (record["controller"] == "policy", record["number"]))
    blocks = report_blocks(seed, records)
    write_text(out / "report.md", to_markdown(blocks, {}, ""))
    write_text(out / "report.html", to_html(blocks, {}))
    header = ["controller", "case", "made_on", "run_on", "seed", "percent_of_range"]
    rows = [
        [record["controller"], record["number"], name, where, i, value]
        for record in records
        for where, by_model in record["errors"].items()
        for name, values in by_model.items()
        for i, value in enumerate(values, 1)
    ]
    write_text(out / "scores.csv", csv_text([header, *rows]))
    for block in blocks:
        if isinstance(block, TextTable):
            print_table(block)
    print(f"Report: {out / 'report.html'}")
    return int(bool(failures))
