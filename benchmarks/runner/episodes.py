"""`python -m benchmarks record`: episodes of a suite's controllers as data sets.

A controller's volts drive its episode twice: once as the benchmark scores it, once through `step`,
where observations, rewards and infos are recorded. The two positions must have the same bits.
"""

import json
import os
import warnings
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from benchmarks.executors.executor import Executor, run_all
from benchmarks.files import write_bytes
from benchmarks.runner.case import Case, blank_row, drive, environment_of
from pma_gym import __version__
from pma_gym.data.files.trial_formats import encode_parquet, needed
from pma_gym.data.readers.table import PROVENANCE
from pma_gym.envs import PMAEnv


@dataclass(frozen=True)
class Recording:
    """What went between an environment and whoever drives it, in an episode.

    Attributes:
        origin: the case: suite, version, controller, station, task, pressure, seed.
        observations: float32, shape (steps + 1, entries).
        actions: float64, which loses no bit of a voltage, shape (steps, commands).
        rewards: shape (steps,).
        terminated: whether a physical limit ended it; else its time was over.
        infos: numbers by key, shape (steps + 1,) each.
    """

    origin: Mapping[str, str]
    observations: NDArray[np.float32]
    actions: NDArray[np.float64]
    rewards: NDArray[np.float64]
    terminated: bool
    infos: Mapping[str, NDArray[Any]]


def record_actions(
    environment: PMAEnv, origin: Mapping[str, str], actions: NDArray[Any]
) -> Recording:
    """The episode that actions lead to from the seed of `origin`; the same bits each time."""
    observation, info = environment.reset(seed=int(origin["seed"]))
    observations, infos, rewards, terminated = [observation], [info], [], False
    for action in actions:
        observation, reward, terminated, _, info = environment.step(action)
        observations.append(observation)
        infos.append(info)
        rewards.append(reward)
    columns = {key: np.array([info[key] for info in infos]) for key in infos[0]}
    return Recording(
        origin, np.array(observations), actions, np.array(rewards), bool(terminated), columns
    )


def record_case(case: Case) -> Recording:
    """Drive a case and record its episode.

    Raises:
        Exception: whatever the controller or the environment raised.
    """
    done, environment = drive(case)
    actions = np.array([environment.action(volts) for volts in done.asked])
    origin = {name: str(value) for name, value in blank_row(case).items()}
    record = record_actions(environment, origin, actions)
    again = environment.trajectory()[: done.position.size]
    if again.tobytes() != done.position.tobytes():
        raise RuntimeError(f"{case.name}: its actions do not lead to the scored positions again")
    return record


def record_cases(
    cases: Sequence[Case], to: str, out: Path, executor: Executor
) -> dict[str, BaseException]:
    """Recording cases and write their data sets.

    Args:
        cases: who drives what.
        to: `parquet`, a file a case, or `minari`, a data set a task.
        out: folder of the files; made if need be.
        executor: where the cases run.
    Returns:
        Why a case failed, by its name.
    Raises:
        UnreadableError: a library is not installed.
        KeyboardInterrupt: Ctrl-C; files that are written stay.
    """
    needed("pyarrow" if to == "parquet" else "minari", f"--to {to}")
    failed = dict[str, BaseException]()
    tasks = defaultdict[str, dict[int, Recording]](dict)

    def keep(index: int, result: Any) -> None:  # noqa: ANN401
        case = cases[index]
        if isinstance(result, BaseException):
            failed[case.name] = result
        elif to == "parquet":
            file = out / f"{case.name.replace('/', '-')}.parquet"
            write_bytes(file, encode_record(result))
        else:
            tasks[case.episode.task][index] = result

    if not run_all([partial(record_case, case) for case in cases], executor, keep):
        raise KeyboardInterrupt
    for records in tasks.values():
        ordered = [records[index] for index in sorted(records)]
        write_minari(ordered, environment_of(cases[0].suite, cases[min(records)].episode), out)
    return failed


def encode_record(record: Recording) -> bytes:
    """A Parquet file: a row a control step, and a last one without action and reward."""
    columns = {f"observation_{i}": values for i, values in enumerate(record.observations.T)}
    columns |= {f"action_{i}": _longer(values) for i, values in enumerate(record.actions.T)}
    columns["reward"] = _longer(record.rewards)
    columns |= {f"info_{key}": values for key, values in record.infos.items()}
    return encode_parquet(columns, {**record.origin, "terminated": str(record.terminated)})


def read_record(path: Path) -> Recording:
    """Read an episode that `encode_record` wrote, with the same bits.

    Raises:
        KeyError: the file holds no episode.
    """
    table = needed("pyarrow.parquet", path.name).read_table(path)
    origin = json.loads(table.schema.metadata[f"pma_gym.{PROVENANCE}".encode()])
    ended = origin.pop("terminated")
    columns = {name: table[name].to_numpy() for name in table.column_names}

    def named(prefix: str) -> dict[str, NDArray[Any]]:
        return {k.removeprefix(prefix): v for k, v in columns.items() if k.startswith(prefix)}

    return Recording(
        origin,
        np.stack(list(named("observation_").values()), axis=1),
        np.stack(list(named("action_").values()), axis=1)[:-1],
        columns["reward"][:-1],
        ended == "True",
        named("info_"),
    )


def write_minari(records: Sequence[Recording], environment: PMAEnv, out: Path) -> None:
    """Write the episodes of a task as a Minari data set, `pma-gym/SUITE-TASK-vVERSION`.

    Args:
        records: its episodes.
        environment: whose observations they have.
        out: Minari's root folder of data sets.
    """
    minari, buffers = needed("minari", "--to minari"), needed("minari.data_collector", "minari")
    out.mkdir(parents=True, exist_ok=True)
    os.environ["MINARI_DATASETS_PATH"] = str(out.resolve())
    origin, space = records[0].origin, environment.action_space
    assert isinstance(space, Box)
    with warnings.catch_warnings():
        # It asks for authors and addresses, which the project's citation has.
        warnings.simplefilter("ignore", UserWarning)
        data = minari.create_dataset_from_buffers(
            f"pma-gym/{origin['suite']}-{origin['task']}-v{origin['version']}",
            [
                buffers.EpisodeBuffer(seed=int(r.origin["seed"]), **_minari_parts(r))
                for r in records
            ],
            observation_space=environment.observation_space,
            action_space=Box(space.low.astype(float), space.high.astype(float), dtype=np.float64),
            algorithm_name=", ".join(dict.fromkeys(r.origin["controller"] for r in records)),
            data_format="parquet",
            requirements=[f"pma-gym=={__version__}"],
        )
    data.storage.update_episode_metadata([dict(record.origin) for record in records])


def _minari_parts(record: Recording) -> dict[str, Any]:
    last = np.arange(1, len(record.rewards) + 1) == len(record.rewards)
    return {
        "observations": record.observations,
        "actions": record.actions,
        "rewards": record.rewards,
        "terminations": last & record.terminated,
        "truncations": last & (not record.terminated),
        "infos": {key: values.tolist() for key, values in record.infos.items()},
    }


def _longer(values: NDArray[Any]) -> NDArray[np.float64]:
    return np.append(values, np.nan)
