"""Old keyword arguments work, with one warning that says the new name."""

import numpy as np
import pytest

from controllers import SerresReplay
from pma_gym import Plant
from pma_gym.effects.effect import Effect

TIME = np.linspace(0.0, 0.5, 6)
MOTOR = np.array([1.0, 2.0, 1.0, 2.0, 1.0, 2.0])


@pytest.mark.parametrize(("joined", "interpolation"), [(True, "foh"), (False, "zoh")])
def test_joined_is_interpolation(joined, interpolation):
    plant, regulator = Plant("station"), np.full(6, 6.0)
    new, _ = plant.run(TIME, MOTOR, regulator, interpolation=interpolation)
    with pytest.warns(DeprecationWarning, match=f"is now run.interpolation='{interpolation}'"):
        old, _ = plant.run(TIME, MOTOR, regulator, joined=joined)  # pyright: ignore
    assert np.array_equal(new, old)


@pytest.mark.parametrize(("hold", "interpolation"), [("linear", "foh"), ("zero", "zoh")])
def test_hold_of_a_replay_is_interpolation(hold, interpolation):
    with pytest.warns(DeprecationWarning, match=f"interpolation='{interpolation}'") as said:
        replay = SerresReplay(hold=hold)  # pyright: ignore
    assert len(said) == 1 and replay.interpolation == interpolation


def test_both_names_are_refused():
    with pytest.raises(TypeError, match="got interpolation and joined, its old name"):
        Plant("station").run(TIME, MOTOR, MOTOR, joined=True, interpolation="foh")  # pyright: ignore


def test_another_interpolation_is_refused_with_what_there_is():
    with pytest.raises(ValueError, match="interpolation must be 'foh'.*or 'zoh'.*got 'cubic'"):
        Plant("station").run(TIME, MOTOR, MOTOR, interpolation="cubic")  # pyright: ignore


def test_effects_take_their_laws_by_the_old_names():
    def law(memory, travel, direction, p):
        return memory

    with pytest.warns(DeprecationWarning) as said:
        effect = Effect("drag", "slide_force", None, law, path=law, path_bend=law)  # pyright: ignore
    assert effect.rate_independent_law is effect.path_breakpoint is law
    assert [str(one.message).partition(" is now ")[0][:12] for one in said] == [
        "Effect(path=",
        "Effect(path_",
    ]
