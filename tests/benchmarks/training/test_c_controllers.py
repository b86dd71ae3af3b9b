"""A controller's C says what the controller says."""

import ctypes
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks.__main__ import app
from controllers.pid import PID
from controllers.policies.adapter import ActionMapping
from controllers.policies.network import Network
from controllers.policies.policy_file import save_policy_file
from pma_gym.envs import PMAEnv
from pma_gym.export.fmu import shared_library
from tests.controllers.policies.test_network import drawn_policy

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler cc")

REAL = ctypes.c_double


def exported(folder, controller, *words):
    """The compiled C that the command writes for a controller."""
    done = CliRunner().invoke(
        app, ["export", str(controller), "--to", "c", "--out", str(folder / "own"), *words]
    )
    assert done.exit_code == 0, done.output
    sources = {path.name: path.read_text() for path in map(Path, done.stdout.split())}
    (folder / "own.so").write_bytes(shared_library(sources, ["own.c"]))
    return ctypes.CDLL(str(folder / "own.so"))


@pytest.mark.parametrize("task", ["displacement", "rotation"])
def test_a_pid_in_c_drives_as_it_does_in_python(task, tmp_path):
    words = (
        "--env",
        f"pma_gym/Isokinetic{task.title()}-v0",
        "--env-kwargs",
        '{"pressure_kpa": 300}',
    )
    library = exported(tmp_path, "pid", *words)
    library.own_act.restype, library.own_act.argtypes = REAL, [ctypes.c_void_p, REAL, REAL]
    state, env, pid = (ctypes.c_double * 8)(), PMAEnv(task), PID()
    env.reset(seed=1, options={"pressure_kpa": 300})
    pid.reset(env.reference, env.station)
    library.own_reset(state)
    for _ in range(300):
        volts = pid.act(env.measurement, env.time)
        ahead = env.reference(env.time + pid.gains.lead)
        assert library.own_act(state, ahead, pid._position(env.measurement)) == pytest.approx(
            volts, abs=1e-9
        )
        env.step(np.array([volts / 5.0 - 1.0]))


@pytest.mark.parametrize("form", [ActionMapping(), ActionMapping("residual", 0.3, "pid")])
@pytest.mark.parametrize(("activation", "output"), [("tanh", "clip"), ("relu", "tanh")])
def test_a_policy_in_c_acts_as_its_network(activation, output, form, tmp_path):
    policy = drawn_policy(
        PMAEnv("displacement").station,
        form=form,
        activation=activation,
        output=output,
        scaled=output == "clip",
    )
    # What a file says stays in a comment.
    policy = replace(policy, title="PPO */ #error")
    library = exported(tmp_path, save_policy_file(policy, tmp_path / "mine"))
    library.own_act.restype, library.own_act.argtypes = REAL, [ctypes.c_void_p]
    library.own_volts.restype, library.own_volts.argtypes = REAL, [REAL] * 3
    seen = np.random.default_rng(1).uniform(-1.0, 1.0, (20, policy.weights.sizes[0]))
    acted = [library.own_act(row.ctypes.data) for row in seen]
    assert acted == pytest.approx(Network(policy.weights).many(seen)[:, 0].tolist(), abs=1e-6)
    asked = np.clip([form.unclipped_voltage(action, 9.9, 0.1) for action in acted], 0.0, 10.0)
    assert [library.own_volts(action, 9.9, 0.1) for action in acted] == pytest.approx(asked)
