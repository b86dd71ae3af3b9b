"""The time that a diagnosis still takes, from what its steps took so far."""

import pytest

from pma_gym.cli import progress as shown
from pma_gym.cli.progress import DIAGNOSIS, FIT, SHARES, StepProgress, TimeLeft
from pma_gym.discovery.workflow import diagnose, refit
from tests.discovery.laboratory import STATION, laboratory


class Clock:
    """A clock that stands still but for what the test lets pass."""

    now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


def replay(left, clock, *steps):
    """Steps of so many seconds, each begun and ended."""
    for step, seconds in steps:
        left(step, 0, 1)
        clock.now += seconds


def test_nothing_is_known_before_the_first_step_has_ended(clock):
    left = TimeLeft(DIAGNOSIS, clock)
    assert left.seconds() is None and left.text() == ""
    left("refitting parameters", 0, 1)
    clock.now += 50.0
    assert left.seconds() is None and left.text() == ""


def test_steps_to_come_are_weighed_by_those_that_ended(clock):
    left = TimeLeft(DIAGNOSIS, clock)
    replay(left, clock, ("refitting parameters", 100.0))
    left("looking for effect 1", 0, 30)
    pace = 100.0 / SHARES["refitting parameters"]
    least = pace * sum(SHARES[s] for s in ("looking for effect", "trials left out"))
    least += pace * SHARES["putting the answer together"]
    more = pace * (SHARES["fitting effect"] + SHARES["looking for effect"])
    assert left.seconds() == pytest.approx((least, least + more))
    assert left.text() == "about 2 min left (about 6 min if it adds an effect)"


def test_a_step_that_ran_before_takes_as_long_again(clock):
    left = TimeLeft(DIAGNOSIS, clock)
    replay(
        left,
        clock,
        ("refitting parameters", 100.0),
        ("looking for effect 1", 500.0),
        ("fitting effect 1", 40.0),
    )
    left("looking for effect 2", 0, 29)
    clock.now += 100.0
    # The median of 10, 167 and 2 s a share: an estimate by those that are like the others.
    pace = 100.0 / SHARES["refitting parameters"]
    end = pace * (SHARES["trials left out"] + SHARES["putting the answer together"])
    assert left.seconds() == pytest.approx((400.0 + end, 400.0 + end + 40.0 + 500.0))


def test_the_step_that_runs_counts_by_its_own_pace(clock):
    left = TimeLeft(FIT, clock)
    replay(left, clock, ("refitting parameters", 70.0))
    left("trials left out", 0, 5)
    clock.now += 3600.0
    left("trials left out", 1, 5)
    pace = 70.0 / SHARES["refitting parameters"]
    least = 4 * 3600.0 + pace * SHARES["putting the answer together"]
    assert left.seconds() == pytest.approx((least, least))
    assert left.text() == "about 4.0 h left"
    clock.now += 3600.0
    left("trials left out", 4, 5)
    assert left.seconds()[0] == pytest.approx(1800.0 + least - 4 * 3600.0)
    assert left.text() == "about 30 min left"


def test_a_step_that_outlasts_its_estimate_has_no_negative_rest(clock):
    left = TimeLeft(FIT, clock)
    replay(left, clock, ("refitting parameters", 10.0))
    left("trials left out", 0, 3)
    clock.now += 1000.0
    assert left.seconds()[0] == pytest.approx(1.0)
    assert left.text() == "less than a minute left"


@pytest.mark.parametrize("search", [pytest.param(True, marks=pytest.mark.campaign), False])
def test_every_step_of_a_run_is_known_beforehand(search):
    left, said = TimeLeft(DIAGNOSIS if search else FIT), []

    def progress(step, done, total):
        left(step, done, total)
        said.append((step, left.seconds()))

    trials = laboratory("hysteresis", 2, 32.0)[0] if search else laboratory("parameters")[0]
    options = {"propose": False} if search else {}
    (diagnose if search else refit)(trials, STATION, progress=progress, **options)
    first = said[0][0]
    later = [seconds for step, seconds in said if step != first]
    assert len({step for step, _ in said}) >= (6 if search else 3)
    assert later and None not in later
    assert all(0.0 <= least <= most for least, most in later)


def test_lines_say_it_where_nobody_watches(clock, monkeypatch, capsys):
    monkeypatch.setattr(shown.time, "monotonic", clock)
    with StepProgress(TimeLeft(FIT, clock)) as progress:
        progress("refitting parameters", 0, 1)
        clock.now += 600.0
        progress("trials left out", 0, 5)
        clock.now += 50.0
        progress("trials left out", 1, 5)
        clock.now += 50.0
        progress("trials left out", 2, 5)
    assert capsys.readouterr().err.splitlines() == [
        "refitting parameters ...",
        "trials left out ... about 8 min left",
        "trials left out 2 of 5 ... about 4 min left",
    ]


def test_a_bar_says_it_beside_the_step_that_runs(clock, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "160")
    progress = StepProgress(TimeLeft(FIT, clock))
    progress("refitting parameters", 1, 1)
    clock.now += 600.0
    progress("trials left out", 0, 5)
    bars = progress._bars
    assert bars is not None
    ended, running = (bars.columns[-1](task).plain for task in bars.tasks)
    assert (ended, running) == ("", "in all: about 8 min left")
