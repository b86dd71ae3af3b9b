"""A limit that is never reached, and a law whose chi-square is rugged, are fitted all the same."""

import numpy as np
import pytest

from pma_gym import Model, Plant, Trial, load_model
from pma_gym.discovery import diagnose
from pma_gym.discovery.fitting.free_parameters import at_limit


def _trials(model: Model) -> list[Trial]:
    time = np.arange(0.0, 5.0, 1 / 64)
    trials = []
    for seed, (volts, period) in enumerate(((1.5, 2.0), (2.5, 1.2), (2.0, 3.0)), 1):
        motor = 0.5 * volts * (1.0 - np.cos(2.0 * np.pi * time / period))
        regulator = 5.5 + 2.0 * np.sign(np.sin(2.0 * np.pi * time / (0.7 * period) + 0.3))
        commands = {"motor_voltage": motor, "regulator_voltage": regulator}
        trials.append(Plant(model).simulate(Trial(time, commands), seed=seed))
    return trials


@pytest.mark.campaign
def test_a_limit_that_is_never_reached_is_fitted_from_its_own_size() -> None:
    """The steps of its derivatives come from its value, not from bounds a million times as wide."""
    hidden = {"regulator_rate_limit": {"limit_kpa_per_s": 600.0}}
    rig = load_model("serres2008").with_effects(hidden)
    fitted = diagnose(_trials(rig), "serres2008", propose=False)
    assert fitted.verdict == "effect"
    (effect,) = fitted.effects
    assert effect.name == "regulator_rate_limit"
    limit = effect.parameters["limit_kpa_per_s"]
    assert limit.value == pytest.approx(600.0, rel=0.02)
    assert limit.limit == ""
    assert not fitted.unfitted


def test_a_boundless_range_has_a_lower_end_only_where_it_begins() -> None:
    """A value far above the lower end is not there because the upper end is farther."""
    assert at_limit(638.0, 10.0, 1e9) == ""
    assert at_limit(10.0, 10.0, 1e9) == "lower"
    assert at_limit(1e9, 10.0, 1e9) == "upper"
