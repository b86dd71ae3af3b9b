"""One case: a controller drives one episode of a suite, and a row has its figures."""

import time
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from benchmarks.runner.controller_spec import ControllerSpec
from benchmarks.runner.figures import Episode as Measured
from benchmarks.runner.figures import figures
from benchmarks.runner.isolated_controller import Isolated, driver
from benchmarks.runner.phase_score import score_trial
from benchmarks.runner.rollout import Rollout, rollout
from benchmarks.suites.suite import Entry, Episode, FrozenSuite
from pma_gym.data.files.trial_formats import ENCODERS
from pma_gym.engine.nominal_rig import nominal_model
from pma_gym.envs import PMAEnv
from pma_gym.plant.model import Model

Row = dict[str, Any]
"""What the journal says of a case: who, what, why it failed, its figures."""


EXERCISE_FIGURES = {
    "pace_rmse_deg": "Angle, RMSE (deg)",
    "peak_moment_nm": "Peak moment (N m)",
    "peak_speed_deg_s": "Peak speed (deg/s)",
    "peak_power_w": "Peak power (W)",
    "work_j": "Work (J)",
    "returned_j": "Returned (J)",
}
"""What a row of an exercise has beside its errors, `exercise_summaries` of the environments, and
what tables call it."""

BY_LIMIT = "by a physical limit"
"""What a row's failure says where the rig's limits ended the episode."""


@dataclass(frozen=True)
class Case:
    """A controller and an episode of a suite.

    Attributes:
        suite: the suite.
        spec: who drives.
        episode: what it drives.
    """

    suite: FrozenSuite
    spec: ControllerSpec
    episode: Episode

    @property
    def name(self) -> str:
        """Unique name in the suite: `pid/17/rotation/300/0`."""
        return self.suite.case_name(self.episode, self.spec.name)


def cases(suite: FrozenSuite, entries: tuple[Entry, ...]) -> list[Case]:
    """List the cases of a suite's controllers, episode by episode.

    All controllers meet an episode before the next one begins, so that what is done when a run is
    interrupted compares them all. Tasks that a controller cannot do by its rule are left out.
    """
    return [
        Case(suite, entry.spec, episode)
        for episode in suite.episodes
        for entry in entries
        if suite.runs(entry, episode)
    ]


def run_case(case: Case, model: Model | None = None, traces: str = "") -> Row:
    """Run a case; a user's controller runs in a separate process.

    Args:
        case: the case.
        model: the station's own; drawn anew if not given.
        traces: form of its time series, `csv` or `parquet`; none if empty.
    Returns:
        Its row, without figures if a physical limit ended it early; `trace` has the contents of
        the file of its time series.
    Raises:
        Exception: whatever the controller or the environment raised.
    """
    began = time.perf_counter()
    done, environment = drive(case, model)
    share, farthest = done.clipped
    clipped: Row = {"clipped_share": share, "clipped_v": farthest}
    if traces:
        origin = {name: str(value) for name, value in blank_row(case).items()}
        clipped["trace"] = ENCODERS[f".{traces}"](done.trace, origin)
    if done.ended_by:
        end = f"ended after {done.steps * done.period:.4g} s {BY_LIMIT}: {done.ended_by}"
        return blank_row(case) | {"failure": end} | clipped
    row = blank_row(case) | _figures(done, environment) | clipped
    if not case.suite.has_lines:
        return row
    lines = score_trial(done.trial, case.episode.task)
    row["lines"] = {phase: asdict(score) for phase, score in lines.items()}
    times = {"steps": done.steps, "step_seconds": done.step_seconds}
    return row | {"times": times | {"seconds": time.perf_counter() - began}}


def drive(case: Case, model: Model | None = None) -> tuple[Rollout, PMAEnv]:
    """Run the episode of a case; return the rollout and its environment.

    Args:
        case: the case.
        model: the station's own; drawn anew if not given.
    Raises:
        Exception: whatever the controller or the environment raised.
    """
    suite, spec, episode = case.suite, case.spec, case.episode
    environment = environment_of(suite, episode, model)
    controller = driver(spec, environment.options.period, suite.keep_pace)
    nominal = nominal_model(environment.task, suite.nominal_of(episode.station))
    seed = suite.seed_of(episode, spec.name)
    done = rollout(environment, controller, seed, nominal, reveal=spec.is_bound)
    if isinstance(controller, Isolated):
        done = replace(done, act_seconds=np.array(controller.act_seconds))
    return done, environment


def environment_of(suite: FrozenSuite, episode: Episode, model: Model | None = None) -> PMAEnv:
    """The environment of a suite's episode; its station is drawn anew if no model is given."""
    return PMAEnv(
        task=episode.task,
        model=model or suite.station(episode.station).model,
        pressure_kpa=episode.pressure_kpa,
        **suite.environment,
    )


def _figures(done: Rollout, environment: PMAEnv) -> Row:
    actuator = 1 if done.task.actuator == "regulator" else 0
    measured = Measured(done.position, done.commands[:, actuator], done.truth, done.act_seconds)
    row = figures(
        done.task, measured, done.period, environment.plant.model.parameters["limits"]
    ).to_json()
    if done.task.exercise is None:
        return row
    summary = environment.episode_summary()
    return row | {"exercise": {name: summary[name] for name in EXERCISE_FIGURES}}


def blank_row(case: Case) -> Row:
    """A case's row without figures."""
    suite, episode = case.suite, case.episode
    return {
        "suite": suite.name,
        "version": suite.version,
        "controller": case.spec.name,
        **episode._asdict(),
        "seed": suite.seed_of(episode, case.spec.name),
        "failure": "",
    }


def failed_row(case: Case, error: BaseException) -> Row:
    """The row of a case that raised."""
    return blank_row(case) | {"failure": f"{type(error).__name__}: {error}"}
