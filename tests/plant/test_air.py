"""Air obeys its laws: choked and subsonic flow, a shut chamber's energy, a tank's mass."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pma_gym import Plant, load_model
from pma_gym.data.trial import Trial
from pma_gym.effects import CATALOGUE
from pma_gym.effects.effect import ANTAGONIST
from pma_gym.effects.regulator.air_chamber import muscle_volume
from pma_gym.effects.regulator.valve import DENSITY, HEAT, orifice_flow
from pma_gym.plant.model import ModelError
from pma_gym.plant.simulation import Run, simulate_all

AIR = 101325.0
PAIR, STATION = load_model("muscle_pair"), load_model("station")
CHAMBER = CATALOGUE["air_chamber"].usual
MUSCLES = ("", ANTAGONIST)
REGULATED = ("regulator_line", "regulator_lag")
VALVES = ("valve", "air_chamber", "valve_spool")


def pair(*names, without=REGULATED, both=VALVES, **values):
    """The shipped pair with other effects of the air, at usual values and SI values of some."""
    dropped = {f"{prefix}{name}" for prefix in MUSCLES for name in (*without, "hysteresis")}
    kept = {n: p for n, p in PAIR.parameters.items() if n not in dropped | {"joint_friction"}}
    added = [*names, *(f"{prefix}{name}" for prefix in MUSCLES for name in both)]
    parameters = kept | {name: CATALOGUE[name].usual for name in added}
    for name, changed in values.items():
        parameters[name] = parameters[name]._replace(**changed)
    return replace(PAIR, parameters=parameters)


def waved(model, tolerance=2.3e-4, seconds=2.0):
    """States by name and times under waves of both voltages."""
    plant, time = Plant(model, tolerance), 0.005 * np.arange(int(200 * seconds) + 1)
    wave = 3.0 * np.sin(3.0 * time)
    rest = plant.settle(0.0, regulator_voltage=0.0)
    run = Run(*(time, -wave, wave, "foh", plant.table, rest.state, rest.zero_contraction))
    simulate_all(plant.program, [run])
    return dict(zip(plant.states, run.states.T, strict=True)), time


@pytest.mark.parametrize("ratio", [0.1, 0.3])
@pytest.mark.parametrize("critical", [0.3, 0.5])
def test_below_the_critical_ratio_the_flow_is_that_of_sound(ratio, critical):
    flow = orifice_flow(6e5, ratio * 6e5, 1e-8, critical)
    assert flow == pytest.approx(DENSITY * 1e-8 * 6e5, rel=1e-14)


def test_above_it_the_flow_is_an_ellipse_and_at_equal_pressures_a_line_through_zero():
    high, part = 6e5, (0.8 - 0.3) / (1.0 - 0.3)
    expected = DENSITY * 1e-8 * high * math.sqrt(1.0 - part**2)
    assert orifice_flow(high, 0.8 * high, 1e-8, 0.3) == pytest.approx(expected, rel=1e-14)
    assert orifice_flow(0.8 * high, high, 1e-8, 0.3) == pytest.approx(-expected, rel=1e-14)
    assert orifice_flow(high, high, 1e-8, 0.3) == 0.0
    below, above = (orifice_flow(high + d, high, 1e-8, 0.3) for d in (-10.0, 10.0))
    assert above == pytest.approx(-below, rel=1e-12)
    # Without a step where the line begins.
    edges = [orifice_flow(high, r * high, 1e-8, 0.3) for r in (0.999 - 1e-12, 0.999 + 1e-12)]
    assert edges[0] == pytest.approx(edges[1], rel=1e-8)


def test_the_muscles_work_is_that_of_its_volume():
    """Chou and Hannaford: force = P dV/dx, which their law states in another form."""
    law = CATALOGUE["chou_hannaford_force"]
    chamber = CATALOGUE["air_chamber"].usual
    muscle = law.usual._replace(scale=1.0)
    for contraction in np.linspace(-0.005, 0.06, 7):
        volume, slope = muscle_volume(contraction, chamber)
        assert law.law(3e5, contraction, muscle) == pytest.approx(3e5 * slope, rel=1e-9)
        after, _ = muscle_volume(contraction + 1e-6, chamber)
        assert (after - volume) / 1e-6 == pytest.approx(slope, rel=1e-4)


@pytest.mark.parametrize("exponent", [1.0, 1.2, 1.4])
def test_a_shut_chamber_keeps_its_invariant_and_its_energy(exponent):
    """U = P V / (g - 1) falls by the work done, less the heat (g - n) / (g - 1) of the work."""
    model = pair("torque_drive", both=("air_chamber",), air_chamber={"exponent": exponent})
    plant, time = Plant(model, 1e-6), 1e-3 * np.arange(2001)
    torque = 4.0 * np.sin(4.0 * time)
    truth = plant.simulate(Trial(time, {"torque_command": torque}), noise=False).truth
    chamber, pulley = (model.parameters[name] for name in ("air_chamber", "pulley"))
    contraction = pulley.contraction_at_zero + pulley.radius * truth["angle"]
    volume = np.array([muscle_volume(x, chamber)[0] for x in contraction])
    pressure = truth["pressure"] + AIR
    assert np.ptp(volume) > 0.1 * volume[0]
    invariant = pressure * volume**exponent
    np.testing.assert_allclose(invariant, invariant[0], rtol=1e-6)
    gamma = 1.4
    work = np.concatenate(
        [[0.0], np.cumsum(0.5 * (pressure[1:] + pressure[:-1]) * np.diff(volume))]
    )
    heat = (gamma - exponent) / (gamma - 1.0) * work
    energy = pressure * volume / (gamma - 1.0)
    np.testing.assert_allclose(energy - energy[0], heat - work, atol=1e-4 * np.ptp(work))


def test_a_tank_loses_what_the_muscles_take():
    """Isothermal and never refilled: the sag times its volume is R T times the mass."""
    slow = {"exponent": 1.0}
    supply = {"volume": 5e-3, "refill": 1e9, "share": 1.0}
    model = pair("supply", supply=supply, air_chamber=slow, antagonist_air_chamber=slow)
    plant, time = Plant(model, 1e-6), 0.01 * np.arange(101)
    commands = {name: np.full(101, 6.0) for name in ("valve_voltage", "antagonist_valve_voltage")}
    rest = plant.settle(0.0, regulator_voltage=0.0)
    states, _ = plant.run(time, *commands.values(), "zoh", rest)
    sag = states[-1, plant.states.index("memory_supply")]
    gained = 0.0
    for prefix, side in (("", 1.0), (ANTAGONIST, -1.0)):
        chamber, pulley = (model.parameters[f"{prefix}{n}"] for n in ("air_chamber", "pulley"))
        masses = [
            (row[plant.states.index(f"{prefix}pressure")] + AIR)
            * muscle_volume(pulley.contraction_at_zero + side * pulley.radius * row[0], chamber)[0]
            / HEAT
            for row in (states[0], states[-1])
        ]
        gained += masses[1] - masses[0]
    assert gained > 1e-4
    assert sag * 5e-3 / HEAT == pytest.approx(gained, rel=1e-5)


NEUTRAL = {"share": 0.0, "conductance": 0.0, "opening_time": 0.0, "closing_time": 0.0}


@pytest.mark.parametrize("name", ["leak", "tube_delay", "pulse_width"])
def test_what_is_neutral_changes_nothing(name):
    plain = pair("supply", supply={"share": 0.0})
    states, _ = waved(plain)
    added, effect = {}, CATALOGUE[name]
    for prefix in MUSCLES:
        values = effect.usual
        added[f"{prefix}{name}"] = values._replace(
            **{field: NEUTRAL[field] for field in values._fields if field in NEUTRAL}
        )
    others, _ = waved(replace(plain, parameters=plain.parameters | added))
    for state in ("angle", "pressure", "antagonist_pressure"):
        np.testing.assert_allclose(others[state], states[state], rtol=0, atol=1e-9 * 6e5)


def test_a_supply_without_its_share_does_not_sag_and_a_small_tank_slows_the_arm():
    constant, _ = waved(pair("supply", supply={"share": 0.0}))
    assert np.all(constant["memory_supply"] == 0.0)
    sagging, _ = waved(pair("supply", supply={"volume": 1e-3}))
    assert 1e4 < sagging["memory_supply"].max() < 6e5
    assert sagging["pressure"].max() < constant["pressure"].max() - 1e3


def test_pulses_move_the_arm_as_their_mean_does():
    both = (*VALVES, "pulses")
    pulsed, time = waved(pair("supply", both=both))
    steady, _ = waved(pair("supply"))
    assert np.abs(pulsed["angle"] - steady["angle"]).max() < math.radians(0.2)
    # Over whole periods of 20 ms pulses pass what the mean passes.
    np.testing.assert_allclose(pulsed["pressure"][::4], steady["pressure"][::4], atol=1e3)


def test_a_pressure_loop_on_a_valve_rests_at_its_command_and_fills_no_faster_than_its_valve():
    model = pair(
        "supply", without=("regulator_lag",), both=("valve", "air_chamber", "pressure_loop")
    )
    time = 0.002 * np.arange(501)
    asked = {
        "pressure_command": np.where(time > 0.1, 4e5, 1e5),
        "antagonist_pressure_command": np.full(501, 2e5),
    }
    truth = Plant(model).simulate(Trial(time, asked), noise=False, interpolation="zoh").truth
    assert truth["pressure"][0] == pytest.approx(1e5, abs=1.0)
    assert truth["pressure"][-1] == pytest.approx(4e5, rel=1e-3)
    valve, chamber = model.parameters["valve"], model.parameters["air_chamber"]
    least, _ = muscle_volume(-0.01, chamber)
    most = chamber.exponent * HEAT * DENSITY * valve.filling * (6e5 + AIR) / least
    assert np.diff(truth["pressure"]).max() < 0.002 * most


def test_a_regulator_of_second_order_answers_as_its_transfer_function():
    model = pair(without=("regulator_lag",), both=("regulator_second_order",))
    time = 0.002 * np.arange(301)
    asked = {
        "pressure_command": np.where(time > 0.0, 3e5, 2e5),
        "antagonist_pressure_command": np.full(301, 2e5),
    }
    truth = Plant(model, 1e-6).simulate(Trial(time, asked), noise=False, interpolation="zoh").truth
    law = model.parameters["regulator_second_order"]
    w, z = 2.0 * math.pi * law.frequency, law.damping
    root, late = w * math.sqrt(1.0 - z * z), np.maximum(time - 0.002, 0.0)
    rise = 1.0 - np.exp(-z * w * late) * (np.cos(root * late) + z * w / root * np.sin(root * late))
    np.testing.assert_allclose(truth["pressure"], 2e5 + 1e5 * rise, atol=20.0)


def test_mean_and_difference_are_two_pressures():
    without = ("antagonist_regulator_line",)
    kept = {n: p for n, p in PAIR.parameters.items() if n not in without}
    mixed = replace(PAIR, parameters=kept | {"co_contraction": CATALOGUE["co_contraction"].usual})
    time = 0.01 * np.arange(101)
    mean, difference = 2.5e5 + 0.0 * time, 1e5 * np.sin(4.0 * time)
    one = Plant(mixed).simulate(
        Trial(time, {"pressure_command": mean, "pressure_difference_command": difference}), False
    )
    two = Plant(PAIR).simulate(
        Trial(
            time,
            {
                "pressure_command": mean + 0.5 * difference,
                "antagonist_pressure_command": mean - 0.5 * difference,
            },
        ),
        False,
    )
    np.testing.assert_allclose(one.truth["angle"], two.truth["angle"], atol=1e-7)


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (lambda: pair(), r"\[valve\] of a muscle_pair needs \[supply\] beside it"),
        (lambda: pair(both=("regulator_lag",)), r"\[regulator_lag\] .* needs \[regulator_line\]"),
        (
            lambda: replace(
                STATION, parameters=STATION.parameters | {"air_chamber": CHAMBER}
            ),
            r"a station cannot have \[air_chamber\]",
        ),
    ],
)  # fmt: skip
def test_air_that_lacks_a_part_is_refused(model, message):
    with pytest.raises(ModelError, match=message):
        model()
