"""Every command explains itself on a screen, completes, prints JSON, and knows near misses."""

import json
import math
import os
import shlex

import numpy as np
import pytest
import typer.main
from typer.testing import CliRunner

import benchmarks.__main__
import pma_gym
import pma_gym.cli
from controllers.policies.policy_file import load_policy_file
from pma_gym.cli.terminal import print_json
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.data.files.trial_files import read_trial, write_trial
from pma_gym.effects.user_effects import load_effects
from pma_gym.envs import RIG_ID
from pma_gym.plant.model import dump_model
from pma_gym.tasks import EVERY_TASK

SCREEN = 24
PROGRAMS = {"pma-gym": pma_gym.cli.app, "python -m benchmarks": benchmarks.__main__.app}
GROUPS = {name: typer.main.get_command(app) for name, app in PROGRAMS.items()}
COMMANDS = [(program, name) for program, group in GROUPS.items() for name in group.commands]
# It lists what it does without a command, and two dozen commands.
LONG = {"python -m benchmarks": 42}


WITH_MODEL = [
    (program, name)
    for program, group in GROUPS.items()
    for name, command in [("", group), *group.commands.items()]
    if any("--model" in param.opts for param in command.params)
]
OWN = """
from typing import Annotated, NamedTuple
from pma_gym.effects import Effect
from pma_gym.units import Quantity

class Toe(NamedTuple):
    force: Annotated[float, Quantity("N", 0, 100, "assumption: 5", 0.0, usual=5.0)]

def toe(contraction, p):
    return p.force * contraction

TOE = Effect("toe", "muscle_force", Toe, toe)
"""


@pytest.fixture
def lab(tmp_path, forget_user_effects):
    """A folder with an effect in toe.py, a station with it in toe.toml, and a data set."""
    (tmp_path / "toe.py").write_text(OWN)
    load_effects(tmp_path / "toe.py")
    model = pma_gym.load_model("station").with_effects({"toe": {"force_n": 5.0}}, name="toe")
    (tmp_path / "toe.toml").write_text(dump_model(model))
    time = np.arange(40) / 20.0
    asked = pma_gym.Trial(time, {"motor_voltage": time, "regulator_voltage": 0 * time + 5.0})
    (tmp_path / "lab").mkdir()
    write_trial(pma_gym.Plant(model).simulate(asked), tmp_path / "lab" / "trial.csv")
    forget_user_effects()
    return tmp_path


FAST = {
    "simulate": ["lab/trial.csv", "--out", "x.csv"],
    "info": [],
    "convert": ["lab"],
    "diagnose": ["lab"],
    "fit": ["lab"],
    "compare": ["lab"],
    "watch": ["--video", "x.gif"],
    "": ["--controllers", "pid", "--out", "job", "--jobs", "1"],
    "voltages": [
        *("--controller", "serres_feedforward", "--task", "displacement"),
        *("--pressure", "300", "--out", "v.csv"),
    ],
    "tune": ["--out", "gains.toml"],
    "run": [],
    "from-logs": ["lab"],
}
"""Arguments of every command with --model."""

SLOW = {
    "pma_gym.discovery.diagnose": lambda trials, model, **rest: _stop(model),
    "pma_gym.discovery.refit": lambda trials, model, **rest: _stop(model),
    "pma_gym.envs.PMAEnv.picture": lambda env: _stop(env.station.model),
    "benchmarks.reproduction.reproduce.run_job": lambda suite, *rest: _stop(suite.nominal_of(0)),
    "benchmarks.tuning.tune.run_tune": lambda out, seed, model, *rest: _stop(
        pma_gym.load_model(model)
    ),
    "benchmarks.rigs.run.run_rig": lambda model, *rest: _stop(pma_gym.load_model(model)),
}
"""What takes long of these commands, replaced by a check of the model that it receives."""


def _stop(model):
    assert "toe" in model.parameters
    raise ValueError("stopped")


@pytest.mark.parametrize(("program", "command"), WITH_MODEL)
def test_a_command_with_a_model_takes_the_effects_of_a_user(program, command, lab, monkeypatch):
    monkeypatch.chdir(lab)
    for name, check in SLOW.items():
        monkeypatch.setattr(name, check)
    asked = [*filter(None, [command]), *FAST[command], "--model", "toe.toml"]

    def said(*others):
        done = CliRunner().invoke(PROGRAMS[program], [*asked, *others])
        return f"{done.output} {done.exception}"

    assert "unknown effect [toe]" in said()
    after = said("--effect", "toe.py")
    assert after.endswith(" None") or "stopped" in after
    assert os.environ["PMA_GYM_EFFECTS"] == str(lab / "toe.py")


def help_of(program, *command):
    env = {"COLUMNS": "80", "TERMINAL_WIDTH": "80"}
    done = CliRunner(env=env).invoke(PROGRAMS[program], [*command, "--help"])
    assert done.exit_code == 0
    return done.output


@pytest.mark.parametrize(("program", "command"), [*COMMANDS, *((name, "") for name in PROGRAMS)])
def test_help_fits_a_screen_and_ends_with_an_example(program, command):
    lines = help_of(program, *filter(None, [command])).splitlines()
    assert len(lines) <= (SCREEN if command else LONG.get(program, SCREEN))
    assert max(map(len, lines)) <= 80
    last = " ".join(" ".join(lines).split()).rpartition("Example: ")
    assert last[1] and last[2].startswith(f"{program} {command}".strip())


@pytest.mark.parametrize(("program", "command"), COMMANDS)
def test_the_example_is_a_command_line_that_the_command_takes(
    program, command, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    group = GROUPS[program]
    words = shlex.split(group.commands[command].epilog.removeprefix("Example: "))
    given = words[len(program.split()) :]
    assert given[0] == command
    context = group.commands[command].make_context(command, given[1:])
    assert not context.args


def test_the_version_is_said_once(run):
    assert run("--version") == (0, f"pma-gym {pma_gym.__version__}\n", "")


@pytest.mark.parametrize(
    ("arguments", "near"),
    [
        (["watch", "--contoller", "x"], "--controller"),
        (["watch", "--presure=3"], "--pressure"),
        (["fit", "logs", "--ot", "x"], "--out"),
        (["--versoin"], "--version"),
        (["info", "--hepl"], "--help"),
    ],
)
def test_an_unknown_option_gets_the_nearest_one(run, arguments, near):
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert err.rstrip().endswith(f"Did you mean {near}?")


def test_an_option_like_no_other_gets_no_guess(run):
    code, _, err = run("info", "--zzz\x1b[31m")
    assert code == 2 and "No such option: --zzz" in err
    assert "Did you mean" not in err and "\x1b" not in err


def test_an_unknown_command_gets_the_nearest_one(run):
    code, _, err = run("simulat")
    assert code == 2 and "Did you mean 'simulate'?" in err


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ("pma-gym wat", ["watch"]),
        ("pma-gym info --model serr", ["serres2008"]),
        ("pma-gym watch --task ", [*EVERY_TASK]),
        ("pma-gym evaluate --task rot", ["rotation"]),
        ("pma-gym watch --contr", ["--controller"]),
    ],
)
def test_a_shell_completes_commands_options_models_and_tasks(run, monkeypatch, words, wanted):
    monkeypatch.setenv("_PMA_GYM_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split(" ")) - 1))
    assert run()[1].split() == wanted


def test_info_is_json_for_programs(run):
    document = json.loads(run("info", "--json")[1])
    assert document["versions"]["pma-gym"] == pma_gym.__version__
    assert {each["id"] for each in document["environments"]} == {*pma_gym.ENVIRONMENTS, RIG_ID}
    model = json.loads(run("info", "--model", "station", "--json")[1])
    assert len(model["parameters"]) == len(list(pma_gym.load_model("station").paths()))


def test_an_evaluation_is_json_for_programs(run, tmp_path):
    time = np.arange(1923) / 384.0
    asked = pma_gym.Trial(time, {"motor_voltage": 0.9 * time, "regulator_voltage": 0 * time + 5.0})
    write_trial(pma_gym.Plant("serres2008").simulate(asked), tmp_path / "trial.csv")
    (row,) = json.loads(run("evaluate", "trial.csv", "--task", "displacement", "--json")[1])
    table = run("evaluate", "trial.csv", "--task", "displacement")[1]
    assert f"{row['rmse_mm']:.6g}" in table and f"{row['slope_mm_per_s']:.6g}" in table


def test_suites_are_json_for_programs():
    done = CliRunner().invoke(PROGRAMS["python -m benchmarks"], ["suites", "--json"])
    robust = {each["name"]: each for each in json.loads(done.output)}["robust"]
    assert robust["stations"] == 64 and "pid" in robust["controllers"]


def test_json_has_null_for_what_is_no_number(capsys):
    print_json({"a": (math.inf, 1.0), "b": [math.nan]})
    assert json.loads(capsys.readouterr().out) == {"a": [None, 1.0], "b": [None]}


@pytest.mark.parametrize("program", PROGRAMS)
def test_an_empty_text_is_refused_for_every_argument_and_option(program):
    group = GROUPS[program]
    refused = 0
    for name, command in [("", group), *group.commands.items()]:
        for param in command.params:
            if getattr(param, "is_flag", False):
                continue
            needed = [p for p in command.params if p.required and p is not param]
            option = param.opts[0].startswith("-")
            words = [*filter(None, [name]), *([param.opts[0]] if option else []), " "]
            # Parameters are processed in order; those before an argument must not be missing.
            for other in needed:
                words += [other.opts[0], "1"] if other.opts[0].startswith("-") else ["1"]
            done = CliRunner().invoke(PROGRAMS[program], words)
            assert done.exit_code == 2, words
            assert "it is empty, like a shell variable that is not set" in done.output, words
            refused += 1
    assert refused > 15


@pytest.mark.parametrize("path", ["", " "])
def test_an_empty_path_is_refused_by_the_library(path):
    calls = [
        read_trial,
        read_dataset,
        load_effects,
        load_policy_file,
        pma_gym.load_model,
        lambda path: write_trial(pma_gym.Trial([0.0], {"motor_voltage": [0.0]}), path),
    ]
    for call in calls:
        with pytest.raises(ValueError, match="the path is empty|no model ' ?'"):
            call(path)
