"""Fits by the likelihood, each kept in a journal, from which an interrupted diagnosis goes on."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numpy as np

from pma_gym.discovery.fitting.journal import Journal
from pma_gym.estimation import likelihood_fit
from pma_gym.estimation.innovations import GreyBox, Point
from pma_gym.estimation.likelihood_fit import (
    BLOCKS,
    Coordinate,
    Fit,
    value_of,
    with_tied,
    with_values,
)
from pma_gym.plant.model import dump_model

_JOURNAL: ContextVar[Journal | None] = ContextVar("journal", default=None)


@contextmanager
def kept_in(journal: Journal) -> Iterator[None]:
    """Keep all fits within, and restore those that are kept already."""
    token = _JOURNAL.set(journal)
    try:
        yield
    finally:
        _JOURNAL.reset(token)


def fit(
    box: GreyBox,
    start: Point,
    coordinates: Sequence[Coordinate],
    tied: Mapping[str, str],
    rough: bool = False,
    near: bool = False,
) -> Fit:
    """`likelihood_fit.fit`, or the same bits from the journal where it was made before."""
    journal = _JOURNAL.get()
    if journal is None:
        return likelihood_fit.fit(box, start, coordinates, tied, rough, near)

    def restored(entry: dict[str, Any]) -> Fit:
        names = [c.name for c in coordinates]
        values, value = map(float, entry["values"]), float(entry["value"])
        known = dict(zip(names, values, strict=True))
        information, scores = (np.array(entry[n], float) for n in ("information", "scores"))
        if information.shape != (len(names),) * 2 or scores.shape != (BLOCKS, len(names)):
            raise ValueError(f"not of {len(names)} numbers")
        finite = np.isfinite([*known.values(), *information.flat, *scores.flat]).all()
        if not (finite and value < np.inf):
            raise ValueError("a number is not finite")
        point = with_values(start, with_tied(known, tied))
        return Fit(point, value, tuple(coordinates), dict(tied), information, scores)

    name = _name(box, start, coordinates, tied, rough, near)
    kept = journal.restored(name, restored)
    if kept is None:
        kept = likelihood_fit.fit(box, start, coordinates, tied, rough, near)
        journal.keep(
            name,
            {
                "values": [float(value_of(kept.point, c.name)) for c in coordinates],
                "value": kept.value,
                "information": kept.information.tolist(),
                "scores": kept.scores.tolist(),
            },
        )
    return kept


def _name(
    box: GreyBox,
    start: Point,
    coordinates: Sequence[Coordinate],
    tied: Mapping[str, str],
    *how: bool,
) -> str:
    """What determines a fit, in a few characters."""
    numbers = repr((start, list(coordinates), dict(tied), how, box.channels))
    total = hashlib.sha256(f"{dump_model(box.model)} {numbers}".encode())
    for rows in box.rows:
        for values in (rows.lengths, rows.commands(0.0), rows.readings, rows.there):
            total.update(values.tobytes())
    return total.hexdigest()
