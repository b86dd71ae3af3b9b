"""The environment `PMAEnv`: a task on a plant, observed through the plant's sensors."""

from collections.abc import Callable, Mapping
from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from pma_gym.engine.cpu.python_step import NOT_READ
from pma_gym.engine.cpu.step_writer import BAD_ACTION
from pma_gym.engine.option_checks import Pressure, check_known, check_named, parse_pressure
from pma_gym.engine.options import EnvironmentOptions
from pma_gym.engine.plain_engine import PlainEngine
from pma_gym.engine.snapshot import put, take
from pma_gym.envs.batch import FunctionRewards, parse_seed
from pma_gym.envs.episode import NOT_BEGUN, Episode
from pma_gym.envs.kind import STATION
from pma_gym.envs.rendering.display import Display
from pma_gym.envs.rendering.scene import USUAL_WIDTH, History, check_render_width
from pma_gym.envs.setup import SINGLE, Copies, SeededByReset, Setup, setup
from pma_gym.envs.specs import completed_spec
from pma_gym.envs.state import EnvState, check_state, generator_at, generator_state
from pma_gym.envs.summary import last_info, no_scores, step_info
from pma_gym.metrics import SAMPLE_RATE_HZ
from pma_gym.tasks import Task

OWN = ("task", "render_mode", "render_width", "compiled")
"""Keyword arguments of an environment in addition to the options."""


class PMAEnv(Copies, SeededByReset, Episode, gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """Track a reference with a pneumatic muscle that a servo drive pulls through a cable.

    At every control step kT the agent commands a voltage, which is constant until (k+1)T. The
    controlled position should follow the task's reference. An episode begins in equilibrium.

    ## Tasks
    | task | controlled quantity and its reference | actuator |
    |---|---|---|
    | `displacement` | the muscle's extension: 5 mm/s for 5 s | motor |
    | `rotation` | the pulley's rotation: 0-90 deg in 5 s, held 5 s, back in 5 s | motor |
    | `displacement_sine`, `_multisine`, `_steps`, `_speeds` | extension, 10 s in 25 mm | motor |
    | `rotation_sine`, `_multisine`, `_steps`, `_speeds` | rotation, 10 s in 90 deg | motor |
    | `isotonic` | contraction: 12.5 mm in 2.5 s, held 2.5 s, back in 2.5 s | regulator |
    | `triangle_low` | contraction: 11.4 mm up and down in 4 s, three times | regulator |
    | `triangle_high` | contraction: 5.5 mm up and down in 10 s, three times | regulator |
    | `isokinetic_exercise` | an operator's joint angle: 0-90 deg in 5 s, held, back | regulator |
    | `isotonic_exercise` | moment at the operator's joint: 8 N m | regulator |
    | `profile_exercise` | moment at the operator's joint, as a function of angle | regulator |

    Tasks of the motor begin without load, at a pressure that the regulator holds. Tasks of the
    regulator begin under a load that the motor holds (200, 150 and 400 N) with the voltage of the
    nominal drive; contraction counts from there. In an exercise the motor simulates an operator
    (`pma_gym.tasks.operator`) with a leg on the lever, and the regulator resists. A suffix sets
    another moment than 8 N m, `isotonic_exercise_6.5`, or the seed of a drawn reference,
    `displacement_speeds_17`. Instead of a name you can pass a `Task`, for example one that
    `pma_gym.tasks.following` makes from a function. `reference` draws another one at every reset.

    ## Action
    A Box of shape (1,), or (2,) with `regulator_action`; values are clipped to -1 to 1.

    | index | meaning | range | physical |
    |---|---|---|---|
    | 0 | voltage of the task's actuator | -1 to 1 | 0 to 10 V |
    | 1, only with `regulator_action` | regulator voltage | -1 to 1 | 0 to 10 V |

    `action(volts)` returns the action for a voltage.

    ## Observation
    A float32 Box, each entry clipped to -5 to 5. "Position" is the task's controlled quantity; its
    range is 25 mm, 90 deg, or the contraction's stroke. Extension and rotation count from the
    trial's start, so that extension is negative while a regulator's task contracts the muscle.
    All measured values are `observation_delay_s` old.

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
    | next `history` | measured position 1, 2... control steps before | range |

    If an exercise prescribes a moment, entry 4 is the moment prescribed at the measured angle,
    entry 5 is that minus the measured moment, and the history contains the moment's excess. The
    range is the largest prescribed moment, and there is no preview.

    `table.describe()` prints this table for the options in use.

    ## Reward
    By name, from the true error e at the end of the step (percent of the range) and the largest
    change da of an action since the previous step:

    | name | reward of a step |
    |---|---|
    | `absolute` (default) | -abs(e) |
    | `quadratic` | -e^2 |
    | `gaussian` | exp(-e^2), 0 where e^2 is 12 or more |
    | `smooth` | -abs(e) - 0.1 abs(da) |

    After termination, the last reward includes the reward of e = 100 for every step that remained
    until truncation. `reward_scale` multiplies the whole reward.

    `reward` may also be a Python function. It is called after every step with four floats: e, da,
    the true position and its reference, in the unit of the info (mm, deg or N m). It returns a
    finite number: `def reward(error_percent, action_change, position, reference): ...`

    ## Termination and truncation
    `terminated` only at a physical limit of the rig (the model's `[limits]`):

    | limit | shipped models |
    |---|---|
    | contraction | 70 mm |
    | stretch beyond the resting length | 12 mm |
    | cable tension | 1300 N |
    | pressure | 600 kPa |

    An exercise also ends beyond a safe moment (24 N m) or joint speed (60 deg/s). Its safety filter
    (`safety`, on by default; `pma_gym.tasks.safety_filter`) limits the regulator's command to
    prevent this.

    `truncated` at the last sample of the trial at 384 Hz, 1922/384 s after the start of its last
    phase: at 100 Hz after 501 steps (displacement), 1501 (rotation), 1001 (the unseen
    references), 751 (isotonic), 1201 or 3001 (triangles), 1501 (exercises). `max_episode_steps`
    truncates earlier, also with the summary in the last info.

    ## Disturbances
    By name, `disturbances`; their random times follow from the environment's seed at every reset:

    | name | disturbance, every 2.5 s on average |
    |---|---|
    | `none` (default) | |
    | `regulator` | the regulator's pressure jumps by 25 kPa, away from its line and back in turn |
    | `hand_push` | a hand pulls or pushes the slide with 50 N, for 0.2 to 0.8 s at a time |
    | `regulator_and_hand_push` | both |

    A jump adds a voltage to the regulator's command, by the nominal line and within 0-10 V. The
    hand's force adds to the muscle's at the slide. Both act from the control step after their time.
    `env.disturbance` and `env.events` return them for analysis; controllers do not receive them.

    ## Info
    Every info has the same keys, with numbers of NumPy: float64, and int64 for
    `limit_code`.

    | key | value | unit |
    |---|---|---|
    | `time_s` | since the trial began | s |
    | `extension_mm`, `rotation_deg` or `contraction_mm` | true position | mm, deg |
    | `measured_` + the same | position as the agent receives it | mm, deg |
    | `reference_mm` or `reference_deg` | reference now | mm, deg |
    | `error_mm` or `error_deg` | true position minus reference | mm, deg |
    | `motor_voltage_v`, `regulator_voltage_v` | commands at the station in this step | V |
    | `pressure_kpa`, `load_n` | true gauge pressure and cable tension | kPa, N |
    | `extrapolated` | 1 if the pressure is outside the trials or the model's validity, else 0 | |
    | exercise: `moment_nm`, `operator_nm` | moment at the joint; intended by the operator | N m |
    | `speed_deg_s`, `power_w` | speed of the joint; its power into the device | deg/s, W |
    | if it prescribes a moment: `rotation_deg`, `prescribed_nm` | angle, moment | deg, N m |
    | and `excess_nm` for the position, `_nm` for `_mm` | moment minus prescribed moment | N m |
    | `rmse_mm`, `_deg` or `_nm` | in the last info, else 0: RMSE over all phases | mm, deg, N m |
    | `rmse_I_mm` and so on | the same, of each phase; NaN if it has not begun | mm, deg, N m |
    | `percent_of_range` | the same over all phases, in percent of the range | % |
    | exercise: `pace_rmse_deg`, `work_j`, ... | in the last info, else 0: see `episode_summary` | |
    | `limit_code` | number of the limit that terminated the episode (`ended_by`), else 0 | |

    ## Reset options
    `reset(options={"pressure_kpa": 300})` sets the pressure of one episode, as the keyword does.

    ## Versions
    | version | change |
    |---|---|
    | v0 | first |

    Args:
        task: name of a task, or a Task.
        render_mode: None; `rgb_array`: `render` returns a picture; or `human`: a window (pygame,
            extra `view`) shows `reset` and every step in real time, until the user closes it.
        render_width: width of the pictures (pixels), a multiple of 4; they are half as high.
        compiled: whether compiled code makes the steps; with False plain Python makes them, about
            ten a second, and a debugger stops at breakpoints in laws, sensors and rewards.
        options: keyword arguments, see `Options`.

    Attributes:
        task: the Task of this episode.
        options: the checked Options.
        table: the ObservationTable.
        nominal_plant: the Plant of the nominal model.
        plant: the Plant of this episode; differs from the nominal one with `randomisation`.
        condition: present condition of the plant.
        pressure: gauge pressure at the start of this episode (Pa).
        ended_by: name of the limit that terminated the episode; "" if none has.
        horizon: control steps after which an episode is truncated.

    Example:
        >>> env = PMAEnv("displacement", model="serres2008", pressure_kpa=300, noise=False)
        >>> observation, info = env.reset(seed=1)
        >>> observation, reward, *_, info = env.step(env.action(2.0))
        >>> print(info["time_s"], info["motor_voltage_v"], f"{info['extension_mm']:.2f}")
        0.01 2.0 0.91
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 100}
    _kind = STATION

    def __init__(
        self,
        task: str | Task = "displacement",
        render_mode: str | None = None,
        render_width: int = USUAL_WIDTH,
        compiled: bool = True,
        **options: Unpack[EnvironmentOptions],
    ) -> None:
        """Check the options and compile the plant."""
        if render_mode is not None:
            check_named("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self.render_width = check_render_width(render_width)
        self.options = self._kind.options(options, "PMAEnv.__init__()", OWN)
        parsed = self._kind.task(task, self.options)
        if not isinstance(compiled, bool):
            raise ValueError(f"compiled must be true or false, got {compiled!r}")
        self._engine = (self._kind.engine if compiled else PlainEngine)(parsed, self.options)
        self.observation_space = self._engine.table.space
        self._commands = self._kind.commands(self.options, parsed)
        self.action_space = self._commands.space
        # A film of every step plays in real time.
        self.metadata = self.metadata | {"render_fps": round(self.options.control_rate_hz)}
        self.ended_by = ""
        self._idle: str | None = NOT_BEGUN
        self._attach()

    _ATTACHED = frozenset(
        {"nominal_plant", "table", "plant", "_offsets", "_row", "_measured", "_observed", "_given"}
        | {"_made", "_datum", "_display", "_advance", "_detached"}
    )

    def _attach(self) -> None:
        """Point into the engine."""
        self.nominal_plant = self._engine.nominal
        self.table = self._engine.table
        self._row = self._engine.records[0, :, 0]
        self._find_offsets()
        self._observed = self._engine.observations[0]
        self._given = self._engine.actions[0]
        self._made = self._engine.advance(self._observed.copy, self._given, no_scores(self.task))
        if callable(self.options.reward):
            self._made = self._rewarded(self._made)
        windowed = self.render_mode == "human"
        self._display = Display(self.task, self.render_width, windowed)
        if windowed:
            self._made = self._display.shown(self._made, self)
        self._wait(self._idle)

    # -- episode -----------------------------------------------------------------------------------

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin a trial: draw the pressure and the station, pressurise, settle, zero the sensors.

        Args:
            seed: seed of all random numbers in this and the following episodes.
            options: may contain `pressure_kpa` for this episode.
        Raises:
            TypeError: an unknown option.
            ValueError: a pressure out of range.
        """
        wanted, seed = self._wanted_pressure(options or {}), parse_seed(self._or_drawn(seed))
        super().reset(seed=seed)
        self._wait(NOT_BEGUN)
        # Unseeded, it begins with the seed that `np_random_seed` says.
        begins = seed is None and not self._engine.is_seeded(0)
        self._engine.seed(_FIRST, [self.np_random_seed if begins else seed])
        self._engine.reset(_FIRST, [wanted])
        self.ended_by = ""
        self._wait(None)
        self.__dict__.pop("plant", None)
        self._commands.begin(self._number("rest_regulator"))
        self._display.begin(self)
        return self._observed.copy(), self._info()

    def step(
        self, action: NDArray[np.floating]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Apply an action for one control step and return the result.

        Raises:
            ValueError: an action of the wrong shape, or not finite.
            gymnasium.error.ResetNeeded: no episode has begun, or it has ended.
        """
        made = self._advance(action)
        return made if type(made) is tuple else self._otherwise(action, made)

    def _rewarded(self, made: Callable[[Any], Any]) -> Callable[[Any], Any]:
        """A compiled step, and the reward of a user's function."""
        rewards, engine = FunctionRewards(self._engine), self._engine

        def advance(action: object) -> Any:  # noqa: ANN401 - as `Engine.advance` has it
            result = made(action)
            if type(result) is not tuple:
                if result in (1, 2):
                    rewards.write()
                return result
            rewards.write()
            observation, _, *rest = result
            return (observation, float(engine.rewards[0]), *rest)

        return advance

    @property
    def window_closed(self) -> bool:
        """Whether the window of `render_mode="human"` was closed, by its user or by `close`."""
        return self._display.window_closed

    def _otherwise(
        self, action: NDArray[np.floating], code: int
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """What a step returns that compiled code does not make."""
        if self._idle:
            raise self._needs_reset("step()")
        if code == NOT_READ:
            self._given[:] = self._commands.checked(action)
            made = self._advance(self._given)
            if type(made) is tuple:
                return made
            code = made
        if code & BAD_ACTION:
            self._commands.checked(action)
        return self._last(bool(code & 1))

    def _last(
        self, terminated: bool
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """What the step that ends an episode returns."""
        self._wait(f"the episode ended at {self.time:g} s")
        info = last_info(self._engine, 0)
        self.ended_by = self._engine.limit_in_words(0, info["limit_code"])
        self._display.show(self)
        return self._observed.copy(), self._number("reward"), terminated, not terminated, info

    def _info(self) -> dict[str, Any]:
        """Numbers of the last step or reset; what compiled code makes in between."""
        return step_info(self._engine, self._index)

    def _wait(self, why: str | None) -> None:
        """Let no step be made until `reset`, and say why; None to let them."""
        self._idle = why
        self._advance = _no_step if why else self._made

    def _needs_reset(self, wanted: str) -> gym.error.ResetNeeded:
        return gym.error.ResetNeeded(f"{self._idle}: call reset() before {wanted}")

    def _wanted_pressure(self, options: Mapping[str, Any]) -> Pressure:
        check_known("reset option", options, self._kind.reset_options)
        if "pressure_kpa" in options:
            return parse_pressure(options["pressure_kpa"], self._engine.nominal_model)
        return self.options.pressure_kpa

    # -- states ------------------------------------------------------------------------------------

    def get_state(self) -> EnvState:
        """Return the state from which the environment continues with the same bits.

        It works before the first `reset` too.
        """
        begun, ended = self._idle != NOT_BEGUN, self._idle not in (NOT_BEGUN, None)
        return EnvState(
            self._setup,
            take(self._engine),
            _FLAGS[begun],
            _FLAGS[ended],
            self.ended_by,
            (self._np_random_seed,),
            generator_state(self._np_random),
        )

    def set_state(self, state: EnvState) -> None:
        """Continue from a state of this environment or of one with the same arguments.

        Args:
            state: result of `get_state`.
        Raises:
            TypeError: not a state.
            StateError: a damaged state, or one with another task, options or model, with the
                differences. The environment is unchanged then.
        """
        state = check_state(state, self._setup, 1)
        put(self._engine, state.simulation)
        self.__dict__.pop("plant", None)
        self.ended_by = state.ended_by or ""
        self._np_random_seed = state.seeds[0]
        self._np_random = generator_at(state.generator, self._np_random)
        self._commands.begin(self._number("rest_regulator"))
        ended = f"the episode ended at {self.time:g} s" if any(state.ended) else None
        self._wait(ended if any(state.begun) else NOT_BEGUN)

    def _made_as(self) -> Setup:
        return setup(self._engine, num_envs=SINGLE, precision="double")

    # -- length of an episode ----------------------------------------------------------------------

    @property
    def horizon(self) -> int:
        """Control steps after which an episode is truncated."""
        return self._engine.horizon

    def limit_steps(self, steps: int) -> None:
        """Truncate after a number of control steps, or at the task's end if that comes first.

        `gym.make(id, max_episode_steps=steps)` calls it, so that the last info of an episode
        contains the summary.
        """
        self._engine.limit_steps(steps)
        self.options = self._engine.options

    @property
    def spec(self) -> EnvSpec | None:
        """Gymnasium's spec with JSON arguments and the true number of steps."""
        return self.__dict__.get("spec")

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:  # type: ignore[override]
        self.__dict__["spec"] = completed_spec(spec, self.horizon)

    # -- actions and pictures ----------------------------------------------------------------------

    def action(self, voltage: float, regulator_voltage: float | None = None) -> NDArray[np.float64]:
        """Return the action for given voltages (V), limited to 0-10 V.

        It is float64, which `step` uses unchanged; float32 would change a voltage by up to 0.3 uV.

        Args:
            voltage: command (V) of the task's actuator: motor or regulator.
            regulator_voltage: regulator command (V), with `regulator_action`; by default the one
                that holds the initial pressure of the episode.
        """
        return self._commands.action_for(voltage, regulator_voltage)

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """Return a picture of the station and of the trial so far, RGB.

        Returns:
            Shape (render_width / 2, render_width, 3); None if a window shows it
            (`render_mode="human"`).

        Raises:
            gymnasium.error.ResetNeeded: no episode has begun.
        """
        if self.render_mode is None:
            gym.logger.warn(
                "render() draws nothing without a render mode; make the environment with "
                'render_mode="rgb_array"'
            )
            return None
        if not self._display.has_window:
            return self.picture()
        if self._idle == NOT_BEGUN:
            raise self._needs_reset("render()")
        self._display.show(self)
        return None

    def picture(self) -> NDArray[np.uint8]:
        """Return the picture of `render` in every render mode."""
        if self._idle == NOT_BEGUN:
            raise self._needs_reset("render()")
        return self._display.draw(self, self._history())

    def _history(self) -> History:
        position = self.trajectory()
        return History(np.arange(len(position)) / SAMPLE_RATE_HZ, position, self.voltages)

    def close(self) -> None:
        """Free the picture and close the window."""
        self._display.close()


def _no_step(_: object) -> int:
    """What is called in the place of a step where there is no episode."""
    return NOT_READ


_FIRST = np.zeros(1, np.int64)
_FLAGS = (b"\x00", b"\x01")
