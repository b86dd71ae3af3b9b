"""Model predictive control of an exercise: of the joint's angle, or of the moment at it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers.design.quadratic_program import BoundedProgram
from controllers.exercise.leg_observer import (
    Horizon,
    Joint,
    LegObserver,
    PressureObserver,
    ProcessNoise,
    Program,
    leg_of,
    programmed,
)
from controllers.exercise.resistance import Resistance, exercise_of, pressures_of, volts_of
from controllers.registry import Reference
from pma_gym.envs import Measurement, StationInfo
from pma_gym.tasks.exercise import PACE

Array = NDArray[np.float64]

STRIDE_S = 0.01
"""Time from one predicted instant to the next (s), or a control step where that is longer."""


class Settings(NamedTuple):
    """Settings of the MPC.

    Attributes:
        effort: rho, weight of a change of the command by 1 N m beside the mean square of the errors
            (rad^2 or N^2 m^2).
        expected: share of what the operator is expected to give later, 1.
        horizon: how far it looks ahead (s), beyond the delays.
        process_noise: what the observers take for unknown.
    """

    effort: float
    expected: float = 1.0
    horizon: float = 0.5
    process_noise: ProcessNoise = ProcessNoise()


ANGLE, MOMENT = Settings(effort=1e-4), Settings(effort=3e-3)
"""Settings where the speed is prescribed, and where a moment is."""


class ExerciseMPC:
    """Predicts the joint and chooses the pressures that it will need.

    From what the observers (`controllers.exercise.leg_observer`) make of the last reading, with the
    commands on their way, it foresees the errors e of the coming half second, linear in the
    commands v (`controllers.exercise.leg_observer`), and chooses

        min  |e|^2 / n + rho * sum over i of (v_i - v_(i-1))^2,   0 <= V <= 10 V

    commanding the first of them. e is the angle less the reference, or the moment less the one that
    is prescribed at the angle predicted. The commands are counted as the moment that they come to
    in the end, h (P_c + g - P), so that rho is the same at every angle and pressure. The nominal
    device is taken as it is at the present pressure and angle: h and its stiffness k are those of
    `Resistance`. What it is off does not matter, for deviations start at the load cell's moment;
    what the regulator is off, g, is observed. Hysteresis is left to the load cell.

    The operator is expected to keep the pace as a typical one of the task's people does
    (`expected_moment`); what he gives beyond is observed, and its slope, fading.

    The commands are held between the times of `MOVES`. If what minimises without limits keeps them,
    it is the answer; else OSQP searches (`controllers.design.quadratic_program`). The environment's
    safety layer is not in the model. What it holds back is seen in the pressure, and the bound on g
    keeps the observer from taking it for more.

    Mean RMSE by phase of 16 operators of seeds from 1000000 on, nominal station, by which settings
    were tried. All figures here were measured behind an earlier, looser safety layer of the
    exercises of a moment; behind the one of now their errors are larger (`docs/exercise.md`):

        =============================  ================  =================
        .                              isokinetic (deg)  isotonic (N m)
        =============================  ================  =================
        as it is                       3.55, 0.36, 1.83  0.084, .023, .074
        limits left to the regulator   3.55, 0.36, 1.82  0.085, .023, .074
        nothing expected of operators  3.57, 0.40, 1.93  0.099, .023, .090
        g without its bound            3.75, 0.58, 1.92  0.106, .023, .094
        =============================  ================  =================

    So a linear-quadratic feedback whose voltage is cut off would do as well: the limits are reached
    in 7 of 1501 control steps of a trial. g is worth nothing on the nominal station; on drawn ones
    the isotonic errors are 0.14, 0.09 and 0.14 N m with it and 0.18, 0.14 and 0.16 without.

    What is left of the errors is the safety layer's, which lets the pressure change slowly only: of
    the profile, on the same operators, 0.07, 0.07 and 0.27 N m with it and 0.02 in every phase
    without (nominal station). What the layer lets through as limits of the commands, by the numbers
    of now and the typical speed later, gained nothing: 0.09, 0.07 and 0.31 N m.

    Args:
        settings: in place of `ANGLE` or `MOMENT`.

    Attributes:
        settings: in use since `reset`.
        program: the quadratic program, which counts how often limits mattered.

    Source:
        J. B. Rawlings, D. Q. Mayne and M. M. Diehl 2017, "Model predictive control", chapter 1.
        Settings were found by trying few values, on few operators.
    """

    name = "exercise_mpc"
    kinds = ("isokinetic", "moment")

    def __init__(self, settings: Settings | None = None) -> None:
        self._fixed_settings = settings

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Begin at rest, at the trial's first pressure.

        Raises:
            ImportError: osqp is not installed; says how to install it.
            ValueError: the task is no exercise.
        """
        self._prescription = exercise_of(self.name, station).prescription
        self.settings = self._fixed_settings or (ANGLE if self._prescription is None else MOMENT)
        self._station, self._device, self._volts = station, Resistance(station), volts_of(station)
        self._leg = LegObserver(station, self.settings.process_noise)
        self._regulator = PressureObserver(station, self.settings.process_noise)
        self._limits = np.array(pressures_of(station))
        self._horizon = _horizon(station, self.settings.horizon)
        self._joint = _joint(station, self.settings.process_noise.fade)
        self._old = round(station.observation_delay / station.period)
        self._foretell(reference)
        # In force before the coming reading, then what is on its way.
        self._sent = [station.pressure] * (self._horizon.late + 1)
        self._chosen = station.pressure
        self.program = BoundedProgram(len(self._horizon.edges) - 1)

    def _foretell(self, reference: Reference) -> None:
        """What is wanted and expected in every control step of the trial, and a horizon more."""
        station, stride = self._station, self._horizon.stride
        steps = round(PACE.duration / station.period) + stride * (self._horizon.ahead + 2)
        times = station.period * np.arange(steps, dtype=np.float64)
        self._expected = self.settings.expected * expected_moment(station, self._device, times)
        if self._prescription is None:
            self._targets = np.array([reference(time) for time in times.tolist()])
        else:
            angles = self._prescription.angles
            self._knots = angles, [self._prescription.at(angle) for angle in angles]

    def act(self, measurement: Measurement, time: float) -> float:
        """Regulator voltage (V)."""
        self._leg.update(measurement)
        self._regulator.update(measurement.pressure, self._sent.pop(0))
        now = max(round(time / self._station.period) - self._old, 0)
        self._chosen = self._best(self._station.moment(measurement), now)
        self._sent.append(self._chosen)
        return self._volts(self._chosen)

    def _best(self, moment: float, now: int) -> float:
        """Pressure (Pa) to command, by the moment at the joint (N m) at a control step."""
        angle, pressure = float(self._leg.state[0]), self._regulator.pressure
        local = self._device.at(pressure, angle)
        # Where a command would change nothing in the end.
        still = pressure - self._regulator.offset
        program = self._programmed(local.stiffness, pressure)
        past = local.influence * (np.array(self._sent) - still)
        linear = program.pull @ self._errors(program, past, moment, now)
        linear[0] -= self.settings.effort * local.influence * (self._chosen - still)
        low, high = (local.influence * (limit - still) for limit in self._limits)
        size = np.ones(len(linear))
        plan = self.program.solve(program.square, linear, low * size, high * size)
        return self._chosen if plan is None else still + float(plan[0]) / local.influence

    def _errors(self, program: Program, past: Array, moment: float, now: int) -> Array:
        """Errors that the commands on their way will leave at the predicted times (rad or N m)."""
        angle, speed, operator, slope, _ = self._leg.state.tolist()
        stride = self._horizon.stride
        state = np.array([0.0, speed, 0.0, operator - moment, slope, speed])
        last = now + stride * self._horizon.ahead
        drift = self._expected[now:last:stride] - self._expected[now]
        predicted = program.state @ state + program.drift @ drift + program.past @ past
        angles = angle + predicted[0]
        if self._prescription is None:
            return angles - self._targets[now + stride : last + 1 : stride]
        return moment + predicted[1] - np.interp(angles, *self._knots)

    def _programmed(self, stiffness: float, pressure: float) -> Program:
        """The program of a stiffness (N m/rad) and a pressure (Pa), rounded: it is kept."""
        parameters, muscle = self._station.model.parameters, 0.0
        damping = parameters.get("symmetric_damping")
        if damping is not None:
            radius = parameters["rotor"].radius
            muscle = (damping.intercept + damping.slope * pressure) * radius**2
        joint = self._joint._replace(stiffness=float(round(stiffness)), muscle=round(muscle, 1))
        of_moment = self._prescription is not None
        return programmed(joint, of_moment, self.settings.effort, self._horizon)


def expected_moment(station: StationInfo, device: Resistance, times: Array) -> Array:
    """What a typical operator gives (N m) at times (s), but for how far he is from his intent.

        K theta_i(t - reaction) + plan(theta_i(t - reaction - rise))

    theta_i is the ideal angle and the plan the moment that the exercise takes, as
    `pma_gym.tasks.operator` has them.
    """
    exercise = station.task.exercise
    assert exercise is not None
    people, prescription = exercise.population.typical, exercise.prescription
    meant = PACE.reference(times - people.reaction)
    planned = PACE.reference(times - people.reaction - people.rise).tolist()
    if prescription is None:
        plan = [device.at(station.pressure, angle).moment for angle in planned]
    else:
        plan = [prescription.at(angle) for angle in planned]
    return people.stiffness * meant + np.array(plan)


def _horizon(station: StationInfo, length: float) -> Horizon:
    late = round((station.action_delay + station.observation_delay) / station.period)
    stride = max(1, round(STRIDE_S / station.period))
    ahead = max(4, round((length / station.period + late) / stride))
    return Horizon(station.period, stride, ahead, late)


def _joint(station: StationInfo, fade: float) -> Joint:
    exercise = station.task.exercise
    assert exercise is not None
    return Joint(
        *leg_of(station),
        station.model.parameters["regulator_lag"].time_constant,
        fade,
        exercise.population.typical.stiffness,
    )
