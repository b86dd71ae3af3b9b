"""Parts of the documentation that are rendered from the code, so that they cannot be out of date.

A page says `<!-- generate: NAME -->` or `<!-- generate: NAME ARGUMENT -->` on a line of its own;
`expand` puts in Markdown instead, as far indented. GENERATORS lists the names.
"""

import re
from collections.abc import Callable
from textwrap import indent

from generators.catalogue import effects, overview
from generators.commands import commands
from generators.environments import (
    disturbances,
    docstring,
    options,
    randomisations,
    tasks,
)
from generators.equations import equations, ports, written
from generators.exercise import (
    exercise_check,
    exercise_knee,
    exercise_makers,
    exercise_people,
    exercise_ranges,
    exercise_safety,
    exercise_safety_text,
    exercise_worst,
)
from generators.files import calibrations, columns, raw_columns, tables
from generators.hidden_effects import (
    hidden_cases,
    hidden_confused,
    hidden_kinds,
    hidden_measured,
    hidden_misses,
    hidden_parameters,
    hidden_rates,
    hidden_rounds,
    hidden_seconds,
    hidden_sizes,
    hidden_summary,
)
from generators.models import differences, identification, misfit, parameters, shipped
from generators.policies import policies_shipped
from generators.source import misprints, rates, verdicts, wrong_in_print
from generators.suite import controllers, example, trials, tuning
from generators.suites import episode_plans, occasional, suites

GENERATORS: dict[str, Callable[..., str]] = {
    function.__name__: function
    for function in (
        *(effects, overview, commands, docstring, options, randomisations),
        *(disturbances, tasks),
        *(equations, ports, written, calibrations, columns, raw_columns, tables),
        *(differences, identification, misfit, parameters, shipped),
        *(misprints, rates, verdicts, wrong_in_print),
        *(controllers, example, trials, tuning),
        *(suites, episode_plans, occasional),
        *(hidden_rates, hidden_cases, hidden_sizes, hidden_rounds, hidden_misses),
        *(hidden_kinds, hidden_parameters, hidden_seconds),
        *(hidden_confused, hidden_summary, hidden_measured),
        policies_shipped,
        *(exercise_check, exercise_worst, exercise_ranges, exercise_knee, exercise_makers),
        *(exercise_people, exercise_safety, exercise_safety_text),
    )
}
"""Renderers by name; each takes the words after its name in the mark."""

_MARK = re.compile(r"^( *)<!-- generate: (.+?) -->$", re.MULTILINE)


def expand(markdown: str) -> str:
    """A page's Markdown with its marks filled.

    Raises:
        KeyError: a mark names no generator.
    """

    def fill(mark: re.Match[str]) -> str:
        name, *arguments = mark[2].split()
        if name not in GENERATORS:
            raise KeyError(f"no generator {name!r}; there are {', '.join(GENERATORS)}")
        return indent(GENERATORS[name](*arguments), mark[1])

    return _MARK.sub(fill, markdown)
