"""Effects in a sentence: which of them may be another one is clear."""

from pma_gym.discovery.report.size_text import effect_sizes, sized_effects
from pma_gym.discovery.result.estimates import Estimate, NamedEffect

FORCE = {"force_n": Estimate(3.66, 3.5, 3.8, "N")}
FRICTION = NamedEffect("contact_friction", ("quadratic_drag",), 0.001, FORCE)
SPRING = NamedEffect("linear_spring", (), 0.001, FORCE)


def test_a_rival_ends_before_the_next_effect():
    text = "contact friction (force 3.66 N), or quadratic drag, and linear spring (force 3.66 N)"
    assert sized_effects([FRICTION, SPRING]) == text


def test_effects_without_a_rival_stand_side_by_side():
    text = "linear spring (force 3.66 N) and contact friction (force 3.66 N), or quadratic drag"
    assert sized_effects([SPRING, FRICTION]) == text
    assert sized_effects([]) == ""


def test_stribeck_is_a_name():
    speed = {"stribeck_speed_mm_per_s": Estimate(3.0, 2.5, 3.9, "mm/s")}
    friction = NamedEffect("coulomb_friction", (), 0.001, speed)
    assert effect_sizes(friction) == "Stribeck speed 3 mm/s"
