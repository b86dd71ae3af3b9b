"""What is wrong in the dissertation: corrected cells, and figures that its own data contradict."""

import math
from collections import Counter
from functools import cache

from generators.text import number, table
from pma_gym.data.serres2008 import corrections, pressures
from pma_gym.studies import VERDICTS, Comparison, compare_all
from pma_gym.studies.voltage_profile import profile_model


def misprints() -> str:
    """Every corrected cell; table I3's change of unit on one line."""
    by_place = corrections()
    reasons = Counter(item.reason for item in by_place)
    single = [item for item in by_place if reasons[item.reason] < 10]
    rows = [
        [
            item.table,
            item.where.replace("_", " "),
            item.column.replace("_", " "),
            item.printed,
            "lost" if math.isnan(item.corrected) else number(item.corrected),
            item.reason,
        ]
        for item in single
    ]
    text = table(["Table", "Row", "Column", "Printed", "Used", "Why"], rows, right=(3, 4))
    shifted = [f"{count} cells {reason}" for reason, count in reasons.items() if count >= 10]
    return text + "\n\n" + f"In table I3, {'; '.join(shifted)}. They are read as percent."


def verdicts() -> str:
    """Tabulate figures of each study that are equal, rounded and misprinted."""
    rows = []
    for study in dict.fromkeys(row.study for row in _compared()):
        counts = Counter(row.verdict for row in _compared() if row.study == study)
        rows.append([study, *(counts[name] for name in VERDICTS)])
    total = Counter(row.verdict for row in _compared())
    rows.append(["all", *(total[name] for name in VERDICTS)])
    return table(["Study", *VERDICTS], rows, right=(1, 2, 3))


def wrong_in_print() -> str:
    """Every figure that does not follow from the printed data."""
    rows = [
        [row.table, row.quantity.replace("_", " "), row.printed, number(row.recomputed), row.note]
        for row in _compared()
        if row.verdict == "wrong in print"
    ]
    header = ["Table", "Figure", "Printed", "Recomputed", "From"]
    return table(header, rows, right=(2, 3))


def rates() -> str:
    """Rates of the muscle that the printed voltage profiles were computed with."""
    known = sorted({*pressures("displacement"), *pressures("rotation")})
    header = ["Pressure (kPa)", *map(str, known)]
    cells = [f"{profile_model(pressure).muscle_rate:.2f}" for pressure in known]
    return table(header, [["A (1/s)", *cells]], right=range(1, len(header)))


@cache
def _compared() -> tuple[Comparison, ...]:
    return tuple(compare_all())
