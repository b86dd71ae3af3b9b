"""The task, options and model of an environment as text, for comparison and storage.

Gymnasium's `np_random` and `np_random_seed` for episodes with counter-based random numbers.

Copies and pickles of environments, which continue independently with the same bits.
"""

import copy
import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from pma_gym.effects.user_effects import source_of
from pma_gym.engine.engine import Engine
from pma_gym.engine.observation import step_references
from pma_gym.engine.options import Options
from pma_gym.pickling import Packed, packed
from pma_gym.plant.model import Model

Setup = tuple[tuple[str, str], ...]
"""Names and values of the task, the options and the model's parameters."""

SINGLE = "a PMAEnv"
"""Text of `num_envs` for a single environment."""

FEW = 4
"""Largest number of differences in a message."""

_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")


def setup(engine: Engine, **others: object) -> Setup:
    """Return everything that the continuation from a state depends on.

    Args:
        engine: the engine.
        others: what else does, by name.
    """
    said = {name: _text(value) for name, value in others.items()}
    said |= _task(engine)
    # The nominal model stands elsewhere, number by number, wherever it was read from.
    names = [f.name for f in fields(engine.options) if f.name not in ("model", "pressure_kpa")]
    said |= {name: _text(getattr(engine.options, name)) for name in names}
    several = len(set(map(repr, engine.wanted))) > 1
    said["pressures_kpa" if several else "pressure_kpa"] = _text(
        engine.wanted if several else engine.wanted[0]
    )
    said |= _model(engine.nominal_model)
    said["numbers"] = " ".join(engine.state_layout.offsets)
    return tuple(said.items())


def differences(theirs: Setup, ours: Setup) -> str:
    """Describe the differences between two setups; empty if there are none.

    >>> differences((("num_envs", "2"), ("noise", "True")), (("num_envs", "2"), ("noise", "False")))
    'noise is True there and False here'
    """
    known, here = dict(theirs), dict(ours)
    names = [*known, *(name for name in here if name not in known)]
    odd = [name for name in names if known.get(name) != here.get(name)]
    # A PMAEnv has no mode to differ in, and any batch of the same kind takes its state.
    without = {"autoreset_mode"} if here.get("num_envs") == SINGLE else set()
    if known.get("num_envs") == SINGLE:
        without = {"autoreset_mode", "num_envs"}
    odd = [name for name in odd if name not in without]
    # What differs in its task or its model keeps other numbers too.
    if len(odd) > 1 and "numbers" in odd:
        odd.remove("numbers")
    if "task" in odd:
        odd = [name for name in odd if not name.startswith("task.")]
    shown = [
        f"{name} is {_shortened(known.get(name))} there and {_shortened(here.get(name))} here"
        for name in odd[:FEW]
    ]
    more = [f"{len(odd) - FEW} more"] if len(odd) > FEW else []
    return ", ".join(shown + more)


def _shortened(text: str | None) -> str:
    if text is None:
        return "absent"
    return text if len(text) <= 60 else f"{text[:57]}..."


def _task(engine: Engine) -> dict[str, str]:
    """The task by its name, by what is compiled of it, and by the references that it gives."""
    task = engine.task
    said = {"task": task.name, "task.load": _text(task.load), "task.starts": _text(task.starts)}
    if task.exercise is not None:
        said["task.exercise"] = _text(task.exercise)
    digest = hashlib.sha256(repr(task.structure).encode())
    digest.update(step_references(task, engine.options).tobytes())
    digest.update(task.ideals(engine._samples).tobytes())
    return said | {"task.reference": f"{task.name} {digest.hexdigest()[:12]}"}


def _model(model: Model) -> dict[str, str]:
    """A model's parameters and intervals, and the text of the effects that users brought."""
    said = {"model.plant": model.plant}
    for effect in model.parameters:
        for file_key, value in model.values_in_files(effect).items():
            note = model.notes.get(f"{effect}.{file_key}")
            bounds = "" if note is None or note.low is None else f" ({note.low!r}-{note.high!r})"
            said[f"model.{effect}.{file_key}"] = _text(value) + bounds
        text = source_of(effect)
        if text:
            said[f"model.{effect}"] = hashlib.sha256(text.encode()).hexdigest()[:12]
    return said


def _text(value: Any) -> str:  # noqa: ANN401
    """A value as text that is the same in every process.

    >>> _text(300), _text([1, 2.5]), _text(np.float64(0.1)), _text(max)
    ('300.0', '[1.0, 2.5]', '0.1', '<built-in function max>')
    """
    if isinstance(value, bool | np.bool_):
        return repr(bool(value))
    if isinstance(value, int | float | np.number):
        return repr(float(value))
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return type(value).__name__ + _text(value._asdict())  # type: ignore[attr-defined]
    if isinstance(value, list | tuple | range | np.ndarray):
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_text(one)}" for key, one in value.items()) + "}"
    if is_dataclass(value) and not isinstance(value, type):
        parts = {field.name: getattr(value, field.name) for field in fields(value)}
        return type(value).__name__ + _text(parts)
    return value if isinstance(value, str) else _ADDRESS.sub("", repr(value))


SEEDS = 1 << 31
"""Upper bound of drawn seeds, which fits the integers of all libraries."""


class SeededByReset:
    """Derive all random numbers of an episode from the seed of the last `reset`.

    Compiled code computes them from the seed, the episode's number and the step's, and never draws
    from `np_random`. That generator restarts with each seed and serves wrappers and users. A
    generator assigned to `np_random` provides the seed of the next `reset` without a seed.
    """

    _drawn: int | None = None

    @property
    def np_random(self) -> np.random.Generator:
        """Generator with the last seed, for wrappers and users; episodes do not draw from it."""
        return super().np_random  # type: ignore[misc]

    @np_random.setter
    def np_random(self, value: object) -> None:
        if not isinstance(value, np.random.Generator):
            raise TypeError(
                f"np_random must be a numpy.random.Generator, got {type(value).__name__}; set "
                "numpy.random.default_rng(seed), or call reset(seed=...)"
            )
        self._drawn = int(value.integers(SEEDS))

    def _or_drawn(self, seed: Any) -> Any:  # noqa: ANN401
        """The seed that a reset was given, or what was drawn for it from a generator."""
        if seed is None and self._drawn is not None:
            seed = self._drawn
        self._drawn = None
        return seed


def own_seeds(
    requested: Sequence[int | None],
    known: Sequence[int | None],
    indices: NDArray[np.int64],
    first: int | None,
) -> list[int | None]:
    """Return the seeds of a batch's environments at a reset, None for those that keep their seed.

    Args:
        requested: for every environment, the seed given to the reset, or None.
        known: for every environment, its present seed, or None.
        indices: the environments of the reset.
        first: seed of the first environment, with consecutive seeds for the others, if no seeds are
            given or known; None to draw one for each.
    Returns:
        Seeds in the order of indices.

    >>> both = np.arange(2)
    >>> own_seeds([None, None], [None, None], both, 40), own_seeds([7, None], [3, 4], both, None)
    ([40, 41], [7, None])
    """
    seeds = []
    for i in indices.tolist():
        seed = requested[i]
        if seed is None and known[i] is None:
            seed = drawn_seed() if first is None else first + i
        seeds.append(seed)
    return seeds


def drawn_seed() -> int:
    """Draw a seed from the operating system."""
    entropy: Any = np.random.SeedSequence().entropy
    return int(entropy)


class Copies:
    """Support of `copy.copy`, `copy.deepcopy` and pickle for environments.

    A copy has a new engine, with code from the compile cache, and continues from the same state.
    All other attributes are copied.
    """

    _ATTACHED: ClassVar[frozenset[str]] = frozenset()
    """Attributes that point into the engine, set by `_attach`."""

    options: Options
    _setup_of: tuple[Options | None, Setup] = (None, ())

    def _made_as(self) -> Setup:
        """What decides how the environment goes on from a state."""
        raise NotImplementedError

    @property
    def _setup(self) -> Setup:
        """`_made_as` of the present options, made once: every state has it."""
        if self._setup_of[0] is not self.options:
            self._setup_of = self.options, self._made_as()
        return self._setup_of[1]

    def _attach(self) -> None:
        """Make what points into the engine."""
        raise NotImplementedError

    def _kept(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in self._ATTACHED}

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes for pickle.

        Raises:
            pickle.PicklingError: an option or the task's motion cannot be pickled; with the fix.
        """
        kept = self._kept()
        # These name what is wrong; the spec has it too, without a name.
        engine: Engine = kept.get("engine") or kept["_engine"]
        for part in (engine.options, engine.task.schedule):
            part.__getstate__()
        spec = kept.get("spec")
        return kept if spec is None else kept | {"spec": packed("spec", spec)}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Restore the attributes from `__getstate__`."""
        attributes = {n: v.value() if isinstance(v, Packed) else v for n, v in state.items()}
        self.__dict__.update(attributes)
        self._attach()

    def __copy__(self) -> Self:
        """Copy as `copy.deepcopy`, because environments cannot share an engine."""
        return copy.deepcopy(self)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return an independent environment that continues with the same bits."""
        other = type(self).__new__(type(self))
        memo[id(self)] = other
        other.__dict__.update(copy.deepcopy(self._kept(), memo))
        other._attach()
        return other
