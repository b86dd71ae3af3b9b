"""Loops of the regulator: their margins against the station itself, their place in the report."""

from dataclasses import replace

import control
import numpy as np
import pytest

from benchmarks.report.errors import SuiteRecord
from benchmarks.report.leaderboard import Leaderboard
from benchmarks.report.margins import load_step, loops
from benchmarks.report.plots import loop_plot, margin_table, styles_of
from benchmarks.suites.frozen import frozen_suite
from controllers import CONTROLLERS
from controllers.models.operating_range import rest_voltages
from controllers.models.voltage import nominal_offset
from pma_gym.envs import PMAEnv, StationInfo
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.tasks import ISOTONIC

LINEAR = ("pid", "feedforward_pid", "lqg", "adrc", "sliding_mode")
TASK = ISOTONIC["isotonic"]
LATE, KICK_V = 0.02, 0.02


@pytest.fixture(scope="module")
def smooth():
    """The nominal station less what the loops leave out: its dry friction and hysteresis."""
    names = ("hysteresis.force_n", "coulomb_friction.static_n", "coulomb_friction.dynamic_n")
    return load_model("station").replace(dict.fromkeys(names, 0.0))


def swings(environment, law, factor):
    """How far the regulator's voltage swings (V) in each half second after a kick, shape (8,).

    Nothing but the law, its gain multiplied, holds the station where the trial begins.
    """
    environment.reset(seed=0)
    station, state, volts = environment.station, np.zeros(law.nstates), []
    rest = nominal_offset(station)
    while environment.time < 4.0:
        error = -station.position(environment.measurement)
        wanted = float(law.C[0] @ state + law.D[0, 0] * error)
        state = law.A @ state + law.B[:, 0] * error
        kick = 0.0 if volts else KICK_V
        volts.append(min(max(rest + kick + factor * wanted, 0.0), 10.0))
        environment.step(environment.action(volts[-1]))
    return np.ptp(np.reshape(volts, (8, -1)), axis=1)


@pytest.mark.parametrize("name", LINEAR)
@pytest.mark.parametrize(("rate", "delay"), [(100.0, 0.0), (50.0, LATE)])
def test_station_swings_just_beyond_the_gain_margin_and_calms_down_just_below(
    name, rate, delay, smooth
):
    environment = PMAEnv(
        TASK,
        model=smooth,
        pressure_kpa=250.0,
        noise=False,
        control_rate_hz=rate,
        action_delay_s=delay,
    )
    station = StationInfo(smooth, TASK, 250e3, 1.0 / rate, delay)
    (loop,) = loops([CONTROLLERS[name]()], station, [0.0])
    assert loop.margins.stable
    below, beyond = (
        swings(environment, loop.law, factor * loop.margins.gain) for factor in (0.98, 1.02)
    )
    # What grows or dies out does so by a constant factor; the first second is the kick's.
    assert below[-1] < 0.8 * below[2]
    assert beyond[-1] > 1.25 * beyond[2]


def test_load_step_without_a_controller_ends_where_the_station_rests():
    station = StationInfo(load_model("station"), TASK, 250e3, 0.01)
    (loop,) = loops([CONTROLLERS["pid"]()], station, [0.0])
    free = loop._replace(law=control.ss([], [], [], [[0.0]], station.period))
    _, position = load_step(free, 3.0)
    plant, (motor, regulator) = Plant(station.model), rest_voltages(station)
    at, step = plant.states.index("contraction"), 0.01
    loaded, eased = (
        plant.settle(motor + change, regulator_voltage=regulator).state[at]
        for change in (step, -step)
    )
    assert position[-1] == pytest.approx((loaded - eased) / (2.0 * step), rel=1e-3)


def test_regulator_takes_a_load_away():
    station = StationInfo(load_model("station"), TASK, 250e3, 0.01)
    (loop,) = loops([CONTROLLERS["pid"]()], station, [0.5])
    _, position = load_step(loop, 3.0)
    # A volt of the motor pulls the muscle longer before the regulator raises the pressure.
    assert position.min() < -1e-3
    assert position[-1] == pytest.approx(0.0, abs=1e-3 * abs(position.min()))


def test_report_of_suite_pressure_has_every_loop_at_low_middle_and_high_pressure():
    suite = frozen_suite("pressure")
    two = tuple(e for e in suite.entries if e.spec.name in ("pid", "improved_feedforward"))
    ran = {(entry.spec.name, episode): {} for entry in two for episode in suite.episodes}
    leaderboard = Leaderboard(SuiteRecord(replace(suite, entries=two), ran), {})
    loops_there = leaderboard.loops
    pressures = {task: [each.pressure_kpa for each in row] for task, row in loops_there.items()}
    assert pressures == {
        "isotonic": [150.0, 250.0, 300.0],
        "triangle_low": [150.0],
        "triangle_high": [450.0],
    }
    table = margin_table(loops_there["triangle_low"], leaderboard.labels)
    assert table.title.startswith("Triangle low, against 150 N: least margins")
    assert [row[0] for row in table.rows] == ["PID"]
    assert table.rows[0][-1] == "stable"
    drawn = loop_plot(loops_there["triangle_low"], styles_of(leaderboard.labels))
    assert len(drawn.axes) == 4 and drawn.axes[0].get_title() == "150 kPa"
