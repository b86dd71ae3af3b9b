"""The command `rig`: a controller drives a real rig."""

import signal
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from benchmarks.commands.options import INTERRUPTED, app, listed, refuse
from benchmarks.files import RESULTS

if TYPE_CHECKING:
    from controllers.registry import Controller
    from pma_gym.bench import RigFile, Sample, Step
    from pma_gym.bench.control_loop import Act
    from pma_gym.tasks import Task


@app.command(epilog="Example: python -m benchmarks rig rig.toml --controller pid --task sine")
def rig(
    file: Annotated[Path, typer.Argument(help="TOML file of the rig: line, limits, safe state.")],
    controller: Annotated[
        str, typer.Option(help="Name, path/to/file.py:ClassName, or a policy.")
    ] = "pid",
    task: Annotated[str, typer.Option(help="Tasks by commas, a trial each.")] = "sine",
    out: Annotated[
        Path | None, typer.Option(help="Data set to add to; results/rig/FILE if not given.")
    ] = None,
) -> None:
    """Drive a real rig, or its emulator, and log trials for `pma-gym diagnose`."""
    from benchmarks.runner.controller_spec import parse_controllers
    from pma_gym.bench import ControlLoop, TrialLog, open_rig, read_rig_file

    content = read_rig_file(file)
    spec, *others = parse_controllers(controller)
    if others or spec.is_bound:
        raise ValueError(f"a rig takes one controller, and not the oracle, got {controller}")
    tasks = [_task(name) for name in listed(task)]
    folder = out or RESULTS / "rig" / file.stem
    log = TrialLog(folder, content)
    # Whoever ends this process ends it by way of the rig's safe state.
    for ending in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(ending, signal.default_int_handler)
    try:
        with open_rig(content) as line:
            loop = ControlLoop(line, content)
            for each in tasks:
                act = station_act(content, each, spec.make())
                with log.trial() as write:
                    steps = loop.run(each.duration, act, write)
                print(f"{each.name}: {_summary(steps)}")
    except KeyboardInterrupt:
        print(f"Interrupted; the rig is in its safe state, rows are kept in {folder}")
        raise typer.Exit(INTERRUPTED) from None
    except (OSError, ImportError) as error:
        refuse(error)
    print(f"Trials: {folder}")


def _task(name: str) -> "Task":
    """A task by name; of a displacement where only its kind is given."""
    from pma_gym.tasks import EVERY_TASK, named_task

    task = named_task(name) or named_task(f"displacement_{name}")
    if task is None or task.exercise:
        known = ", ".join(key for key, each in EVERY_TASK.items() if not each.exercise)
        raise ValueError(f"a rig's task is one of {known}, got {name!r}")
    return task


def station_act(file: "RigFile", task: "Task", controller: "Controller") -> "Act":
    """What a controller does with a rig's measurements, after its reset.

    The other command, where there are two, keeps its start value. Positions count from the first
    measurement; what the rig does not measure is 0.
    """
    from benchmarks.runner.rollout import checked_volts
    from pma_gym.data.trial_columns import COLUMNS
    from pma_gym.envs import Measurement, StationInfo
    from pma_gym.envs.station_info import Reference
    from pma_gym.plant.model import load_model
    from pma_gym.units import SI_FACTORS

    model, start = load_model(file.model), file.start
    line, driven = model.parameters.get("regulator_line"), int(task.actuator == "regulator")
    if driven >= len(start):
        raise ValueError(f"task {task.name} moves a regulator, and the rig's file has none")
    pressure = line.gain * start[1] + line.offset if line else 0.0
    info = StationInfo(model, task, pressure, 1.0 / file.rate_hz)
    controller.reset(Reference(task.schedule), info)
    columns = {column.name: column for column in COLUMNS}
    kept = [(columns[n].quantity, SI_FACTORS[columns[n].unit]) for n in file.measurements]
    zeros: dict[str, float] = {}

    def act(time: float, sample: "Sample") -> Sequence[float]:
        pairs = zip(kept, sample.values, strict=True)
        known = {name: value * factor for (name, factor), value in pairs}
        if not zeros:
            zeros.update(known)
        moved = {name: value - zeros[name] for name, value in known.items()}
        measurement = Measurement(
            time,
            -moved.get("contraction", 0.0),
            moved.get("rotation", moved.get("angle", 0.0)),
            known.get("load", known.get("force", 0.0)),
            known.get("pressure", 0.0),
        )
        commands = list(start)
        commands[driven] = checked_volts(controller.act(measurement, time), time)
        return commands

    return act


def _summary(steps: "Sequence[Step]") -> str:
    """Times of the steps in one line."""
    import numpy as np

    texts = []
    for name in ("late_us", "read_us", "act_us", "command_delay_us"):
        values = np.array([getattr(step, name) for step in steps])
        middle, high, most = np.nanquantile(values, [0.5, 0.999, 1.0])
        texts.append(f"{name} {middle:.0f}, {high:.0f}, {most:.0f}")
    missed = steps[-1].step + 1 - len(steps)
    return f"median, p99.9 and most: {'; '.join(texts)}; periods passed over: {missed}"
