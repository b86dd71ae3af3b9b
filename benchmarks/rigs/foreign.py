"""Controllers in closed loop on a rig that foreign code simulates."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.hidden_effects.rigs.driven_campaign import DrivenCampaign
from benchmarks.hidden_effects.rigs.laws import HiddenEffect
from benchmarks.hidden_effects.rigs.sensing import Sensor
from controllers.rigs import RigController, RigMeasurement
from pma_gym.engine.observation import step_references
from pma_gym.envs import RigEnv
from pma_gym.metrics import percent_of_range, rmse

RATE_HZ = 1000.0
"""Rows of a simulation: a command of a control step is reached within one of them."""


class ForeignLoop:
    """Source of a foreign simulator's commands: a controller that reads a foreign sensor.

    Args:
        env: environment whose references, limits and observation the controller knows.
        controller: drives the rig.
        sensor: of the position.
        noise: of its reading in every control step (rad), shape (steps,).
    """

    def __init__(
        self, env: RigEnv, controller: RigController, sensor: Sensor, noise: np.ndarray
    ) -> None:
        if [signal.is_angle for signal in env.options.signals] != [True]:
            raise ValueError("a foreign joint has a sensor of its angle alone, as the logs tell")
        self._env, self._controller, self._sensor, self._noise = env, controller, sensor, noise
        self.rows = round(RATE_HZ * env.options.period)
        self._references = step_references(env.task, env.options)
        self._readings: list[float] = []
        self._command = env.options.resting()[env.options.commands[0].place]
        self._action = env.action(self._command)
        controller.reset(env.station)

    def __call__(self, row: int, q: float) -> float:
        """Command of a row (N m); q is the angle in the row before it (rad)."""
        if row and (row - 1) % self.rows == 0:
            now = len(self._readings)
            self._readings.append(self._sensor.reading(q, self._noise[now]))
            measurement = self.measurement(now)
            commands = self._controller.act(measurement)
            self._action = self._env.action(*commands)
            self._command = self._env.options.commands[0].at(commands[0])
        return self._command

    def measurement(self, now: int) -> RigMeasurement:
        """What the controller receives in a control step, as the environment makes it."""

        def reading(part: str, age: int) -> float:
            return self._readings[max(now - age, 0)]

        table, space = self._env.table, self._env.observation_space
        entries = table.entries(reading, lambda k: self._references[now + k], [*self._action])
        observation = np.clip(np.array(entries, np.float32), space.low, space.high)  # type: ignore[attr-defined]
        time = now * self._env.options.period
        return RigMeasurement({"angle": reading("", table.delay)}, observation, time)


def foreign_error(
    campaign: DrivenCampaign,
    effects: Sequence[HiddenEffect],
    env: RigEnv,
    controller: RigController,
    seed: int,
) -> float:
    """Error of the true angle in percent of the range, scored as the environment scores it.

    Args:
        campaign: the rig, its sensor and its simulator.
        effects: what it hides.
        env: environment of the controller's model, with the task.
        controller: drives the rig.
        seed: of the noise.
    """
    steps, phase = env.task.steps(env.options.control_rate_hz), env.task.schedule.phases[0]
    rng = np.random.default_rng((*campaign.seed, seed, 13))
    noise = campaign.sensor.noise.draw(rng, np.arange(steps) * env.options.period)
    loop = ForeignLoop(env, controller, campaign.sensor, noise)
    rig = replace(campaign, rig=replace(campaign.rig, rate=RATE_HZ))
    motion = rig.motion(effects, loop, steps * loop.rows + 1)
    error = np.interp(phase.times, motion.time, motion.q) - phase.reference(phase.times)
    return percent_of_range(rmse(error), env.task.schedule.span)
