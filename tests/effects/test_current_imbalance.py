"""Unequal phase currents: where the shaft stands decides, and table I3 has it."""

import numpy as np
import pytest

from pma_gym.data.serres2008 import load_table
from pma_gym.effects import CATALOGUE
from pma_gym.effects.drive.current_imbalance import imbalance_load
from pma_gym.plant.equilibrium.solver import equilibria_at

RADIUS_M = 25.9e-3
SEEN_KPA = (150.0, 250.0, 300.0, 400.0, 500.0, 575.0)
"""Pressures that the load is fitted to; the other five judge."""


def shares(plant, pressure):
    """Swing of the load as a share of it, contraction (m) and the shaft's angle (rad)."""
    drive, radius = plant.model.parameters["drive"], plant.model.parameters["rotor"].radius
    volts = np.linspace(1.0, 7.0, 60)
    states, zero = equilibria_at(plant, volts, np.full(60, plant.regulator_voltage(pressure)))
    truth = [
        plant.observe(state[None, :], start) for state, start in zip(states, zero, strict=True)
    ]
    load, contraction, angle = (
        np.array([seen[name][0] for seen in truth]) for name in ("load", "contraction", "rotation")
    )
    return load / (drive.gain * volts + drive.offset) - 1.0, contraction, angle - zero / radius


def test_peaks_stand_where_the_slide_stands_at_every_pressure(station_with):
    plant = station_with("current_imbalance", amplitude_percent=3.0, phase_deg=40.0)
    places = []
    for pressure in (300e3, 450e3):
        share, contraction, angle = shares(plant, pressure)
        expected = 0.03 * np.cos(6.0 * angle + np.radians(40.0))
        np.testing.assert_allclose(share, expected, atol=1e-8)
        between = (contraction > 20e-3) & (contraction < 42e-3)
        places.append(contraction[between][np.argmax(share[between])])
    # The cable gives by 1 mm between the loads that hold these places; a ripple over the angle from
    # no load would stand 10 mm apart.
    assert places[0] == pytest.approx(places[1], abs=2e-3)


def test_it_swings_in_proportion_to_the_load_and_about_it():
    p = CATALOGUE["current_imbalance"].usual
    turn = np.linspace(0.0, 2.0 * np.pi, 361)[:-1]
    loads = np.array([imbalance_load(400.0, angle, p) for angle in turn])
    assert loads.mean() == pytest.approx(0.0, abs=1e-9)
    assert np.abs(loads).max() == pytest.approx(0.025 * 400.0, rel=1e-3)
    np.testing.assert_allclose(loads, np.roll(loads, 60), atol=1e-9)
    assert imbalance_load(0.0, 0.3, p) == 0.0


def fitted(columns, loads, chosen):
    """Rms (N) of loads about their fit on some rows, at the other rows."""
    coefficients, *_ = np.linalg.lstsq(columns[chosen], loads[chosen], rcond=None)
    off = (loads - columns @ coefficients)[~chosen]
    return float(np.sqrt(np.mean(off**2))), coefficients


def test_table_i3_has_it_on_pressures_that_were_not_fitted_to():
    table = load_table("I3")
    volts, loads = table["motor_voltage_v"], table["load_n"]
    seen = np.isin(table["pressure_nominal_kpa"], SEEN_KPA)
    line = np.column_stack([volts, np.ones_like(volts)])
    # Where the slide stands, as an angle of the pulley.
    stands = (table["extension_mm"] - table["no_load_contraction_mm"]) * 1e-3 / RADIUS_M
    from_no_load = table["extension_mm"] * 1e-3 / RADIUS_M

    def wave(angle, periods):
        return [volts * np.cos(periods * angle), volts * np.sin(periods * angle)]

    plain, _ = fitted(line, loads, seen)
    by_stand, coefficients = fitted(np.column_stack([line, *wave(stands, 5.9)]), loads, seen)
    from_rest, _ = fitted(np.column_stack([line, *wave(from_no_load, 5.9)]), loads, seen)
    assert plain > 12.0 and from_rest > 11.5
    assert by_stand < 6.5
    assert np.hypot(*coefficients[2:]) / coefficients[0] == pytest.approx(0.027, abs=0.002)
    tried = np.arange(2.0, 12.05, 0.1)
    errors = [fitted(np.column_stack([line, *wave(stands, n)]), loads, ~seen)[0] for n in tried]
    assert tried[int(np.argmin(errors))] == pytest.approx(6.0, abs=0.25)
