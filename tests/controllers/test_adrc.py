"""ADRC: what it leaves of disturbances, its linear law, and trials on the station."""

from dataclasses import replace

import control
import numpy as np
import pytest

from controllers import ADRC
from controllers.adrc import Settings
from controllers.registry import LinearController
from pma_gym.tasks import ISOTONIC

PERIOD = 0.01


def begun(controller, station, pressure_kpa=300.0, delay=0.0):
    """A controller that is to stay where an isotonic trial begins: some volts from any limit."""
    given = replace(
        station(pressure_kpa=pressure_kpa), task=ISOTONIC["isotonic"], action_delay=delay
    )
    controller.reset(lambda time: 0.0, given)
    return given


def close(controller, reading, disturbance, steps):
    """Errors (m) of the plant that the controller assumes; d and its slope begin so (V, V/s)."""
    observer = controller._observer
    place, n = observer.places[observer.nearest(0.0)], observer.order
    rest = controller._motion.voltage(0.0)
    z, sent, errors = np.array([*[0.0] * n, *disturbance]), [0.0] * 10, []
    for k in range(steps):
        errors.append(z[0])
        voltage = controller.act(reading(extension=-z[0], load=200.0), k * PERIOD)
        sent.append(voltage - rest)
        z = place.step @ z
        z += place.older * sent[-place.since - 1] + place.newer * sent[-place.since]
    return np.array(errors)


@pytest.mark.parametrize("delay", [0.0, 0.02])
@pytest.mark.parametrize("disturbance", [(0.5, 0.0), (0.0, 0.5)])
def test_no_offset_is_left_of_a_constant_or_a_ramp(disturbance, delay, station, reading):
    controller = ADRC(Settings(0.6, 0.6))
    begun(controller, station, delay=delay)
    errors = close(controller, reading, disturbance, 500)
    assert np.abs(errors).max() > 5e-5
    # Of a ramp there is left what a voltage that is held over a period cannot follow.
    assert abs(errors[-1]) < 5e-3 * np.abs(errors).max()


@pytest.mark.parametrize("delay", [0.0, 0.02])
def test_linear_law_is_what_it_does(delay, station, reading):
    controller = ADRC(Settings(0.6, 0.6))
    given = begun(controller, station, delay=delay)
    law = controller.linear(given, 0.0)
    errors = np.random.default_rng(1).normal(0.0, 2e-5, 60)
    rest = controller._motion.voltage(0.0)
    got = [
        controller.act(reading(extension=error, load=200.0), k * PERIOD) - rest
        for k, error in enumerate(errors)
    ]
    known = control.forced_response(law, inputs=errors).outputs
    # The strokes of the two references end some nanometres apart.
    assert got == pytest.approx(known, rel=1e-4, abs=1e-6)
    assert isinstance(controller, LinearController)
