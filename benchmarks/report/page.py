"""The leaderboard's page: what stands on it, in which order, with which words.

The leaderboard's figures to zoom, hover and filter: every case of every controller.
"""

from collections.abc import Mapping, Sequence

from benchmarks.report.errors import PERCENT, is_bound, task_of
from benchmarks.report.leaderboard import Leaderboard
from benchmarks.report.plots import (
    Style,
    distribution_plot,
    loop_plot,
    loop_title,
    margin_table,
    pressure_plot,
    profile_plot,
    styles_of,
)
from benchmarks.report.standings import Standings
from benchmarks.report.tables import (
    capital,
    exercise_table,
    failure_table,
    obstacle_table,
    pair_table,
    spending,
    spending_table,
    standings_table,
    tasks_table,
)
from benchmarks.runner.fingerprint import code_digest
from pma_gym.pages.document import Block, Heading, Paragraph, Picture, TextTable
from pma_gym.pages.figures import Plot
from pma_gym.pages.interactive import InteractiveFigure, Trace

MOST_POINTS = 40_000
"""Points of all figures together, so that a page stays below 5 MB."""


def case_figures(
    every: Sequence[Standings], styles: Mapping[str, Style]
) -> list[InteractiveFigure]:
    """Errors of all cases by pressure, a figure a measure, until there are too many points.

    Args:
        every: standings in the measures.
        styles: of the controllers, by name.
    """
    figures, points = [], 0
    for standings in every:
        points += standings.errors.values.size
        if points > MOST_POINTS:
            break
        figures.append(_figure(standings, styles))
    return figures


def _figure(standings: Standings, styles: Mapping[str, Style]) -> InteractiveFigure:
    errors = standings.errors
    title = capital(errors.measure.name)
    notes = [f"{episode.task}, station {episode.station}" for episode in errors.episodes]
    pressures = [episode.pressure_kpa for episode in errors.episodes]
    traces = [
        Trace(
            styles[name].label, pressures, list(errors.of(name)), styles[name].color, False, notes
        )
        for name in errors.names
    ]
    name = "cases-" + "-".join(errors.measure.name.split())
    return InteractiveFigure(
        name,
        f"{title}: every case. Hover for its station; click a controller to hide it, double-click "
        "to see it alone; drag to zoom, double-click to zoom out.",
        "pressure (kPa)",
        f"RMSE ({errors.measure.unit})",
        traces,
        logarithmic=True,
    )


_RANKS = (
    "A rank is claimed only where all pairs, taken together with 95 % confidence, leave no other: "
    "1–3 means that these controllers cannot be told apart. Intervals come from 2000 resamples of "
    "what was drawn at random, stations or noise, the same for all controllers. “Over the best” "
    "compares two controllers on the same stations and so resolves far finer differences than "
    "their two intervals; its interval holds for all pairs at once, as the ranks do. A failed case "
    "counts as an error of the whole range. "
    "`docs/reference/score-definitions.md` defines every figure."
)


def page_blocks(leaderboard: Leaderboard) -> list[Block]:
    """The whole page."""
    blocks = _opening(leaderboard)
    blocks += _ranking_blocks(leaderboard)
    blocks += _obstacle_blocks(leaderboard)
    blocks += _picture_blocks(leaderboard)
    blocks += _exercise_blocks(leaderboard)
    blocks += _spending_blocks(leaderboard)
    blocks += _loop_blocks(leaderboard)
    if leaderboard.record.failures():
        table = failure_table(leaderboard.record, leaderboard.labels)
        blocks += [Heading("Failed cases"), table]
    return blocks + _origin_blocks(leaderboard)


def drawn_plots(leaderboard: Leaderboard) -> dict[str, Plot]:
    """Every plot that there are figures for, by name: scores, loops of linear controllers."""
    styles, loops = styles_of(leaderboard.labels), leaderboard.loops
    plots = {f"loops_{task}": loop_plot(each, styles) for task, each in loops.items()}
    if single := shown_standings(leaderboard):
        plots["distributions"] = distribution_plot(single, styles)
        plots["profiles"] = profile_plot(single, styles)
        plots["pressures"] = pressure_plot(single, styles)
    return plots


def _opening(leaderboard: Leaderboard) -> list[Block]:
    suite = leaderboard.suite
    environment = ", ".join(
        f"`{name}` {value}" for name, value in suite.environment.items() if value not in ("", None)
    )
    text = (
        f"{suite.title}. Suite `{suite.name}`, version {suite.version}: {len(suite.stations)} "
        f"station{'s' if len(suite.stations) > 1 else ''}, {len(suite.episodes)} episodes of "
        f"{', '.join(suite.tasks)}; {environment}. Controllers receive model `{suite.model}`. "
        "Every trial is scored on the true motion at 384 Hz."
    )
    blocks: list[Block] = [Heading(f"Leaderboard: {suite.name}", 1), Paragraph(text)]
    return blocks + [Paragraph(note) for note in _notes(leaderboard)]


def incomplete_counts(leaderboard: Leaderboard) -> str:
    """Controllers that have some of their cases, each with how many of how many; may be empty."""
    return ", ".join(
        f"{leaderboard.labels[entry.spec.name]} ({done} of {planned} cases)"
        for entry, done, planned in leaderboard.incomplete
    )


def _notes(leaderboard: Leaderboard) -> list[str]:
    """What the reader must know before the first figure: what is missing."""
    labels, notes = leaderboard.labels, []
    if leaderboard.missing:
        names = ", ".join(labels[entry.spec.name] for entry in leaderboard.missing)
        notes.append(f"**Not run: {names}.**")
    if leaderboard.incomplete:
        notes.append(
            f"**The journal is incomplete: {incomplete_counts(leaderboard)}.** Measures whose "
            "cases a controller has not all run are shown without it; where nobody "
            "has, only the cases that all have."
        )
    bounds = [labels[name] for name in labels if is_bound(name)]
    if bounds:
        notes.append(
            f"{', '.join(bounds)} may see the true station and its state: no rival, but the bound "
            "that the others are measured by."
        )
    return notes


def shown_standings(leaderboard: Leaderboard) -> list[Standings]:
    """Standings with somebody in them, but not that of all tasks together."""
    return [each for each in leaderboard.shown if each.errors.measure.unit != PERCENT]


def _ranking_blocks(leaderboard: Leaderboard) -> list[Block]:
    labels = leaderboard.labels
    # What pools all tasks stands first.
    shown = sorted(leaderboard.shown, key=lambda each: each.errors.measure.unit != PERCENT)
    blocks: list[Block] = [
        Heading("Ranking"),
        Paragraph(_RANKS),
        *(standings_table(each, labels) for each in shown),
    ]
    if leaderboard.by_task:
        blocks.append(tasks_table(leaderboard.by_task, labels))
    if leaderboard.shown and len(leaderboard.shown[-1].rivals) > 1:
        text = (
            "Pairs of controllers on the same stations with the same noise. Two differ where 1 "
            "lies outside their interval, which holds for all pairs at once; ranks say the same. "
            "`pairs.csv` has every measure, and the bounds."
        )
        blocks += [
            Heading("Who differs", 3),
            Paragraph(text),
            pair_table(leaderboard.shown[-1], labels),
        ]
    return blocks


def _obstacle_blocks(leaderboard: Leaderboard) -> list[Block]:
    if not leaderboard.obstacles:
        return []
    text = (
        "By the nominal balance of forces the actuator cannot follow these references all the way, "
        "whoever drives; the oracle's error is the bound that can be reached."
    )
    return [
        Heading("References that cannot be followed", 3),
        Paragraph(text),
        obstacle_table(leaderboard.obstacles, shown_standings(leaderboard)),
    ]


def _picture_blocks(leaderboard: Leaderboard) -> list[Block]:
    return [
        Heading("How the errors are spread"),
        Picture("distributions", "All cases of every controller, on a logarithmic scale."),
        Picture(
            "profiles",
            "Performance profiles: share of the cases with an error up to that on the axis; the "
            "higher and further left, the better. Bands: 95 % at each point.",
        ),
        Picture("pressures", "Median error by pressure, on a logarithmic scale."),
        *case_figures(shown_standings(leaderboard), styles_of(leaderboard.labels)),
    ]


def _spending_blocks(leaderboard: Leaderboard) -> list[Block]:
    text = (
        "Medians over the cases that did not fail; “saturated” and “clipped” are means. A command "
        "below 0 V or above 10 V is clipped to there. Effort is the standard "
        "deviation of the voltage, variation its total variation a second. Soft limits are the "
        "reach of table I3; 100 % of the way beyond them the episode ends. Real-time factor: how "
        "often the 99th percentile of the computing time fits into a control period."
    )
    blocks: list[Block] = [Heading("What it costs"), Paragraph(text)]
    for each in shown_standings(leaderboard):
        measure = each.errors.measure
        if not (measure.returning or measure.alone):
            rows = spending(leaderboard.record, measure, [row.name for row in each.rows])
            name = measure.tasks[0].replace("_", " ")
            title = f"{capital(name)}: whole trials"
            if len(measure.tasks) > 1:
                title = f"{capital(measure.name)}: whole trials"
            blocks.append(spending_table(rows, title, measure.unit, leaderboard.labels))
    return blocks


def _exercise_blocks(leaderboard: Leaderboard) -> list[Block]:
    """What exercises came to beside their errors."""
    blocks: list[Block] = []
    for each in shown_standings(leaderboard):
        measure = each.errors.measure
        exercises = [task for task in measure.tasks if task_of(task).exercise]
        if exercises and not measure.alone:
            names = [row.name for row in each.rows]
            title = f"{capital(measure.name)}: the joint and the operator's work"
            table = exercise_table(leaderboard.record, exercises, names, title, leaderboard.labels)
            blocks.append(table)
    text = (
        "Medians over the cases that did not fail, at the ends of the control steps. The angle is "
        "compared with the dissertation's line, whatever is prescribed. Work is what the joint "
        "does on the device, returned what the device does on it."
    )
    return [Heading("Moment, speed, power"), Paragraph(text), *blocks] if blocks else []


def _loop_blocks(leaderboard: Leaderboard) -> list[Block]:
    if not leaderboard.loops:
        return []
    text = (
        "Every linear controller's loop with the nominal plant, linearised near rest, sampled with "
        "its sensor and delays. Without voltage limits, feed-forward, hysteresis and dry friction. "
        "The step of the reference is through the feedback alone."
    )
    blocks: list[Block] = [Heading("For the engineer: loops and margins"), Paragraph(text)]
    for task, conditions in leaderboard.loops.items():
        caption = (
            f"{loop_title(conditions)}: Bode plot of the loop in the middle of the stroke, "
            "response to a step of the reference and of the load; unstable loops have no step."
        )
        blocks += [margin_table(conditions, leaderboard.labels), Picture(f"loops_{task}", caption)]
    return blocks


def _origin_blocks(leaderboard: Leaderboard) -> list[Block]:
    """How the run can be made again."""
    info = leaderboard.info
    git = info["git"]
    state = {True: "with changes that are not committed", False: "clean", None: ""}[git["dirty"]]
    same = "that of now" if info["code"] == code_digest() else "changed since"
    rows = [
        ["Commit", f"{git['commit']} {state}".strip()],
        ["Code", f"digest {info['code']}, {same}"],
        ["Versions", ", ".join(f"{name} {text}" for name, text in info["versions"].items())],
        ["Machine", f"{info['platform']}, {info['processors']} processors"],
        ["Suite", f"version {leaderboard.suite.version}, digest {leaderboard.suite.digest}"],
    ]
    runs: dict[tuple[str, str], list[str]] = {}
    for name, entry in info["contenders"].items():
        runs.setdefault((entry["started"], entry["command"]), []).append(name)
    for (started, command), names in runs.items():
        rows.append([f"Begun {started}", f"`{command}`: {', '.join(names)}"])
    return [
        Heading("How it was made"),
        TextTable("Origin", ["", ""], rows, words=2),
        Paragraph(
            "`leaderboard.csv` and `pairs.csv` beside this page hold every figure with all its "
            "digits, `journal.jsonl` every case."
        ),
    ]
