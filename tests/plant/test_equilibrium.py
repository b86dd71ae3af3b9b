"""At rest nothing moves; what cannot rest is refused."""

import numpy as np
import pytest

from pma_gym.plant.model import load_model, shipped_models
from pma_gym.plant.plant import Plant

LAWS = sorted(set(shipped_models()) - {"serres2008", "station", "cascade"})


@pytest.mark.parametrize("model", sorted(shipped_models()))
def test_nothing_moves_at_rest(model):
    plant = Plant(model)
    for pressure in (200e3, 314e3, 430e3, 575e3):
        for voltage in (0.0, 0.5, 2.0, 4.5):
            rest = plant.settle(voltage, pressure)
            rates = plant.derivative(
                rest.state, voltage, plant.regulator_voltage(pressure), rest.zero_contraction
            )
            # Forces of 1e3 N over 0.5 kg, balanced to rounding; pressures of 5e5 Pa at 600 1/s.
            scale = np.where(["pressure" in name for name in plant.states], 1e-5, 1e-6)
            assert np.all(np.abs(rates) < scale)
            truth = plant.observe(rest.state[None, :], rest.zero_contraction)
            assert truth["pressure"][0] == pytest.approx(pressure, rel=1e-12)
            assert truth["extension"][0] >= -1e-12
            if voltage == 0.0:
                assert truth["extension"][0] == pytest.approx(0.0, abs=1e-12)
                assert truth["load"][0] == pytest.approx(0.0, abs=1e-9)


def test_serres2008_rests_where_its_three_elements_say():
    rest = Plant("serres2008").settle(3.0, 250e3)
    stiffness, load = 32.7 - 0.0321 * 250.0, 97.84 * 3.0 - 2.0
    assert rest.zero_contraction * 1e3 == pytest.approx((2.91 * 250.0 + 44.6) / stiffness)
    assert rest.state[0] * 1e3 == pytest.approx((2.91 * 250.0 + 44.6 - load) / stiffness)


def test_what_no_muscle_balances_is_refused():
    plant = Plant("serres2008")
    for message, act in (
        (r"balances a load of 976\.4 N .*lower the first motor", lambda: plant.settle(10.0, 50e3)),
        ("no contraction between -24 and 180 mm", lambda: Plant("schulte").settle(3.0, 0.0)),
        ("what the regulator reaches with 0-10 V; got 900 kPa", lambda: plant.settle(0.0, 900e3)),
        (r"settle\(\) needs a pressure", lambda: plant.settle(1.0)),
    ):
        with pytest.raises(ValueError, match=message):
            act()


@pytest.mark.parametrize("model", LAWS)
def test_each_law_of_the_literature_settles_and_moves_stably(model):
    loaded = load_model(model)
    plant = Plant(loaded)
    for pressure in (200e3, 300e3, 400e3, 575e3):
        rest = plant.settle(0.0, pressure)
        zero = rest.zero_contraction
        assert 0.02 < zero < loaded.parameters["limits"].contraction
        assert loaded.parameters["limits"].pressure >= pressure
    rest = plant.settle(0.0, 300e3)
    regulator = plant.regulator_voltage(300e3)
    held = plant.settle(1.5, 300e3)
    for _ in range(150):
        plant.step(rest, 1.5, regulator, 0.01)
    stroke = rest.zero_contraction - held.state[0]
    assert rest.state[0] == pytest.approx(held.state[0], abs=0.05 * stroke)
