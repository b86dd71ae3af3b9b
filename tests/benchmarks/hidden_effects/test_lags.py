"""What follows late in the generator is as late as its truth says, however coarse the step."""

import numpy as np
import pytest

from benchmarks.hidden_effects.physics.drive import CurrentLag
from benchmarks.hidden_effects.physics.rig import BANDWIDTH, NOMINAL, SIGNALS
from benchmarks.hidden_effects.physics.simulation import RATE, SUBSTEPS, Commands, simulate

STEP = 1.0 / (RATE * SUBSTEPS)


@pytest.mark.parametrize("lag_ms", [0.02, 0.1, 0.3, 1.0, 10.0])
def test_a_drive_lags_a_ramp_by_its_time_constant(lag_ms):
    time = (np.arange(4000, dtype=np.float64) + 0.5) * STEP
    lag = CurrentLag(np.array([lag_ms * 1e-3]))
    lag.loads(np.zeros((1, 1)), 0.0)
    late = np.concatenate([lag.loads(part, STEP) for part in time.reshape(8, -1, 1)])
    assert time[-1] - late[-1, 0] == pytest.approx(lag_ms * 1e-3, abs=1e-8)


def test_a_sensor_lags_a_ramp_by_its_time_constant():
    """The pressure follows a ramp; its transducer is later than that by what its bandwidth says."""
    rows = np.arange(256)
    numbers = {name: np.array([value]) for name, value in NOMINAL.items()}
    asked = 5.0 + 2.0 * rows / RATE
    commands = Commands(np.full((1, len(rows)), 2.0), asked[None], np.zeros(1))
    read = simulate(commands, numbers)[0, :, SIGNALS.index("pressure")]
    gain = NOMINAL["regulator_gain"]
    instants = (read - NOMINAL["regulator_offset"]) / gain / 2.0 - 2.5
    late = rows[-1] / RATE - instants[-1]
    sensor = 1.0 / (2.0 * np.pi * BANDWIDTH[SIGNALS.index("pressure")])
    assert late == pytest.approx(NOMINAL["regulator_time"] + sensor, abs=3e-7)
