"""Stations at rest when an episode begins: in a batch as alone, kept as searched anew."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from benchmarks.training.stations import Stations
from pma_gym.engine.reset import reset_state
from pma_gym.engine.reset.reset_state import holding_voltages, settled_at_no_load
from pma_gym.envs import PMAVectorEnv
from pma_gym.plant.equilibrium.solver import NoLoadEquilibria
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import vector

PRESSURES = np.array([150e3, 300e3, 500e3, 300e3])


@pytest.fixture(scope="module")
def drawn():
    stations = Stations("robust", 0, 3)
    models = [stations.of(0), stations.of(1), stations.of(2), stations.of(1)]
    return Plant(stations.options["model"]), models


@pytest.fixture(autouse=True)
def nothing_kept(monkeypatch):
    monkeypatch.setattr(reset_state, "_KEPT", {})


def begun(nominal, models, pressures=PRESSURES):
    numbers = np.array([vector(model, nominal.tolerance) for model in models])
    return settled_at_no_load(
        NoLoadEquilibria(nominal), models, pressures, holding_voltages(models, pressures), numbers
    )


def test_each_rests_as_its_own_plant_does_first_and_again(drawn):
    for _ in range(2):
        states, zeros = begun(*drawn)
        for model, pressure, state, zero in zip(drawn[1], PRESSURES, states, zeros, strict=True):
            rest = Plant(model).settle(0.0, float(pressure))
            assert rest.state.tobytes() == state.tobytes() and rest.zero_contraction == zero


def test_equal_stations_at_equal_pressures_are_searched_for_once(drawn):
    begun(*drawn)
    assert len(reset_state._KEPT) == 3


def test_the_oldest_go_first(drawn, monkeypatch):
    monkeypatch.setattr(reset_state, "KEPT", 3)
    nominal, models = drawn
    begun(nominal, models[:2], PRESSURES[:2])
    first = next(iter(reset_state._KEPT))
    begun(nominal, models[:2], 1.5 * PRESSURES[:2])
    assert len(reset_state._KEPT) == 3 and first not in reset_state._KEPT


def test_threads_that_drop_what_others_take_find_the_same(drawn, monkeypatch):
    single = begun(*drawn)
    # Room for one of three: every thread drops what another has just kept.
    monkeypatch.setattr(reset_state, "KEPT", 1)
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda _: begun(*drawn), range(24)))
    for states, zeros in together:
        assert states.tobytes() == single[0].tobytes() and zeros.tobytes() == single[1].tobytes()
    assert len(reset_state._KEPT) == 1


def test_what_does_not_balance_is_named(drawn):
    nominal, models = drawn
    strong = models[0].replace({"sarosi_force.offset_n": 2e3})
    with pytest.raises(ValueError, match="balances a load"):
        begun(nominal, [strong], PRESSURES[:1])


@pytest.mark.parametrize(
    ("task", "options"),
    [
        ("displacement", {"pressure_kpa": [200, 312.5, 400]}),
        ("rotation", {"action_delay_s": 0.02, "regulator_action": True, "noise": False}),
    ],
)
def test_compiled_beginnings_are_those_of_a_search_bit_for_bit(task, options):
    def begun(count, search):
        envs = PMAVectorEnv(count, task, **options)
        engine = envs.engine
        assert engine._settling == engine.task.starts
        if search:
            engine._settling = np.inf, -np.inf
        states = []
        for seed in (5, None, None, 6):
            envs.reset(seed=seed)
            names = [
                n for n in engine.state_layout.offsets if engine.state_layout.kind(n) == "real"
            ]
            states.append([engine.pressures.copy(), *map(engine.numbers, names)])
        envs.close()
        return np.array(states)

    for count in (1, 7):
        np.testing.assert_array_equal(begun(count, search=False), begun(count, search=True))
