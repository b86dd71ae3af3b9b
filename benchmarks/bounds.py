"""Least tracking error that any controller can reach, even with full knowledge; kept for pages.

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

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.executors.executor import Executor, run_all
from benchmarks.files import write_text
from benchmarks.runner.fingerprint import code_digest_with
from controllers.models.nominal_motion import nominal_motion
from controllers.oracle import Oracle
from pma_gym.documents import read_json
from pma_gym.envs import PMAEnv, StationInfo
from pma_gym.metrics import SAMPLE_RATE_HZ
from pma_gym.plant.model import Model, dump_model, load_model
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
        yield _open_loop_position(plant, station, needed)


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


VOLTAGE_LIMIT = 10.0
"""Largest motor voltage (V)."""


def _open_loop_position(
    plant: Plant, station: StationInfo, volts: NDArray[np.float64]
) -> NDArray[np.float64]:
    """True position of a trial without feedback or noise that begins settled with no load.

    Args:
        plant: the plant.
        station: task, pressure and control period.
        volts: motor voltage of every control period (V), shape (steps,), cut off at 0 and 10 V.
    Returns:
        Extension (m) or rotation (rad) at k / 384 s to the last scored sample, shape (samples,).
    """
    period, steps = station.period, len(volts)
    controlled = period * np.arange(steps + 1)
    sampled = np.arange(round(station.task.duration * SAMPLE_RATE_HZ) + 1) / SAMPLE_RATE_HZ
    # Where a command and a sample fall together but for rounding, the command's time is taken.
    near = np.abs(sampled - period * np.round(sampled / period)) < 1e-9
    sampled = np.where(near, period * np.round(sampled / period), sampled)
    time = np.union1d(controlled, sampled)
    row = np.minimum(np.searchsorted(controlled, time, side="right") - 1, steps - 1)
    motor = np.clip(volts, 0.0, VOLTAGE_LIMIT)[row]
    regulator = np.full(len(time), plant.regulator_voltage(station.pressure))
    rest = plant.settle(0.0, pressure=station.pressure)
    states, zero = plant.run(time, motor, regulator, "zoh", rest)
    kept = np.searchsorted(time, sampled)
    return plant.observe(states[kept], zero)[station.task.schedule.quantity].copy()


BOUNDS = "bounds.json"
"""File of the bounds that are known, in the page's folder."""

Trial = tuple[str, float]
"""Task and pressure (kPa)."""

Compute = Callable[[str, str, float], float]


def least_return_error(model: str, task: str, pressure_kpa: float) -> float:
    """The achievable bound of phase III (mm or deg)."""
    return achievable_bound(model, task, pressure_kpa)["III"]


class Bounds:
    """Achievable bounds of phase III on a model; each is computed once.

    One takes seconds: the oracle has to drive the trial. What a folder keeps counts only if it was
    made with this code and model.

    Args:
        model: shipped name, or path of a TOML file.
        folder: where bounds are kept; nowhere if None.
        compute: the bound of a model, task and pressure (kPa).
    """

    def __init__(
        self, model: str, folder: Path | None = None, compute: Compute = least_return_error
    ) -> None:
        self._model, self._compute = model, compute
        self._path = None if folder is None else folder / BOUNDS
        self._key = _key(model) if self._path else ""
        self._known = self._read()

    def __call__(self, task: str, pressure_kpa: float) -> float:
        """The bound (mm or deg) of a task at a pressure (kPa)."""
        trial = task, pressure_kpa
        if trial not in self._known:
            self._known[trial] = self._compute(self._model, *trial)
            self._write()
        return self._known[trial]

    def compute(self, trials: Iterable[Trial], executor: Executor) -> tuple[dict[Trial, str], bool]:
        """Compute bounds on an executor; each is kept as it is done.

        Args:
            trials: task and pressure (kPa) of each.
            executor: where.
        Returns:
            Why those that failed have no bound, and whether all was run: Ctrl-C ends it.
        """
        missing = [trial for trial in trials if trial not in self._known]
        failures: dict[Trial, str] = {}

        def keep(index: int, result: object) -> None:
            trial = missing[index]
            if isinstance(result, BaseException):
                failures[trial] = f"{type(result).__name__}: {result}"
            else:
                assert isinstance(result, float)
                self._known[trial] = result
                self._write()

        works = [partial(self._compute, self._model, *trial) for trial in missing]
        return failures, run_all(works, executor, keep)

    def known(self, task: str, pressure_kpa: float) -> float | None:
        """The bound (mm or deg) of a task at a pressure (kPa), if it is there."""
        return self._known.get((task, pressure_kpa))

    def _read(self) -> dict[Trial, float]:
        """What the folder keeps; nothing if it is damaged or was made with something else."""
        if self._path is None:
            return {}
        try:
            document = read_json(self._path, own=True)
            rows = document["bounds"] if document["key"] == self._key else []
            return {(str(task), float(kpa)): float(least) for task, kpa, least in rows}
        except (OSError, ValueError, KeyError, TypeError):
            return {}

    def _write(self) -> None:
        if self._path is None:
            return
        rows = [[task, kpa, least] for (task, kpa), least in sorted(self._known.items())]
        write_text(self._path, json.dumps({"key": self._key, "bounds": rows}, indent=1) + "\n")


def _key(model: str) -> str:
    """Digest of what a bound depends on: code and model."""
    text = code_digest_with([Path(__file__)]) + dump_model(load_model(model))
    return hashlib.sha256(text.encode()).hexdigest()[:16]
