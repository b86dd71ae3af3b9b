"""Imposed motions diagnosed from a model that knows nothing: what rubs, and what is lost before."""

import json

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.trial import Trial
from pma_gym.discovery import diagnose
from tests.plant.test_imposed import imposed

SENSOR = {"bandwidth_hz": 1000.0, "noise_n": 0.3}
TIME = np.arange(0.0, 8.0, 0.01)
KNOWN = imposed(force_sensor=SENSOR)


def trials(pressures=(0.0, 0.0), strokes=(0.02, 0.03), **hidden):
    """Sines that begin at rest, of a rig with hidden effects."""
    rig = Plant(imposed(force_sensor=SENSOR, **hidden))
    made = []
    for seed, (pressure, stroke) in enumerate(zip(pressures, strokes, strict=True)):
        swing = np.clip(TIME - 1.0, 0.0, 6.0)
        commands = {
            "contraction_command": 0.5 * stroke * (1.0 - np.cos(np.pi * swing)),
            "pressure_command": np.full(TIME.size, pressure),
        }
        made.append(rig.simulate(Trial(TIME, commands), seed=seed))
    return [Trial(each.time, each.commands, {"force": each.measurements["force"]}) for each in made]


def sizes_of(diagnosis):
    """Value by effect and parameter."""
    return {
        f"{effect.name}.{name}": estimate.value
        for effect in diagnosis.effects
        for name, estimate in effect.parameters.items()
    }


def rubs(force, slope):
    """Tables of friction (N), of its growth with the pressure (N/kPa), and what expects them."""
    hidden = {
        "contact_friction": {"force_n": force, "presliding_um": 100.0},
        "pressure_friction": {"slope_n_per_kpa": slope, "presliding_um": 100.0},
    }
    sizes = {"contact_friction.force_n": force, "pressure_friction.slope_n_per_kpa": slope}
    return hidden, {path: size for path, size in sizes.items() if size}


SEAL = (250e3, 300e3, 350e3, 400e3)


@pytest.mark.parametrize(
    ("pressures", "tables", "error"),
    [
        ((100e3, 300e3, 700e3), rubs(3.0, 0.01), 0.05),
        (SEAL, rubs(0.5, 3e-3), 0.03),
        (SEAL, rubs(1.0, 0.0), 0.03),
        (SEAL, rubs(0.0, 3e-3), 0.03),
    ],
)
def test_friction_of_a_seal_has_both_parts_where_both_are_there_and_one_where_one_is(
    pressures, tables, error
):
    """Each changes less beside the other than is looked for by itself."""
    hidden, there = tables
    diagnosis = diagnose(
        trials(pressures, (0.02,) * len(pressures), **hidden), KNOWN, propose=False
    )
    sizes = sizes_of(diagnosis)
    named = {path for path in sizes if not path.endswith("presliding_um")}
    assert named == set(there), diagnosis.sentence
    for path, size in there.items():
        assert sizes[path] == pytest.approx(size, rel=error)


def test_friction_and_backlash_are_named_with_their_sizes():
    hidden = {
        "contact_friction": {"force_n": 40.0, "presliding_um": 300.0},
        "backlash": {"width_mm": 3.0},
    }
    diagnosis = diagnose(trials(**hidden), KNOWN, propose=False)
    sizes = sizes_of(diagnosis)
    assert {name.partition(".")[0] for name in sizes} == set(hidden), diagnosis.sentence
    assert sizes["contact_friction.force_n"] == pytest.approx(40.0, rel=0.02)
    assert sizes["backlash.width_mm"] == pytest.approx(3.0, rel=0.05)


def test_a_drag_beside_friction_is_no_friction_that_falls_with_speed():
    """Beside a law that falls with speed the drag does not show: friction of 38 N, rise 1.7 N."""
    tables = {"intercept_n_s_per_mm": 0.5, "slope_n_s_per_mm_per_kpa": 0.0}
    hidden = {
        "contact_friction": {"force_n": 40.0, "presliding_um": 50.0},
        "quadratic_drag": {"coefficient_n_s2_per_mm2": 3e-4},
        "symmetric_damping": tables | {"intercept_n_s_per_mm": 0.55},
    }
    known = imposed(force_sensor=SENSOR, symmetric_damping=tables)
    diagnosis = diagnose(trials(strokes=(0.03, 0.06), **hidden), known, propose=False)
    sizes = sizes_of(diagnosis)
    assert {name.partition(".")[0] for name in sizes} == {"contact_friction", "quadratic_drag"}
    assert "contact_friction.rise_n" not in sizes
    assert sizes["contact_friction.force_n"] == pytest.approx(40.0, rel=0.01)
    assert sizes["quadratic_drag.coefficient_n_s2_per_mm2"] == pytest.approx(3e-4, rel=0.05)


def test_nothing_hidden_names_nothing():
    spring = {"piston_force": {"area_mm2": 490.0}}
    given = trials((100e3, 300e3), **spring)
    diagnosis = diagnose(given, imposed(force_sensor=SENSOR, **spring), propose=False)
    assert not diagnosis.effects, diagnosis.sentence
    assert diagnosis.verdict in ("agrees", "parameters", "undecidable")


def test_backlash_that_nothing_could_show_is_no_reason_to_decide_nothing():
    """Without friction no way is lost, however large the gap: it is not counted as hidden."""
    diagnosis = diagnose(trials(), KNOWN, propose=False)
    assert "backlash" in {each.name for each in diagnosis.candidates}
    assert "backlash" not in diagnosis.not_detectable
    assert diagnosis.verdict != "effect"


def test_friction_that_rises_near_rest_is_one_effect_with_its_stribeck_speed():
    hidden = {
        "contact_friction": {
            "force_n": 10.0,
            "presliding_um": 100.0,
            "rise_n": 4.0,
            "stribeck_speed_mm_per_s": 8.0,
        }
    }
    diagnosis = diagnose(trials((100e3, 300e3), (0.02, 0.02), **hidden), KNOWN, propose=False)
    sizes = sizes_of(diagnosis)
    assert {name.partition(".")[0] for name in sizes} == set(hidden), diagnosis.sentence
    assert sizes["contact_friction.force_n"] == pytest.approx(10.0, rel=0.05)
    assert sizes["contact_friction.rise_n"] == pytest.approx(4.0, rel=0.15)


def test_friction_of_one_level_keeps_one_number():
    hidden = {"contact_friction": {"force_n": 10.0, "presliding_um": 100.0}}
    diagnosis = diagnose(trials((100e3, 300e3), (0.02, 0.02), **hidden), KNOWN, propose=False)
    (effect,) = diagnosis.effects
    assert set(effect.parameters) == {"force_n", "presliding_um"}
    assert set(effect.undetermined) == {"rise_n", "stribeck_speed_mm_per_s"}
    assert "rise not determined" in diagnosis.sentence and "limit" not in diagnosis.sentence
    (written,) = json.loads(diagnosis.text())["effects"]
    assert set(written["not_determined"]) == set(effect.undetermined)
    assert "not determined" in diagnosis.model.notes["contact_friction.rise_n"].source
