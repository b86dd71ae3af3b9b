"""Every command explains itself on a screen, completes, prints JSON, and knows near misses."""

import json
import math
import os
import shlex
import subprocess
import sys

import numpy as np
import pytest
import typer.main
from typer.testing import CliRunner

import benchmarks.__main__
import pma_gym
import pma_gym.cli
from pma_gym.cli import main
from pma_gym.cli.terminal import print_json
from pma_gym.tasks import EVERY_TASK

SCREEN = 24
PROGRAMS = {"pma-gym": pma_gym.cli.app, "python -m benchmarks": benchmarks.__main__.app}
GROUPS = {name: typer.main.get_command(app) for name, app in PROGRAMS.items()}
COMMANDS = [(program, name) for program, group in GROUPS.items() for name in group.commands]
# It lists what it does without a command, and two dozen commands.
LONG = {"python -m benchmarks": 41}


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Runs `pma-gym` in an empty folder: exit code, output, errors."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        with pytest.raises(SystemExit) as caught:
            main([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        return caught.value.code or 0, printed.out, printed.err

    return run


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
def test_a_shell_completes_commands_options_models_and_tasks(words, wanted):
    env = os.environ | {
        "_PMA_GYM_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": str(len(words.split(" ")) - 1),
    }
    program = "from pma_gym.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", program], env=env, capture_output=True, text=True)
    assert done.stdout.split() == wanted, done.stderr


def test_info_is_json_for_programs(run):
    document = json.loads(run("info", "--json")[1])
    assert document["versions"]["pma-gym"] == pma_gym.__version__
    assert {each["id"] for each in document["environments"]} == set(pma_gym.ENVIRONMENTS)
    model = json.loads(run("info", "--model", "station", "--json")[1])
    assert len(model["parameters"]) == len(list(pma_gym.load_model("station").paths()))


def test_an_evaluation_is_json_for_programs(run, tmp_path):
    time = np.arange(1923) / 384.0
    asked = pma_gym.Trial(time, {"motor_voltage": 0.9 * time, "regulator_voltage": 0 * time + 5.0})
    from pma_gym.data.files.trial_files import write_trial

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
