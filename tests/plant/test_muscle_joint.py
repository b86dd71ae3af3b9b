"""An arm that muscles turn moves as an independent integration says, and keeps its energy."""

import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pma_gym import Plant, load_model
from pma_gym.cli import main
from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.files.trial_files import read_trial, write_trial
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.preparation.prepared_trials import prepared
from pma_gym.discovery.selection.profile_limits import limits
from pma_gym.effects import CATALOGUE
from pma_gym.effects.effect import ANTAGONIST
from pma_gym.estimation.logged import Logged
from pma_gym.plant.model import Model, ModelError, dump_model
from pma_gym.plant.sensors import voltages

PAIR = load_model("muscle_pair")
FRICTIONLESS = ("joint_friction", "hysteresis", "antagonist_hysteresis")
LEVER = {
    "arm_mm": 30.0,
    "base_mm": 240.0,
    "angle_at_zero_deg": 95.0,
    "contraction_at_zero_mm": 18.0,
}


def pair(without=(), **tables):
    """The shipped pair without some effects and with others, given by their tables in files."""
    kept = {name: values for name, values in PAIR.parameters.items() if name not in without}
    given = {name: CATALOGUE[name].parse(table) for name, table in tables.items()}
    return replace(PAIR, parameters=kept | given)


def one_muscle(**tables):
    """The first muscle of the shipped pair alone, against a spring."""
    kept = {n: values for n, values in PAIR.parameters.items() if not n.startswith(ANTAGONIST)}
    spring = {"joint_spring": {"stiffness_n_m_per_rad": 8.0, "rest_deg": -50.0}}
    given = {name: CATALOGUE[name].parse(table) for name, table in (spring | tables).items()}
    return Model("one_muscle", "An arm", "muscle_joint", kept | given)


def moved(model, time, **kilopascals):
    """Truth of a simulation under pressure commands (kPa)."""
    commands = {name: 1e3 * (values + 0.0 * time) for name, values in kilopascals.items()}
    return Plant(model).simulate(Trial(time, commands), noise=False).truth


def by_scipy(time, first, second, levers):
    """Angle (rad) of the frictionless pair, with the equations written afresh in SI."""

    def muscle(p, x, v):
        turn = 250.0 / (math.pi * 1.881 * 20.0)
        a, b = 3 * turn**2, 1 + turn**2
        force = p * math.pi * 1e-4 * (a * (1 - 1.442 * x / 0.25) ** 2 - b)
        s = max(0.0, -400 * x)
        force += s * (80 + 2 / 3 + s * (14 + 7 / 12 + s * (1 / 3 + s * 5 / 12)))
        return max(0.0, force - (250 + 1.5e-3 * p) * v)

    def arm(q):
        if not levers:
            return 0.02 + 0.0254 * q, 0.0254
        a, b, start = 0.03, 0.24, math.radians(95)
        length = math.sqrt(a * a + b * b - 2 * a * b * math.cos(start - q))
        whole = math.sqrt(a * a + b * b - 2 * a * b * math.cos(start))
        return 0.018 + whole - length, a * b * math.sin(start - q) / length

    def rates(t, y):
        q, w, p1, p2 = y
        x1, r1 = arm(q)
        x2, r2 = arm(-q)
        torque = r1 * muscle(p1, x1, r1 * w) - r2 * muscle(p2, x2, -r2 * w)
        torque += -1.2 * math.sin(q) - 0.02 * w
        return w, torque / 0.02, (first(t) - p1) / 0.055, (second(t) - p2) / 0.055

    # Settled at the first commands before it begins.
    rest = solve_ivp(
        lambda t, y: rates(0.0, y), (0, 30), [0, 0, first(0), second(0)],
        method="LSODA", rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    start = rest.y[:, -1]
    return solve_ivp(
        rates, (0, time[-1]), start, method="LSODA", rtol=1e-10, atol=1e-12, t_eval=time,
        max_step=0.002,
    ).y[0]  # fmt: skip


@pytest.mark.parametrize("levers", [False, True])
def test_pressures_turn_it_as_an_independent_integration_says(levers):
    """Between taut and slack, deflated in turn: within a millionth of a radian."""
    time = 1e-3 * np.arange(1501)
    places = {"lever": LEVER, "antagonist_lever": LEVER} if levers else {}
    without = ("pulley", "antagonist_pulley") if levers else ()
    truth = moved(
        pair((*FRICTIONLESS, *without), **places),
        time,
        pressure_command=150.0 * (1.0 - np.cos(5.0 * time)),
        antagonist_pressure_command=120.0 + 60.0 * np.sin(7.0 * time),
    )
    # Commands are linear between rows.
    first, second = (
        lambda t, c=command: np.interp(t, time, c)
        for command in (
            150e3 * (1.0 - np.cos(5.0 * time)),
            120e3 + 60e3 * np.sin(7.0 * time),
        )
    )
    assert np.ptp(truth["angle"]) > 1.0
    np.testing.assert_allclose(truth["angle"], by_scipy(time, first, second, levers), atol=1e-6)


def test_the_arm_takes_what_the_muscles_give_over_a_cycle():
    """With constant pressures and no losses, a drive's work is that of springs and gas: none."""
    lossless = pair(
        (*FRICTIONLESS, "joint_damping", "symmetric_damping", "antagonist_symmetric_damping")
    )
    plant, time = Plant(lossless, tolerance=1e-7), 1e-3 * np.arange(4001)
    rest = plant.settle(4.0, regulator_voltage=4.0)
    rest.state[plant.states.index("spin")] = 2.0
    states, zero = plant.run(time, np.full(time.size, 4.0), np.full(time.size, 4.0), condition=rest)
    angle, spin = (states[:, plant.states.index(name)] for name in ("angle", "spin"))
    starts = np.flatnonzero((angle[:-1] < 0.0) & (angle[1:] >= 0.0))
    assert len(starts) > 10
    share = -angle[starts] / (angle[starts + 1] - angle[starts])
    crossing = spin[starts] + share * (spin[starts + 1] - spin[starts])
    assert crossing == pytest.approx(2.0, abs=2e-4)


def test_damping_and_friction_take_exactly_the_energy_that_pressure_gives():
    """Over a settled cycle the muscles' work equals what bearing and weight take."""
    model, time = pair(FRICTIONLESS), 1e-3 * np.arange(8001)
    wave = 60.0 * np.sin(2.0 * math.pi * time)
    plant = Plant(model, tolerance=1e-7)
    asked = {"pressure_command": 250.0 + wave, "antagonist_pressure_command": 250.0 - wave}
    truth = plant.simulate(
        Trial(time, {name: 1e3 * values for name, values in asked.items()}), noise=False
    ).truth
    angle = truth["angle"][-1001:]
    spin = np.gradient(truth["angle"], time, edge_order=2)[-1001:]
    state, given = plant.settle(4.0, regulator_voltage=4.0).state, []
    names = plant.states.index
    for q, w, p1, p2 in zip(
        angle, spin, truth["pressure"][-1001:], truth["antagonist_pressure"][-1001:], strict=True
    ):
        state[names("angle")], state[names("spin")] = q, w
        state[names("pressure")], state[names("antagonist_pressure")] = p1, p2
        torque = 0.02 * plant.derivative(state, 4.0, 4.0, 0.0)[names("spin")]
        given.append((torque + 1.2 * math.sin(q) + 0.02 * w) * w)
    taken = np.trapezoid(0.02 * spin**2, time[-1001:])
    assert np.trapezoid(given, time[-1001:]) == pytest.approx(taken, rel=1e-3)


def test_a_slack_muscle_does_not_push_and_a_deflated_pair_hangs():
    time = 0.01 * np.arange(101)
    truth = moved(pair(), time, pressure_command=0.0, antagonist_pressure_command=0.0)
    assert np.abs(truth["angle"]).max() < 1e-9
    start = moved(one_muscle(), time, pressure_command=0.0)["angle"][0]
    # The spring's end: its rest, raised by no push of the muscle, lowered by the weight.
    assert 8.0 * (start - math.radians(-50.0)) == pytest.approx(-1.2 * math.sin(start), rel=1e-6)


@pytest.mark.parametrize("arrival", [-1.0, 0.0, 1.0])
def test_with_friction_the_start_is_the_end_of_its_range_that_the_arm_came_from(arrival):
    friction = dict(PAIR.values_in_files("joint_friction")) | {"static_n_m": 0.5}
    values = dict(PAIR.values_in_files("joint_range")) | {"arrival": arrival}
    model = pair(FRICTIONLESS, joint_friction=friction, joint_range=values)
    plant = Plant(model)
    frictionless = Plant(pair(FRICTIONLESS)).settle(4.0, regulator_voltage=5.0).state[0]
    rest = plant.settle(4.0, regulator_voltage=5.0)
    assert np.sign(rest.state[0] - frictionless) == -arrival
    rates = plant.derivative(rest.state, 4.0, 5.0, rest.zero_contraction)
    assert np.abs(rates).max() < 1e-6
    held = moved(
        model, 0.01 * np.arange(51), pressure_command=279.1, antagonist_pressure_command=219.2
    )
    assert np.ptp(held["angle"]) < 1e-6


def test_co_contraction_stiffens_and_the_linear_model_has_the_slopes_of_equilibria():
    plant = Plant(pair(FRICTIONLESS))
    soft, stiff = (plant.linearize(pressure, 0.1) for pressure in (200e3, 400e3))
    assert stiff.A[1, 0] < 1.5 * soft.A[1, 0] < 0.0
    gain = -np.linalg.solve(soft.A, soft.B)[0]
    rest, (second, first) = plant.settle, (None, None)
    first = plant.regulator_voltage(200e3)
    from scipy.optimize import brentq

    def angle(volts):
        return float(rest(volts, regulator_voltage=first).state[0])

    second = brentq(lambda volts: angle(volts) - 0.1, 0.0, 10.0, xtol=1e-13)
    slope = (angle(second + 1e-3) - angle(second - 1e-3)) / 2e-3
    assert gain[soft.input_labels.index("antagonist_voltage")] == pytest.approx(slope, rel=1e-3)


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"torque_drive": {"gain": 1.0}}, r"one place for the commands of \[torque_drive\] and"),
        (
            {"cable": {"stiffness_n_per_mm": 1, "damping_n_s_per_mm": 0, "slack_mm": 0}},
            "acts at port cable",
        ),
    ],
)
def test_what_a_pair_cannot_have_is_refused(tables, message):
    with pytest.raises(ModelError, match=message):
        pair(**tables)


def test_a_simulation_beyond_the_joints_range_says_so(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = ["time_s,pressure_command_kpa,antagonist_pressure_command_kpa", "0,200,200", "0.5,560,1"]
    Path("asked.csv").write_text("\n".join([*rows, "2,560,1"]))
    narrow = PAIR.replace({"joint_range.highest_deg": 40, "joint_range.pressure_kpa": 500})
    Path("narrow.toml").write_text(dump_model(narrow))
    with pytest.raises(SystemExit, match="0"):
        main(["simulate", "asked.csv", "--out", "out.csv", "--model", "narrow.toml", "--no-noise"])
    said = " ".join(capsys.readouterr().err.split())
    assert re.search(
        r"angle_deg goes from .* to 5\d.*, beyond the -60 to 40 of \[joint_range\]", said
    )
    assert re.search(r"pressure_kpa goes from 200 to 560, beyond the 0 to 500", said)


def test_logs_of_a_pair_are_volts_in_a_diagnosis_as_a_stations_are():
    time = 0.01 * np.arange(20)
    asked = {"pressure_command": np.full(20, 3e5), "antagonist_pressure_command": np.full(20, 2e5)}
    trial = Plant(PAIR).simulate(Trial(time, asked))
    ((kept, *_), _) = prepared([NamedTrial("a", trial), NamedTrial("b", trial)], PAIR)
    # So that another line of the regulator is another pressure, whose size the logs determine.
    other = PAIR.replace({"antagonist_regulator_line.gain_kpa_per_v": 55.0})
    np.testing.assert_array_equal(voltages(other, kept.trial), voltages(PAIR, trial))


def test_a_speed_beyond_a_pairs_trials_is_a_limit_of_its_law():
    time = 0.01 * np.arange(200)
    swing = 5e4 * np.sin(6.0 * time)
    asked = {"pressure_command": 2e5 + swing, "antagonist_pressure_command": 2e5 - swing}
    trial = Plant(PAIR).simulate(Trial(time, asked), noise=False)
    whitened = SimpleNamespace(logged=[Logged.of(PAIR, 1, trial)], readings=lambda _: [None])
    problem = SimpleNamespace(whitened_at=lambda *_: whitened)
    path = "joint_friction.stribeck_speed_deg_per_s"
    _, high = limits(problem, SimpleNamespace(values=None), (), path)
    fastest = np.degrees(np.abs(np.gradient(trial.measurements["angle"], time)).max())
    assert high == pytest.approx(30.0 * fastest)


def test_shut_valves_leave_the_mass_of_air_as_two_integrators():
    assert np.sum(np.abs(Plant("valve_pair").linearize().poles()) < 1e-5) == 2


PAGE = (Path(__file__).parents[2] / "docs" / "muscle-labs.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r'^```python title="([^"]+)"\n(.*?)^```$', PAGE, re.MULTILINE | re.DOTALL))


def test_the_laboratorys_page_works_as_it_stands(
    forget_user_effects, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rubber.py").write_text(FILES["rubber.py"])
    exec(compile(FILES["pair.py"], "pair.py", "exec"), {})
    degrees, unit = capsys.readouterr().out.split()[:2]
    assert 30.0 < float(degrees) < 60.0 and unit == "deg"
    pair = load_model("my_pair.toml")
    assert pair.parameters["antagonist_rubber"] == pair.parameters["rubber"]
    valve = PAGE.split("```toml\n")[1].split("```")[0]
    given = {name: CATALOGUE[name].parse(table) for name, table in tomllib.loads(valve).items()}
    line = ("regulator_line", "regulator_lag")
    kept = {n: p for n, p in pair.parameters.items() if n.removeprefix(ANTAGONIST) not in line}
    seconds = {f"{ANTAGONIST}{name}": values for name, values in given.items() if name != "supply"}
    opened = replace(pair, parameters=kept | given | seconds)
    assert np.isfinite(Plant(opened).settle(0.0, regulator_voltage=0.0).state).all()
    back = read_trial("logs/sine.csv").measurements
    assert set(PAGE.split("```text\n")[1].split("\n")[0].split(",")[3:]) <= {
        BY_QUANTITY[name].name for name in back
    }


def test_an_unbalanced_start_says_what_to_change():
    weight = {"moment_n_m": 500.0, "offset_deg": 90.0}
    with pytest.raises(
        ValueError, match=r"no angle between -60 and 60 deg.*change \[joint_range\]"
    ):
        Plant(one_muscle(joint_weight=weight)).settle(pressure=100e3)


def test_a_file_gives_a_trial_back_with_both_pressures(tmp_path):
    time = 0.01 * np.arange(50)
    commands = {
        "pressure_command": np.full(50, 3e5),
        "antagonist_pressure_command": np.full(50, 2e5),
    }
    trial = Plant(PAIR).simulate(Trial(time, commands))
    write_trial(trial, tmp_path / "log.csv")
    back = read_trial(tmp_path / "log.csv")
    for name, values in trial.measurements.items():
        np.testing.assert_array_equal(back.measurements[name], values)
