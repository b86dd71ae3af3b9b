"""The environment: a task on a plant, seen through the plant's sensors."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from pma_gym.envs.command import CommandLine
from pma_gym.envs.knowledge import Reading, Station
from pma_gym.envs.observation import ObservationTable
from pma_gym.envs.options import (
    Pressure,
    check_known,
    check_named,
    check_pressure,
    parse_options,
    parse_task,
)
from pma_gym.envs.recording import Recording
from pma_gym.envs.sensing import SensorLine
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.tasks import RANDOMISATIONS, REWARDS, broken_limit, missed_reward
from pma_gym.units import SI_FACTORS

if TYPE_CHECKING:
    from pma_gym.envs.picture import Picture

RESET_OPTIONS = ("pressure_kpa",)
NOT_BEGUN = "no episode has begun"

PRESSURE_TOLERANCE = 1.0
"""How far a pressure may leave the trials' range before it counts (Pa): a settled pressure is
exact to its last bits only."""


class PMAEnv(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """Isokinetic tracking with a pneumatic muscle that a servo drive pulls through a cable.

    An episode begins pressurised and settled, with no load. In every control step kT the agent
    commands the motor's voltage, which is held until (k+1)T; the muscle's extension (task
    `displacement`: 5 mm/s for 5 s) or the pulley's rotation (task `rotation`: 0-90 deg in 5 s,
    held 5 s, back in 5 s) is to follow the reference.

    ## Action
    A Box of shape (1,), or (2,) with `regulator_action`; beyond -1 to 1 it is held there.

    | index | meaning | range | physical |
    |---|---|---|---|
    | 0 | motor voltage | -1 to 1 | 0 to 10 V |
    | 1, only with `regulator_action` | regulator voltage | -1 to 1 | 0 to 10 V |

    `action(volts)` gives the action of a voltage.

    ## Observation
    A float32 Box, each entry clipped to -5 to 5. "Position" is the quantity that the task asks
    for, and its range 25 mm or 90 deg. With `observation_delay_s` everything measured is so old.

    | index | entry | 1.0 = |
    |---|---|---|
    | 0 | measured extension | 25 mm |
    | 1 | measured rotation | 90 deg |
    | 2 | measured load | 1000 N |
    | 3 | measured pressure | 600 kPa |
    | 4 | reference now | range |
    | 5 | reference now less measured position | range |
    | next `preview` | reference 1, 2... control steps ahead | range |
    | next 1 or 2 | last action | 10 V, -1.0 = 0 V |
    | next `history` | position heard 1, 2... control steps before | range |

    `table.describe()` prints the table of the options in use.

    ## Reward
    By name, of the true error e at the end of the step in percent of the range, and of the
    largest change da of an action since the step before:

    | name | reward of a step |
    |---|---|
    | `absolute` (default) | -abs(e) |
    | `quadratic` | -e^2 |
    | `gaussian` | exp(-e^2) |
    | `smooth` | -abs(e) - 0.1 abs(da) |

    A terminated episode also gets, for every step that it did not reach, the reward of e = 100.

    ## Termination and truncation
    `terminated` only at a physical limit of the rig (the model's `[limits]`):

    | limit | shipped models |
    |---|---|
    | contraction | 70 mm |
    | stretch beyond the resting length | 12 mm |
    | cable tension | 1300 N |
    | pressure | 600 kPa |

    `truncated` once the last sample of the trial at 384 Hz, 1922/384 s after its last phase began,
    is reached: at 100 Hz after 501 steps (displacement) or 1501 (rotation).

    ## Info
    | key | value | unit |
    |---|---|---|
    | `time_s` | since the trial began | s |
    | `extension_mm` or `rotation_deg` | true position | mm, deg |
    | `measured_extension_mm` or `measured_rotation_deg` | as heard by the agent | mm, deg |
    | `reference_mm` or `reference_deg` | reference now | mm, deg |
    | `error_mm` or `error_deg` | true position less reference | mm, deg |
    | `motor_voltage_v`, `regulator_voltage_v` | as heard by the station in this step | V |
    | `pressure_kpa`, `load_n` | true gauge pressure and cable tension | kPa, N |
    | `extrapolated` | pressure outside the dissertation's trials or the model's validity | |
    | at the end: `rmse_mm` or `rmse_deg`, ... | see `episode_summary` | |

    ## Reset options
    `reset(options={"pressure_kpa": 300})` sets the pressure of one episode, as the keyword does.

    ## Versions
    | version | change |
    |---|---|
    | v0 | first |

    Args:
        task: `displacement` or `rotation`.
        render_mode: None or `rgb_array`.
        options: keyword arguments, see `Options`.

    Attributes:
        task: the Task.
        options: the checked Options.
        table: the ObservationTable.
        nominal_plant: the Plant of the nominal model.
        plant: the Plant of this episode; differs from the nominal one with `randomisation`.
        condition: where the plant stands.
        pressure: gauge pressure that this episode began at (Pa).
        ended_by: the limit that ended the episode, in words, or None.

    Example:
        >>> env = PMAEnv("displacement", model="serres2008", pressure_kpa=300, noise=False)
        >>> observation, info = env.reset(seed=1)
        >>> observation, reward, *_, info = env.step(env.action(2.0))
        >>> info["time_s"], info["motor_voltage_v"], round(info["extension_mm"], 2)
        (0.01, 2.0, 0.91)
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 100}

    def __init__(
        self, task: str = "displacement", render_mode: str | None = None, **options: Any
    ) -> None:
        """Check the options and compile the plant."""
        if render_mode is not None:
            check_named("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self.task = parse_task(task)
        self.options = parse_options(options)
        self.nominal_plant = Plant(load_model(self.options.model))
        self.table = ObservationTable(self.task, self.options)
        self.observation_space = self.table.space
        self._commands = CommandLine(self.options)
        self.action_space = self._commands.space
        self._sensors = SensorLine(self.options)
        # A film of every step plays in real time.
        self.metadata = self.metadata | {"render_fps": round(self.options.control_rate_hz)}
        self._reward = REWARDS[self.options.reward]
        self._steps = self.task.steps(self.options.control_rate_hz)
        self._picture: Picture | None = None
        self._idle: str | None = NOT_BEGUN

    # -- episode -----------------------------------------------------------------------------------

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin a trial: draw the pressure and the station, pressurise, settle, zero the sensors.

        Args:
            seed: seed of everything random in the episodes from here on.
            options: may hold `pressure_kpa` for this episode.
        Raises:
            TypeError: an unknown option.
            ValueError: a pressure out of range.
        """
        wanted = self._wanted_pressure(options or {})
        super().reset(seed=seed)
        self._idle = NOT_BEGUN
        self.pressure = self._drawn_pressure(wanted)
        nominal = self.nominal_plant.model
        model = RANDOMISATIONS[self.options.randomisation](nominal, self.np_random)
        self.plant = self.nominal_plant if model is nominal else Plant(model)
        self.condition = self.plant.settle(motor_voltage=0.0, pressure=self.pressure)
        self._begin()
        return self._observation(), self._info()

    def step(
        self, action: NDArray[np.floating]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Command the station, let one control step pass, look what came of it.

        Raises:
            ValueError: an action of the wrong shape, or not finite.
            gymnasium.error.ResetNeeded: no episode, or one that has ended.
        """
        self._require_episode("step()")
        self._volts = self._commands.send(action)
        self._recording.record(self._volts)
        self._sensors.take(self.condition, self.time)
        self.ended_by = broken_limit(self.plant.model, self.truth)
        terminated = self.ended_by is not None
        missed = self._steps - self._recording.count
        truncated = not terminated and missed == 0
        reward = self._reward(self.task.error_percent(self.error), self._commands.change)
        info = self._info()
        if terminated:
            reward += missed * missed_reward(self._reward)
        if terminated or truncated:
            self._idle = f"the episode ended at {self.time:g} s"
            info |= self.episode_summary()
        return self._observation(), reward, terminated, truncated, info

    def _begin(self) -> None:
        self._idle = self.ended_by = None
        self._volts = self._commands.begin(self.plant.regulator_voltage(self.pressure))
        self._sensors.begin(self.plant, self.condition, self.np_random)
        self._recording = Recording(self.plant, self.condition, self._steps, self.options.period)

    def _require_episode(self, wanted: str) -> None:
        if self._idle:
            raise gym.error.ResetNeeded(f"{self._idle}: call reset() before {wanted}")

    def _wanted_pressure(self, options: Mapping[str, Any]) -> Pressure:
        check_known("reset option", options, RESET_OPTIONS)
        wanted = options.get("pressure_kpa", self.options.pressure_kpa)
        check_pressure(wanted)
        return wanted

    def _drawn_pressure(self, wanted: Pressure) -> float:
        if isinstance(wanted, str):
            low, high = self.task.lowest_pressure, self.task.highest_pressure
            return float(self.np_random.uniform(low, high))
        if isinstance(wanted, Sequence):
            return 1e3 * float(wanted[int(self.np_random.integers(len(wanted)))])
        return 1e3 * float(wanted)

    # -- what the agent, a controller and the reader see -------------------------------------------

    @property
    def time(self) -> float:
        """Time since the trial began (s)."""
        return self._recording.time

    @property
    def reading(self) -> Reading:
        """What the sensors say now, as late as `observation_delay_s` makes them."""
        return self._sensors.reading

    @property
    def truth(self) -> dict[str, float]:
        """True contraction, extension (m), rotation (rad), load (N) and pressure (Pa)."""
        return self._sensors.truth

    @property
    def station(self) -> Station:
        """What a controller may know: the nominal model, the task, the pressure, the period."""
        return Station(self.nominal_plant.model, self.task, self.pressure, self.options.period)

    @property
    def error(self) -> float:
        """True position less reference (m or rad)."""
        return (
            self.truth[self.task.protocol.quantity] - self.table.references[self._recording.count]
        )

    @property
    def extrapolated(self) -> bool:
        """Whether the pressure lies outside this task's trials or the model's validity."""
        valid, pressure = self.plant.model.parameters["validity"], self.truth["pressure"]
        low = max(valid.lowest, self.task.lowest_pressure)
        high = min(valid.highest, self.task.highest_pressure)
        return not low - PRESSURE_TOLERANCE <= pressure <= high + PRESSURE_TOLERANCE

    @property
    def motor_voltage(self) -> float:
        """Motor voltage that the station heard in the last step (V)."""
        return self._volts.motor

    @property
    def regulator_voltage(self) -> float:
        """Regulator voltage that the station heard in the last step (V)."""
        return self._volts.regulator

    @property
    def motor_voltages(self) -> NDArray[np.float64]:
        """Motor voltage that the station heard in every step so far (V), shape (steps,)."""
        return self._recording.motor_voltages

    def reference(self, time: float) -> float:
        """The reference at a time (s): extension (m) or rotation (rad)."""
        return float(self.task.protocol.reference(time))

    def action(
        self, motor_voltage: float, regulator_voltage: float | None = None
    ) -> NDArray[np.float64]:
        """The action that commands these voltages (V), held to 0-10 V.

        In float64, which `step` takes as it is: float32 would move a voltage by up to 0.3 uV.

        Args:
            motor_voltage: motor command (V).
            regulator_voltage: regulator command (V), with `regulator_action`; if not given, the
                one that holds the pressure of the episode's start.
        """
        return self._commands.action_for(motor_voltage, regulator_voltage)

    def trajectory(self) -> NDArray[np.float64]:
        """True position (m or rad) at k / 384 s so far, whatever the control rate, shape (k,)."""
        return self._recording.trajectory(self.task.protocol.quantity)

    def episode_summary(self) -> dict[str, Any]:
        """RMSE of the true position at 384 Hz so far, as the dissertation defines it.

        Returns:
            `rmse_mm` or `rmse_deg`: over all phases; `rmse_by_phase_mm` or `rmse_by_phase_deg`: of
            each phase begun, by its name; `percent_of_range`: the first, of 25 mm or 90 deg;
            `ended_by`: the limit that ended the episode, in words, or None.
        """
        return self._recording.score(self.task) | {"ended_by": self.ended_by}

    def _observation(self) -> NDArray[np.float32]:
        sensors = self._sensors
        count, action = self._recording.count, self._commands.action
        return self.table.pack(count, sensors.reading, action, sensors.earlier)

    def _info(self) -> dict[str, Any]:
        unit, quantity = self.task.protocol.unit, self.task.protocol.quantity
        factor, truth = SI_FACTORS[unit], self.truth
        return {
            "time_s": self.time,
            f"{quantity}_{unit}": truth[quantity] / factor,
            f"measured_{quantity}_{unit}": getattr(self.reading, quantity) / factor,
            f"reference_{unit}": self.table.references[self._recording.count] / factor,
            f"error_{unit}": self.error / factor,
            "motor_voltage_v": self.motor_voltage,
            "regulator_voltage_v": self.regulator_voltage,
            "pressure_kpa": truth["pressure"] / 1e3,
            "load_n": truth["load"],
            "extrapolated": self.extrapolated,
        }

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """A picture of the station and of the trial so far, shape (400, 800, 3).

        Raises:
            gymnasium.error.ResetNeeded: no episode has begun.
        """
        if self.render_mode is None:
            gym.logger.warn(
                "render() draws nothing without a render mode; make the environment with "
                'render_mode="rgb_array"'
            )
            return None
        if self._idle == NOT_BEGUN:
            self._require_episode("render()")
        if self._picture is None:
            # Imported here: an environment without pictures needs no matplotlib.
            from pma_gym.envs.picture import Picture

            self._picture = Picture(self.task)
        return self._picture.draw(self)

    def close(self) -> None:
        """Free the picture."""
        self._picture = None
