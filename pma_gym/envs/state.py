"""The state of an environment as a value, for planners and checkpoints.

Models of randomised stations as exact documents in SI; model files round their numbers.
"""

import base64
import json
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from pma_gym.engine.snapshot import Snapshot, StateError
from pma_gym.envs.setup import Setup, differences
from pma_gym.plant.model import Model, known_effect
from pma_gym.plant.parameter_rows import Note
from pma_gym.units import Quantity

ROUNDING = 1e-9
"""Relative tolerance of a parameter's bounds, for the conversion to SI and back."""


def model_document(model: Model) -> dict[str, Any]:
    """Return a model as numbers and texts, with parameters in SI by effect and field."""
    return {
        "name": model.name,
        "title": model.title,
        "plant": model.plant,
        "parameters": {effect: _floats(p) for effect, p in model.parameters.items()},
        "notes": {path: [n.source, n.low, n.high] for path, n in model.notes.items()},
    }


def parse_model_document(document: Mapping[str, Any]) -> Model:
    """Make a model from a document of `model_document`.

    Raises:
        StateError: an unknown parameter, or a value out of its bounds.
        ModelError: an unknown effect, or effects that do not form a plant.
    """
    parameters = {name: _parameters(name, p) for name, p in document["parameters"].items()}
    notes = {path: _note(path, note) for path, note in document["notes"].items()}
    name, title, plant = (str(document[key]) for key in ("name", "title", "plant"))
    return Model(name, title, plant, parameters, notes)


def _floats(parameters: Any) -> dict[str, Any]:  # noqa: ANN401
    return {
        field: list(map(float, value)) if isinstance(value, tuple) else float(value)
        for field, value in parameters._asdict().items()
    }


def _note(path: str, entry: Any) -> Note:  # noqa: ANN401
    source, low, high = entry
    if not (
        isinstance(source, str) and all(isinstance(n, int | float | None) for n in (low, high))
    ):
        raise StateError(f"the note of {path} must be a text and two numbers, got {entry!r}")
    return Note(source, low, high)


def _parameters(name: str, table: Mapping[str, Any]) -> Any:  # noqa: ANN401
    effect = known_effect(name)
    if set(table) != set(effect.quantities):
        raise StateError(
            f"[{name}] of a drawn station must have {', '.join(effect.quantities)}, got "
            f"{', '.join(map(str, table))}"
        )
    for field, quantity in effect.quantities.items():
        many = field in effect.rows
        numbers = table[field] if many else [table[field]]
        if not isinstance(numbers, list) or not all(_within(quantity, one) for one in numbers):
            raise StateError(
                f"{name}.{quantity.name(field)} of a drawn station must lie in "
                f"{quantity.lower:g}-{quantity.upper:g} {quantity.unit}, got {table[field]!r} in SI"
            )
    values = {f: tuple(v) if isinstance(v, list) else v for f, v in table.items()}
    return effect.checked(effect.parameters(**values))


def _within(quantity: Quantity, number: object) -> bool:
    if not isinstance(number, float) or not math.isfinite(number):
        return False
    lower = quantity.lower - ROUNDING * abs(quantity.lower)
    upper = quantity.upper + ROUNDING * abs(quantity.upper)
    return lower <= quantity.from_si(number) <= upper


FORM = "pma-gym environment state 1"
"""First entry of a state in JSON: its type and format version."""


class EnvState(NamedTuple):
    """State of an environment, from which it continues with the same bits.

    `get_state()` of `PMAEnv` and `PMAVectorEnv` returns one; `set_state(state)` restores it. A
    state is immutable, can be compared and pickled, and `to_json` writes it as text. It contains no
    data of a policy or of the spaces, whose `sample` uses a separate generator.

    Attributes:
        setup: its task, options and model, as names and texts.
        simulation: the numbers of the simulation.
        begun: whether each environment has begun an episode, bool as bytes.
        ended: whether the episode of each environment has ended, bool as bytes.
        ended_by: name of the limit that ended a single environment's episode, or None.
        seeds: seed of each environment's last reset, None before.
        generator: state of `np_random`: the PCG64's state and increment, whether a 32-bit number is
            buffered, and that number; None if there is no generator yet.

    Example:
        >>> from pma_gym.envs import PMAEnv
        >>> env = PMAEnv("displacement", pressure_kpa=300)
        >>> _ = env.reset(seed=1)
        >>> state = env.get_state()
        >>> first = env.step(env.action(2.0))
        >>> env.set_state(state)
        >>> again = env.step(env.action(2.0))
        >>> bool((first[0] == again[0]).all()), first[1:] == again[1:]
        (True, True)
    """

    setup: Setup
    simulation: Snapshot
    begun: bytes
    ended: bytes
    ended_by: str | None
    seeds: tuple[int | None, ...]
    generator: tuple[int, int, int, int] | None

    def spread(self, setup: Setup, count: int) -> "EnvState":
        """Return the state of a batch in which every environment has this single state.

        Args:
            setup: setup of the batch.
            count: number of environments.
        """
        one = self.simulation
        simulation = Snapshot(
            one.numbers * count,
            one.pressures * count,
            one.observations * count,
            one.rewards * count,
            one.flags[:1] * count + one.flags[1:] * count,
            b"",
            b"",
            one.models * count,
        )
        flags = self.begun * count, self.ended * count
        return EnvState(setup, simulation, *flags, None, self.seeds * count, self.generator)

    def to_json(self) -> str:
        """Return the state as JSON text, with arrays in base64."""
        simulation: dict[str, Any] = {
            name: _encoded(value)
            for name, value in self.simulation._asdict().items()
            if name != "models"
        }
        models = [None if m is None else model_document(m) for m in self.simulation.models]
        document = {
            "form": FORM,
            "setup": dict(self.setup),
            "simulation": simulation | {"models": models},
            "begun": _encoded(self.begun),
            "ended": _encoded(self.ended),
            "ended_by": self.ended_by,
            "seeds": self.seeds,
            "generator": self.generator,
        }
        return json.dumps(document)

    @classmethod
    def from_json(cls, text: str) -> "EnvState":
        """Read a state from the text of `to_json`; nothing in the text is executed.

        Raises:
            StateError: invalid text, with the place of the error.
        """
        try:
            document = json.loads(text)
        except (ValueError, TypeError, RecursionError) as error:
            raise StateError(f"a state must be JSON text that to_json() gave: {error}") from None
        if not isinstance(document, dict) or document.get("form") != FORM:
            form = document.get("form") if isinstance(document, dict) else type(document).__name__
            raise StateError(
                f"a state's form must be {FORM!r}, got {form!r}; give to_json()'s text"
            )
        try:
            return cls._parsed(document)
        except StateError:
            raise
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise StateError(
                f"the state is damaged ({type(error).__name__}: {error}); write it anew with "
                "get_state().to_json()"
            ) from None

    @classmethod
    def _parsed(cls, document: dict[str, Any]) -> "EnvState":
        simulation = dict(document["simulation"])
        models = tuple(
            None if m is None else parse_model_document(m) for m in simulation.pop("models")
        )
        arrays = {name: _decoded(value) for name, value in simulation.items()}
        generator = document["generator"]
        return cls(
            tuple((str(name), str(value)) for name, value in document["setup"].items()),
            Snapshot(**arrays, models=models),
            _decoded(document["begun"]),
            _decoded(document["ended"]),
            document["ended_by"],
            tuple(document["seeds"]),
            None if generator is None else tuple(generator),  # type: ignore[arg-type]
        )


def check_state(state: object, ours: Setup, count: int) -> EnvState:
    """Check that a state fits these environments, and return it.

    Args:
        state: the value to check.
        ours: setup of these environments.
        count: number of environments.
    Raises:
        TypeError: not a state.
        StateError: a damaged state, or one with another task, options or model, with the
            differences.
    """
    if not isinstance(state, EnvState):
        raise TypeError(
            f"set_state takes what get_state() gave, or EnvState.from_json(text); got "
            f"{type(state).__name__}"
        )
    if state.setup is not ours and state.setup != ours:
        raise StateError(
            f"the state belongs to another environment: {differences(state.setup, ours)}; make "
            "this one with the task, the options and the model of that one"
        )
    _check_rest(state, count)
    return state


def _check_rest(state: EnvState, count: int) -> None:
    """Refuse flags, seeds and a generator that no environment has."""
    flags = all(isinstance(one, bytes) and len(one) == count for one in (state.begun, state.ended))
    seeds = isinstance(state.seeds, tuple) and len(state.seeds) == count
    if not flags or not seeds or not all(map(_is_seed, state.seeds)):
        raise StateError(
            f"begun, ended and seeds of a state must have {count} entries here, seeds being whole "
            "numbers from 0 on: the state is damaged; take it anew with get_state()"
        )
    generator, limits = state.generator, (1 << 128, 1 << 128, 2, 1 << 32)
    if generator is not None and not (
        isinstance(generator, tuple)
        and len(generator) == len(limits)
        and all(type(n) is int and 0 <= n < end for n, end in zip(generator, limits, strict=True))
    ):
        raise StateError(
            "generator of a state must be None or the four whole numbers of a PCG64, got "
            f"{generator!r}: the state is damaged; take it anew with get_state()"
        )
    if not isinstance(state.ended_by, str | None):
        raise StateError(f"ended_by of a state must be words or None, got {state.ended_by!r}")


def _is_seed(seed: object) -> bool:
    return seed is None or (type(seed) is int and seed >= 0)


def generator_state(generator: np.random.Generator | None) -> tuple[int, int, int, int] | None:
    """Return the state of Gymnasium's generator, a PCG64, as numbers."""
    if generator is None:
        return None
    state: Any = generator.bit_generator.state
    inner = state["state"]
    return inner["state"], inner["inc"], state["has_uint32"], state["uinteger"]


def generator_at(
    numbers: tuple[int, int, int, int] | None, present: np.random.Generator | None
) -> np.random.Generator | None:
    """Return a generator with a given state; the present one is reused if there is one."""
    if numbers == generator_state(present):
        return present
    if numbers is None:
        return None
    generator = present or np.random.Generator(np.random.PCG64(0))
    state, increment, has, left = numbers
    generator.bit_generator.state = {
        "bit_generator": "PCG64",
        "state": {"state": state, "inc": increment},
        "has_uint32": has,
        "uinteger": left,
    }
    return generator


def _encoded(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def _decoded(text: object) -> bytes:
    if not isinstance(text, str):
        raise StateError(f"a state's arrays must be base64 text, got {type(text).__name__}")
    return base64.b64decode(text, validate=True)
