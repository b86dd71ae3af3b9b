"""A feed-forward's voltages for a real rig: `python -m benchmarks voltages`."""

import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.files import write_text
from controllers import CONTROLLERS
from pma_gym.envs import PMAEnv
from pma_gym.units import SI_FACTORS

FEEDFORWARDS = ("serres_replay", "serres_feedforward", "improved_feedforward")
"""Controllers that need no sensor, so that their voltages are known before the trial."""


@dataclass(frozen=True)
class Order:
    """Request for voltages.

    Attributes:
        controller: one of `FEEDFORWARDS`.
        task: name of a task, `displacement` or another.
        pressure_kpa: gauge pressure that the trial begins at (kPa).
        rate_hz: rows a second (Hz).
        model: nominal model, a shipped name or a TOML file.
    """

    controller: str
    task: str
    pressure_kpa: float
    rate_hz: float = 100.0
    model: str = "station"


def run_voltages(order: Order, out: Path) -> int:
    """Write a feed-forward's voltages as CSV: whole or not at all.

    The first row is the rest to settle at before the trial. Every voltage is to be held from its
    row's time until that of the next; the last row ends the trial.

    Args:
        order: which.
        out: CSV file that `pma-gym simulate --interpolation zoh` takes.
    Returns:
        The number of rows.
    Raises:
        ValueError: a controller that needs sensors, an unknown task, a pressure or rate out of
            range, or what the controller cannot compute; with the fix.
    """
    environment = _environment(order)
    rows = list(_rows(order, environment))
    unit = environment.task.schedule.unit
    text = io.StringIO()
    text.write(
        f"# {order.controller}, {order.task}, {order.pressure_kpa:g} kPa, {order.rate_hz:g} Hz, "
        f"model {environment.nominal_plant.model.name}\n"
        "# Settle at the first row; hold each row until the next "
        "(pma-gym simulate --interpolation zoh)\n"
    )
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("time_s", "motor_voltage_v", "regulator_voltage_v", f"reference_{unit}"))
    writer.writerows(rows)
    write_text(out, text.getvalue())
    return len(rows)


def _environment(order: Order) -> PMAEnv:
    """The environment of the trial, begun.

    Raises:
        ValueError: see `run_voltages`.
    """
    if order.controller not in FEEDFORWARDS:
        known = order.controller in CONTROLLERS
        why = "needs feedback at every step" if known else "is unknown"
        raise ValueError(
            f"--controller must be a feed-forward, whose voltages are known before the trial: "
            f"{', '.join(FEEDFORWARDS)}; {order.controller!r} {why}"
        )
    environment = PMAEnv(
        order.task,
        model=order.model,
        pressure_kpa=order.pressure_kpa,
        control_rate_hz=order.rate_hz,
        noise=False,
    )
    environment.reset(seed=0)
    return environment


def _rows(order: Order, environment: PMAEnv) -> Iterator[tuple[str, ...]]:
    """Rows as text: time (s), motor and regulator voltage (V), reference in the task's unit."""
    task, period = environment.task, environment.options.period
    unit = SI_FACTORS[task.schedule.unit]
    controller = CONTROLLERS[order.controller]()
    controller.reset(environment.reference, environment.station)
    motor, regulator = environment.motor_voltage, environment.regulator_voltage
    yield _row(-period, motor, regulator, environment.reference(0.0) / unit)
    for step in range(task.steps(order.rate_hz) + 1):
        # Open loop: the reading at rest is all it could ever have seen.
        if step < task.steps(order.rate_hz):
            volts = min(max(controller.act(environment.measurement, step * period), 0.0), 10.0)
            if task.actuator == "motor":
                motor = volts
            else:
                regulator = volts
        yield _row(step * period, motor, regulator, environment.reference(step * period) / unit)


def _row(time: float, motor: float, regulator: float, reference: float) -> tuple[str, ...]:
    return f"{time:.9g}", f"{motor:.6f}", f"{regulator:.6f}", f"{reference:.6g}"
