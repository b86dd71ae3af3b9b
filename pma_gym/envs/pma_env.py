"""The environment: a task on a plant, seen through the plant's sensors."""

from collections.abc import Callable, Mapping
from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from pma_gym.engine.actions import CommandLine
from pma_gym.engine.cpu.python_step import NOT_READ
from pma_gym.engine.cpu.step_writer import BAD_ACTION
from pma_gym.engine.engine import Engine
from pma_gym.engine.option_checks import Pressure, check_known, check_named, parse_pressure
from pma_gym.engine.options import EnvironmentOptions, parse_options, parse_task
from pma_gym.engine.snapshot import put, take
from pma_gym.envs.batch import parse_seed
from pma_gym.envs.copies import Copies
from pma_gym.envs.episode import NOT_BEGUN, Episode
from pma_gym.envs.function_rewards import FunctionRewards
from pma_gym.envs.rendering.display import Display
from pma_gym.envs.rendering.history import History
from pma_gym.envs.rendering.picture_size import USUAL_WIDTH, check_render_width
from pma_gym.envs.seeding import SeededByReset
from pma_gym.envs.setup import SINGLE, Setup, setup
from pma_gym.envs.specs import completed_spec
from pma_gym.envs.state import EnvState, check_state, generator_at, generator_state
from pma_gym.envs.summary import last_info, step_info
from pma_gym.metrics import SAMPLE_RATE_HZ
from pma_gym.tasks import Task

OWN = ("task", "render_mode", "render_width")
"""Keyword arguments of an environment beside the options."""

RESET_OPTIONS = ("pressure_kpa",)


class PMAEnv(Copies, SeededByReset, Episode, gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """Tracking with a pneumatic muscle that a servo drive pulls through a cable.

    In every control step kT the agent commands a voltage, which is held until (k+1)T; a position is
    to follow the task's reference. An episode begins settled.

    ## Tasks
    | task | what follows what | actuator |
    |---|---|---|
    | `displacement` | the muscle's extension: 5 mm/s for 5 s | motor |
    | `rotation` | the pulley's rotation: 0-90 deg in 5 s, held 5 s, back in 5 s | motor |
    | `displacement_sine`, `_multisine`, `_steps`, `_speeds` | extension, 10 s in 25 mm | motor |
    | `rotation_sine`, `_multisine`, `_steps`, `_speeds` | rotation, 10 s in 90 deg | motor |
    | `isotonic` | contraction: 12.5 mm in 2.5 s, held 2.5 s, back in 2.5 s | regulator |
    | `triangle_low` | contraction: 11.4 mm up and down in 4 s, three times | regulator |
    | `triangle_high` | contraction: 5.5 mm up and down in 10 s, three times | regulator |
    | `isokinetic_exercise` | an operator's joint: 0-90 deg in 5 s, held, back | regulator |
    | `isotonic_exercise` | the moment at his joint: 8 N m | regulator |
    | `profile_exercise` | the moment at his joint, by its angle | regulator |

    The motor's tasks begin with no load at a pressure that the regulator holds. The regulator's
    begin under a load that the motor holds (200, 150 and 400 N), by the voltage that the nominal
    drive needs for it; contraction counts from there. In an exercise the motor plays an operator
    (`pma_gym.tasks.operator`) with a leg on the lever, and the regulator resists him; a moment
    other than 8 N m comes by name: `isotonic_exercise_6.5`. Drawn references come by number too:
    `displacement_speeds_17` is that of seed 17. A `Task` of one's own, such as
    `pma_gym.tasks.following` makes of a function, can be given instead of a name.

    ## Action
    A Box of shape (1,), or (2,) with `regulator_action`; beyond -1 to 1 it is held there.

    | index | meaning | range | physical |
    |---|---|---|---|
    | 0 | voltage of the task's actuator | -1 to 1 | 0 to 10 V |
    | 1, only with `regulator_action` | regulator voltage | -1 to 1 | 0 to 10 V |

    `action(volts)` gives the action of a voltage.

    ## Observation
    A float32 Box, each entry clipped to -5 to 5. "Position" is the quantity that the task asks
    for, and its range 25 mm, 90 deg, or the contraction's stroke. Extension and rotation count from
    the trial's beginning, so that extension is negative while a regulator's task contracts the
    muscle. `observation_delay_s` is the age of everything measured.

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

    Where an exercise prescribes a moment, 4 is the moment prescribed at the measured angle, 5 that
    less the measured one, and the position heard before is the moment's excess; the range is the
    greatest moment prescribed, and there is no preview.

    `table.describe()` prints the table of the options in use.

    ## Reward
    By name, of the true error e at the end of the step in percent of the range, and of the
    largest change da of an action since the step before:

    | name | reward of a step |
    |---|---|
    | `absolute` (default) | -abs(e) |
    | `quadratic` | -e^2 |
    | `gaussian` | exp(-e^2), 0 where e^2 is 12 or more |
    | `smooth` | -abs(e) - 0.1 abs(da) |

    A terminated episode also gets, for every step until truncation that it did not reach, the
    reward of e = 100.
    `reward_scale` multiplies all of it.

    `reward` may also be a function, which Python calls after every step with four floats: e, da,
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

    An exercise also ends where moment (24 N m) or speed of the joint (60 deg/s) are not safe. Its
    safety layer (`safety`, on by default; `pma_gym.tasks.safety_filter`) holds the regulator's
    command away from there.

    `truncated` once the last sample of the trial at 384 Hz, 1922/384 s after its last phase began,
    is reached: at 100 Hz after 501 steps (displacement), 1501 (rotation), 1001 (the unseen
    references), 751 (isotonic), 1201 or 3001 (triangles), 1501 (exercises). `max_episode_steps`
    truncates earlier, with the same last info.

    ## Disturbances
    By name, `disturbances`; drawn at every reset, at random times, by the environment's seed:

    | name | what comes, every 2.5 s on average |
    |---|---|
    | `none` (default) | |
    | `regulator` | the regulator's pressure jumps by 25 kPa, away from its line and back in turn |
    | `hand_push` | somebody at the slide pulls or pushes with 50 N, for 0.2 to 0.8 s at a time |
    | `regulator_and_hand_push` | both |

    A jump adds volts to the regulator's command, by the nominal line and as far as
    0-10 V go; the hand's force adds to the muscle's at the slide. Both come with the control
    step after their time. `env.disturbance` and `env.events` tell, but not controllers.

    ## Info
    | key | value | unit |
    |---|---|---|
    | `time_s` | since the trial began | s |
    | `extension_mm`, `rotation_deg` or `contraction_mm` | true position | mm, deg |
    | `measured_` and the same | as the agent receives it | mm, deg |
    | `reference_mm` or `reference_deg` | reference now | mm, deg |
    | `error_mm` or `error_deg` | true position less reference | mm, deg |
    | `motor_voltage_v`, `regulator_voltage_v` | as the station receives it in this step | V |
    | `pressure_kpa`, `load_n` | true gauge pressure and cable tension | kPa, N |
    | `extrapolated` | pressure outside the dissertation's trials or the model's validity | |
    | of an exercise: `moment_nm`, `operator_nm` | at the joint; that the operator means | N m |
    | `speed_deg_s`, `power_w` | of the joint; that it gives the device | deg/s, W |
    | if it prescribes a moment: `rotation_deg`, `prescribed_nm` | angle, moment | deg, N m |
    | and `excess_nm` for the position, `_nm` for `_mm` | moment less prescribed | N m |
    | at the end: `rmse_mm`, `rmse_deg` or `rmse_nm`, ... | see `episode_summary` | |
    | at the end: `ended_by` | the limit that terminated the episode, in words, else "" | |

    ## Reset options
    `reset(options={"pressure_kpa": 300})` sets the pressure of one episode, as the keyword does.

    ## Versions
    | version | change |
    |---|---|
    | v0 | first |

    Args:
        task: name of a task, or a Task.
        render_mode: None; `rgb_array`: `render` returns a picture; or `human`: a window (pygame,
            extra `view`) shows `reset` and every step at real time, until its user closes it.
        render_width: width of the pictures (pixels), a multiple of 4; they are half as high.
        options: keyword arguments, see `Options`.

    Attributes:
        task: the Task.
        options: the checked Options.
        table: the ObservationTable.
        nominal_plant: the Plant of the nominal model.
        plant: the Plant of this episode; differs from the nominal one with `randomisation`.
        condition: where the plant stands.
        pressure: gauge pressure that this episode began at (Pa).
        ended_by: the limit that terminated the episode, in words; "" while none has.
        horizon: control steps after which an episode is truncated.

    Example:
        >>> env = PMAEnv("displacement", model="serres2008", pressure_kpa=300, noise=False)
        >>> observation, info = env.reset(seed=1)
        >>> observation, reward, *_, info = env.step(env.action(2.0))
        >>> info["time_s"], info["motor_voltage_v"], round(info["extension_mm"], 2)
        (0.01, 2.0, 0.91)
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 100}

    def __init__(
        self,
        task: str | Task = "displacement",
        render_mode: str | None = None,
        render_width: int = USUAL_WIDTH,
        **options: Unpack[EnvironmentOptions],
    ) -> None:
        """Check the options and compile the plant."""
        if render_mode is not None:
            check_named("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self.render_width = check_render_width(render_width)
        self.options = parse_options(options, "PMAEnv.__init__()", OWN)
        self.task = parse_task(task, self.options)
        self._engine = Engine(self.task, self.options)
        self.observation_space = self._engine.table.space
        self._commands = CommandLine(self.options, self.task.actuator)
        self.action_space = self._commands.space
        # A film of every step plays in real time.
        self.metadata = self.metadata | {"render_fps": round(self.options.control_rate_hz)}
        self.ended_by = ""
        self._idle: str | None = NOT_BEGUN
        self._attach()

    _ATTACHED = frozenset(
        {"nominal_plant", "table", "plant", "_offsets", "_row", "_measured", "_observed", "_given"}
        | {"_made", "_datum", "_display", "_advance"}
    )

    def _attach(self) -> None:
        """Point into the engine."""
        self.nominal_plant = self._engine.nominal
        self.table = self._engine.table
        self._row = self._engine.records[0, :, 0]
        self._find_offsets()
        self._observed = self._engine.observations[0]
        self._given = self._engine.actions[0]
        self._made = self._engine.advance(self._observed.copy, self._given)
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
            seed: seed of everything random in the episodes from here on.
            options: may hold `pressure_kpa` for this episode.
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
        """Command the station, let one control step pass, return its result.

        Raises:
            ValueError: an action of the wrong shape, or not finite.
            gymnasium.error.ResetNeeded: no episode, or one that has ended.
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
        self.ended_by = info["ended_by"]
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
        check_known("reset option", options, RESET_OPTIONS)
        if "pressure_kpa" in options:
            return parse_pressure(options["pressure_kpa"])
        return self.options.pressure_kpa

    # -- states ------------------------------------------------------------------------------------

    def get_state(self) -> EnvState:
        """All that the environment needs to go on from here with the same bits, as a value.

        Before the first `reset` too: then it is the state of an environment that waits for it.
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
        """Go on from a state, of this environment or of another one that was made as this.

        Args:
            state: what `get_state` gave.
        Raises:
            TypeError: no state.
            StateError: a state of another task, other options or another model, naming what
                differs; or a damaged one. Nothing has changed then.
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
        """Truncate after so many control steps, or at the task's end if that comes first.

        `gym.make(id, max_episode_steps=steps)` calls it, so that the last info of an episode has
        the episode's summary.
        """
        self._engine.limit_steps(steps)
        self.options = self._engine.options

    @property
    def spec(self) -> EnvSpec | None:
        """How Gymnasium made it: with plain arguments and the true number of steps, for JSON."""
        return self.__dict__.get("spec")

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:  # type: ignore[override]
        self.__dict__["spec"] = completed_spec(spec, self.horizon)

    # -- actions and pictures ----------------------------------------------------------------------

    def action(self, voltage: float, regulator_voltage: float | None = None) -> NDArray[np.float64]:
        """The action that commands these voltages (V), held to 0-10 V.

        In float64, which `step` takes as it is: float32 would move a voltage by up to 0.3 uV.

        Args:
            voltage: command (V) of the task's actuator: motor or regulator.
            regulator_voltage: regulator command (V), with `regulator_action`; if not given, the
                one that holds the pressure of the episode's start.
        """
        return self._commands.action_for(voltage, regulator_voltage)

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """A picture of the station and of the trial so far, RGB.

        Returns:
            Shape (render_width / 2, render_width, 3); None where a window shows it
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
        """The picture that `render` gives, whatever the render mode."""
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
