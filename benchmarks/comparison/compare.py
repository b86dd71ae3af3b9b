"""`python -m benchmarks compare`: which of two controllers is better, in one line."""

from pathlib import Path
from typing import NamedTuple

from benchmarks.files import RESULTS
from benchmarks.report.errors import SuiteRecord, is_bound
from benchmarks.report.leaderboard import Leaderboard, read_leaderboard
from benchmarks.report.standings import Standings
from benchmarks.report.tables import figure
from benchmarks.runner.provenance import RUN, read_run
from benchmarks.suites.frozen import frozen_suite
from benchmarks.suites.reproduction import ReproductionSuite
from benchmarks.suites.suite import SuiteError


class _Side(NamedTuple):
    """A controller in a folder of results.

    Attributes:
        folder: the folder.
        board: its leaderboard.
        name: of the controller.
    """

    folder: Path
    board: Leaderboard
    name: str


def compare(first: str, second: str, results: Path | None = None, task: str = "") -> str:
    """Say which of two controllers is better, by how much, and whether they differ.

    Args:
        first: a controller in the results, a folder that has one rival, or `FOLDER:CONTROLLER`.
        second: another.
        results: folder of controllers that name none; that of the last run if None.
        task: the only task that counts; all of them if empty.
    Returns:
        One line. It agrees with the folder's leaderboard: the interval of two rivals there holds
        for all pairs at once. Two that no leaderboard has together are compared in the cases that
        both ran.
    Raises:
        SuiteError: there are no such results, or nothing that both ran.
    """
    one, other = (_side(text, results) for text in (first, second))
    suite = one.board.suite.part(tasks=[task] if task else [])
    if suite.digest != other.board.suite.digest:
        raise SuiteError(
            f"{one.folder} has suite {suite.name} version {suite.version} and {other.folder} suite "
            f"{other.board.suite.name} version {other.board.suite.version}; compare one suite"
        )
    together, names = one.folder == other.folder, (one.name, other.name)
    standings = _standings(one.board, task) if together else None
    if standings is None or not set(names) <= set(standings.errors.names):
        names, standings = ("0", "1"), _standings(_in_common(one, other), task)
    if standings is None:
        raise SuiteError(f"{first} and {second} have no case in common; run both on the same")
    labels = [
        side.board.labels[side.name] + ("" if together else f" of {side.folder}")
        for side in (one, other)
    ]
    return _line(standings, [standings.errors.names.index(name) for name in names], labels)


def _side(text: str, results: Path | None) -> _Side:
    """What a word of the command line names."""
    before, _, name = text.rpartition(":")
    if (Path(text) / RUN).is_file():
        folder = Path(text)
        rivals = [its for its in read_run(folder).get("contenders", {}) if not is_bound(its)]
        if len(rivals) != 1:
            raise SuiteError(f"{text} has {', '.join(rivals)}; name one as {text}:{rivals[0]}")
        (name,) = rivals
    else:
        folder = Path(before) if (Path(before) / RUN).is_file() and before else None
        folder = folder or results or _last_run()
    suite = frozen_suite(read_run(folder).get("suite", {}).get("source", ""))
    if isinstance(suite, ReproductionSuite):
        raise SuiteError(f"{folder} has suite {suite.name}, whose report has no leaderboard")
    board = read_leaderboard(suite, folder)
    ran = dict.fromkeys(who for who, _ in board.record.rows)
    if name not in ran:
        raise SuiteError(f"{folder} has no results of {name}; it has {', '.join(ran)}")
    return _Side(folder, board, name)


def _last_run() -> Path:
    runs = sorted(RESULTS.glob(f"*/{RUN}"), key=lambda path: path.stat().st_mtime)
    if not runs:
        raise SuiteError(
            f"{RESULTS} has no results; name a folder with --results, or make some: "
            "python -m benchmarks run --suite robust --stations 6"
        )
    return runs[-1].parent


def _in_common(one: _Side, other: _Side) -> Leaderboard:
    """A leaderboard of the cases that both ran, with the two as controllers 0 and 1."""
    rows = [
        {
            episode: row
            for (name, episode), row in side.board.record.rows.items()
            if name == side.name
        }
        for side in (one, other)
    ]
    common = rows[0].keys() & rows[1].keys()
    pooled = {(str(at), episode): rows[at][episode] for at in (0, 1) for episode in common}
    return Leaderboard(SuiteRecord(one.board.suite, pooled), {})


def _standings(board: Leaderboard, task: str) -> Standings | None:
    every = [board.standings_in(task)] if task else board.shown
    return every[-1] if every and every[-1].errors.values.size else None


def _line(standings: Standings, places: list[int], labels: list[str]) -> str:
    (better, its), (worse, other) = sorted(
        zip(places, labels, strict=True), key=lambda each: standings.means[each[0]]
    )
    pair, ratio = standings.pair(better, worse), standings.pair(worse, better).ratio
    measure, cases = standings.errors.measure, len(standings.errors.episodes)
    count = len(standings.rivals)
    joint = f" for all {count * (count - 1) // 2} pairs at once" if count > 2 else ""
    interval = f"95 % interval {figure(ratio.low)} to {figure(ratio.high)}{joint}"
    verdict = (
        f"{its} is better than {other}"
        if pair.separated
        else f"{its} and {other} do not differ significantly"
    )
    return (
        f"{verdict}: the error of {other} is {figure(ratio.estimate)} times that of {its} "
        f"({interval if standings.draws.known else 'no interval: too few stations'}), {its} has "
        f"the smaller one in {pair.improvement.estimate * cases:g} of {cases} cases of "
        f"{measure.name}"
    )
