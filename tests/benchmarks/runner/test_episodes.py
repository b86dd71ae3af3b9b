"""A recorded episode is read back and replayed bit for bit, as Parquet and by Minari."""

import os
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.executors.executor import ThisProcess
from benchmarks.runner.case import cases, environment_of
from benchmarks.runner.controller_spec import ControllerSpec
from benchmarks.runner.episodes import read_record, record_actions, record_cases
from benchmarks.suites.frozen import frozen_suite
from benchmarks.suites.suite import Entry, Episode

PID = (Entry(ControllerSpec("pid", "PID")),)


def two_cases(suite="robust"):
    """A drawn station's first cases of one task."""
    part = frozen_suite(suite).part(2)
    return cases(part, PID)[:2]


def same_bits(first, second):
    return first.dtype == second.dtype and first.tobytes() == second.tobytes()


def test_a_file_holds_its_episode_and_replays_it(tmp_path):
    pytest.importorskip("pyarrow")
    chosen = two_cases()
    assert record_cases(chosen, "parquet", tmp_path, ThisProcess()) == {}
    files = [tmp_path / f"{case.name.replace('/', '-')}.parquet" for case in chosen]
    assert sorted(tmp_path.iterdir()) == sorted(files)
    for case, file in zip(chosen, files, strict=True):
        read = read_record(file)
        # From the file alone: the suite's name, the episode and the seed.
        episode = Episode(*(read.origin[name] for name in Episode._fields))
        episode = episode._replace(
            station=int(episode.station), pressure_kpa=float(episode.pressure_kpa)
        )
        environment = environment_of(frozen_suite(read.origin["suite"]), episode)
        again = record_actions(environment, read.origin, read.actions)
        for name in ("observations", "actions", "rewards"):
            assert same_bits(getattr(read, name), getattr(again, name)), name
        assert read.infos.keys() == again.infos.keys()
        assert all(same_bits(read.infos[key], again.infos[key]) for key in read.infos)
        assert (read.terminated, len(read.rewards)) == (False, environment.horizon)
        assert read.origin["controller"] == case.spec.name
        # Another action makes another episode.
        changed = read.actions.copy()
        changed[5] += 1e-3
        other = record_actions(environment, read.origin, changed)
        assert not same_bits(read.observations, other.observations)


def test_minari_loads_its_data_set_with_the_same_bits(tmp_path, monkeypatch):
    minari = pytest.importorskip("minari")
    monkeypatch.setattr(os, "environ", dict(os.environ))
    chosen = two_cases()
    assert record_cases(chosen, "minari", tmp_path, ThisProcess()) == {}
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    tasks = {case.episode.task for case in chosen}
    for task in tasks:
        data = minari.load_dataset(f"pma-gym/robust-{task}-v{chosen[0].suite.version}")
        its = [case for case in chosen if case.episode.task == task]
        metadata = list(data.storage.get_episode_metadata(range(len(its))))
        assert [each["controller"] for each in metadata] == ["pid"] * len(its)
        for case, episode, origin in zip(its, data.iterate_episodes(), metadata, strict=True):
            again = record_actions(
                environment_of(case.suite, case.episode), origin, episode.actions
            )
            assert same_bits(episode.observations, again.observations)
            assert np.array_equal(episode.rewards, again.rewards)
            assert episode.truncations[-1] and not episode.truncations[:-1].any()
            for key, values in again.infos.items():
                assert np.array_equal(episode.infos[key], values, equal_nan=True), key


def test_a_missing_library_and_a_failed_case_are_one_message_each(tmp_path, monkeypatch):
    pytest.importorskip("pyarrow")
    mine = tmp_path / "mine.py"
    mine.write_text(
        "class Mine:\n    def reset(self, reference, station): ...\n"
        "    def act(self, measurement, time): return None\n"
    )
    command = ["record", "nominal", "--stations", "1", "--task", "displacement", "--jobs", "1"]
    done = CliRunner().invoke(
        app, [*command, "--to", "parquet", "--controllers", f"{mine}:Mine", "--out", str(tmp_path)]
    )
    assert done.exit_code == 1 and "act must return volts as a number" in done.stdout
    assert not list(tmp_path.glob("*.parquet"))
    monkeypatch.setitem(sys.modules, "minari", None)
    done = CliRunner().invoke(app, [*command, "--to", "minari", "--out", str(tmp_path)])
    assert done.exit_code == 2 and 'pip install "pma-gym[files]"' in done.output
