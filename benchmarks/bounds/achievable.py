"""Least tracking error that any controller can reach, even with full knowledge.

The drive pulls and cannot push. On the way back the muscle pulls the cable out, with what force it
has left after hysteresis, dry friction and damping; at the end the rotor coasts into the cable's
slack on its own, braked by its friction. Where the reference asks for more, every controller lags.

The bound of a phase is the least RMSE of several ideal controllers on the noise-free plant, all of
which know its equations exactly:

- the oracle (`controllers.oracle`), which knows its state and memories too and plans 0.32 s ahead,
  at 100 and at 384 decisions a second;
- the exact inverse of the model (`controllers.models.nominal_motion`), at 100 and at 384 periods a
  second.

The oracle is not proven to be the optimum: it may lie some thousandths of a degree lower. No
controller that is shipped comes closer; a test holds that.
"""

from collections.abc import Iterator

import numpy as np

from benchmarks.bounds.open_loop import open_loop_positions
from controllers.models.nominal_motion import nominal_motion
from controllers.oracle import Oracle
from pma_gym.envs import PMAEnv, StationInfo
from pma_gym.metrics import SAMPLE_RATE_HZ
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant
from pma_gym.tasks import TASKS, phase_rmse
from pma_gym.units import SI_FACTORS

ORACLE_RATES_HZ = (100.0, SAMPLE_RATE_HZ)
"""Control rates of the oracle (Hz)."""

INVERSE_RATES_HZ = (100.0, SAMPLE_RATE_HZ)
"""Control rates of the inverse (Hz)."""


def achievable_bound(model: str | Model, task: str, pressure_kpa: float) -> dict[str, float]:
    """Least RMSE of each phase that ideal controllers reach.

    Args:
        model: a Model, the name of a shipped one, or the path of a TOML file.
        task: `displacement` or `rotation`.
        pressure_kpa: gauge pressure of the trial (kPa).
    Returns:
        RMSE by phase name, in mm (displacement) or deg (rotation).
    """
    schedule = TASKS[task].schedule
    positions = _ideal_positions(load_model(model), task, pressure_kpa)
    errors = [phase_rmse(schedule, position) for position in positions]
    unit = SI_FACTORS[schedule.unit]
    return {phase.name: min(f[phase.name] for f in errors) / unit for phase in schedule.phases}


def _ideal_positions(model: Model, task: str, pressure_kpa: float) -> Iterator[np.ndarray]:
    """Position (m or rad) at k / 384 s under each ideal controller, shape (samples,)."""
    yield from (_under_oracle(model, task, pressure_kpa, rate) for rate in ORACLE_RATES_HZ)
    plant = Plant(model)
    for rate in INVERSE_RATES_HZ:
        station = StationInfo(plant.model, TASKS[task], 1e3 * pressure_kpa, 1.0 / rate)
        needed = nominal_motion(station.task.schedule.at, station).volts
        yield from open_loop_positions([plant], station, [needed])


def _under_oracle(model: Model, task: str, pressure_kpa: float, rate: float) -> np.ndarray:
    """Position at k / 384 s under the oracle at a control rate (Hz)."""
    environment = PMAEnv(
        task, model=model, pressure_kpa=float(pressure_kpa), control_rate_hz=rate, noise=False
    )
    environment.reset(seed=0)
    oracle, ended = Oracle(), False
    oracle.receive(environment)
    oracle.reset(environment.reference, environment.station)
    while not ended:
        voltage = oracle.act(environment.measurement, environment.time)
        _, _, terminated, ended, _ = environment.step(environment.action(voltage))
        ended = ended or terminated
    return environment.trajectory()
