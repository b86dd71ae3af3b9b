"""The chain: what depends on the station's model, in the order in which each part needs the last.

Every step is commands of this project. A step is done when all of them have ended well and neither
they nor what they depend on have changed since. What one step makes the next depends on, so
whatever comes after a step that was made anew is made anew too.
"""

import hashlib
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.runner.fingerprint import ROOT
from benchmarks.suites.frozen import frozen_suite, suite_names
from benchmarks.suites.versions import model_digest
from benchmarks.training.train_policies import train_words
from benchmarks.tuning.design import designable
from controllers.policies.policy_file import load_policy_file
from controllers.policy import shipped_policies

MODEL = Path("pma_gym/models/station.toml")
GAINS = Path("controllers/design/gains.toml")
DESIGNS = Path("controllers/design/designs.toml")
POLICIES = Path("controllers/policies/shipped")
SUITES = Path("benchmarks/suites")


@dataclass(frozen=True)
class Step:
    """One step of the chain.

    Attributes:
        name: by which options call it.
        makes: what it makes, for people.
        commands: arguments of Python, one command after the other.
        depends: files and folders that it reads beside the package's code.
        hours: about how long it takes on two cores that do nothing else (h).
    """

    name: str
    makes: str
    commands: tuple[tuple[str, ...], ...]
    depends: tuple[Path, ...]
    hours: float

    @property
    def digest(self) -> str:
        """The digest of its commands and of all dependencies."""
        parts = [" ".join(arguments) for arguments in self.commands]
        return hashlib.sha256("\n".join([*parts, *map(content, self.depends)]).encode()).hexdigest()


def content(path: Path) -> str:
    """Digest of a file, or of all files of a folder; empty if nothing is there."""
    whole = ROOT / path
    files = sorted(each for each in whole.rglob("*") if each.is_file()) if whole.is_dir() else []
    digest = hashlib.sha256()
    for each in files or ([whole] if whole.is_file() else []):
        digest.update(each.name.encode() + each.read_bytes())
    return digest.hexdigest() if files or whole.is_file() else ""


def chain(jobs: int = 2) -> list[Step]:
    """All steps, in their order.

    Args:
        jobs: processes of each command.
    """
    own, workers = ("-m", "benchmarks"), ("--jobs", str(jobs))
    searched = (MODEL, GAINS, DESIGNS, SUITES)
    scored = (*searched, POLICIES)
    identified = (*own, "identify", "--out", str(MODEL), *workers)
    designs = tuple((*own, "design", "--controllers", name, "--recompute") for name in designable())
    exercise = ((*own, "exercise"), (*own, "safety"))
    run = Path("results/reproduction/scores.json")
    return [
        Step("identify", "the station, from tables I2 and I3", (identified,), TABLES, 0.2),
        Step("suites", "versions of suites that draw from it", (("-m", VERSIONS),), (MODEL,), 0.0),
        Step("gains", "gains of the PIDs", ((*own, "tune", *workers),), (MODEL,), 3.0),
        Step(
            "designs",
            "settings of the other controllers",
            tuple((*each, *workers) for each in designs),
            (MODEL, GAINS, SUITES),
            8.0,
        ),
        Step(
            "policies",
            "policies, trained and shipped",
            tuple(_policies()),
            searched,
            2.0,
        ),
        Step(
            "scores",
            "the main job and every suite, with its leaderboard",
            tuple(_scores(own, workers)),
            scored,
            1.5,
        ),
        Step("exercise", "the exercise device", exercise, scored, 0.2),
        Step("measured", "diagnosis of I2 and I3", ((*own, "measured", *workers),), (MODEL,), 4.0),
        Step(
            "tables",
            "tables of README and documentation",
            (("-m", "benchmarks.readme_table"),),
            (*scored, run, Path("docs/figures")),
            0.0,
        ),
    ]


def _policies() -> Iterable[tuple[str, ...]]:
    """Every policy that ships, trained as it was."""
    for path in shipped_policies():
        # A folder a model: what was trained on another one is no policy of this.
        folder = f"results/training/{model_digest()}/{path.stem}"
        yield (*train_words(load_policy_file(path)), "--out", folder, "--ship")


TABLES = (Path("benchmarks/identification"), Path("pma_gym/data/serres2008"))
"""What the station is identified from, and by."""

VERSIONS = "benchmarks.suites.versions"
"""Module that gives suites a new version where their stations are others."""


def _scores(own: Sequence[str], workers: Sequence[str]) -> Iterable[tuple[str, ...]]:
    yield (*own, *workers)
    for name in suite_names():
        if not frozen_suite(name).only_by_name:
            yield (*own, "run", "--suite", name, *workers)
            yield (*own, "report", name)


def command_line(arguments: Sequence[str]) -> list[str]:
    """The words of a command with this Python before them."""
    return [sys.executable, *arguments]
