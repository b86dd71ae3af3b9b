"""The state of an engine as a value: take, check and restore it."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pma_gym.engine.engine_memory import EngineMemory
from pma_gym.metrics import SAMPLE_RATE_HZ
from pma_gym.plant.model import Model
from pma_gym.plant.program import vector
from pma_gym.tasks import PACE

_WORD = 1 << 32


class StateError(ValueError):
    """A state does not fit an environment; the message has the reason and the fix."""


class Snapshot(NamedTuple):
    """The state of n environments: what changes from step to step and from episode to episode.

    Each field but the last is the bytes of an array in C order, little-endian on every machine that
    this package runs on; `np.frombuffer` reads one.

    Attributes:
        numbers: what the compiled step reads and writes, float64, shape (n, numbers), in the order
            of `setup`'s entry `numbers`. Control steps and the random numbers' key and counter
            stand there as int64.
        pressures: gauge pressure at the start of every episode (Pa), float64, shape (n,).
        observations: last observation, float32, shape (n, entries).
        rewards: last reward, float64, shape (n,).
        flags: last terminated and truncated, bool, shape (2, n).
        trajectory: true position at k / 384 s so far, of a single environment, float64.
        voltages: voltage of the actuator in every step so far (V), of a single environment,
            float64.
        models: the drawn Model of each environment's episode, None for the nominal one; empty if
            none is drawn.
    """

    numbers: bytes
    pressures: bytes
    observations: bytes
    rewards: bytes
    flags: bytes
    trajectory: bytes
    voltages: bytes
    models: tuple[Model | None, ...]


def take(engine: EngineMemory) -> Snapshot:
    """Return the state of an engine's environments."""
    trajectory = voltages = b""
    if engine.width == 1:
        row = engine.records[0, :, 0]
        numbers = row.tobytes()
        offsets = engine.state_layout.offsets
        trajectory = engine.trace[: int(row[offsets["sample"]])].tobytes()
        voltages = engine.voltages[: engine.steps(0)].tobytes()
    else:
        numbers = engine.rows(np.arange(engine.count)).tobytes()
    return Snapshot(
        numbers,
        engine.pressures.tobytes(),
        engine.observations.tobytes(),
        engine.rewards.tobytes(),
        engine._all_flags[:, : engine.count].tobytes(),
        trajectory,
        voltages,
        _models(engine),
    )


def _models(engine: EngineMemory) -> tuple[Model | None, ...]:
    if engine._shares_table:
        return ()
    nominal = engine.nominal.model
    return tuple(None if model is nominal else model for model in engine.models)


def put(engine: EngineMemory, state: Snapshot) -> None:
    """Check a state and restore it to an engine's environments.

    Raises:
        StateError: a part of another size, or an impossible number; the engine is unchanged then.
    """
    n, size = engine.count, engine.state_layout.size
    numbers = _array(state, "numbers", np.float64, n * size).reshape(n, size)
    pressures = _array(state, "pressures", np.float64, n)
    observations = _array(state, "observations", np.float32, engine.observations.size)
    rewards = _array(state, "rewards", np.float64, n)
    flags = _array(state, "flags", np.uint8, 2 * n).reshape(2, n)
    _check_numbers(engine, numbers)
    is_single = engine.width == 1
    single = numbers[0, engine.state_layout.offsets["sample"]] if is_single else 0
    trajectory = _array(state, "trajectory", np.float64, int(single))
    steps = numbers.view(np.int64)[:, engine.state_layout.offsets["count"]]
    voltages = _array(state, "voltages", np.float64, int(steps[0]) if is_single else 0)
    _check_models(engine, state.models)
    # From here on nothing can fail.
    _put_models(engine, state.models)
    _put_numbers(engine, numbers)
    engine._draw_tasks(np.arange(n))
    engine.pressures[:] = pressures
    engine.observations[:] = observations.reshape(engine.observations.shape)
    engine.rewards[:] = rewards
    engine._all_flags[:, :n] = flags != 0
    engine.trace[: len(trajectory)] = trajectory
    engine.voltages[: len(voltages)] = voltages


def _array(state: Snapshot, name: str, kind: Any, length: int) -> NDArray[Any]:  # noqa: ANN401
    data = getattr(state, name)
    wanted = length * np.dtype(kind).itemsize
    if not isinstance(data, bytes) or len(data) != wanted:
        got = f"{len(data)}" if isinstance(data, bytes) else type(data).__name__
        raise StateError(
            f"{name} of a state must be {wanted} bytes here, {length} numbers of "
            f"{np.dtype(kind).name}; got {got}: the state is damaged; take it anew with get_state()"
        )
    return np.frombuffer(data, kind)


def _put_numbers(engine: EngineMemory, numbers: NDArray[np.float64]) -> None:
    offsets, wholes = engine.state_layout.offsets, numbers.view(np.int64)
    if engine.width == 1:
        engine.records[0, :, 0] = numbers[0]
    else:
        block, lane = np.divmod(np.arange(engine.count), engine.width)
        engine.records[block, :, lane] = numbers
    for i in range(2):
        engine._keys[:, i] = wholes[:, offsets[f"key_{i}"]]
    engine._episodes[:] = wholes[:, offsets["episode"]]
    # Before the first seed there is no key, and no episode either.
    if not engine._keys[:, 0].all():
        engine._episodes[~engine._keys.any(axis=1)] = -1


def _check_numbers(engine: EngineMemory, numbers: NDArray[np.float64]) -> None:
    """Refuse what would be read or written beyond an array's end."""
    offsets, wholes = engine.state_layout.offsets, numbers.view(np.int64)
    steps = engine.task.steps(engine.options.control_rate_hz)
    counts, samples = wholes[:, offsets["count"]], numbers[:, offsets["sample"]]
    lowest, highest = _range(counts)
    # Samples are counted up to the control step's end; a few are rounding.
    early = counts * (engine.options.period * SAMPLE_RATE_HZ) + 3.0 - samples
    keys = [n for i in range(2) for n in _range(wholes[:, offsets[f"key_{i}"]])]
    if not (0 <= lowest and highest <= steps):
        rule = f"control steps must lie in 0-{steps}, got {lowest} to {highest}"
    # `not >=`: NaN is out of every range.
    elif not (_range(samples)[0] >= 0.0 and _range(early)[0] >= 0.0):
        rule = "samples at 384 Hz must go with the control steps"
    elif not _range(numbers[:, offsets["size"]])[0] >= 0.0:
        rule = "the integrator's next step must be 0 s or longer"
    elif any(_range(numbers[:, offsets[name]])[0] < 0.0 for name in _squares(engine)):
        rule = "sums of squares must not be negative"
    elif not (0 <= min(keys) and max(keys) < _WORD):
        rule = f"keys of random numbers must lie in 0-{_WORD - 1}, got {keys}"
    elif not _range(wholes[:, offsets["episode"]])[0] >= -1:
        rule = "episodes must count from 0"
    else:
        return
    raise StateError(f"{rule}: the state is damaged; take it anew with get_state()")


def _squares(engine: EngineMemory) -> list[str]:
    pace = PACE.phases if engine.task.exercise else ()
    sums = [f"sum_{phase.name}" for phase in engine.task.schedule.phases]
    return [*sums, *(f"pace_{phase.name}" for phase in pace)]


def _range(column: NDArray[Any]) -> tuple[Any, Any]:
    """Smallest and largest; of one number without the cost of an array's."""
    if len(column) == 1:
        return (column.item(),) * 2
    return column.min().item(), column.max().item()


def _check_models(engine: EngineMemory, models: tuple[Model | None, ...]) -> None:
    wanted = 0 if engine._shares_table else engine.count
    if not isinstance(models, tuple) or len(models) != wanted:
        raise StateError(f"models of a state must be a tuple of {wanted} here, got {models!r}")
    nominal = engine.nominal.model
    for model, present in zip(models, engine.models, strict=False):
        if model is None or model is present:
            continue
        if not isinstance(model, Model) or model.lengths() != nominal.lengths():
            raise StateError(
                "models of a state must have the effects of the nominal model, with rows of their "
                f"lengths, got {model!r}"
            )


def _put_models(engine: EngineMemory, models: tuple[Model | None, ...]) -> None:
    nominal = engine.nominal
    for index, model in enumerate(models):
        drawn = nominal.model if model is None else model
        if drawn is engine.models[index]:
            continue
        engine.models[index] = drawn
        block, lane = divmod(index, engine.width)
        engine._tables[block, :, lane] = engine._table_of(vector(drawn, nominal.tolerance))
