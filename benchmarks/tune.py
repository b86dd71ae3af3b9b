"""Tunes the PIDs of `controllers/pid.py` on a model of the station and writes their gains.

For every task, controller and pressure of a small table:

1. Start: lambda tuning (Rivera et al. 1986) on the plant linearised in the middle of the stroke,
   k_p = tau / (g (lambda + delay)), k_i = k_p / tau, with g the static gain, tau the sum of the
   time constants that the motor voltage moves, lambda 2 control periods and delay half of one.
   Lead of the PID: 1 / (g k_i), which a ramp asks for; of the one with feed-forward: none.
2. Search: Nelder-Mead on the logarithms of k_p, k_i, k_d, the factor on them at the end of the
   range and, for the PID alone, the lead. The cost of gains is the mean over four stations - twice
   the nominal one, one with 20 % more force and 20 % less damping, one the other way round (on the
   cascade also with 10 % less and more displacement) - of what a whole trial with sensor noise at
   100 Hz costs, the noise another in each:

       mean over the phases of RMSE / target + 0.01 s/V * total variation of the voltage / duration

   with the RMSE of the true position at 384 Hz, targets 0.10 mm and 0.4 deg.
3. Margin: gains whose loop, linearised at three places of the stroke and in each direction of
   motion, has a largest sensitivity above 2 pay for it. At 2 the gain may be off by a factor of
   2 and the phase by 29 deg at least before the loop is unstable.

The same seed gives the same bytes on the same machine and versions.
"""

import hashlib
import json
import math
import platform
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, cast

import control
import numpy as np
from rich.progress import Progress
from scipy.optimize import minimize

from benchmarks.files import write_text
from benchmarks.processes import run_all
from controllers.controller import Reference
from controllers.gains import GAINS_FILE, SCHEMA, Gains, column_names
from controllers.inverse import inverse_of
from controllers.pid import PID, FeedforwardPID
from pma_gym.data.protocol import Protocol
from pma_gym.effects.effect import Value
from pma_gym.envs import PMAEnv, Station
from pma_gym.plant.linear import linearize
from pma_gym.plant.model import Model, dump_model, load_model
from pma_gym.plant.plant import Plant
from pma_gym.tasks import TASKS
from pma_gym.units import SI_FACTORS

PRESSURES_KPA = {
    "displacement": (150, 200, 250, 300, 400, 575),
    "rotation": (275, 350, 450, 575),
}
"""Pressures that gains are tuned at, by task; between them they are interpolated."""

CONTROLLERS = (PID.name, FeedforwardPID.name)
TARGETS = {"extension": 0.10 * SI_FACTORS["mm"], "rotation": 0.4 * SI_FACTORS["deg"]}
SENSORS = {"extension": "lvdt", "rotation": "potentiometer"}

CONTROL_RATE_HZ = 100.0
FILTER_S = 0.005

START_FACTOR = 0.3
"""Factor on the gains of the PID where the cable may go slack; see `Gains.scaled`. Set by hand: of
16 trials of phase III at each of 275, 500 and 575 kPa the worst fell from 0.41 to 0.29 deg."""
VARIATION_WEIGHT_S_PER_V = 0.01
HIGHEST_SENSITIVITY = 2.0
SENSITIVITY_WEIGHT = 10.0
UNSTABLE_COST = 1e3
EVALUATIONS = 100
SEARCH_WIDTH = 3.0
"""How far the search may leave its start, as the logarithm of a factor: 20 either way."""

STATIONS = ((1.0, 1.0), (1.0, 1.0), (1.2, 0.8), (0.8, 1.2))
"""Factors on the muscle's force and damping of the stations that a cost is averaged over."""

STROKES = (0.05, 0.5, 0.95)
"""Places of the stroke at which the margin is judged, as shares of it."""


@dataclass(frozen=True)
class Job:
    """One row of the table of gains.

    Attributes:
        model: model to tune on.
        task: `displacement` or `rotation`.
        controller: one of `CONTROLLERS`.
        pressure_kpa: gauge pressure (kPa).
        seed: seed of the sensors' noise on the nominal station; the others get the next ones.
    """

    model: Model
    task: str
    controller: str
    pressure_kpa: float
    seed: int

    @property
    def protocol(self) -> Protocol:
        """The task's protocol."""
        return TASKS[self.task].protocol

    @property
    def start_factor(self) -> float:
        """`START_FACTOR` for a PID that brings the cable back to slack, else 1."""
        slack = "cable" in self.model.parameters and self.protocol.quantity == "rotation"
        return START_FACTOR if slack and self.controller == PID.name else 1.0


def run_tune(out: Path = GAINS_FILE, seed: int = 0, model: str = "station", jobs: int = 2) -> bool:
    """Tune on a model and write the gains; those of other models in the file stay.

    Args:
        out: file of gains, replaced whole once all is computed.
        seed: seed of the sensors' noise.
        model: name of a shipped model or path of a TOML file.
        jobs: number of processes.
    Returns:
        Whether it was written: Ctrl-C leaves the file as it was.
    Raises:
        ModelError: no such model.
        ValueError: the file of gains is broken.
    """
    known, document = load_model(model), _read(out)
    rows = [
        Job(known, task, controller, pressure, seed)
        for task, pressures in PRESSURES_KPA.items()
        for controller in CONTROLLERS
        for pressure in pressures
        if _begins_at_zero(known, task, pressure)
    ]
    results = _all_tuned(rows, jobs)
    if len(results) < len(rows):
        return False
    document["models"][known.name] = _tables(rows, [results[i] for i in range(len(rows))])
    document["provenance"][known.name] = _provenance(known, seed)
    _write(out, document)
    return True


def _begins_at_zero(model: Model, task: str, pressure_kpa: float) -> bool:
    """Whether no voltage is no motion, so that the sensors' zero is that of the position.

    The cascade's map does not begin at zero at 150 kPa: sensors zeroed at rest then miss 0.6 mm,
    more than any gains could make good.
    """
    plant, quantity = Plant(model), TASKS[task].protocol.quantity
    rest = plant.settle(0.0, pressure=pressure_kpa * 1e3)
    truth = plant.observe(rest.state[None, :], rest.zero_contraction)
    return abs(float(truth[quantity][0])) <= TARGETS[quantity]


def _all_tuned(rows: list[Job], jobs: int) -> dict[int, tuple[Gains, float]]:
    """Gains and cost by the row's place; fewer than there are rows after Ctrl-C."""
    # Trials of rotation take three times as long: first, so that no process waits at the end.
    order = sorted(range(len(rows)), key=lambda i: rows[i].task != "rotation")
    Plant(rows[0].model)  # compiled here, once, so that the processes find it on disk
    results: dict[int, tuple[Gains, float]] = {}
    with Progress() as progress:
        bar = progress.add_task("Tuning", total=len(rows))

        def keep(index: int, result: object) -> None:
            if isinstance(result, BaseException):
                raise result
            results[order[index]] = cast("tuple[Gains, float]", result)
            progress.update(bar, advance=1)

        run_all([partial(tuned, rows[i]) for i in order], jobs, keep)
    return results


def tuned(job: Job) -> tuple[Gains, float]:
    """Best gains (SI) of a job, to four digits, and their cost."""
    cost = Cost(job)
    start = np.log(lambda_tuning(job))

    def objective(logarithms: np.ndarray) -> float:
        return cost(gains_from(logarithms, job.start_factor))

    simplex = np.vstack([start, start + 0.4 * np.eye(len(start))])
    found = minimize(
        objective,
        start,
        method="Nelder-Mead",
        bounds=[(value - SEARCH_WIDTH, value + SEARCH_WIDTH) for value in start],
        options={"maxfev": EVALUATIONS, "initial_simplex": simplex, "xatol": 0.02, "fatol": 1e-3},
    )
    gains = gains_from(found.x, job.start_factor)
    return gains, cost(gains)


def gains_from(logarithms: np.ndarray, start_factor: float = 1.0) -> Gains:
    """Gains (SI), to four digits, from logarithms: k_p, k_i, k_d, end factor, lead or none."""
    proportional, integral, derivative, end, *lead = (_rounded(v) for v in np.exp(logarithms))
    ahead = lead[0] if lead else 0.0
    return Gains(proportional, integral, derivative, FILTER_S, ahead, end, start_factor)


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")


class Loop:
    """The linearised loop of a job in discrete time, at several places of the stroke."""

    def __init__(self, job: Job) -> None:
        self.period = 1.0 / CONTROL_RATE_HZ
        places = _linearised(job)
        self.shares = [share for share, _ in places]
        self.plants = [self._sampled(job, system) for _, system in places]
        corners = np.linspace(0.0, math.pi, 301)[1:]
        self.z = np.exp(1j * corners)
        self.responses = [self._response(*plant) for plant in self.plants]

    def _sampled(self, job: Job, system: control.StateSpace) -> tuple[np.ndarray, ...]:
        """A, B, C of plant and sensor, the voltage held over each period."""
        quantity = job.protocol.quantity
        one = system[quantity, "motor_voltage"]
        sensor = job.model.parameters.get(SENSORS[quantity])
        if sensor is not None:
            one = control.tf([1.0], [1.0 / (2.0 * math.pi * sensor.bandwidth), 1.0]) * one
        held: Any = control.ss(control.sample_system(one, self.period, method="zoh"))
        return np.asarray(held.A), np.asarray(held.B), np.asarray(held.C)

    def _response(self, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
        inverse = np.linalg.inv(self.z[:, None, None] * np.eye(len(a)) - a)
        return (c @ inverse @ b)[:, 0, 0]

    def _controller(self, gains: Gains) -> tuple[np.ndarray, ...]:
        """A, B, C, D of the PID as `controllers.pid` computes it."""
        total = gains.filter + self.period
        share, slope = gains.filter / total, gains.derivative / total
        a, c = np.diag([1.0, share]), np.ones((1, 2))
        b = np.array([[gains.integral * self.period], [(share - 1.0) * slope]])
        return a, b, c, np.array([[gains.proportional + slope]])

    def sensitivity(self, gains: Gains) -> float:
        """Largest sensitivity |1 / (1 + C G)| over all places; infinite if one is unstable."""
        largest = 0.0
        for share, plant, response in zip(self.shares, self.plants, self.responses, strict=True):
            pa, pb, pc = plant
            a, b, c, d = self._controller(gains.scaled(share))
            closed = np.block([[pa - pb @ d @ pc, pb @ c], [-b @ pc, a]])
            if np.abs(np.linalg.eigvals(closed)).max() >= 1.0:
                return math.inf
            own = (c[0] * b[:, 0] / (self.z[:, None] - np.diag(a))).sum(axis=1) + d[0, 0]
            largest = max(largest, float(np.abs(1.0 / (1.0 + own * response)).max()))
        return largest


def _linearised(
    job: Job, shares: Iterable[float] = STROKES
) -> list[tuple[float, control.StateSpace]]:
    """The plant at places of the stroke (shares of it), in the task's directions of motion."""
    plant, pressure = Plant(job.model), job.pressure_kpa * 1e3
    zero = plant.settle(0.0, pressure=pressure).zero_contraction
    stroke = job.protocol.span
    directions = ["relaxing"]
    if job.protocol.quantity == "rotation":
        parameters = job.model.parameters
        stroke *= parameters["rotor" if "rotor" in parameters else "servo"].radius
        directions.append("contracting")
    systems = []
    for share in shares:
        for direction in directions:
            try:
                system = linearize(plant, pressure, zero - share * stroke, direction)
            except ValueError:
                continue  # no voltage reaches that far at this pressure
            systems.append((share, system))
    return systems


def lambda_tuning(job: Job) -> np.ndarray:
    """k_p, k_i, k_d (SI), end factor and, for the PID alone, lead (s) to start from."""
    ((_, system), *_) = _linearised(job, [0.5])
    one = system[job.protocol.quantity, "motor_voltage"]
    period = 1.0 / CONTROL_RATE_HZ
    gain = float(np.real(one.dcgain()))
    # Area between the step response and its end over the gain: the sum of all time constants.
    high, low = (float(np.real(one(s))) for s in (1e-4, -1e-4))
    lag = max((low - high) / 2e-4 / gain, period)
    integral = 1.0 / (gain * (2.0 * period + 0.5 * period))
    lead = [1.0 / (gain * integral)] if job.controller == PID.name else []
    return np.array([lag * integral, integral, 0.5 * lag * integral * period, 1.0, *lead])


class Cost:
    """What gains cost; see the module."""

    def __init__(self, job: Job) -> None:
        self.job = job
        self.loop = Loop(job)
        self.environments = [_environment(job, *factors) for factors in STATIONS]
        self.trials = [_Trial(job, env, job.seed + i) for i, env in enumerate(self.environments)]

    def __call__(self, gains: Gains) -> float:
        """Cost of gains (SI)."""
        sensitivity = self.loop.sensitivity(gains)
        if math.isinf(sensitivity):
            return UNSTABLE_COST
        excess = max(0.0, sensitivity - HIGHEST_SENSITIVITY)
        trials = [trial.cost(gains) for trial in self.trials]
        return float(np.mean(trials)) + SENSITIVITY_WEIGHT * excess


class _Trial:
    """A trial on one station, its feed-forward computed once."""

    def __init__(self, job: Job, env: PMAEnv, seed: int) -> None:
        self.job, self.env, self.seed = job, env, seed
        env.reset(seed=seed)
        self.station = replace(env.station, model=job.model)
        steps = env.task.steps(CONTROL_RATE_HZ)
        self.open_loop = _OpenLoop(inverse_of(job.model)(env.reference, self.station, steps))

    def _controller(self, gains: Gains) -> PID:
        if self.job.controller == FeedforwardPID.name:
            return FeedforwardPID(gains, self.open_loop)
        return PID(gains)

    def cost(self, gains: Gains) -> float:
        """Cost of a whole trial; that of an unstable loop if a limit of the rig ends it."""
        env, controller = self.env, self._controller(gains)
        env.reset(seed=self.seed)
        controller.reset(env.reference, self.station)
        ended, info = False, dict[str, Any]()
        while not ended:
            _, _, broken, ended, info = env.step(env.action(controller.act(env.reading, env.time)))
            if broken:
                return UNSTABLE_COST
        by_phase = info.get("rmse_by_phase_mm") or info["rmse_by_phase_deg"]
        target = TARGETS[self.job.protocol.quantity] / SI_FACTORS[self.job.protocol.unit]
        variation = float(np.abs(np.diff(env.motor_voltages)).sum()) / env.time
        return float(np.mean(list(by_phase.values()))) / target + (
            VARIATION_WEIGHT_S_PER_V * variation
        )


class _OpenLoop:
    """A feed-forward computed before."""

    def __init__(self, volts: np.ndarray) -> None:
        self.volts = volts

    def reset(self, reference: Reference, station: Station) -> None:
        """Nothing to compute."""

    def voltage(self, time: float) -> float:
        """Voltage (V) of the period at a time (s)."""
        return float(self.volts[min(round(time * CONTROL_RATE_HZ), len(self.volts) - 1)])


def _environment(job: Job, force: float, damping: float) -> PMAEnv:
    """The task on a station whose muscle's force and damping are scaled."""
    # The cascade's map is what its muscle's force is to the station; 20 % would leave its reach.
    by_port = {"muscle_force": force, "muscle_damping": damping, "position_map": force**-0.5}
    values = {}
    for name, effect in job.model.effects.items():
        factor = by_port.get(effect.port, 1.0)
        stems = effect.names_at_the_door()
        for door, value in job.model.at_the_door(name).items():
            unit = effect.quantities[stems[door]].unit
            # Forces and displacements by volts; not lengths, steepness and breakpoints.
            if factor != 1.0 and (unit.startswith("N") or unit in ("m", "m/V", "m/V^2")):
                values[f"{name}.{door}"] = _times(value, factor)
    return PMAEnv(
        job.task,
        model=job.model.replace(values),
        pressure_kpa=job.pressure_kpa,
        control_rate_hz=CONTROL_RATE_HZ,
    )


def _times(value: Value, factor: float) -> Value:
    return tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value


def _tables(jobs: list[Job], results: list[tuple[Gains, float]]) -> dict[str, Any]:
    """Gains at the door by task and controller."""
    tables: dict[str, Any] = {}
    for job, (gains, cost) in zip(jobs, results, strict=True):
        table = tables.setdefault(job.task, {}).setdefault(job.controller, {})
        columns = column_names(job.protocol.unit)
        row = {"pressure_kpa": job.pressure_kpa} | {
            name: float(f"{getattr(gains, field) / factor:.4g}")
            for field, (name, factor) in columns.items()
        }
        row["cost"] = round(cost, 4)
        for name, value in row.items():
            table.setdefault(name, []).append(value)
    return tables


def _provenance(model: Model, seed: int) -> dict[str, Any]:
    return {
        "written_by": "benchmarks/tune.py",
        "model_sha256": hashlib.sha256(dump_model(model).encode()).hexdigest(),
        "seed": seed,
        "control_rate_hz": CONTROL_RATE_HZ,
        "versions": {
            "python": platform.python_version(),
        }
        | {name: version(name) for name in ("numpy", "scipy", "numba")},
    }


def _read(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {"schema": SCHEMA, "provenance": {}, "models": {}}
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if document["schema"] == SCHEMA:
            return document
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(
            f"{path} is no file of gains ({error!r}); delete it or name another"
        ) from error
    raise ValueError(f"{path} must have schema {SCHEMA}; delete it or name another")


def _write(path: Path, document: dict[str, Any]) -> None:
    ordered = document | {k: dict(sorted(document[k].items())) for k in ("provenance", "models")}
    write_text(path, json.dumps(ordered, indent=2) + "\n")
