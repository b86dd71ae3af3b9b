"""The commands that are killed: what each keeps when it is, and what it must come to."""

import json
import re
import sys
import zipfile
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]

TIMED = re.compile(r"seconds|wall|elapsed|started|created|act_us")
"""Keys of results that say when or how fast they were computed, which may differ."""


class Command(ABC):
    """A command on a small order, in one folder.

    Args:
        folder: where its input and its results are; new.
    """

    name = ""

    def __init__(self, folder: Path) -> None:
        self.folder, self.out = folder, folder / "out"
        folder.mkdir(parents=True)
        self.prepare()

    @abstractmethod
    def prepare(self) -> None:
        """Write its input."""

    @abstractmethod
    def arguments(self) -> list[str]:
        """The command line, the same every time."""

    @abstractmethod
    def finished(self) -> dict[str, Any]:
        """Cases that are finished, by name; a value that changes if one is computed again."""

    @abstractmethod
    def final(self) -> dict[str, Any]:
        """What a whole run comes to, without times."""

    def may_go(self, name: str, now: dict[str, Any]) -> bool:
        """Whether a finished case may be gone, for it is part of something later."""
        return False

    def faults(self) -> list[str]:
        """Whatever else is wrong with what is kept."""
        return []

    def complete(self) -> bool:
        """Whether all is done, so that the same command has nothing to go on with."""
        return False


SUITE = """
schema = 2
name = "small"
title = "A few cases"
version = 1
seed = 7
model = "station"
[environment]
control_rate_hz = 100.0
[stations]
of = "robust"
count = 3
nominal = true
[[episodes]]
tasks = ["displacement"]
pressures_kpa = [200, 400]
per_station = 2
[[controllers]]
name = "pid"
title = "PID"
"""


class Run(Command):
    """`python -m benchmarks run` on 16 cases and two processes."""

    name = "run"

    def prepare(self) -> None:
        """Write the suite."""
        (self.folder / "small.toml").write_text(SUITE)

    def arguments(self) -> list[str]:
        """Two processes, so that either is killed with the other."""
        suite = str(self.folder / "small.toml")
        options = ["--suite", suite, "--controllers", "pid", "--out", str(self.out)]
        return [sys.executable, "-m", "benchmarks", "run", *options, "--jobs", "2"]

    def _rows(self) -> list[tuple[str, str]]:
        path = self.out / "journal.jsonl"
        lines = path.read_bytes().splitlines() if path.exists() else []
        rows = []
        for line in lines:
            try:
                row = json.loads(line)
            except ValueError:
                continue
            which = (
                row[key] for key in ("controller", "station", "task", "pressure_kpa", "repeat")
            )
            rows.append((" ".join(map(str, which)), line.decode()))
        return rows

    def finished(self) -> dict[str, Any]:
        """Rows of the journal."""
        return dict(self._rows())

    def faults(self) -> list[str]:
        """Cases that the journal has twice."""
        names = [name for name, _ in self._rows()]
        return [f"twice: {name}" for name in sorted(set(names)) if names.count(name) > 1]

    def final(self) -> dict[str, Any]:
        """All scores."""
        head, *rows = (self.out / "scores.csv").read_text().splitlines()
        keep = [i for i, name in enumerate(head.split(",")) if not TIMED.search(name)]
        return {str(i): [row.split(",")[k] for k in keep] for i, row in enumerate(sorted(rows))}


PRESET = """
pma_gym/IsokineticDisplacement-v0:
  env_wrapper:
    - benchmarks.training.policy_env.PolicyEnv:
        view: {kind: tracking, preview: 2, history: 2}
        form: {kind: increment, authority_v: 0.5}
        options: {control_rate_hz: 10.0, pressure_kpa: 300.0}
  callback:
    - benchmarks.training.run.WeightAverage:
        share: 0.5
  n_envs: 4
  n_timesteps: 4800
  policy: MlpPolicy
  n_steps: 32
  batch_size: 32
  n_epochs: 2
  learning_rate: lin_0.003
  policy_kwargs: {net_arch: [16]}
"""


class Train(Command):
    """`python -m benchmarks train` through several validations."""

    name = "train"

    def prepare(self) -> None:
        """Write the preset."""
        (self.folder / "small.yml").write_text(PRESET)

    def arguments(self) -> list[str]:
        """One thread, as by default."""
        options = ["--algo", "ppo", "--task", "displacement", "--out", str(self.out)]
        preset = ["--preset", str(self.folder / "small.yml"), "--seed", "3"]
        return [sys.executable, "-m", "benchmarks", "train", *options, *preset]

    def finished(self) -> dict[str, Any]:
        """Validations of the checkpoint: errors by control steps."""
        path = self.out / "checkpoint.zip"
        if not path.exists():
            return {}
        with zipfile.ZipFile(path) as archive:
            curve = json.loads(archive.read("data"))["curve"]
        return {f"{steps:06d}": error for steps, _, error, *_ in curve}

    def final(self) -> dict[str, Any]:
        """What does not depend on chance: a training that goes on draws anew from there."""
        (path,) = self.out.glob("*.json")
        policy = json.loads(path.read_text())
        return {key: policy[key] for key in ("name", "network", "environment", "observation")}


class HiddenEffects(Command):
    """`python -m benchmarks hidden-effects` on two cases."""

    name = "hidden-effects"

    def prepare(self) -> None:
        """Nothing: the cases are drawn."""

    def arguments(self) -> list[str]:
        """Two cases, one after the other."""
        options = ["--block", "nothing", "--n", "2", "--seed", "1", "--out", str(self.out)]
        return [sys.executable, "-m", "benchmarks", "hidden-effects", *options]

    def finished(self) -> dict[str, Any]:
        """Records, with the moment of their writing."""
        paths = (self.out / "cases").glob("case_*.json")
        return {path.name: (path.stat().st_mtime_ns, path.read_bytes()) for path in paths}

    def final(self) -> dict[str, Any]:
        """All records and figures."""
        paths = [*sorted((self.out / "cases").glob("case_*.json")), self.out / "score.json"]
        return {path.name: timeless(json.loads(path.read_text())) for path in paths}


class Diagnose(Command):
    """`pma-gym diagnose --resume` on two short trials."""

    name = "diagnose"

    def prepare(self) -> None:
        """Simulate two trials of the station, 2 s each."""
        from pma_gym.data.files.trial_files import write_trial
        from pma_gym.data.trial import Trial
        from pma_gym.plant.plant import Plant

        lab, plant = self.folder / "lab", Plant("station")
        lab.mkdir()
        for number, top in enumerate((3.0, 5.0)):
            time = np.arange(0.0, 2.0, 1.0 / 96.0)
            commands = {
                "motor_voltage": np.interp(time, [0.2, 1.5], [0.0, top]),
                "regulator_voltage": np.full_like(time, 3.0),
            }
            trial = plant.simulate(Trial(time, commands, {}), seed=number)
            write_trial(trial, lab / f"ramp_{number}.csv")

    def arguments(self) -> list[str]:
        """With --resume from the first time on: there is nothing yet, and it begins."""
        options = [str(self.folder / "lab"), "--out", str(self.out), "--resume"]
        return [sys.executable, "-m", "pma_gym.cli", "diagnose", *options]

    def finished(self) -> dict[str, Any]:
        """Fits that are kept, with the moment of their writing; results once all is done."""
        paths = (self.out / "unfinished").glob("*.json")
        return {path.name: (path.stat().st_mtime_ns, path.read_bytes()) for path in paths}

    def may_go(self, name: str, now: dict[str, Any]) -> bool:
        """All of them once the results are there."""
        return (self.out / "diagnosis.json").exists()

    def complete(self) -> bool:
        """A kill may come after the last file."""
        return (self.out / "diagnosis.json").exists() and not (self.out / "unfinished").exists()

    def final(self) -> dict[str, Any]:
        """Verdict, models and the next experiment."""
        contents: dict[str, Any] = {
            name: (self.out / name).read_bytes()
            for name in ("model.toml", "next.csv")
            if (self.out / name).exists()
        }
        contents["diagnosis.json"] = timeless(json.loads((self.out / "diagnosis.json").read_text()))
        contents["journal is gone"] = not (self.out / "unfinished").exists()
        return contents


class DiagnoseJoint(Diagnose):
    """The same on a joint with dry friction that its model lacks."""

    name = "diagnose joint"

    def prepare(self) -> None:
        """Three trials of 2 s of another simulator."""
        from pma_gym.data.files.trial_files import write_trial
        from pma_gym.plant.model import dump_model
        from tests.discovery.grey_box.test_free_rigs import logs, model

        lab = self.folder / "lab"
        lab.mkdir()
        (self.folder / "joint.toml").write_text(dump_model(model("joint")))
        for number, trial in enumerate(logs("joint", 2.0)):
            write_trial(trial, lab / f"swing_{number}.csv")

    def arguments(self) -> list[str]:
        """With the model of its data sheet."""
        return [*super().arguments(), "--model", str(self.folder / "joint.toml")]


def timeless(value: Any) -> Any:  # noqa: ANN401
    """A JSON value without what depends on the moment or the speed of its making."""
    if isinstance(value, dict):
        return {k: timeless(v) for k, v in value.items() if not TIMED.search(k)}
    return [timeless(each) for each in value] if isinstance(value, list) else value


COMMANDS = {one.name: one for one in (Run, Train, HiddenEffects, Diagnose, DiagnoseJoint)}
"""All commands by name."""
