"""A function as randomisation: the same station alone as in a batch, and none that cannot be."""

import numpy as np
import pytest

from pma_gym.envs import PMAEnv, PMAVectorEnv


def heavier(nominal, generator):
    """A slide of up to twice the mass."""
    mass = nominal.values_in_files("slide")["mass_kg"]
    return nominal.replace({"slide.mass_kg": mass * (1.0 + generator.random())})


def test_a_function_draws_the_same_alone_as_in_a_batch():
    given = {"randomisation": heavier, "pressure_kpa": 300.0, "control_rate_hz": 20.0}
    envs = PMAVectorEnv(3, "displacement", autoreset_mode="Disabled", **given)
    singles = [PMAEnv("displacement", **given) for _ in range(3)]
    for seed in (4, None):
        seen, _ = envs.reset(seed=seed)
        theirs = [
            one.reset(seed=None if seed is None else seed + i)[0] for i, one in enumerate(singles)
        ]
        np.testing.assert_array_equal(seen, theirs)
        drawn = [model.parameters["slide"].mass for model in envs.engine.models]
        assert drawn == [one.plant.model.parameters["slide"].mass for one in singles]
        # Each environment and each episode has one of its own.
        assert len(set(drawn)) == 3
        for volts in np.linspace(0.0, 3.0, 20):
            seen = envs.step(np.full((3, 1), 0.2 * volts - 1.0))[0]
            np.testing.assert_array_equal(seen, [one.step(one.action(volts))[0] for one in singles])
    envs.close()


def test_other_effects_are_refused():
    def other(nominal, generator):
        return nominal.with_effects({"hanging_load": {}})

    env = PMAEnv("displacement", randomisation=other, pressure_kpa=300.0)
    with pytest.raises(ValueError, match=r"these differ: hanging_load; give both all of them"):
        env.reset(seed=0)


def test_what_is_no_model_is_refused():
    env = PMAEnv("displacement", randomisation=lambda nominal, generator: None)
    with pytest.raises(ValueError, match=r"a randomisation must give a Model, got None"):
        env.reset(seed=0)


@pytest.mark.parametrize("given", [3, None, "wide open"])
def test_what_is_neither_a_name_nor_a_function_is_refused(given):
    with pytest.raises(ValueError, match=r"randomisation must be one of .*got"):
        PMAEnv("displacement", randomisation=given)
