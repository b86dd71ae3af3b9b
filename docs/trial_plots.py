"""Plots of trials for four pages: controllers, environments, rigs, measured and simulated."""

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from PIL import Image

from benchmarks.report.plots import MEASURED, REFERENCE, styles_of
from benchmarks.reproduction.plots import measured_lines
from benchmarks.runner.phase_score import measured_score, score_trial
from benchmarks.runner.rollout import make_environment, rollout
from controllers import PID, SerresReplay
from controllers.policy import PPOPolicy
from controllers.registry import Controller
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.data.serres2008 import pressures
from pma_gym.data.trial_schedule import SCHEDULES
from pma_gym.discovery import diagnose
from pma_gym.discovery.report.curves import worst_trial
from pma_gym.discovery.report.pictures import AFTER, BEFORE
from pma_gym.envs import PMAEnv
from pma_gym.pages.figures import legend_below, picture, png
from pma_gym.units import SI_FACTORS

BAND = "#dcdfe3"
COLOURS = 128
RIGS = Path(__file__).parents[1] / "tests" / "discovery" / "rigs"
PRESSURE_KPA = 350.0
ENLARGED_DEG = 0.6
FRAME_S = 2.5
"""Instant of the rendered frame (s)."""
SIGNALS = (
    ("measured extension", "reference now"),
    ("measured load", "measured pressure"),
)
"""Entries of the observation that are drawn, a tuple a panel."""
ENTRY_STYLES: tuple[dict[str, Any], ...] = (
    {"color": "#0072B2", "linewidth": 2.6},
    {"color": "#000000", "linestyle": "--"},
)
ROTATION = {
    "serres_replay": ("Feed-forward of 2008", SerresReplay),
    "ppo": ("Shipped policy (PPO)", PPOPolicy),
    "pid": ("PID", PID),
}


def controllers_plot() -> bytes:
    """A rotation trial of three controllers: angle, error, and the error enlarged."""
    styles = styles_of({name: label for name, (label, _) in ROTATION.items()})
    with picture(10.0, 3.5) as figure:
        axes: Any = figure.subplots(1, 3)
        angle, error, enlarged = axes
        for name, (_, make) in ROTATION.items():
            time, ideal, actual = _rotation(make)
            color = styles[name].color
            angle.plot(time, actual, color=color)
            error.plot(time, actual - ideal, color=color)
            enlarged.plot(time, actual - ideal, color=color, linewidth=0.9)
            angle.plot(time, ideal, zorder=4, **REFERENCE)
        enlarged.set_ylim(-ENLARGED_DEG, ENLARGED_DEG)
        for axis, label in zip(
            axes, ("rotation (deg)", "error (deg)", "error, enlarged (deg)"), strict=True
        ):
            axis.set(ylabel=label, xlabel="time (s)")
        handles = [Line2D([], [], color=each.color, label=each.label) for each in styles.values()]
        legend_below(figure, [*handles, Line2D([], [], label="Ideal", **REFERENCE)], 4)  # type: ignore[arg-type]
        return _few_colours(png(figure))


def _few_colours(image: bytes) -> bytes:
    """The PNG with a palette, a third as large."""
    out = io.BytesIO()
    few = Image.open(io.BytesIO(image)).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    few.save(out, format="PNG", optimize=True)
    return out.getvalue()


def _rotation(make: Callable[[], Controller]) -> tuple[Any, Any, Any]:
    """Times (s), ideal and true angle (deg) of a trial."""
    environment = make_environment("rotation", "station", PRESSURE_KPA)
    trial = rollout(environment, make(), seed=1).trial
    ideal = environment.task.schedule.reference(trial.time)
    unit = SI_FACTORS["deg"]
    return trial.time, ideal / unit, trial.truth["rotation"] / unit


def environment_plot() -> bytes:
    """An episode under the PID: its frame, beside actions, entries of observations and rewards."""
    frame, scales, observations, actions, rewards, period = _episode()
    with picture(10.0, 7.0) as figure:
        parts: Any = figure.subfigures(2, 1, height_ratios=(2.3, 1.0))
        shown, below = parts[0].subplots(), parts[1]
        shown.imshow(frame, interpolation="lanczos")
        shown.set_axis_off()
        axes: Any = below.subplots(1, 2 + len(SIGNALS))
        time = period * np.arange(len(observations))
        axes[0].step(
            time[:-1],
            actions,
            where="post",
            color="#D55E00",
            label=f"action (1.0 = {scales['last motor action']})",
        )
        for axis, entries in zip(axes[1:-1], SIGNALS, strict=True):
            for entry, style in zip(entries, ENTRY_STYLES, strict=True):
                values = observations[:, list(scales).index(entry)]
                axis.plot(time, values, label=f"{entry} (1.0 = {scales[entry]})", **style)
        axes[-1].plot(time[1:], rewards, color="#009E73", label="reward")
        for axis in axes:
            axis.axvline(FRAME_S, color="#666666", linewidth=0.9, linestyle=":")
            axis.margins(y=0.15)
            axis.set_xlabel("time (s)")
            axis.legend(loc="lower left", bbox_to_anchor=(-0.25, 1.0), frameon=False, fontsize=7.5)
        return _few_colours(png(figure))


def _episode() -> tuple[Any, dict[str, str], Any, list[float], list[float], float]:
    """Frame, scales of 1.0 by entry, observations, actions, rewards and control period (s)."""
    env = PMAEnv("displacement", pressure_kpa=PRESSURE_KPA, preview=3, render_mode="rgb_array")
    observation, _ = env.reset(seed=1)
    controller = PID()
    controller.reset(env.reference, env.station)
    observations, actions, rewards = [observation], [], []
    frame, ended = None, False
    while not ended:
        action = env.action(controller.act(env.measurement, env.time))
        observation, reward, terminated, truncated, _ = env.step(action)
        observations.append(observation)
        actions.append(float(action[0]))
        rewards.append(float(reward))
        if frame is None and env.time >= FRAME_S - 1e-9:
            frame = env.render()
        ended = terminated or truncated
    return frame, dict(env.table.rows), np.array(observations), actions, rewards, env.options.period


def rig_plot() -> bytes:
    """A log of the example `hanging_load`, and what its diagnosis names."""
    diagnosis = diagnose(read_dataset(RIGS / "hanging_load"), jobs=2)
    record = worst_trial(diagnosis)
    assert record is not None and diagnosis.effects
    time, unit = record.time, SI_FACTORS["mm"]
    at = record.columns.index("contraction_mm")
    measured, before, after = (
        each[:, at] / unit for each in (record.measured, record.before, record.after)
    )
    pressure = record.measured[:, record.columns.index("pressure_kpa")] / SI_FACTORS["kPa"]
    effect = diagnosis.effects[0]
    sizes = ", ".join(f"{each.value:.3g} {each.unit}" for each in effect.parameters.values())
    with picture(10.0, 3.5) as figure:
        log, curves, residual = axes = figure.subplots(1, 3)
        log.plot(time, pressure, color="#000000")
        curves.plot(time, measured, **MEASURED)
        floor = diagnosis.gap["contraction_mm"].floor
        residual.axhspan(-2.0 * floor, 2.0 * floor, color=BAND, zorder=0)
        for values, color in ((before, BEFORE), (after, AFTER)):
            curves.plot(time, values, color=color)
            residual.plot(time, measured - values, color=color, linewidth=0.9)
        for axis, title, label in (
            (log, f"The log {record.name}", "pressure (kPa)"),
            (curves, "The model simulates it", "contraction (mm)"),
            (residual, f"The diagnosis names {effect.name}", "measured less simulated (mm)"),
        ):
            axis.set(title=title, ylabel=label)
        for axis in axes:
            axis.set_xlabel("time (s)")
        handles = [
            Line2D([], [], label="Measured", **MEASURED),  # type: ignore[arg-type]
            Line2D([], [], color=BEFORE, label="Model as given"),
            Line2D([], [], color=AFTER, label=f"With {effect.name} ({sizes})"),
            Patch(color=BAND, label="Noise, 95 %"),
        ]
        legend_below(figure, handles, 4)
        return _few_colours(png(figure))


def measured_plot() -> bytes:
    """Displacement trials less their ideal, a panel a pressure: measured lines, simulated trials.

    Measured are the regression lines of table 21 with the scatter about them, for no more is
    printed. Simulated is the replay of the printed voltages, with its own regression line.
    """
    color = styles_of({"serres_replay": ""})["serres_replay"].color
    names = pressures("displacement")
    with picture(10.0, 5.6) as figure:
        axes: Any = figure.subplots(3, 3, sharex=True, sharey=True)
        for axis, pressure in zip(axes.flat, names, strict=True):
            _measured_panel(axis, pressure)
            time, ideal, actual, line = _replay(pressure)
            axis.plot(time, actual - ideal, color=color, linewidth=0.9)
            axis.plot(time, line - ideal, color=color, linestyle="--")
            axis.axhline(0.0, **REFERENCE)
            axis.set_title(f"{pressure:g} kPa")
        for axis in axes[:, 0]:
            axis.set_ylabel("error (mm)")
        for axis in axes[-1]:
            axis.set_xlabel("time (s)")
        handles = [
            Line2D([], [], label="Measured, regression line", **MEASURED),  # type: ignore[arg-type]
            Patch(color=BAND, label="Measured, scatter (rms)"),
            Line2D([], [], color=color, linestyle="--", label="Simulated, regression line"),
            Line2D([], [], color=color, linewidth=0.9, label="Simulated"),
            Line2D([], [], label="Ideal", **REFERENCE),  # type: ignore[arg-type]
        ]
        legend_below(figure, handles, 5)
        return _few_colours(png(figure))


def _measured_panel(axis: Axes, pressure: float) -> None:
    """Draw a measured regression line less the ideal, with its scatter."""
    schedule, unit = SCHEDULES["displacement"], SI_FACTORS["mm"]
    scatter = measured_score("displacement", "displacement", pressure).scatter
    for time, line in measured_lines("displacement", pressure):
        error = line - schedule.reference(time) / unit
        axis.fill_between(time, error - scatter, error + scatter, color=BAND, linewidth=0.0)
        axis.plot(time, error, **MEASURED)


def _replay(pressure: float) -> tuple[Any, Any, Any, Any]:
    """Times (s), ideal, true extension and its regression line (mm) of the printed voltages."""
    environment = make_environment("displacement", "station", pressure)
    trial = rollout(environment, SerresReplay(), seed=1).trial
    ideal = environment.task.schedule.reference(trial.time)
    line = score_trial(trial, "displacement")["displacement"]
    unit = SI_FACTORS["mm"]
    fitted = line.intercept + line.slope * trial.time
    return trial.time, ideal / unit, trial.truth["extension"] / unit, fitted
