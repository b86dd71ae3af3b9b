"""One case, run: a controller drives an environment, and what happened comes back as a trial."""

import math
import numbers
import time
from dataclasses import dataclass

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from benchmarks.contender import ControllerError
from controllers.controller import Controller
from pma_gym.data.trial import Trial
from pma_gym.envs import ENVIRONMENTS, PMAEnv
from pma_gym.metrics import PHASE_SAMPLES, SAMPLE_RATE_HZ

# 5 s in steps of 0.01 s are 499.99999999999994 steps.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Rollout:
    """A trial that a controller drove.

    Attributes:
        trial: on the 384 Hz grid: the true position, the commands in force, the last reading.
        steps: control steps.
        step_seconds: time spent inside the environment's steps (s).
        ended_by: the physical limit that ended it early, or None.
    """

    trial: Trial
    steps: int
    step_seconds: float
    ended_by: str | None


def make_environment(
    task: str, model: str, pressure_kpa: float, control_rate_hz: float = 100.0, noise: bool = True
) -> PMAEnv:
    """The registered environment of a task at one pressure, without wrappers."""
    identifier = next(name for name, its in ENVIRONMENTS.items() if its == task)
    environment = gym.make(
        identifier,
        disable_env_checker=True,
        model=model,
        pressure_kpa=float(pressure_kpa),
        control_rate_hz=control_rate_hz,
        noise=noise,
    ).unwrapped
    assert isinstance(environment, PMAEnv)
    return environment


def rollout(environment: PMAEnv, controller: Controller, seed: int) -> Rollout:
    """Let a controller drive one episode.

    Args:
        environment: of one pressure.
        controller: who drives; reset first.
        seed: seed of the episode.
    Returns:
        The trial, to the last scored sample or to where a physical limit ended it.
    Raises:
        ControllerError: the controller returned what is no voltage.
        Exception: whatever the controller or the environment raised.
    """
    environment.reset(seed=seed)
    controller.reset(environment.reference, environment.station)
    commands: list[tuple[float, float]] = []
    readings = [environment.reading]
    seconds = 0.0
    ended = False
    while not ended:
        volts = _checked(controller.act(environment.reading, environment.time), environment.time)
        action = environment.action(volts)
        before = time.perf_counter()
        _, _, terminated, truncated, _ = environment.step(action)
        seconds += time.perf_counter() - before
        ended = terminated or truncated
        commands.append((environment.motor_voltage, environment.regulator_voltage))
        readings.append(environment.reading)
    trial = _trial(environment, commands, np.array([reading[1:] for reading in readings]))
    return Rollout(trial, len(commands), seconds, environment.ended_by)


def _checked(volts: object, now: float) -> float:
    """A controller's answer as volts.

    Raises:
        ControllerError: it is no finite number; says what came and when.
    """
    if isinstance(volts, np.ndarray) and volts.size == 1:
        volts = volts.item()
    if isinstance(volts, bool) or not isinstance(volts, numbers.Real):
        raise ControllerError(
            f"act must return volts as a number, 0-10 V, at {now:.4g} s it returned {volts!r} "
            f"({type(volts).__name__}); return float(volts)"
        )
    if not math.isfinite(volts):
        raise ControllerError(
            f"act must return finite volts, 0-10 V, at {now:.4g} s it returned {float(volts)}; "
            "look for a division by zero or a root of a negative number there"
        )
    return float(volts)


def _trial(
    environment: PMAEnv, commands: list[tuple[float, float]], readings: NDArray[np.float64]
) -> Trial:
    """What happened, on the 384 Hz grid; readings are extension, rotation, load, pressure."""
    protocol = environment.task.protocol
    wanted = round(protocol.phases[-1].start * SAMPLE_RATE_HZ) + PHASE_SAMPLES
    position = environment.trajectory()[:wanted]
    samples = position.size
    times = np.arange(samples) / SAMPLE_RATE_HZ
    step = np.floor(times * environment.options.control_rate_hz + _ROUNDING).astype(int)
    # The last grid point may fall on the end of the last step, where no further command came.
    volts = np.array(commands)[np.minimum(step, len(commands) - 1)]
    held = readings[step]
    return Trial(
        time=times,
        commands={"motor_voltage": volts[:, 0], "regulator_voltage": volts[:, 1]},
        measurements={
            "contraction": environment.condition.zero_contraction - held[:, 0],
            "rotation": held[:, 1],
            "load": held[:, 2],
            "pressure": held[:, 3],
        },
        truth={protocol.quantity: position},
    )
