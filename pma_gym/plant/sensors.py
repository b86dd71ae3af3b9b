"""Measurements of the DAQ: lagged signals plus noise, through the calibrations, quantised."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from pma_gym.data import calibration
from pma_gym.data.calibration import Calibration
from pma_gym.data.signals import SIGNALS, Signal
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import BY_QUANTITY, VOLTAGE_RANGE, SampleError, TrialError
from pma_gym.effects.contact.imposed_motion import following_rate
from pma_gym.effects.effect import Effect, Parameters, signals
from pma_gym.effects.ports import MOUNT
from pma_gym.plant.imposed_motion import level_command, motion_command
from pma_gym.plant.model import Model
from pma_gym.plant.rigs.rig import TakenCommand
from pma_gym.units import SI_FACTORS

_ROUNDING = 1e-9
"""Tolerance (V) of a conversion at the ends of the range."""

_MENDS = {
    "load_command": "write newtons, or give the drive another gain",
    "pressure_command": "write gauge pressure in kPa: 1 bar is 100, 1 psi 6.895, 1000 Pa 1",
}
"""Fix for a command out of range, for messages."""

_NO_PUSH = (
    "a cable pulls and cannot push; write newtons of pull, or, for a drive on a rigid link that "
    "pushes too, take a model of plant = 'slide' with [two_way_drive]"
)
"""Fix for a load below 0, for messages."""

SENSORS: dict[str, Signal] = {
    signal.sensor: signal for signal in SIGNALS.values() if signal.sensor and signal.is_measured
}
"""Measured quantity of each sensor, keyed by the sensor's effect."""

DAQ_CHANNELS = 4
"""Smallest number of channels with drawn noise per row, so that a seed gives a sensor the same
noise in rigs with fewer sensors."""


def noise_levels(model: Model) -> np.ndarray:
    """Noise standard deviations of a rig's sensors (SI), ordered as its signals; 0 for no noise."""
    sensors = [model.parameters.get(signal.sensor) for signal in model.rig.signals]
    return np.array([getattr(sensor, "noise", 0.0) for sensor in sensors])


def resolutions(model: Model) -> np.ndarray:
    """Quantisation steps of a rig's signals (SI), in order; 0 where unknown."""
    return np.array([signal.resolution for signal in model.rig.signals])


def deviations(model: Model) -> np.ndarray:
    """Standard deviations of a rig's measurements (SI): sensor noise and the DAQ's quantisation.

    A signal without both has 1, because its sensor is not in the model.
    """
    known = np.hypot(noise_levels(model), resolutions(model) / np.sqrt(12.0))
    return np.where(known > 0.0, known, 1.0)


def read(
    signals: Sequence[Signal], lagged: np.ndarray, levels: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """Compute the measurements of sensors.

    Args:
        signals: the measured signals.
        lagged: sensor outputs before noise, shape (..., signals) (SI).
        levels: standard deviations, shape (signals,).
        normals: standard normal numbers, shape (..., signals).
    Returns:
        Measurements in SI; those of the DAQ are quantised to its steps and limited to its range.
    """
    noisy = [
        reading(lagged[..., i], levels[i], normals[..., i], signal.calibration)
        for i, signal in enumerate(signals)
    ]
    return np.stack(noisy, axis=-1)


def reading(lagged: Any, level: Any, normal: Any, line: Calibration | None) -> Any:  # noqa: ANN401
    """Compute one sensor's measurement from numbers, arrays or traced values.

    Args:
        lagged: sensor output before noise (SI).
        level: standard deviation of its noise (SI).
        normal: standard normal number.
        line: its calibration at the DAQ; None for a sensor without the DAQ.
    """
    noisy = lagged + level * normal
    if line is None:
        return noisy
    volts = noisy * line.gain + line.offset
    return (calibration.quantise(volts) - line.offset) * (1.0 / line.gain)


def mount_error(
    model: Model,
    parameters: Mapping[str, Parameters],
    output: str,
    truth: Any,  # noqa: ANN401
    memory: Callable[[Effect], Any],
) -> Any:  # noqa: ANN401
    """What the mount of an output's sensor adds to the true value (SI), a number or an array.

    Args:
        model: the model.
        parameters: of the effects at the mount (SI), by name.
        output: the output's name.
        truth: its value (SI), a number or an array.
        memory: of an effect that has one.
    """
    added = 0.0
    for each in model.effects.values():
        if each.port == f"{MOUNT}{output}" and each.law:
            known = {"signal": truth, "p": parameters[each.name]}
            known |= {"memory": memory(each)} if each.memory_names else {}
            added = added + each.law(*(known[name] for name in signals(each.law)))
    return added


def measure(
    model: Model, lagged: np.ndarray, generator: np.random.Generator | None
) -> dict[str, np.ndarray]:
    """Compute measurements by name, of shape (rows,) each.

    Args:
        model: the model with the sensors.
        lagged: sensor outputs before noise, shape (rows, signals) (SI).
        generator: source of the noise; None for neither noise nor quantisation.
    """
    readings, signals = lagged, model.rig.signals
    if generator is not None:
        channels = max(len(signals), DAQ_CHANNELS)
        normals = generator.standard_normal((len(lagged), channels))[:, : len(signals)]
        readings = read(signals, lagged, noise_levels(model), normals)
    return {signal.name: readings[:, i] for i, signal in enumerate(signals)}


def voltages(model: Model, trial: Trial) -> tuple[np.ndarray, np.ndarray]:
    """Return a trial's motor and regulator voltages, converted from loads and pressures if needed.

    Raises:
        TrialError: a command is missing, or is outside the range of 0-10 V; a `SampleError` if it
            concerns one sample.
    """
    if model.rig.imposes_motion:
        return _imposed(model, trial)
    if model.rig.commands:
        return _slots(model, trial)
    direct = direct_command(model)
    if direct:
        return _direct(trial, direct), np.zeros(len(trial.time))
    line, two_way = (model.parameters.get(each) for each in ("regulator_line", "two_way_drive"))
    drive, least = model.parameters.get("drive"), 0.0
    if two_way is not None:
        drive, least = two_way, -np.inf
    motor = _voltage(trial, "motor_voltage", "load_command", drive, least)
    if not model.rig.has_muscle:
        return motor, np.zeros(len(motor))
    return motor, _voltage(trial, "regulator_voltage", "pressure_command", line)


def active_commands(model: Model) -> tuple[TakenCommand | None, TakenCommand | None]:
    """Commands that a model's effects take, for the motor's and the regulator's place."""
    active = {each.slot: each for each in model.rig.commands if each.effect in model.parameters}
    return active.get(0), active.get(1)


def _slots(model: Model, trial: Trial) -> tuple[np.ndarray, np.ndarray]:
    """Commands in their places; zeros where no effect takes one."""
    first, second = (
        np.zeros(len(trial.time))
        if command is None
        else _voltage(
            *(trial, command.name, command.wish, model.parameters[command.effect]),
            -np.inf if command.is_signed else 0.0,
        )
        if command.wish
        else _direct(trial, command.name)
        for command in active_commands(model)
    )
    return first, second


def direct_command(model: Model) -> str:
    """Command in SI that a model's drive takes directly; "" if it takes a voltage."""
    commands = model.rig.direct_commands.items()
    return next((command for drive, command in commands if drive in model.parameters), "")


def quantities(model: Model) -> frozenset[str]:
    """What trials of a model's rig hold: its signals, and commands of its drive and regulator."""
    if model.rig.commands:
        active = (each for each in active_commands(model) if each)
        names = {name for each in active for name in (each.name, each.wish) if name}
        return frozenset(names.union(model.rig.outputs))
    direct = direct_command(model)
    commands = {direct} if direct else {"motor_voltage", "load_command"}
    if model.rig.has_muscle:
        commands |= {"regulator_voltage", "pressure_command"}
    return frozenset(commands.union(model.rig.outputs))


def imposed_record(model: Model, trial: Trial) -> np.ndarray:
    """Positions that an imposed motion is asked for (m), or that were measured of it.

    Raises:
        TrialError: without any, and with too few rows for the motion's bandwidth.
    """
    (name,) = model.rig.direct_commands.values()
    positions = _commanded(trial, name)
    if positions is None:
        raise TrialError(
            f"the trial has no motion: give {BY_QUANTITY[name].name}, the position that the drive "
            "was asked for or that was measured, by [columns] if the log has another name for it"
        )
    _check_bandwidth(trial, model.parameters["imposed_motion"].bandwidth)
    return positions


def _imposed(model: Model, trial: Trial) -> tuple[np.ndarray, np.ndarray]:
    """Positions that are asked for (m), and regulator voltage (V) or, without a line, pressure.

    A motion or pressure that was measured and not commanded is the command; no pressure is none.
    """
    drive = model.parameters["imposed_motion"]
    smooth = drive.bandwidth, following_rate(drive)
    motion = motion_command(trial.time, imposed_record(model, trial), *smooth)
    line = model.parameters.get("regulator_line")
    if line is not None:
        return motion, _voltage(trial, "regulator_voltage", "pressure_command", line)
    pressure = _commanded(trial, "pressure_command")
    if pressure is None:
        return motion, np.zeros(len(motion))
    return motion, level_command(trial.time, pressure, *smooth)


def _check_bandwidth(trial: Trial, bandwidth: float) -> None:
    """Refuse a record with too few rows for the bandwidth of its motion."""
    if len(trial.time) < 2:
        return
    rate = 1.0 / float(np.median(np.diff(trial.time)))
    if bandwidth > 0.5 * rate:
        raise TrialError(
            f"imposed_motion.bandwidth_hz must be at most half of the rows in a second, "
            f"{0.5 * rate:.4g} Hz for this trial, got {bandwidth:.4g} Hz; give the model a smaller "
            "one, or log faster"
        )


def _commanded(trial: Trial, command: str) -> np.ndarray | None:
    """A command (SI), or what was measured of it; linear over empty cells, None if all are."""
    for values in (
        trial.commands.get(command),
        trial.measurements.get(SIGNALS[command].measured),
    ):
        if values is not None and not np.isnan(values).all():
            there = ~np.isnan(values)
            return np.interp(trial.time, trial.time[there], values[there])
    return None


def _direct(trial: Trial, name: str) -> np.ndarray:
    """A command that a drive takes as it comes (SI)."""
    values = _command(trial, name)
    if values is None:
        raise TrialError(
            f"the trial does not command the drive: give {BY_QUANTITY[name].name}, which this "
            "model's drive takes"
        )
    return values


def _voltage(
    trial: Trial, voltage: str, wish: str, line: Parameters | None, least: float = 0.0
) -> np.ndarray:
    """A voltage as commanded, or as a line (gain, offset) gives it from what is wished for.

    What is wished for is not below a least value, whatever the line gives at 0 V.
    """
    values = _command(trial, voltage)
    if values is not None:
        return values
    wished = _command(trial, wish)
    if wished is None or line is None:
        choice = f"{voltage}_v or {BY_QUANTITY[wish].name}" if line else f"{voltage}_v"
        raise TrialError(f"the trial does not command the {voltage.split('_')[0]}: give {choice}")
    volts = (wished - line.offset) / line.gain
    lowest, highest = VOLTAGE_RANGE
    low, high = max(least, line.gain * lowest + line.offset), line.gain * highest + line.offset
    margin = _ROUNDING * line.gain
    outside = np.flatnonzero((wished < low - margin) | (wished > high + margin))
    if outside.size:
        column, at = BY_QUANTITY[wish], int(outside[0])
        least, most, value = (v / SI_FACTORS[column.unit] for v in (low, high, float(wished[at])))
        raise SampleError(
            f"{column.name} must lie in {least:g} to {most:g} {column.unit}, what {voltage}_v of "
            f"up to {highest:g} V gives; {{place}} has {value:g}; "
            + (_NO_PUSH if SIGNALS[wish].is_force and wished[at] < 0.0 == least else _MENDS[wish]),
            at,
        )
    return np.clip(volts, *VOLTAGE_RANGE)


def _command(trial: Trial, name: str) -> np.ndarray | None:
    """A command, held over rows where its cell is empty; None if there is none at all."""
    values = trial.commands.get(name)
    if values is None or np.all(np.isnan(values)):
        return None
    if np.isnan(values[0]):
        raise SampleError(
            f"{BY_QUANTITY[name].name} has no value in {{place}}, the first, so there is nothing "
            "to settle at; fill it in (a later empty cell holds the value before it)",
            0,
        )
    last = np.maximum.accumulate(np.where(np.isnan(values), 0, np.arange(len(values))))
    return values[last]
