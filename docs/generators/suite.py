"""The benchmark's suite: its controllers, trials and targets."""

import inspect
from pathlib import Path

from benchmarks.suites.frozen import load_suite
from benchmarks.tuning import tune
from controllers import CONTROLLERS
from generators.text import code, number, summary, table

EXAMPLES = Path(__file__).parent.parent / "examples"


def example(name: str) -> str:
    """A file of `docs/examples`."""
    text = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8").rstrip()
    return f'```python title="docs/examples/{name}.py"\n{text}\n```'


def controllers() -> str:
    """Every controller that comes with the project."""
    scored = {spec.name for spec in load_suite().controllers}
    rows = [
        [code(name), summary(made), "yes" if name in scored else "no"]
        for name, made in CONTROLLERS.items()
    ]
    return table(["Name", "What", "In the suite"], rows)


def tuning() -> str:
    """How the gains of the PIDs are found, as the script that finds them says."""
    return f"```text\n{inspect.cleandoc(tune.__doc__ or '').partition(chr(10) * 2)[2]}\n```"


def trials() -> str:
    """Pressures of the suite's trials, by task."""
    rows = [
        [task, len(pressures), ", ".join(number(pressure) for pressure in pressures)]
        for task, pressures in load_suite().pressures_kpa.items()
    ]
    return table(["Task", "Trials", "Pressures (kPa)"], rows, right=(1,))


def targets() -> str:
    """What a run is measured by."""
    goals = load_suite().goals
    simple = goals.simple_prediction
    feedback = " and ".join(code(name) for name in goals.feedback)
    rows = [
        ["replay, displacement: mean absolute error of slope", f"< {simple['slope']} mm/s"],
        ["replay, displacement: mean absolute error of intercept", f"< {simple['intercept']} mm"],
        ["replay, displacement: mean absolute error of RMSE", f"< {simple['rmse']} mm"],
        [f"{feedback}: displacement, largest RMSE", f"≤ {goals.displacement_rmse_mm:g} mm"],
        [f"{feedback}: rotation I and II", f"≤ {goals.rotation_moving_rmse_deg:g} deg"],
        [
            f"{feedback}: rotation III, above the achievable bound",
            f"≤ {goals.return_above_bound_deg:g} deg",
        ],
        ["whole job", f"< {goals.wall_time_s:g} s"],
    ]
    return table(["What", "Target"], rows)
