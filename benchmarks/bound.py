"""How closely a trial can be followed at all: what is left to controllers that know everything.

The drive pulls and cannot push. On the way back the muscle pulls the cable out, with what force it
has left after hysteresis, dry friction and damping; at the end the rotor coasts into the cable's
slack on its own, braked by its friction. Where the reference asks for more, every controller lags.

The bound of a phase is the least RMSE of several ideal controllers on the noise-free plant, all of
which know its equations exactly, the first its true state and all memories too:

- look-ahead, 384 times a second and without delay: tries voltages on a copy of the plant and holds
  the one of 0-10 V that brings the position onto the reference 1 step (2.6 ms) ahead; for
  extension also 5 steps ahead, so that the rotor does not rush through the slack, where no voltage
  brakes it;
- the exact inverse of the model (`controllers.inverse`), at 100 and at 384 periods a second.

Look-ahead leaves no error but where the voltage is at a limit. It does not prepare for a limit
before it comes: the true optimum of phase III may lie some hundredths of a degree lower. No
controller that is shipped comes closer; a test holds that.
"""

from collections.abc import Iterator
from functools import cache

import numpy as np
from scipy.optimize import brentq

from controllers.inverse import inverse_of
from pma_gym.envs import Station
from pma_gym.metrics import SAMPLE_RATE_HZ
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Condition, Plant
from pma_gym.tasks import TASKS, phase_rmse
from pma_gym.units import SI_FACTORS

STEP_S = 1.0 / SAMPLE_RATE_HZ
"""Time between decisions (s)."""

HORIZONS = {"extension": (1, 5), "rotation": (1,)}
"""How many steps ahead a voltage is judged, by what is followed."""

INVERSE_RATES_HZ = (100.0, SAMPLE_RATE_HZ)
"""Control rates of the inverse (Hz)."""

VOLTAGE_LIMIT = 10.0


def achievable_bound(model: str | Model, task: str, pressure_kpa: float) -> dict[str, float]:
    """Least RMSE of each phase that ideal controllers reach.

    Args:
        model: a Model, the name of a shipped one, or the path of a TOML file.
        task: `displacement` or `rotation`.
        pressure_kpa: gauge pressure of the trial (kPa).
    Returns:
        RMSE by phase name, in mm (displacement) or deg (rotation).
    """
    plant, protocol = Plant(load_model(model)), TASKS[task].protocol
    station = Station(plant.model, TASKS[task], pressure_kpa * 1e3, STEP_S)
    found = [phase_rmse(protocol, position) for position in _ideal_positions(plant, station)]
    unit = SI_FACTORS[protocol.unit]
    return {phase.name: min(f[phase.name] for f in found) / unit for phase in protocol.phases}


def _ideal_positions(plant: Plant, station: Station) -> Iterator[np.ndarray]:
    """Position (m or rad) at k / 384 s under each ideal controller, shape (samples,)."""
    horizons = HORIZONS[station.task.protocol.quantity]
    yield from (_look_ahead(plant, station, horizon) for horizon in horizons)
    yield from (_inverted(plant, station, rate) for rate in INVERSE_RATES_HZ)


def _samples(station: Station) -> int:
    return round(station.task.duration * SAMPLE_RATE_HZ) + 1


def _inverted(plant: Plant, station: Station, rate: float) -> np.ndarray:
    """Position at k / 384 s under the inverse of the model at a control rate (Hz)."""
    protocol, period = station.task.protocol, 1.0 / rate
    known = Station(plant.model, station.task, station.pressure, period)
    volts = inverse_of(plant.model)(
        lambda time: float(protocol.reference(time)), known, station.task.steps(rate)
    )
    volts = np.clip(volts, 0.0, VOLTAGE_LIMIT)
    condition = plant.settle(0.0, pressure=station.pressure)
    regulator = np.full(len(volts) + 1, plant.regulator_voltage(station.pressure))
    controlled, sampled = period * np.arange(len(volts) + 1), STEP_S * np.arange(_samples(station))
    # Where a command and a sample fall together but for rounding, the command's time is taken.
    near = np.abs(sampled - period * np.round(sampled / period)) < 1e-9
    sampled = np.where(near, period * np.round(sampled / period), sampled)
    time = np.union1d(controlled, sampled)
    row = np.minimum(np.searchsorted(controlled, time, side="right") - 1, len(volts) - 1)
    states, zero = plant.run(time, volts[row], regulator[row], False, condition)
    states = states[np.searchsorted(time, sampled)]
    return plant.observe(states, zero)[protocol.quantity]


def _look_ahead(plant: Plant, station: Station, horizon: int) -> np.ndarray:
    """Position at k / 384 s under look-ahead."""
    samples = _samples(station)
    reference = station.task.protocol.reference(STEP_S * np.arange(samples + horizon))
    ideal = _Ideal(plant, station, horizon)
    for k in range(1, samples):
        ideal.step(float(reference[k - 1 + horizon]))
    return np.array(ideal.positions)


class _Ideal:
    """The plant in the hands of look-ahead."""

    def __init__(self, plant: Plant, station: Station, horizon: int) -> None:
        self.plant, self.quantity = plant, station.task.protocol.quantity
        self.ahead = horizon * STEP_S
        self.regulator = plant.regulator_voltage(station.pressure)
        self.condition = plant.settle(0.0, pressure=station.pressure)
        self.voltage = 0.0
        self.positions = [self._position(self.condition)]

    def _position(self, condition: Condition) -> float:
        truth = self.plant.observe(condition.state[None, :], condition.zero_contraction)
        return float(truth[self.quantity][0])

    def _ahead(self, voltage: float) -> float:
        """Position at the horizon if this voltage (V) is held."""
        trial = Condition(self.condition.state.copy(), self.condition.zero_contraction)
        self.plant.step(trial, voltage, self.regulator, self.ahead)
        return self._position(trial)

    def step(self, target: float) -> None:
        """Hold the voltage that leads to the target (m or rad) for a step."""
        self.voltage = self._best(target)
        self.plant.step(self.condition, self.voltage, self.regulator, STEP_S)
        self.positions.append(self._position(self.condition))

    def _best(self, target: float) -> float:
        """Voltage in 0-10 V whose position at the horizon is nearest the target.

        More voltage never leads less far, so the limits bracket it.
        """

        @cache
        def off(voltage: float) -> float:
            return self._ahead(voltage) - target

        # A voltage moves little in a step: most often this narrow bracket holds it.
        for low, high in (
            (max(0.0, self.voltage - 0.2), min(VOLTAGE_LIMIT, self.voltage + 0.2)),
            (0.0, VOLTAGE_LIMIT),
        ):
            if off(low) < 0.0 < off(high):
                return brentq(off, low, high, xtol=1e-6)  # type: ignore[return-value]
        return 0.0 if off(0.0) >= 0.0 else VOLTAGE_LIMIT
