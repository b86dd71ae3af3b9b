"""Trials begin where the muscle stands: its hysteresis as the model, the trial or a fit says."""

import numpy as np
import pytest

from pma_gym.data.trial import Trial, TrialError
from pma_gym.envs import PMAEnv, PMAVectorEnv
from pma_gym.estimation.fitting import fit
from pma_gym.plant.memory_start import begun_at, best_shares, memory_starts
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.statics import muscle_force

FORCE, DISTANCE, BEGUN = 18.0, 1.8, 0.75
SIZES = {"force_n": FORCE, "distance_mm": DISTANCE, "memory_at_start": BEGUN}
MODEL = load_model("serres2008").with_effects({"hysteresis": SIZES})
AT_ZERO = MODEL.replace({"hysteresis.memory_at_start": 0.0})


def pulled(memory_at_start=None, most=3.0, seconds=4.0, rate=100.0):
    """Commands that pull the muscle out and let it go again, at 300 kPa."""
    time = np.arange(round(seconds * rate)) / rate
    volts = most * (1.0 - np.abs(2.0 * time / seconds - 1.0))
    commands = {"motor_voltage": volts, "pressure_command": np.full(time.size, 300e3)}
    return Trial(time, commands, memory_at_start=memory_at_start)


def test_at_rest_the_muscle_balances_what_its_memory_holds():
    rest = Plant(MODEL).settle(0.0, 300e3)
    force = muscle_force(MODEL)(np.array([300e3]), np.array([rest.zero_contraction]))[0]
    assert force == pytest.approx(BEGUN * FORCE, rel=1e-9)
    assert rest.state[Plant(MODEL).states.index("memory_hysteresis")] == BEGUN
    # It has contracted less far: the force that it lacks, over its stiffness.
    short = Plant(AT_ZERO).settle(0.0, 300e3).zero_contraction - rest.zero_contraction
    assert short == pytest.approx(BEGUN * FORCE / (32.7 - 0.0321 * 300.0) * 1e-3, rel=1e-6)


def test_a_pull_from_the_filled_branch_meets_twice_the_hysteresis():
    """From 0 the force falls by H over the distance; from +0.75 by 1.75 H: it gives way earlier."""
    commands = pulled(most=5.0)
    first, second = (
        Plant(model).simulate(commands, noise=False).truth["extension"]
        for model in (MODEL, AT_ZERO)
    )
    half = first.size // 2
    # Both stand on the same branch at the top, from zeros that differ by 0.75 H over K.
    stiffness = (32.7 - 0.0321 * 300.0) * 1e3
    less = BEGUN * FORCE / stiffness
    assert second[half] - first[half] == pytest.approx(less, rel=0.03)


def test_a_trial_says_where_it_begins():
    said = Plant(AT_ZERO).simulate(pulled(BEGUN), noise=False)
    own = Plant(MODEL).simulate(pulled(), noise=False)
    assert said.memory_at_start == BEGUN and own.memory_at_start is None
    assert said.truth["extension"].tobytes() == own.truth["extension"].tobytes()


@pytest.mark.parametrize("value", [1.5, float("nan"), "full", True])
def test_what_no_memory_is_is_refused(value):
    with pytest.raises(TrialError, match=r"memory_at_start of a trial must be a number in -1 to 1"):
        pulled(value)
    with pytest.raises(TrialError, match="memory_at_start of episodes"):
        PMAEnv("displacement", model=MODEL, memory_at_start=value)


def test_a_model_without_hysteresis_has_nothing_to_begin_with():
    bare = load_model("serres2008")
    assert memory_starts(bare) == () and begun_at(bare, 0.5) == bare
    assert memory_starts(MODEL) == ("hysteresis.memory_at_start",)


def test_an_environment_begins_where_its_option_says_one_or_many():
    options = {"model": AT_ZERO, "pressure_kpa": 300.0, "control_rate_hz": 20.0, "noise": False}
    rest = Plant(MODEL).settle(0.0, 300e3)
    env = PMAEnv("displacement", memory_at_start=BEGUN, **options)
    env.reset(seed=1)
    assert env.nominal_plant.model.parameters == MODEL.parameters
    assert env.truth["contraction"] == pytest.approx(rest.zero_contraction)
    many = PMAVectorEnv(3, "displacement", memory_at_start=BEGUN, **options)
    many.reset(seed=1)
    zero = many.engine.state_layout.offsets["zero_contraction"]
    assert many.engine.records[0, zero, 0] == pytest.approx(rest.zero_contraction, rel=1e-12)
    memory = many.engine.state_layout.offsets["memory_hysteresis"]
    assert many.engine.records[0, memory, 0] == BEGUN


def test_a_fit_leaves_the_start_free_in_every_trial():
    """Trials that began on three branches give the force that made them; said starts are kept."""
    begun = [0.0, 0.9, 0.4]
    measured = [Plant(AT_ZERO).simulate(pulled(one), seed=i) for i, one in enumerate(begun)]
    unsaid = [Trial(each.time, each.commands, each.measurements) for each in measured]
    start = AT_ZERO.replace({"hysteresis.force_n": 12.0})
    free = ("hysteresis.force_n", "hysteresis.distance_mm")
    fitted = fit(start, unsaid, free)
    said = fit(start, measured, free)
    for each in (fitted, said):
        assert each.values["hysteresis.force_n"] == pytest.approx(FORCE, abs=0.3)
        assert each.values["hysteresis.distance_mm"] == pytest.approx(DISTANCE, abs=0.05)
    # Held at 0, all three, it finds something else: the starts matter.
    held = fit(
        start,
        [Trial(e.time, e.commands, e.measurements, memory_at_start=0.0) for e in unsaid],
        free,
    )
    assert held.chi_square > 1.2 * fitted.chi_square


def test_shares_stay_within_their_reach():
    along = np.array([1.0, 2.0])
    left = np.array([[-0.5, -1.0], [-5.0, -10.0], [5.0, 10.0]])
    assert best_shares(left, along, (-2.0, 2.0)) == pytest.approx([0.5, 2.0, -2.0])
    assert best_shares(left, 0.0 * along, (-2.0, 2.0)) == pytest.approx([0.0, 0.0, 0.0])
