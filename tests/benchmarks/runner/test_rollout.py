"""A rollout is the plant under held commands, whoever commands; cases do not disturb each other."""

import numpy as np
import pytest

from benchmarks.executors.choice import local
from benchmarks.executors.executor import ThisProcess, run_all
from benchmarks.reproduction.results import scores_csv, scores_of
from benchmarks.runner.controller_spec import ControllerError, ControllerSpec
from benchmarks.runner.execution import execute, pending_cases
from benchmarks.runner.rollout import make_environment, rollout
from benchmarks.suites.frozen import load_suite
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant

MODEL = "serres2008"


class Returns:
    """A controller that always answers the same."""

    name = "returns"

    def __init__(self, answer):
        self.answer = answer

    def reset(self, reference, station):
        pass

    def act(self, observation, time):
        return self.answer


def controller_file(folder, body):
    path = folder / "written.py"
    path.write_text(
        "import time\nclass Written:\n    name = 'written'\n"
        "    def reset(self, reference, station):\n"
        "        self.pressure = round(station.pressure / 1e3)\n"
        f"    def act(self, observation, now):\n        {body}\n"
    )
    return ControllerSpec("Written", path=str(path))


def small_suite(spec, pressures=(300, 350)):
    return load_suite().select([MODEL], [spec], ["displacement"], pressures)


def scores(suite, out, executor=None):
    rows = []
    todo = pending_cases(suite, suite.entries, out)
    assert execute(todo, executor or ThisProcess(), out, rows.append)
    return scores_of(suite, rows)


def test_the_truth_is_the_plant_under_the_same_voltage():
    environment = make_environment("displacement", MODEL, 300, noise=False)
    trial = rollout(environment, Returns(2.0), seed=0).trial
    plant = Plant(MODEL)
    rest = plant.settle(0.0, pressure=300e3)
    volts = np.full(len(trial), 2.0)
    regulator = np.full(len(trial), plant.regulator_voltage(300e3))
    states, zero = plant.run(trial.time, volts, regulator, condition=rest)
    expected = plant.observe(states, zero)["extension"]
    assert np.abs(trial.truth["extension"] - expected).max() < 1e-8


@pytest.mark.parametrize(("task", "samples"), [("displacement", 1923), ("rotation", 5763)])
def test_the_grid_is_the_dissertations(task, samples):
    trial = rollout(make_environment(task, MODEL, 300), Returns(3.0), seed=0).trial
    assert len(trial) == samples
    assert trial.time[384] == 1.0


def test_readings_and_commands_are_held_between_control_steps():
    class Ramp(Returns):
        def act(self, observation, time):
            return time

    environment = make_environment("displacement", MODEL, 300, noise=True)
    trial = rollout(environment, Ramp(0.0), seed=3).trial
    steps = np.floor(trial.time * 100.0 + 1e-9)
    assert np.allclose(trial.commands["motor_voltage"], np.minimum(steps, 500) / 100.0)
    for values in trial.measurements.values():
        assert np.all(np.diff(values)[np.diff(steps) == 0] == 0.0)


def test_the_seed_decides_the_noise_and_nothing_else():
    environment = make_environment("displacement", MODEL, 300)
    first, again, other = (rollout(environment, Returns(2.0), seed).trial for seed in (1, 1, 2))
    assert np.array_equal(first.measurements["load"], again.measurements["load"])
    assert not np.array_equal(first.measurements["load"], other.measurements["load"])
    assert np.array_equal(first.truth["extension"], other.truth["extension"])


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (None, "act must return volts as a number.*at 0 s it returned None"),
        ("2.0", "it returned '2.0' .str."),
        (True, "it returned True"),
        (float("nan"), "act must return finite volts.*nan"),
        (np.array([1.0, 2.0]), "it returned array"),
    ],
)
def test_what_is_no_voltage_is_refused(answer, message):
    environment = make_environment("displacement", MODEL, 300)
    with pytest.raises(ControllerError, match=message):
        rollout(environment, Returns(answer), seed=0)


def test_an_array_of_one_volt_is_a_voltage():
    environment = make_environment("displacement", MODEL, 300)
    assert rollout(environment, Returns(np.array([2.0])), seed=0).steps == 501


def test_any_number_of_processes_gives_the_same_bits(tmp_path):
    spec = controller_file(tmp_path, "return 2.0 - 10.0 * observation.extension")
    suite = small_suite(spec)
    texts = [scores_csv(scores(suite, tmp_path / str(jobs), local(jobs))) for jobs in (1, 2)]
    assert texts[0] == texts[1]
    assert texts[0].count("\n") == 3


def test_a_case_that_fails_loses_only_itself(tmp_path):
    suite = small_suite(controller_file(tmp_path, "return 1 / (self.pressure - 300)"))
    failed, done = scores(suite, tmp_path)
    assert "act raised ZeroDivisionError: division by zero (line 7 of written.py" in failed.failure
    assert not failed.phases
    assert done.phases and not done.failure


def test_a_limit_of_the_rig_is_the_failure_of_its_case(tmp_path):
    suite = small_suite(ControllerSpec("Full", path=__file__), (150,))
    (score,) = scores(suite, tmp_path)
    assert "by a physical limit: muscle stretched over 12 mm" in score.failure


class Full(Returns):
    """Pulls with all that the drive has."""

    def __init__(self):
        super().__init__(10.0)


def test_an_interrupt_leaves_what_is_done():
    kept = []

    def on_done(index, result):
        kept.append(index)
        if index == 1:
            raise KeyboardInterrupt

    assert not run_all([int, int, int], ThisProcess(), on_done)
    assert kept == [0, 1]


class Learns(Returns):
    """Counts its episodes and what it is shown."""

    repetitions = 3

    def __init__(self):
        super().__init__(2.0)
        self.begun, self.observed = [], []

    def receive(self, environment):
        self.begun.append((environment.time, environment.condition.zero_contraction))

    def reset(self, reference, station):
        self.begun.append(station.model.name)
        self.observed.append([])

    def act(self, observation, time):
        self.observed[-1].append(observation)
        return 2.0


def test_a_controller_that_learns_practises_and_its_last_episode_counts():
    environment, learns = make_environment("displacement", MODEL, 300), Learns()
    nominal = load_model("station")
    done = rollout(environment, learns, seed=5, nominal=nominal, reveal=True)
    shown, models = learns.begun[::2], learns.begun[1::2]
    assert len(set(shown)) == 1 and shown[0][0] == 0.0
    assert models == ["station"] * 3
    # Each episode has a noise of its own.
    assert len({tuple(each) for each in learns.observed}) == 3
    plain = rollout(environment, Returns(2.0), seed=5)
    assert np.array_equal(done.readings, plain.readings)
    assert np.array_equal(done.position, plain.position)


def test_a_rollout_holds_what_figures_need():
    environment = make_environment("displacement", MODEL, 300)
    done = rollout(environment, Returns(2.0), seed=1)
    assert done.steps == len(done.act_seconds) == len(done.commands) == 501
    assert {name: len(values) for name, values in done.truth.items()} == dict.fromkeys(
        ("contraction", "load", "pressure"), 502
    )
    assert np.all(done.act_seconds > 0.0) and np.all(done.commands[:, 0] == 2.0)
    # The rig's zero is where the trial began.
    assert done.truth["contraction"][0] == done.start
    assert done.position[-1] == pytest.approx(done.start - done.truth["contraction"][-1], abs=1e-4)
