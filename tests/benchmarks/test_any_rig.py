"""Controllers of any rig: by their model, tuned, trained, and from logs."""

import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.hidden_effects.rigs.drawing import turn_of
from benchmarks.hidden_effects.rigs.driven_campaign import DrivenCampaign
from benchmarks.hidden_effects.rigs.rig import Rig
from benchmarks.hidden_effects.rigs.sensing import Noise, Sensor
from benchmarks.rigs import foreign_rigs, from_logs, run, tune
from benchmarks.rigs.foreign import foreign_error
from benchmarks.rigs.score import run_episode, scores
from controllers.rigs import (
    RIG_CONTROLLERS,
    Feedforward,
    FeedforwardPID,
    RigController,
    RigLQG,
    RigMPC,
    RigPID,
)
from controllers.rigs.rig_controller import Lever
from pma_gym import Plant, Trial
from pma_gym.data.files.trial_files import write_trial
from pma_gym.envs import RigEnv
from pma_gym.plant.model import dump_model, load_model, parse_model
from tests.envs.test_rig import SLIDE

HEAD = {"schema": 1, "name": "arm", "title": "a rig of a test"}
JOINT = parse_model(
    HEAD
    | {
        "plant": "joint",
        "torque_drive": {"gain": 1.0},
        "joint_weight": {"moment_n_m": 0.2, "offset_deg": 0.0},
        "joint_damping": {"coefficient_n_m_s": 0.02},
        "inertia": {"inertia_kg_m2": 0.0049},
        "joint_start": {"angle_deg": 0.0, "spin_deg_per_s": 0.0},
        "encoder": {"bandwidth_hz": 500, "noise_deg": 0.02},
    }
)
RIGS = {
    "joint": ({"model": JOINT, "limits": {"torque_command": [-0.5, 0.5]}, "span": 1.0}, "angle"),
    "slide": ({"model": SLIDE, "span": 0.05}, "contraction"),
    "station": ({"model": "station", "rest": {"pressure_command": 300e3}}, "contraction"),
}


@pytest.fixture(params=RIGS)
def rig(request):
    """Options of an environment of a rig, and a signal of it."""
    options, signal = RIGS[request.param]
    return options | {"duration_s": 3.0, "control_rate_hz": 50.0}, signal


@pytest.mark.parametrize("late", [{}, {"action_delay_s": 0.06}])
def test_the_nominal_rig_follows_its_feedforward(rig, late):
    options, signal = rig
    env = RigEnv(f"{signal}_multisine", noise=False, **options, **late)
    info, *_ = run_episode(env, Feedforward({}), 0)
    # A station's cable hangs slack where episodes begin: that way is lost to every controller.
    assert info["percent_of_range"] < (
        0.5 if signal == "angle" or options["model"] is SLIDE else 20.0
    )


@pytest.mark.parametrize("late", [{}, {"action_delay_s": 0.02, "observation_delay_s": 0.02}])
def test_an_unknown_load_is_left_to_the_feedback(late):
    """The disturbance's estimate takes a constant load off; the plan alone runs away from it."""
    options, _ = RIGS["slide"]
    env = RigEnv(
        "contraction_steps", load=2.0, duration_s=6.0, control_rate_hz=50.0, **options, **late
    )
    errors = {}
    for controller in (Feedforward({}), RigLQG(RigLQG.settings), RigMPC(RigMPC.settings)):
        info, *_ = run_episode(env, controller, 0)
        errors[controller.name] = info["percent_of_range"]
    assert max(errors["lqg"], errors["mpc"]) < 0.01 * errors["feedforward"]


def weak(name, command, most):
    """Options of a rig whose commands reach their limits."""
    return RIGS[name][0] | {"limits": {command: [-most, most]}}


@pytest.mark.parametrize(
    ("options", "task", "most"),
    [
        (RIGS["joint"][0], "angle_multisine", 1.01),
        (RIGS["slide"][0], "contraction_multisine", 1.01),
        # Commands reach their limits from here on.
        (weak("joint", "torque_command", 0.15), "angle_steps", 0.9),
        (weak("slide", "load_command", 1.0), "contraction_steps", 0.95),
        (RIGS["station"][0], "contraction_steps", 0.9),
        ({"model": "muscle_joint"}, "angle_steps", 0.99),
        ({"model": "muscle_pair", "span": 1.5}, "angle_steps", 0.9),
        ({"model": "valve_pair"}, "angle_steps", 0.9),
    ],
)
def test_looking_ahead_pays_where_commands_reach_their_limits(options, task, most):
    env = RigEnv(task, **options, duration_s=6.0, control_rate_hz=50.0)
    errors = [
        run_episode(env, kind(kind.settings), 0)[0]["percent_of_range"] for kind in (RigLQG, RigMPC)
    ]
    assert errors[1] < most * errors[0]


def test_a_search_finds_better_settings_and_repeats_itself(monkeypatch):
    monkeypatch.setattr(tune, "EVALUATIONS", 25)
    options = RIGS["joint"][0] | {"duration_s": 2.0, "control_rate_hz": 50.0}
    best = tune.tuned("pid", options, ["angle_steps"])
    assert best == tune.tuned("pid", options, ["angle_steps"]) and set(best) == set(RigPID.settings)
    env = RigEnv("angle_steps", **options)
    errors = [
        run_episode(env, RigPID(s), 5)[0]["percent_of_range"] for s in (RigPID.settings, best)
    ]
    assert errors[1] < errors[0]


def test_what_is_drawn_is_what_a_fit_could_change():
    assert list(run.varied(JOINT)) == [
        "joint_weight.moment_n_m", "joint_damping.coefficient_n_m_s", "inertia.inertia_kg_m2",
    ]  # fmt: skip
    options = run.rig_options("station", "span = 0.02\nlimits = {load_command = [0, 400]}")
    env = RigEnv(**options)
    assert env.task.schedule.span == 0.02 and env.options.commands[0].limits == pytest.approx(
        (0, 400)
    )


@pytest.fixture
def lab(tmp_path):
    """Logs of a pendulum with more weight than its model has, and their diagnosis."""
    logs, answer = tmp_path / "lab", tmp_path / "diagnosis"
    logs.mkdir()
    answer.mkdir()
    better = JOINT.replace({"joint_weight.moment_n_m": 0.3})
    time = np.arange(200) / 100.0
    asked = Trial(time, {"torque_command": 0.4 * np.sin(4.0 * time)})
    write_trial(Plant(better).simulate(asked), logs / "swing.csv")
    (logs / "model.toml").write_text(dump_model(JOINT), encoding="utf-8")
    (logs / "dataset.toml").write_text('title = "A swing"\nmodel = "model.toml"\n')
    (answer / "model.toml").write_text(dump_model(better), encoding="utf-8")
    document = {
        "sentence": "The weight is 0.3 N m.",
        "covariance": {
            "parameters": ["joint_weight.moment_n_m", "inertia.inertia_kg_m2"],
            "deviations": [0.01, 1e-4],
            "correlation": [[1.0, 0.9], [0.9, 1.0]],
        },
        "verdict": "effect",
        "rivals": [],
        "floors": {"angle_deg": {"value": 0.02, "step": None}},
    }
    (answer / "diagnosis.json").write_text(json.dumps(document), encoding="utf-8")
    return logs, answer, tmp_path / "out"


class Silent:
    """Progress that nobody sees."""

    def add_task(self, *words, **sizes):
        return 0

    def update(self, *bars, **sizes):
        pass


def test_logs_become_controllers_and_scores_and_a_second_run_goes_on(lab, monkeypatch, capsys):
    logs, answer, out = lab
    monkeypatch.setattr(tune, "EVALUATIONS", 6)
    monkeypatch.setattr(from_logs, "SEEDS", range(1))
    monkeypatch.setattr(from_logs, "CONTROLLERS", ("feedforward", "pid"))
    arguments = logs, None, answer, out, Silent()
    rows = from_logs.run_from_logs(*arguments, steps=5120)
    names = {row.controller for row in rows}
    assert names == {
        f"{name} ({model})" for name in (*from_logs.CONTROLLERS, "policy")
        for model in ("amended", "given")
    }  # fmt: skip
    assert {row.rig for row in rows} == {"amended", "given"}
    assert len((out / "scores.csv").read_text().splitlines()) == len(rows) + 1
    assert "The weight is 0.3 N m." in (out / "report.html").read_text()
    error = {(r.rig, r.controller): r.percent for r in rows if r.task == "angle_multisine"}
    assert error["amended", "feedforward (amended)"] < error["amended", "feedforward (given)"]
    assert error["given", "feedforward (given)"] < error["given", "feedforward (amended)"]
    kept = {path: path.stat().st_mtime_ns for path in out.glob("p*")}
    again = from_logs.run_from_logs(*arguments, steps=5120)
    assert [row[:7] for row in again] == [row[:7] for row in rows]
    assert {path: path.stat().st_mtime_ns for path in out.glob("p*")} == kept


def test_rigs_are_drawn_as_the_fit_correlates_their_parameters(lab):
    model, uncertainty = from_logs.amended(lab[1])
    generator = np.random.default_rng(0)
    drawn = [uncertainty(model, generator).parameters for _ in range(500)]
    rows = np.array([(each["joint_weight"].moment, each["inertia"].inertia) for each in drawn])
    assert rows.std(axis=0) == pytest.approx([0.01, 1e-4], rel=0.1)
    assert np.corrcoef(rows.T)[0, 1] == pytest.approx(0.9, abs=0.03)


def test_an_episode_has_the_amended_model_or_a_rival(lab):
    """The rival has a spring in the place of the weight, and a damping of its own."""
    file = lab[1] / "diagnosis.json"
    rival = {
        "name": "joint_spring",
        "absent": {"joint_spring": {"stiffness_n_m_per_rad": 0.0, "rest_deg": 0.0}},
        "values": {"joint_spring.stiffness_n_m_per_rad": 0.4, "joint_weight.moment_n_m": 0.2},
        "covariance": {
            "parameters": ["joint_spring.stiffness_n_m_per_rad"],
            "deviations": [0.01],
            "correlation": [[1.0]],
        },
    }
    file.write_text(json.dumps(json.loads(file.read_text()) | {"rivals": [rival]}))
    model, draw = from_logs.amended(lab[1])
    assert model.parameters["joint_spring"].stiffness == 0.0
    limits = {"torque_command": [-1.0, 1.0]}
    env, seen = RigEnv("angle_steps", model=model, randomisation=draw, limits=limits), []
    for seed in range(20):
        env.reset(seed=seed)
        drawn = env.plant.parameters
        seen.append((drawn["joint_spring"].stiffness, drawn["joint_weight"].moment))
    assert 5 <= sum(spring > 0.0 for spring, _ in seen) <= 15
    for spring, weight in seen:
        assert abs(spring - 0.4) < 0.05 and weight == 0.2 if spring else abs(weight - 0.3) < 0.05


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (None, "covariance is missing"),
        ({"correlation": [[1.0]]}, "correlation must have 2 rows of 2"),
    ],
)
def test_a_diagnosis_without_its_covariance_is_refused(lab, change, fault):
    file = lab[1] / "diagnosis.json"
    document = json.loads(file.read_text())
    kept = document.pop("covariance")
    document |= {"covariance": kept | change} if change else {}
    file.write_text(json.dumps(document))
    with pytest.raises(ValueError, match=f"diagnosis.json: {fault}.*diagnose the logs again"):
        from_logs.amended(lab[1])


def test_a_controller_says_which_rigs_it_is_for(monkeypatch, tmp_path):
    monkeypatch.setattr(RigPID, "missing", classmethod(lambda cls, info: "no brake"))
    options = RIGS["joint"][0]
    with pytest.raises(ValueError, match="pid does not apply to model arm: no brake"):
        run.chosen_controllers(["pid"], options, ["angle_steps"], tmp_path, Silent())
    monkeypatch.setattr(Lever, "_effect", lambda self, rig, at: 1e-7)
    with pytest.raises(ValueError, match="mpc does not apply.*no command moves angle from rest"):
        run.chosen_controllers(["mpc"], options, ["angle_steps"], tmp_path, Silent())
    with pytest.raises(ValueError, match="a controller of any rig is feedforward, pid"):
        run.chosen_controllers(["pda"], options, ["angle_steps"], tmp_path, Silent())


def test_what_does_not_apply_is_left_out_unless_asked_for(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(tune, "EVALUATIONS", 4)
    monkeypatch.setitem(sys.modules, "osqp", None)
    options = RIGS["joint"][0] | {"duration_s": 0.5, "control_rate_hz": 50.0}
    made = run.chosen_controllers([], options, ["angle_steps"], tmp_path, Silent())
    assert set(RIG_CONTROLLERS) - set(made) == {"mpc"}
    assert "Without mpc: " in (said := capsys.readouterr().out) and "pip install" in said


def test_settings_are_kept_for_the_environment_that_they_were_found_on(monkeypatch, tmp_path):
    monkeypatch.setattr(tune, "EVALUATIONS", 4)
    options = RIGS["joint"][0] | {"duration_s": 1.0, "control_rate_hz": 50.0}
    searches = []

    class Watched(Silent):
        def add_task(self, *words, **sizes):
            searches.append(words)
            return 0

    for span in (1.0, 1.0, 0.5):
        table = options | {"span": span}
        run.chosen_controllers(["pid"], table, ["angle_steps"], tmp_path, Watched())
    assert len(searches) == 2


def test_controllers_are_compared_under_the_same_noise():
    options = RIGS["joint"][0] | {"duration_s": 1.0}
    made = {"a": (Feedforward({}), {}), "b": (RIG_CONTROLLERS["feedforward"]({}), {})}
    rows = scores("arm", options, made, ["angle_ramps"], range(2))
    assert [row.percent for row in rows[:2]] == [row.percent for row in rows[2:]]


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


def test_a_case_is_kept_and_one_that_fails_is_said(tmp_path, monkeypatch, capsys):
    """Without a diagnosis: the answer is that the lab's model is right."""
    floors = {"angle_deg": {"value": 0.01, "step": None}}
    answer = {"verdict": "agrees", "effects": [], "parameters": {}, "floors": floors}
    answer |= {
        "covariance": {n: [] for n in ("parameters", "deviations", "correlation")},
        "rivals": [],
    }
    numbers, made = foreign_rigs.joints(32), from_logs.logged_options
    turns = [turn_of(number) for number in numbers]
    assert {(rig, "effect" in kind) for rig, kind, _ in turns} == {("joint", True)}
    assert [simulator for *_, simulator in turns] == ["own", "MuJoCo"] * 16
    for owner, name, quick in (
        (tune, "EVALUATIONS", 4),
        (from_logs, "logged_options", lambda *given: made(*given) | {"duration_s": 1.0}),
        (foreign_rigs, "joints", lambda cases: [29, 1][:cases]),
        (
            foreign_rigs,
            "diagnose",
            lambda logs: SimpleNamespace(
                model=load_model(logs.model), text=lambda: json.dumps(answer)
            ),
        ),
    ):
        monkeypatch.setattr(owner, name, quick)
    assert foreign_rigs.run_foreign_rigs(1, 0, 2, 31, 1, tmp_path, 1) == 0
    monkeypatch.setattr(foreign_rigs, "drawn", lambda seed, number: 1 / 0)
    assert foreign_rigs.run_foreign_rigs(2, 0, 2, 31, 1, tmp_path, 1) == 1
    assert "case 1: ZeroDivisionError" in capsys.readouterr().out
    report = (tmp_path / "report.md").read_text()
    assert "| feedforward_pid | given | not worse | 1 of 1 | 21 to 100 % |" in report
    assert "| 29 | MuJoCo | joint_directional_damping | agrees |" in report
    # On the same model, under the same noise, both are the same to the last bit.
    assert "| +0 ± 0 | +0 % | same |" in report
    assert len((tmp_path / "scores.csv").read_text().splitlines()) == 1 + 3 * 2 * 2
