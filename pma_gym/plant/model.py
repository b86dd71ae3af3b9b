"""Models: a plant's effects with their parameters, read from and written to TOML files."""

import difflib
import itertools
import reprlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from pma_gym.documents import DocumentError, read_toml
from pma_gym.effects import CATALOGUE, Effect
from pma_gym.effects.effect import Parameters, Value
from pma_gym.effects.ports import SENSOR_DELAY, Port, measured_output
from pma_gym.effects.rig_ports import unknown_signal
from pma_gym.effects.user_effects import (
    EFFECTS_FROM,
    HEAD,
    how_to_load,
    load_named_effects,
    source_of,
    sources_of,
)
from pma_gym.files import is_path, missing_file
from pma_gym.limits import LimitError
from pma_gym.plant.parameter_rows import LINE_FORM, Note, ParameterRow, toml_text
from pma_gym.plant.rigs import RIGS, Rig

SCHEMA = 1
_shown = reprlib.repr
_HEAD = HEAD[:-1]


class ModelError(ValueError):
    """Invalid model; the message has the error, its place and the fix."""


@dataclass(frozen=True)
class Model:
    """A plant's effects and their parameters.

    Attributes:
        name: short name.
        title: one line of description.
        plant: name of its rig: `station`, `cascade` or `slide`.
        parameters: NamedTuple of parameters (SI) by effect name, in catalogue order.
        notes: source and interval, keyed by `effect.parameter_unit`.
    """

    name: str
    title: str
    plant: str
    parameters: Mapping[str, Parameters]
    notes: Mapping[str, Note] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Freeze the parameters and check that the plant's ports are filled."""
        for name in self.parameters:
            known_effect(name)
        ordered = {name: self.parameters[name] for name in CATALOGUE if name in self.parameters}
        object.__setattr__(self, "parameters", MappingProxyType(ordered))
        object.__setattr__(self, "notes", MappingProxyType(dict(self.notes)))
        _check_ports(self)

    def __reduce__(self) -> tuple[Any, tuple[object, ...]]:
        """Copy and pickle as numbers, because the class of a user effect is of one process."""
        numbers = {name: values._asdict() for name, values in self.parameters.items()}
        head = {key: getattr(self, key) for key in _HEAD[1:]}
        return _unpickled, (head, numbers, dict(self.notes), list(sources_of(self.parameters)))

    @property
    def effects(self) -> dict[str, Effect]:
        """The model's effects by name, in catalogue order."""
        return {name: CATALOGUE[name] for name in self.parameters}

    @property
    def rig(self) -> Rig:
        """The model's rig."""
        return RIGS[self.plant]

    def vector(self) -> np.ndarray:
        """All parameters in SI as one flat array, in the order the compiled plant reads them."""
        flat: list[float] = []
        for values in self.parameters.values():
            for value in values:
                flat.extend(value if isinstance(value, tuple) else (value,))
        return np.array(flat, dtype=np.float64)

    def lengths(self) -> dict[str, list[int]]:
        """Lengths of parameters by effect: 0 for a number, the number of entries for a row."""
        return {
            name: [len(v) if isinstance(v, tuple) else 0 for v in values]
            for name, values in self.parameters.items()
        }

    def replace(self, values: Mapping[str, Value], name: str | None = None) -> "Model":
        """Return a model with other values, keyed by `effect.parameter_unit`, in file units.

        Raises:
            ModelError: an unknown parameter (with the nearest known name) or one out of bounds.
        """
        changes: dict[str, dict[str, Value]] = {}
        known = set(self.paths())
        for path, value in values.items():
            if path not in known:
                raise ModelError(f"model {self.name} has no parameter {path}{self._nearest(path)}")
            effect, _, parameter = path.partition(".")
            changes.setdefault(effect, {})[parameter] = value
        parameters = dict(self.parameters)
        try:
            for effect, changed in changes.items():
                parameters[effect] = CATALOGUE[effect].changed(parameters[effect], changed)
        except ValueError as error:
            raise ModelError(str(error)) from error
        notes = {path: note for path, note in self.notes.items() if path not in values}
        return replace(self, name=name or self.name, parameters=parameters, notes=notes)

    def with_effects(
        self, effects: Mapping[str, Mapping[str, Value]] | Iterable[str], name: str | None = None
    ) -> "Model":
        """Return a model with effects of the catalogue added, in any order.

        Args:
            effects: values by effect and `parameter_unit`, in file units; or only names. Other
                parameters keep the model's values, or are neutral, so that the effect is inactive.
            name: name of the new model; this one's if not given.
        Raises:
            ModelError: an unknown effect or parameter, one out of bounds, a missing value without
                a neutral one, or an effect that does not fit this rig.

        Example:
            >>> drags = load_model("serres2008").with_effects({"hysteresis": {"force_n": 12.0}})
            >>> round(drags.parameters["hysteresis"].force)
            12
        """
        if isinstance(effects, str):
            raise ModelError(f"with_effects takes a list of names or a dict, got {effects!r}")
        requested = effects if isinstance(effects, Mapping) else dict.fromkeys(effects, {})
        parameters = dict(self.parameters)
        for effect, values in requested.items():
            parameters[effect] = self._added(effect, values)
        kept = {
            path: note
            for path, note in self.notes.items()
            if path.partition(".")[2] not in requested.get(path.partition(".")[0], {})
        }
        return replace(self, name=name or self.name, parameters=parameters, notes=kept)

    def _added(self, effect: str, values: Mapping[str, Value]) -> Parameters:
        """Parameters of an effect to be added, some of them given."""
        known = known_effect(effect)
        before = self.parameters.get(effect, known.neutral)
        missing = [
            file_key
            for file_key in known.names_in_files()
            if file_key not in values and file_key not in known.defaults
        ]
        if before is None and missing:
            raise ModelError(
                f"[{effect}] is never absent: it has no neutral values; give {', '.join(missing)}"
            )
        if before is None:
            return _parse(known, values)
        try:
            return known.changed(before, values)
        except KeyError as error:
            raise ModelError(
                f"[{effect}] has no parameter {error.args[0]}; it has "
                f"{', '.join(known.names_in_files())}"
            ) from None
        except ValueError as error:
            raise ModelError(str(error)) from error

    def values_in_files(self, effect: str) -> dict[str, Value]:
        """An effect's values, keyed by their names in files."""
        return CATALOGUE[effect].values_in_files(self.parameters[effect])

    def rows(self) -> Iterator[ParameterRow]:
        """All parameters with interval, unit and source, in the order of files."""
        for effect in self.parameters:
            stems = CATALOGUE[effect].names_in_files()
            for file_key, value in self.values_in_files(effect).items():
                note = self.notes.get(f"{effect}.{file_key}", Note())
                unit = CATALOGUE[effect].quantities[stems[file_key]].unit
                yield ParameterRow(
                    effect, stems[file_key], value, note.low, note.high, unit, note.source
                )

    def _repr_html_(self) -> str:
        """Table of effects and parameters for notebooks."""
        from pma_gym.pages.document import TextTable
        from pma_gym.pages.figures import notebook_html

        header = ["Effect", "Parameter", "Value", "95 % interval", "Unit", "Source"]
        rows = [
            [r.effect, r.parameter, r.value_text, r.interval_text, r.unit, r.source]
            for r in self.rows()
        ]
        title = f"{self.name} ({self.plant}): {self.title}"
        return notebook_html([TextTable(title, header, rows, words=2)])

    def paths(self) -> Iterator[str]:
        """All parameters as `effect.parameter_unit`."""
        for effect in self.parameters:
            yield from (f"{effect}.{name}" for name in CATALOGUE[effect].names_in_files())

    def _nearest(self, path: str) -> str:
        near = difflib.get_close_matches(path, list(self.paths()), 1)
        return f"; did you mean {near[0]}?" if near else f"; it has {', '.join(self.paths())}"


def shipped_models() -> dict[str, Path]:
    """Paths of the package's models, keyed by name."""
    folder = Path(str(resources.files("pma_gym") / "models"))
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def load_model(source: "str | Path | Model") -> Model:
    """Load a model by its shipped name or the path of a TOML file; return a Model unchanged.

    Raises:
        ModelError: no such model, invalid TOML, another schema, an unknown or missing effect or
            parameter, a value out of bounds or not a number; with the file and the fix.
    """
    if isinstance(source, Model):
        return source
    shipped = shipped_models()
    if str(source) in shipped:
        return _read(shipped[str(source)])
    if is_path(source):
        return _read(_existing(Path(source)))
    near = difflib.get_close_matches(str(source), list(shipped), 1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise ModelError(
        f"no model {str(source)[:200]!r}: give a shipped name ({', '.join(shipped)}) "
        f"or the path of a .toml file{hint}"
    )


def _existing(path: Path) -> Path:
    fault = missing_file(path)
    if fault:
        raise ModelError(fault)
    return path


def _read(path: Path) -> Model:
    # A fault of the user's files is none of this one.
    load_named_effects()
    try:
        return parse_model(read_toml(path, LINE_FORM, finite=False), path.parent)
    except (DocumentError, LimitError) as error:
        raise ModelError(str(error)) from error
    except ValueError as error:
        raise ModelError(f"{path}: {error}") from error


def parse_model(document: Mapping[str, Any], folder: Path | None = None) -> Model:
    """Make a model from a parsed TOML document.

    Args:
        document: the document.
        folder: where its file lies, from which the files that it names count.
    Raises:
        ModelError: as `load_model`.
    """
    if document.get("schema") != SCHEMA:
        actual = f"got {_shown(document['schema'])}" if "schema" in document else "there is none"
        raise ModelError(
            f"schema must be {SCHEMA}, the only form of model files that this version reads, "
            f"{actual}; write schema = {SCHEMA} as the first line"
        )
    files = document.get(EFFECTS_FROM, [])
    if not isinstance(files, list) or not all(isinstance(name, str) for name in files):
        raise ModelError(
            f"{EFFECTS_FROM} must be a list of the names of Python files, {EFFECTS_FROM} = "
            f'["mine.py"]; got {_shown(files)}'
        )
    missing = [key for key in _HEAD if key not in document]
    if missing:
        raise ModelError(f"a model needs {', '.join(_HEAD)}; missing: {', '.join(missing)}")
    for key in _HEAD[1:]:
        if not isinstance(document[key], str):
            raise ModelError(f'{key} must be a text, {key} = "...", got {_shown(document[key])}')
    files = _effect_files(document.get(EFFECTS_FROM, []), folder)
    tables = {key: value for key, value in document.items() if key not in HEAD}
    parameters, notes = {}, {}
    for effect, table in tables.items():
        values, table_notes = _split(effect, table)
        parameters[effect] = _parse(known_effect(effect, files), values)
        notes |= table_notes
    head = {key: document[key] for key in ("name", "title", "plant")}
    return Model(**head, parameters=parameters, notes=notes)


def _effect_files(names: object, folder: Path | None) -> list[str]:
    """The files that user effects come from, by the path from here where they lie in a folder."""
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise ModelError(
            f"{EFFECTS_FROM} must be a list of the names of Python files, {EFFECTS_FROM} = "
            f'["mine.py"]; got {_shown(names)}'
        )
    return [str(folder / n) if folder and (folder / n).is_file() else n for n in names]


def _split(effect: str, table: object) -> tuple[dict[str, Value], dict[str, Note]]:
    if not isinstance(table, dict):
        raise ModelError(f"{effect} = {_shown(table)} is no table; parameters stand under [effect]")
    values, notes = {}, {}
    for name, content in table.items():
        entry = content if isinstance(content, dict) else {"value": content}
        low, high = entry.get("low"), entry.get("high")
        if (
            not {"value"} <= set(entry) <= {"value", "low", "high", "source"}
            or not all(end is None or _is_finite(end) for end in (low, high))
            or not isinstance(entry.get("source", ""), str)
        ):
            raise ModelError(
                f"{effect}.{name} must be a number, or a table of value, low and high (numbers) "
                f"and source (text); got {_shown(content)}"
            )
        values[name] = entry["value"]
        notes[f"{effect}.{name}"] = Note(entry.get("source", ""), low, high)
    return values, notes


def _is_finite(value: object) -> bool:
    real = isinstance(value, int | float) and not isinstance(value, bool)
    # A whole number beyond the doubles fits in none.
    return real and abs(value) < 1e308  # type: ignore[arg-type]


def _parse(effect: Effect, values: Mapping[str, Value]) -> Parameters:
    try:
        return effect.parse(values)
    except ValueError as error:
        raise ModelError(str(error)) from error


def known_effect(name: str, files: Sequence[str] = ()) -> Effect:
    """The effect of a name, of the catalogue or of the user's files.

    Args:
        name: its name.
        files: names of the Python files that a model says its user effects come from.
    Raises:
        ModelError: there is none; with what to do.
        OwnEffectError: a file that the environment variable names cannot be used.
    """
    load_named_effects()
    if name in CATALOGUE:
        return CATALOGUE[name]
    if files:
        raise ModelError(
            f"unknown effect [{name}]; the model says that its user effects come from "
            f"{', '.join(files)}, which runs only if you say so: {how_to_load(files)}"
        )
    near = difflib.get_close_matches(name, list(CATALOGUE), 1)
    hint = f"did you mean [{near[0]}]?" if near else f"known: {', '.join(CATALOGUE)}"
    raise ModelError(
        f"unknown effect [{name}]; {hint}; if a Python file of yours defines it, "
        f"{how_to_load(['FILE.py'])}"
    )


def _unpickled(
    head: Mapping[str, str],
    numbers: Mapping[str, Mapping[str, Any]],
    notes: Mapping[str, Note],
    files: Sequence[str],
) -> Model:
    """Make the model of `Model.__reduce__`."""
    try:
        parameters = {
            name: known_effect(name, files).parameters(**values) for name, values in numbers.items()
        }
    except (ModelError, TypeError) as error:
        raise ModelError(f"pickled model {head['name']}: {error}") from error
    return Model(**head, parameters=parameters, notes=notes)


def _check_ports(model: Model) -> None:
    if model.plant not in RIGS:
        raise ModelError(f"plant must be one of {', '.join(RIGS)}, got {model.plant!r}")
    rig = model.rig
    for name, effect in model.effects.items():
        known = effect.port == "part" or measured_output(effect.port)
        if not known and effect.port not in rig.ports:
            raise ModelError(
                f"[{name}] acts at port {effect.port}, which a {rig.name} does not have; "
                f"its ports: {', '.join(rig.ports)}"
            )
        if source_of(name) and (wrong := unknown_signal(effect, rig.name)):
            raise ModelError(f"[{name}] {wrong}")
        _check_sensor(model, effect)
        if name in rig.refused_effects:
            raise ModelError(f"a {rig.name} cannot have [{name}]: {rig.refused_effects[name]}")
    for part in rig.parts:
        if part not in model.parameters:
            file_keys = ", ".join(CATALOGUE[part].names_in_files())
            example = rig.shipped_example
            where = (
                f"copy it from the shipped model {example}" if example else f"it has {file_keys}"
            )
            raise ModelError(f"a {rig.name} needs [{part}]; {where}")
    for name, port in rig.ports.items():
        _check_port(model, name, port)
    for effect, others in rig.companions:
        if effect in model.parameters and not model.parameters.keys() & set(others):
            raise ModelError(
                f"[{effect}] of a {rig.name} needs [{'] or ['.join(others)}] beside it; add that, "
                f"or leave [{effect}] out"
            )
    taking = [each for each in rig.commands if each.effect in model.parameters]
    for one, other in itertools.combinations(taking, 2):
        if one.slot == other.slot:
            raise ModelError(
                f"a {rig.name} has one place for the commands of [{one.effect}] and "
                f"[{other.effect}]; leave one of them out"
            )


def _check_sensor(model: Model, effect: Effect) -> None:
    sensor = effect.name.removesuffix("_delay")
    if effect.port.startswith(SENSOR_DELAY) and sensor not in model.parameters:
        raise ModelError(
            f"[{effect.name}] delays the readings of [{sensor}], which the model does not have; "
            f"add [{sensor}] with {', '.join(CATALOGUE[sensor].names_in_files())}, or leave "
            f"[{effect.name}] out"
        )


def _check_port(model: Model, name: str, port: Port) -> None:
    at = [effect.name for effect in model.effects.values() if effect.port == name]
    if not port.least <= len(at) <= port.most or (port.only and set(at) != set(port.only)):
        fitting = port.only or [effect.name for effect in CATALOGUE.values() if effect.port == name]
        raise ModelError(
            f"port {name} of a {model.plant} takes {port.takes}: {port.result}; "
            f"got {', '.join(at) or 'none'} of {', '.join(fitting)}"
        )


def dump_model(model: Model) -> str:
    """Return the model as TOML text; equal models give equal bytes.

    With user effects it names their files, with a hash of the laws in a comment.
    """
    lines = [f"schema = {SCHEMA}"]
    lines += [f"{key} = {toml_text(getattr(model, key))}" for key in _HEAD[1:]]
    if sources := sources_of(model.parameters):
        names, digests = ", ".join(map(toml_text, sources)), " ".join(sources.values())
        lines.append(f"{EFFECTS_FROM} = [{names}]  # sha256 {digests}")
    for effect in model.parameters:
        lines += ["", f"[{effect}]"]
        for name, value in model.values_in_files(effect).items():
            lines.append(f"{name} = {_entry(value, model.notes.get(f'{effect}.{name}', Note()))}")
    return "\n".join(lines) + "\n"


def _entry(value: Value, note: Note) -> str:
    known = {"value": value, "low": note.low, "high": note.high, "source": note.source or None}
    parts = [f"{key} = {toml_text(part)}" for key, part in known.items() if part is not None]
    return f"{{ {', '.join(parts)} }}"
