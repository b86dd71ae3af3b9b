"""The shipped models: every value with interval and source, and how the station was identified."""

import re
from collections.abc import Sequence

import numpy as np

from benchmarks.identification.statics import station_limits
from benchmarks.identification.station import TARGETS
from generators.text import code, number, table
from pma_gym.effects import CATALOGUE
from pma_gym.effects.effect import Value
from pma_gym.plant.model import Model, load_model, shipped_models
from pma_gym.plant.parameter_rows import Note
from pma_gym.plant.statics import contraction_at, muscle_force


def shipped() -> str:
    """One row a model."""
    loaded = [load_model(name) for name in shipped_models()]
    rows = [[code(model.name), code(model.plant), f"{model.title}."] for model in loaded]
    return table(["Model", "Plant", "What"], rows)


def parameters(name: str) -> str:
    """Every parameter of a shipped model."""
    return _parameters(load_model(name))


def _parameters(model: Model, leave_out: Sequence[str] = ()) -> str:
    rows = []
    for effect in model.parameters:
        if effect in leave_out:
            continue
        file_keys = CATALOGUE[effect].names_in_files()
        for file_key, value in model.values_in_files(effect).items():
            note = model.notes.get(f"{effect}.{file_key}", Note())
            unit = CATALOGUE[effect].quantities[file_keys[file_key]].unit
            cells = [_value(value), _interval(note), unit, note.source]
            rows.append([code(f"{effect}.{file_key}"), *cells])
    return table(["Parameter", "Value", "95 % interval", "Unit", "Source"], rows, right=(1, 2))


def differences(base: str, *others: str) -> str:
    """Shipped models that are a base model with other effects: what each leaves out and has.

    Args:
        base: name of a shipped model.
        others: models that are shown in full elsewhere.
    """
    parts = []
    for name in shipped_models():
        if name in (base, *others):
            continue
        model, from_base = load_model(name), load_model(base)
        without = [code(e) for e in from_base.parameters if e not in model.parameters]
        same = [
            e for e, values in from_base.parameters.items() if model.parameters.get(e) == values
        ]
        words = f"{model.title}. As {code(base)}" + (
            f" without {', '.join(without)}" * bool(without)
        )
        parts += [f"### `{name}`", f"{words}, but with:", _parameters(model, leave_out=same)]
    return "\n\n".join(parts)


def identification(part: str) -> str:
    """What `python -m benchmarks identify` wrote above the station's model.

    Args:
        part: `judged` (left-out pressures) or `unexplained`.
    """
    text = shipped_models()["station"].read_text(encoding="utf-8")
    header = [line.removeprefix("# ") for line in text.splitlines() if line.startswith("# ")]
    if part == "unexplained":
        return "\n".join(line for line in header if line.startswith("- "))
    (judged,) = (line for line in header if line.startswith("Left-out pressures"))
    figures = dict(zip(TARGETS, re.findall(r"(\d+\.\d+) (?:mm|deg)", judged), strict=True))
    what = {
        "extension_mm": "extension under load, RMSE (mm)",
        "rotation_deg": "rotation, RMSE (deg)",
        "no_load_mm": "mean contraction with no load, largest error (mm)",
    }
    rows = [[what[name], figures[name], number(limit)] for name, limit in TARGETS.items()]
    return table(["Predicted less measured, table I3", "Got", "Aim"], rows, right=(1, 2))


def misfit() -> str:
    """How far the static laws of the shipped stations are from table I3."""
    data, rows = station_limits(), []
    models = [load_model(name) for name in shipped_models()]
    for model in (model for model in models if model.plant == "station"):
        force = muscle_force(model)
        rest = contraction_at(force, data.pressure, np.zeros_like(data.load))
        loaded = contraction_at(force, data.pressure, data.load)
        errors = (
            (rest - data.no_load) * 1e3,
            (rest - loaded - data.extension) * 1e3,
            force(data.pressure, data.no_load - data.extension) - data.load,
        )
        rows.append(
            [code(model.name), *(f"{np.sqrt(np.nanmean(error**2)):.1f}" for error in errors)]
        )
    return table(
        ["Model", "Contraction, no load (mm)", "Extension under load (mm)", "Force (N)"],
        rows,
        right=(1, 2, 3),
    )


def _value(value: Value) -> str:
    many = isinstance(value, tuple)
    return ", ".join(number(one) for one in value) if many else number(value)  # type: ignore


def _interval(note: Note) -> str:
    known = note.low is not None and note.high is not None
    return f"{number(note.low)} to {number(note.high)}" if known else ""  # type: ignore
