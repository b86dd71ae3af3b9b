"""Columns in another unit are named before anything is fitted; the proposed lines correct them."""

import re
from functools import cache

import numpy as np
import pytest

from pma_gym.data.calibration import LVDT
from pma_gym.data.datasets.dataset import Dataset, NamedTrial, read_dataset
from pma_gym.data.files.trial_files import TrialWarning
from pma_gym.data.trial import Trial, TrialError
from pma_gym.data.trial_columns import BY_NAME
from pma_gym.discovery.preparation.data_checks import check_dataset
from pma_gym.discovery.screening.candidates import candidate_effects
from tests.discovery.preparation.data_checks.logs import GIVEN, checked, log, logs, write

BAR = "pressure_kpa"
KINDS = {
    "contraction turned round": ("contraction_mm", -1.0, 0.0, "the opposite sign"),
    "extension from a zero of its own": ("contraction_mm", -1.0, 60.0, "the opposite sign"),
    "centimetres": ("contraction_mm", 0.1, 0.0, "centimetres"),
    "inches": ("contraction_mm", 1 / 25.4, 0.0, "inches"),
    "rotation turned round": ("rotation_deg", -1.0, 0.0, "the opposite sign"),
    "load turned round": ("load_n", -1.0, 0.0, "the opposite sign"),
    "kilograms": ("load_n", 1 / 9.80665, 0.0, "kilograms-force"),
    "pounds": ("load_n", 0.2248089, 0.0, "pounds-force"),
    "absolute": (BAR, 1.0, 101.325, "absolute pressure"),
    "absolute in a town on a hill": (BAR, 1.0, 95.0, "absolute pressure"),
    "millibars": (BAR, 10.0, 0.0, "millibars"),
    "mmHg": (BAR, 7.500617, 0.0, "millimetres of mercury"),
}


def changed(change):
    """The three logs, of which each column's values are changed by a function of its name."""
    return [{name: change(name, values) for name, values in each.items()} for each in logs()]


@cache
def right(folder):
    """The three logs as they are, checked."""
    return checked(write(folder, logs()))


def refusal(folder, match="--no-checks"):
    """What a folder is refused with, and its check once that is followed."""
    with pytest.raises(TrialError, match=match) as caught:
        checked(folder)
    (folder / "dataset.toml").write_text(lines_of(str(caught.value)))
    return str(caught.value), checked(folder)


def lines_of(message):
    """The lines that a message proposes, as a dataset.toml would have them."""
    matches = re.findall(r'("(?:[^"\\]|\\.)+" = \{[^}]*\})', message)
    assert matches
    return "[columns]\n" + "\n".join(matches) + "\n"


@pytest.mark.parametrize("kind", KINDS)
def test_a_unit_is_named_and_its_line_corrects_it(tmp_path, tmp_path_factory, kind):
    name, factor, offset, words = KINDS[kind]
    spoilt = changed(lambda k, v: factor * v + offset if k == name else v)
    message, corrected = refusal(write(tmp_path / "lab", spoilt))
    assert words in message and name in message
    assert corrected.checked == ()
    quantity = BY_NAME[name].quantity
    base = right(tmp_path_factory.getbasetemp() / "right")
    for ours, theirs in zip(corrected.trials, base.trials, strict=True):
        there, given = (each.trial.measurements[quantity] for each in (theirs, ours))
        # A zero of its own stays a lab's; the air of another day is another pressure.
        spread = 1e-5 * np.ptp(there) + (7e3 if quantity == "pressure" else 0.0)
        assert np.ptp(given - there) < 1e-4 * max(np.ptp(there), 1e-3)
        if not (quantity == "contraction" and offset):
            assert abs(np.median(given - there)) <= spread


BOTH = {
    "absolute": (1.0, 101.3, "101.3 kPa above gauge pressure: absolute pressure"),
    "psi": (1 / 6.894757, 0.0, "where the model holds from 150 to 575 kPa: psi"),
    "absolute psi": (1 / 6.894757, 101.325 / 6.894757, ": absolute pressure in psi"),
    "mmHg": (7.500617, 0.0, ": millimetres of mercury"),
}


@pytest.mark.parametrize(
    ("kind", "unread"),
    [*((kind, ()) for kind in BOTH), ("psi", (BAR,)), ("psi", (BAR, "contraction_mm"))],
)
def test_command_and_reading_alike_are_in_another_unit(tmp_path, kind, unread):
    factor, offset, words = BOTH[kind]
    both = changed(lambda k, v: factor * v + offset if "pressure" in k else v)
    for each in both:
        for name in unread:
            del each[name]
    message, corrected = refusal(write(tmp_path / "lab", both), re.escape(words))
    assert lines_of(message).count("pressure_") == 2 * (2 - (BAR in unread))
    assert all("late" in words for words in corrected.checked)


def test_a_command_alone_may_be_absolute(tmp_path):
    written = changed(lambda k, v: v + 101.325 * (k == "pressure_command_kpa"))
    _, corrected = refusal(write(tmp_path / "lab", written), "the command is an absolute pressure")
    assert corrected.checked == ()


def renamed(name, change):
    """The logs with the contraction by another name, changed."""
    return [
        {k: v for k, v in each.items() if k != "contraction_mm"}
        | {name: change(each["contraction_mm"])}
        for each in logs()
    ]


def test_a_line_that_is_there_is_replaced_by_one_that_holds_both(tmp_path):
    """A lab's own name, factor, offset and range are kept in the proposal."""
    line = '"Weg [cm]" = { name = "contraction_mm", offset = 1.0, range = [0, 70] }'
    written = renamed("Weg [cm]", lambda x: 60.0 - x / 10)
    folder = write(tmp_path / "lab", written, f"[columns]\n{line}\n")
    message, corrected = refusal(folder, "replace the line of this name by")
    proposed = (
        '"Weg [cm]" = { name = "contraction_mm", factor = -10, offset = 600, range = [-90, 610] }'
    )
    assert proposed in message and corrected.checked == ()


def test_raw_volts_are_corrected_in_volts(tmp_path):
    folder = write(tmp_path / "lab", renamed("lvdt_v", lambda x: LVDT.to_volts(-1e-3 * x)))
    _, corrected = refusal(folder, "the opposite sign")
    assert corrected.checked == ()
    right = 1e-3 * logs()[0]["contraction_mm"]
    assert corrected.trials[0].trial.measurements["contraction"] == pytest.approx(right, abs=1e-6)


def test_one_file_in_another_unit_is_named(tmp_path):
    written = logs()
    for each in written[1:]:
        each["contraction_mm"] /= 25.4
    folder = write(tmp_path / "lab", written)
    with pytest.raises(TrialError, match="in trial1.csv, trial2.csv") as caught:
        checked(folder)
    for number in (1, 2):
        path = folder / f"trial{number}.csv"
        path.write_text(path.read_text().replace("contraction_mm", "contraction_mm_2"))
    (folder / "dataset.toml").write_text(lines_of(str(caught.value)))
    with pytest.warns(TrialWarning, match="lacks columns"):
        assert checked(folder).checked == ()


def test_several_columns_are_said_at_once_and_may_be_overruled(tmp_path):
    factors = {"contraction_mm": -1.0, "load_n": 1 / 9.80665}
    folder = write(tmp_path / "lab", changed(lambda k, v: v * factors.get(k, 1.0)))
    with pytest.raises(TrialError, match="(?s)the opposite sign.*kilograms-force"):
        checked(folder)
    assert len(checked(folder, stop=False).checked) == 2


def test_good_data_pass_unchanged_and_so_does_what_nothing_can_be_compared_with(tmp_path):
    folder = write(tmp_path / "lab", logs())
    before, after = read_dataset(folder), checked(folder)
    assert after.checked == ()
    for one, other in zip(before.trials, after.trials, strict=True):
        assert np.array_equal(one.trial.time, other.trial.time)
        for name, values in one.trial.measurements.items():
            assert np.array_equal(values, other.trial.measurements[name])
    alone = {k: v for k, v in log(2.0, 300.0, 1).items() if not k.startswith("pressure_")}
    assert checked(write(tmp_path / "alone", [alone])).checked == ()


LARGEST = {each.name: each for each in candidate_effects(GIVEN, [0, 1, 2]) if len(each.probes)}


@pytest.mark.parametrize("name", LARGEST)
def test_missing_physics_is_no_unit(tmp_path, name):
    """Every effect of the catalogue at the largest size that is looked for."""
    candidate = LARGEST[name]
    largest = dict(zip(candidate.paths, map(float, candidate.probes[-1]), strict=True))
    named = []
    for number, each in enumerate(logs(truth=candidate.beside(GIVEN).replace(largest))):
        si = {BY_NAME[k].quantity: BY_NAME[k].to_si(v) for k, v in each.items()}
        commands = {k: si.pop(k) for k in ("motor_voltage", "pressure_command")}
        named.append(NamedTrial(f"trial{number}", Trial(si.pop("time"), commands, si)))
    data = check_dataset(Dataset("", None, tuple(named), tmp_path), GIVEN)
    assert [words for words in data.checked or () if "late" not in words] == []


@pytest.mark.parametrize(
    ("names", "seconds", "said"),
    [
        (
            ("contraction_mm", "rotation_deg", "load_n"), 0.04,
            "contraction_mm, rotation_deg, load_n are late by the same 40 ms",
        ),
        (("load_n",), 0.03, "load_n alone is late, by 30 ms"),
    ],
)  # fmt: skip
def test_what_is_late_is_named(tmp_path, names, seconds, said):
    late = logs(truth=GIVEN)
    for each in late:
        moved = {k: np.interp(each["time_s"] - seconds, each["time_s"], each[k]) for k in names}
        each.update(moved)
    folder = write(tmp_path / "lab", late)
    (words,) = checked(folder).checked
    assert words.startswith(said)
    if names == ("load_n",):
        assert words.endswith("lag or delay")
        known = GIVEN.with_effects({"load_cell_delay": {"share": 1.0, "delay_ms": 30.0}})
        assert check_dataset(read_dataset(folder), known).checked == ()
