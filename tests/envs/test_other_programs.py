"""What other libraries look for: messages, values that are not None, ids in fresh processes."""

import gymnasium as gym
import numpy as np
import pytest

from pma_gym.envs import PMAVectorEnv
from pma_gym.tasks import limit_in_words

DISPLACEMENT = "pma_gym/IsokineticDisplacement-v0"
MADE = {"model": "serres2008", "pressure_kpa": 300.0, "control_rate_hz": 10.0}


def test_an_unknown_option_has_the_words_that_torchrl_looks_for():
    for make in (gym.make, lambda name, **given: gym.make_vec(name, 2, **given)):
        with pytest.raises(TypeError) as caught:
            make(DISPLACEMENT, frameskip=1)
        assert "unexpected keyword argument 'frameskip'" in str(caught.value)
    with pytest.raises(TypeError, match="did you mean 'threads'"):
        PMAVectorEnv(2, thread=2)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_the_limit_has_its_number_wherever_an_episode_ends(mode, fragile):
    made = {**MADE, "model": fragile}
    envs = PMAVectorEnv(3, autoreset_mode=mode, **made)
    envs.reset(seed=1)
    seen = set()
    for step in range(70):
        # The first never moves, so that its episode is truncated; the others break the limit.
        volts = np.array([[-1.0], [min(1.0, -1.0 + 0.05 * step)], [min(1.0, -1.0 + 0.1 * step)]])
        *_, terminated, truncated, info = envs.step(volts.astype(np.float32))
        over = terminated | truncated
        if over.any():
            final = info["final_info"] if mode == "SameStep" else info
            codes = final["limit_code"]
            assert codes.dtype == np.int64
            np.testing.assert_array_equal(codes[over] > 0, terminated[over])
            seen |= {limit_in_words(made["model"], code) for code in codes[over].tolist()}
        if over.any() and mode == "Disabled":
            envs.reset(options={"reset_mask": over})
    assert {"", "cable tension above 450 N"} <= seen
