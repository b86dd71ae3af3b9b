"""Operating points of an exercise for linear laws: angle, pressure, moment, linear plant."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.engine.actions import HIGHEST_VOLTAGE
from pma_gym.engine.nominal_rig import nominal_model
from pma_gym.plant.exercise_device.device import own_device, resistive_moment
from pma_gym.plant.exercise_device.prescription import follow_from
from pma_gym.plant.forms.linear import linearize
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.plant.sensors import noise_levels
from pma_gym.tasks import EVERY_TASK
from pma_gym.units import SI_FACTORS

_DEG, _KPA = SI_FACTORS["deg"], SI_FACTORS["kPa"]

ANGLES_DEG = (30.0, 60.0, 85.0)
"""Angles of the points (deg)."""

PRESSURES_KPA = (300.0, 450.0, 575.0)
"""Gauge pressures (kPa) where an exercise holds the speed; else the prescription says them."""

PRESSURE_STEP = 1e3
"""Change of the pressure by which its effect on the moment is found (Pa)."""


SIZES = {"contraction": 1e-3, "velocity": 1e-2, "angle": 1e-2, "spin": 1e-1, "pressure": 1e4}
"""Units of the plant's states (SI) in which none is large or small: Riccati's equation needs it."""


@dataclass(frozen=True)
class Point:
    """A state of rest of an exercise.

    Attributes:
        task: name of the exercise.
        angle: of the joint (rad).
        pressure: gauge pressure (Pa).
        voltage: of the regulator that holds it (V).
        moment: at the joint (N m).
        contraction: of the muscle from its resting length (m).
        influence: change of the moment by the pressure at this angle (N m/Pa).
        slope: of the prescribed moment over the angle (N m/rad), 0 where the speed is held.
    """

    task: str
    angle: float
    pressure: float
    voltage: float
    moment: float
    contraction: float
    influence: float
    slope: float

    @property
    def paced(self) -> bool:
        """Whether the exercise holds the speed."""
        return EVERY_TASK[self.task].schedule.followed.is_angle

    @property
    def room(self) -> float:
        """The distance of the voltage from 0 and 10 V, the smaller one (V)."""
        return min(self.voltage, HIGHEST_VOLTAGE - self.voltage)


def points(task: str, model: Model) -> tuple[Point, ...]:
    """Points of an exercise: of every pressure, or on its prescription from its lowest start."""
    exercise = EVERY_TASK[task].exercise
    if exercise is None:
        raise ValueError(
            f"task must be an exercise, got {task}; take isokinetic_exercise, isotonic_exercise or "
            "profile_exercise"
        )
    angles = _DEG * np.array(ANGLES_DEG)
    if exercise.prescription is None:
        rests = [(_KPA * kpa, 0.0, np.full(len(angles), _KPA * kpa)) for kpa in PRESSURES_KPA]
    else:
        rest, held = EVERY_TASK[task].starts[0], exercise.start_moment
        wanted = np.array([exercise.prescription.at(angle) for angle in angles.tolist()])
        course = follow_from(model, own_device(model), angles, wanted, rest, held)
        rests = [(rest, held, course.pressure)]
    return tuple(
        _point(task, model, float(angle), float(at), rest, held)
        for rest, held, pressures in rests
        for angle, at in zip(angles, pressures, strict=True)
    )


def _point(
    task: str, model: Model, angle: float, pressure: float, rest: float, held: float
) -> Point:
    near = pressure + PRESSURE_STEP * np.array([0.0, -1.0, 1.0])
    given = resistive_moment(model, own_device(model), near, angle, rest, held)
    influence = float(given.moment[2] - given.moment[1]) / (2.0 * PRESSURE_STEP)
    exercise = EVERY_TASK[task].exercise
    assert exercise is not None
    slope, plan = 0.0, exercise.prescription
    if plan is not None:
        slope = (plan.at(angle + 1e-4) - plan.at(angle - 1e-4)) / 2e-4
    moment, contraction = float(given.moment[0]), float(given.contraction[0])
    line = model.parameters["regulator_line"]
    volts = (pressure - line.offset) / line.gain
    return Point(task, angle, pressure, volts, moment, contraction, influence, slope)


@dataclass(frozen=True)
class Rates:
    """The plant near a point, its states in `SIZES`: x' = A x + B (M, V), y = C x.

    Attributes:
        a: shape (n, n).
        by_moment: change of the rates by the operator's moment (1/(N m)), shape (n,).
        by_voltage: by the regulator's voltage (1/V), shape (n,).
        angle: row of the angle (deg).
        output: row of what the exercise holds (deg or N m).
        seen: rows of the sensors (SI), shape (4, n).
        noise: standard deviations of their readings (SI), shape (4,).
    """

    a: NDArray[np.float64]
    by_moment: NDArray[np.float64]
    by_voltage: NDArray[np.float64]
    angle: NDArray[np.float64]
    output: NDArray[np.float64]
    seen: NDArray[np.float64]
    noise: NDArray[np.float64]


def rates(point: Point, model: Model) -> Rates:
    """The nominal plant with a leg on its lever, linear near a point, friction sliding."""
    plant = Plant(nominal_model(EVERY_TASK[point.task], model))
    system = linearize(plant, point.pressure, point.contraction)
    radius, gain = model.parameters["rotor"].radius, model.parameters["drive"].gain
    sizes = np.array([SIZES[name] for name in system.state_labels])
    seen = dict(zip(system.output_labels, np.asarray(system.C) * sizes, strict=True))
    motor, regulator = (np.asarray(system.B) / sizes[:, None]).T
    angle = seen["rotation"] / _DEG
    excess = radius * seen["load"] - point.slope * seen["rotation"]
    output = angle if point.paced else excess
    a = np.asarray(system.A) * sizes / sizes[:, None]
    measured = np.stack([seen[name] for name in model.rig.outputs])
    noise = noise_levels(model)
    return Rates(a, motor / (radius * gain), regulator, angle, output, measured, noise)
