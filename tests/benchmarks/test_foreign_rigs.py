"""Controllers made from a foreign rig's logs, in closed loop on it."""

import json

import numpy as np
import pytest

from benchmarks.hidden_effects.rigs.drawing import drawn, turn_of
from benchmarks.hidden_effects.rigs.driven_campaign import DrivenCampaign
from benchmarks.hidden_effects.rigs.rig import Rig
from benchmarks.hidden_effects.rigs.sensing import Noise, Sensor
from benchmarks.rigs import foreign_rigs, tune
from benchmarks.rigs.foreign import foreign_error
from benchmarks.rigs.score import run_episode
from controllers.rigs import FeedforwardPID, RigController, RigPID
from pma_gym.envs import RigEnv
from tests.benchmarks.test_any_rig import RIGS

ARM = Rig("joint", 0.0049, 0.02, 0.0, 0.2, 0.0, travel=1.0, frequency=1.0, rate=1000.0)
"""The numbers of the model of `RIGS["joint"]`."""


class Seeing(RigController):
    """Acts on what it sees, as a policy does: the error and the last angles."""

    def reset(self, info):
        self.seen = []

    def act(self, measurement):
        self.seen.append(measurement.observation)
        angle, _, error = measurement.observation[:3]
        return [0.4 * error - 0.8 * (angle - measurement.observation[-2])]


@pytest.mark.parametrize("simulator", ["own", "MuJoCo"])
@pytest.mark.parametrize("kind", [Seeing, RigPID, FeedforwardPID])
def test_a_foreign_rig_that_hides_nothing_scores_as_its_environment(kind, simulator):
    sensor = Sensor("encoder", 1e-5, Noise(0.0))
    rig = DrivenCampaign(ARM, ARM, sensor, (), {}, 0.0, simulator, (1,))
    options = {**RIGS["joint"][0], "duration_s": 2.0, "control_rate_hz": 50.0, "noise": False}
    env, controller = RigEnv("angle_steps_3", preview=2, history=2, **options), kind(kind.settings)
    info, *_ = run_episode(env, controller, 0)
    seen = getattr(controller, "seen", np.zeros(1))
    assert foreign_error(rig, (), env, controller, 0) == pytest.approx(
        info["percent_of_range"], rel=0.01
    )
    # A command arrives within a row of the simulation, 1 ms.
    assert np.allclose(seen, getattr(controller, "seen", np.zeros(1)), atol=0.01)


@pytest.mark.parametrize(
    ("amended", "outcome"),
    [
        ([1.0, 2.1, 2.9], "same"),
        ([1.03, 2.03, 3.03], "same"),
        ([1.1, 2.1, 3.1], "worse"),
        ([0.5, 1.4, 2.6], "better"),
        ([0.1, 2.5, 2.9], "same"),
    ],
)
def test_a_change_counts_where_it_is_sure_and_large(amended, outcome):
    errors = {"given": [1.0, 2.0, 3.0], "amended": amended}
    predicted = {"given": [2.0], "amended": [1.7]}
    made = foreign_rigs.comparison({"foreign": errors, "predicted": predicted})
    assert made.outcome == outcome and made.differs and made.predicted == pytest.approx(-0.15)


def test_half_of_the_joints_are_of_mujoco_and_all_hide_something():
    turns = [turn_of(number) for number in foreign_rigs.joints(32)]
    assert {(rig, "effect" in kind) for rig, kind, _ in turns} == {("joint", True)}
    assert [simulator for *_, simulator in turns] == ["own", "MuJoCo"] * 16


def test_a_case_is_kept_and_one_that_fails_is_said(tmp_path, monkeypatch, capsys):
    """Without a diagnosis: the amended model has the true inertia and damping."""

    def amended(case, campaign, effects):
        answer = case.folder / "diagnosis"
        for name, text in campaign.texts(effects).items():
            foreign_rigs.write_text(case.folder / "logs" / name, text)
        text = (case.folder / "logs" / "model.toml").read_text()
        for key in ("inertia", "damping"):
            old, new = (f"{getattr(each, key):.7g}" for each in (campaign.believed, campaign.rig))
            text = text.replace(old, new)
        foreign_rigs.write_text(answer / "model.toml", text)
        floors = {"angle_deg": {"value": 0.01, "step": None}}
        found = {"verdict": "parameters", "effects": [], "parameters": {}, "floors": floors}
        foreign_rigs.write_text(answer / "diagnosis.json", json.dumps(found))
        return answer

    made = foreign_rigs.environments
    monkeypatch.setattr(tune, "EVALUATIONS", 4)
    monkeypatch.setattr(foreign_rigs, "joints", lambda cases: [29, 1][:cases])
    monkeypatch.setattr(foreign_rigs.ForeignCase, "diagnosis", amended)
    monkeypatch.setattr(
        foreign_rigs,
        "environments",
        lambda *given: (
            {name: {**each, "duration_s": 1.0} for name, each in made(*given)[0].items()},
            "angle",
        ),
    )
    assert foreign_rigs.run_foreign_rigs(1, 0, 2, 31, 1, tmp_path, 1) == 0
    monkeypatch.setattr(foreign_rigs, "drawn", lambda seed, number: 1 / 0)
    assert foreign_rigs.run_foreign_rigs(2, 0, 2, 31, 1, tmp_path, 1) == 1
    said = capsys.readouterr().out
    assert said.count("joint_directional_damping") >= 2 and "case 1: ZeroDivisionError" in said
    report = (tmp_path / "report.md").read_text()
    assert "| feedforward_pid | not worse | 1 of 1 |" in report
    assert len((tmp_path / "scores.csv").read_text().splitlines()) == 1 + 2 * 2 * 2
    assert drawn(31, 29)[1][0].name == "directional_damping"
