"""The linearised loop of a row: where its gains start from, and how large its sensitivity is.

Rows of the table of gains: what each is tuned for, and those that are finished.
"""

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import control
import numpy as np
from scipy.optimize import root_scalar

from benchmarks.files import say_damaged, write_text
from benchmarks.runner.provenance import ROOT, git_state
from controllers.design.designs import Gains, loop_name, task_kind
from controllers.models.voltage import nominal_offset
from controllers.pid import PID, linear_law
from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial_schedule import TrialSchedule
from pma_gym.document_shape import ListOf, Real, check_shape
from pma_gym.documents import read_json
from pma_gym.engine.nominal_rig import motor_at_rest
from pma_gym.envs import StationInfo
from pma_gym.plant.forms.linear import linearize_at, operating_point
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.plant.statics import Condition
from pma_gym.tasks import EVERY_TASK, Actuator

START_FACTOR = 0.3
"""Factor on the gains of the PID where the cable may go slack; see `Gains.scaled`. Set by hand: of
16 trials of phase III at each of 275, 500 and 575 kPa the worst fell from 0.41 to 0.29 deg."""


@dataclass(frozen=True)
class Job:
    """One row of the table of gains.

    Attributes:
        model: model to tune on.
        task: name of the task that is tried.
        controller: one of `CONTROLLERS`.
        pressure_kpa: gauge pressure that trials begin at (kPa).
        seed: seed of the sensors' noise on the nominal station; the others get the next ones.
        rate_hz: control rate (Hz).
        delay_s: how late a command reaches the station (s), whole periods.
    """

    model: Model
    task: str
    controller: str
    pressure_kpa: float
    seed: int
    rate_hz: float = 100.0
    delay_s: float = 0.0

    @property
    def station(self) -> StationInfo:
        """The station info that a controller of the row receives."""
        task, pressure = EVERY_TASK[self.task], self.pressure_kpa * 1e3
        return StationInfo(self.model, task, pressure, 1.0 / self.rate_hz, self.delay_s)

    @property
    def loop(self) -> str:
        """Name of its loop, such as `50hz_delay20ms`."""
        return loop_name(self.station)

    @property
    def kind(self) -> str:
        """Kind of its task: the tables are of one kind each."""
        return task_kind(self.station)

    @property
    def schedule(self) -> TrialSchedule:
        """The task's schedule."""
        return EVERY_TASK[self.task].schedule

    @property
    def start_factor(self) -> float:
        """`START_FACTOR` for a PID that brings the cable back to slack, else 1."""
        slack = "cable" in self.model.parameters and self.schedule.followed.is_angle
        return START_FACTOR if slack and self.controller == PID.name else 1.0


class KeptRows:
    """Gains (SI) and cost by row; what an interrupted run left is there again.

    Args:
        out: the file of gains; the rows are kept beside it.
        made_with: what the rows depend on; rows made with something else are not taken.

    Attributes:
        path: file of the rows.
        rows: gains and cost by the row's name.
    """

    def __init__(self, out: Path, made_with: dict[str, Any]) -> None:
        self.path = out.with_name(f"{out.stem}.partial.json")
        # As JSON gives it back, so that the two can be compared.
        self.made_with = json.loads(json.dumps(made_with | {"commit": git_state(ROOT)["commit"]}))
        self.rows = self._read()

    def keep(self, row: Job, result: tuple[Gains, float]) -> None:
        """Add a row that is done, on disk too."""
        self.rows[name_of(row)] = result
        write_text(
            self.path, json.dumps({"made_with": self.made_with, "rows": self.rows}, indent=1) + "\n"
        )

    def forget(self) -> None:
        """Remove the file: the whole table is written."""
        self.path.unlink(missing_ok=True)

    def _read(self) -> dict[str, tuple[Gains, float]]:
        """The rows in the file; none if it is missing, broken or made with something else."""
        if not self.path.exists():
            return {}
        try:
            document = read_json(self.path, "journal_mib", own=True)
            check_shape(document, {"made_with": dict, "rows": dict})
        except ValueError as error:
            say_damaged(self.path, str(error))
            return {}
        if document["made_with"] != self.made_with:
            return {}
        rows, damaged = dict[str, tuple[Gains, float]](), list[str]()
        for name, row in document["rows"].items():
            try:
                check_shape(row, ListOf(object, 2), name)
                gains, cost = row
                check_shape([*gains, cost], ListOf(Real()), name)
                rows[name] = Gains._make(gains), float(cost)
            except (ValueError, TypeError) as error:
                damaged.append(str(error))
        if damaged:
            say_damaged(self.path, damaged[0], f"{len(damaged)} rows are computed anew")
        return rows


def name_of(row: Job) -> str:
    """Return a row's unique name: `100hz/rotation/pid/350`."""
    return f"{row.loop}/{row.task}/{row.controller}/{row.pressure_kpa:g}"


"""Sensor by what is followed."""

STROKES = (0.05, 0.5, 0.95)
"""Places of the stroke at which a loop is judged, as shares of it."""


class Place(NamedTuple):
    """The plant near rest at a place of the stroke.

    Attributes:
        share: the place, as a share of the task's range.
        direction: of motion, `relaxing` (the motor pulls) or `contracting`: damping differs.
        system: in continuous time, all voltages in and outputs out.
    """

    share: float
    direction: str
    system: control.StateSpace


def linearised(station: StationInfo, shares: Iterable[float] = STROKES) -> list[Place]:
    """The nominal plant at places of the stroke, in the task's directions of motion.

    Places that no voltage holds are left out.
    """
    plant, task = Plant(station.model), station.task
    moved_by_motor = task.actuator == "motor"
    # Of the dissertation's displacement only the way out is asked for.
    both = ("relaxing", "contracting") if not task.schedule.followed.lengthens else ("relaxing",)
    places = []
    for share in shares:
        try:
            rest, commands = (_pulled if moved_by_motor else _contracted)(plant, station, share)
        except ValueError:
            continue
        for direction in both:
            places.append(Place(share, direction, linearize_at(plant, rest, commands, direction)))
    return places


def _pulled(
    plant: Plant, station: StationInfo, share: float
) -> tuple[Condition, tuple[float, float]]:
    """The plant held by the motor at a share of the stroke, at the trial's pressure."""
    schedule, parameters = station.task.schedule, station.model.parameters
    stroke = share * schedule.span
    if schedule.followed.is_angle:
        stroke *= parameters["rotor" if "rotor" in parameters else "servo"].radius
    zero = plant.settle(0.0, pressure=station.pressure).zero_contraction
    return operating_point(plant, station.pressure, zero - stroke)


def _contracted(
    plant: Plant, station: StationInfo, share: float
) -> tuple[Condition, tuple[float, float]]:
    """The plant contracted by the regulator by a share of the stroke, under the task's load.

    Raises:
        ValueError: no voltage of 0-10 V does.
    """
    motor, first = motor_at_rest(station.model, station.task), nominal_offset(station)
    at = plant.states.index("contraction")

    def contraction(voltage: float) -> float:
        return float(plant.settle(motor, regulator_voltage=voltage).state[at])

    target = contraction(first) + share * station.task.schedule.span

    def off(voltage: float) -> float:
        return contraction(voltage) - target

    voltage = float(root_scalar(off, method="brentq", bracket=(first, 10.0), xtol=1e-9).root)
    return plant.settle(motor, regulator_voltage=voltage), (motor, voltage)


def sampled(
    place: Place, station: StationInfo, actuator: Actuator | None = None
) -> control.StateSpace:
    """Measured position (m or rad) by an actuator's voltage (V) in discrete time, delays in it.

    The voltage is held over each period; the sensor's lag and the station's delays of actions and
    readings are part of the plant.

    Args:
        place: the plant there.
        station: its task, sensors, period and delays.
        actuator: whose voltage; the task's if None.
    """
    quantity = station.task.schedule.quantity
    one: Any = place.system[quantity, f"{actuator or station.task.actuator}_voltage"]
    sensor = station.model.parameters.get(SIGNALS[quantity].sensor)
    if sensor is not None:
        one = control.tf([1.0], [1.0 / (2.0 * math.pi * sensor.bandwidth), 1.0]) * one
    discrete: Any = control.ss(control.sample_system(one, station.period, method="zoh"))
    steps = round((station.action_delay + station.observation_delay) / station.period)
    if steps:
        # In a chain of states: a fraction with 1 / z^n is ill-conditioned.
        return discrete * _late(steps, station.period)
    return discrete


def _late(steps: int, period: float) -> Any:  # noqa: ANN401
    """A delay of whole periods."""
    return control.ss(np.eye(steps, k=-1), np.eye(steps)[:, :1], np.eye(steps)[-1:], 0.0, period)


class Loop:
    """The linearised loop of a job in discrete time, at several places of the stroke."""

    def __init__(self, job: Job) -> None:
        station = job.station
        self.period = station.period
        places = linearised(station)
        systems = [sampled(place, station) for place in places]
        self.shares = [place.share for place in places]
        self.plants = [tuple(map(np.asarray, (s.A, s.B, s.C))) for s in systems]
        self.z = np.exp(1j * np.linspace(0.0, math.pi, 301)[1:])
        self.responses = [self._response(*plant) for plant in self.plants]

    def _response(self, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
        return (c @ np.linalg.inv(self.z[:, None, None] * np.eye(len(a)) - a) @ b)[:, 0, 0]

    def sensitivity(self, gains: Gains) -> float:
        """Largest sensitivity |1 / (1 + C G)| over all places; infinite if one is unstable."""
        largest = 0.0
        for share, plant, response in zip(self.shares, self.plants, self.responses, strict=True):
            pa, pb, pc = plant
            a, b, c, d = linear_law(gains.scaled(share), self.period)
            closed = np.block([[pa - pb @ d @ pc, pb @ c], [-b @ pc, a]])
            if np.abs(np.linalg.eigvals(closed)).max() >= 1.0:
                return math.inf
            own = (c[0] * b[:, 0] / (self.z[:, None] - np.diag(a))).sum(axis=1) + d[0, 0]
            largest = max(largest, float(np.abs(1.0 / (1.0 + own * response)).max()))
        return largest


def lambda_tuning(job: Job) -> np.ndarray:
    """Return starting values: k_p, k_i, k_d (SI), end factor and, for the PID, lead (s)."""
    station = job.station
    (place, *_) = linearised(station, [0.5])
    one = place.system[job.schedule.quantity, f"{station.task.actuator}_voltage"]
    period, delay = station.period, station.action_delay
    gain = float(np.real(one.dcgain()))
    # Area between the step response and its end over the gain: the sum of all time constants.
    high, low = (float(np.real(one(s))) for s in (1e-4, -1e-4))
    lag = max((low - high) / 2e-4 / gain, period)
    integral = 1.0 / (gain * (2.0 * period + delay + 0.5 * period + delay))
    ahead = 0.5 * period
    if station.task.actuator == "regulator":
        # Its lag is about the muscle's. The derivative makes up for one of the two, half filtered.
        integral, ahead = 0.5 * integral, 0.25 * lag
    lead = [1.0 / (gain * integral)] if job.controller == PID.name else []
    return np.array([lag * integral, integral, ahead * lag * integral, 1.0, *lead])
