"""Columns in another unit are named before anything is fitted; the proposed lines correct them."""

import re

import numpy as np
import pytest

from pma_gym.data.datasets.dataset import Dataset, NamedTrial, read_dataset
from pma_gym.data.files.trial_files import TrialWarning
from pma_gym.data.trial import Trial, TrialError
from pma_gym.discovery.preparation.data_checks import check_dataset
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.plant.plant import Plant
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


def spoilt(name, factor, offset):
    return [{**each, name: factor * each[name] + offset} for each in logs()]


def lines_of(message):
    """The lines that a message proposes, as a dataset.toml would have them."""
    matches = re.findall(r'("(?:[^"\\]|\\.)+" = \{[^}]*\})', message)
    assert matches
    return "[columns]\n" + "\n".join(matches) + "\n"


@pytest.mark.parametrize("kind", KINDS)
def test_a_unit_is_named_and_its_line_corrects_it(tmp_path, kind):
    name, factor, offset, words = KINDS[kind]
    folder = write(tmp_path / "lab", spoilt(name, factor, offset))
    with pytest.raises(TrialError, match="--no-checks") as caught:
        checked(folder)
    message = str(caught.value)
    assert words in message
    assert name in message
    (folder / "dataset.toml").write_text(lines_of(message))
    right = write(tmp_path / "right", logs())
    corrected = checked(folder)
    assert corrected.checked == ()
    quantity = {"contraction_mm": "contraction", "rotation_deg": "rotation"}.get(
        name, name.partition("_")[0]
    )
    for ours, theirs in zip(corrected.trials, read_dataset(right).trials, strict=True):
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
    right = [{k: v for k, v in each.items() if k not in unread} for each in logs()]
    both = [
        {k: factor * v + offset if "pressure" in k else v for k, v in each.items()}
        for each in right
    ]
    folder = write(tmp_path / "lab", both)
    with pytest.raises(TrialError, match=re.escape(words)) as caught:
        checked(folder)
    written = lines_of(str(caught.value))
    assert written.count("pressure_") == 2 * (2 - (BAR in unread))
    (folder / "dataset.toml").write_text(written)
    assert checked(folder).checked == checked(write(tmp_path / "right", right)).checked


def test_a_command_alone_may_be_absolute(tmp_path):
    written = [
        {k: v + 101.325 * (k == "pressure_command_kpa") for k, v in each.items()} for each in logs()
    ]
    folder = write(tmp_path / "lab", written)
    with pytest.raises(TrialError, match="the command is an absolute pressure") as caught:
        checked(folder)
    (folder / "dataset.toml").write_text(lines_of(str(caught.value)))
    assert checked(folder).checked == ()


def test_a_line_that_is_there_is_replaced_by_one_that_holds_both(tmp_path):
    """A lab's own name, factor, offset and range are kept in the proposal."""
    written = [
        {
            "Weg [cm]" if k == "contraction_mm" else k: 60.0 - v / 10
            if k == "contraction_mm"
            else v
            for k, v in each.items()
        }
        for each in logs()
    ]
    line = '"Weg [cm]" = { name = "contraction_mm", offset = 1.0, range = [0, 70] }'
    folder = write(tmp_path / "lab", written, f"[columns]\n{line}\n")
    with pytest.raises(TrialError, match="replace the line of this name by") as caught:
        checked(folder)
    proposed = (
        '"Weg [cm]" = { name = "contraction_mm", factor = -10, offset = 600, range = [-90, 610] }'
    )
    assert proposed in str(caught.value)
    (folder / "dataset.toml").write_text(f"[columns]\n{proposed}\n")
    assert checked(folder).checked == ()


def test_raw_volts_are_corrected_in_volts(tmp_path):
    from pma_gym.data.calibration import LVDT

    written = []
    for each in logs():
        kept = {k: v for k, v in each.items() if k != "contraction_mm"}
        written.append(kept | {"lvdt_v": LVDT.to_volts(-1e-3 * each["contraction_mm"])})
    folder = write(tmp_path / "lab", written)
    with pytest.raises(TrialError, match="the opposite sign") as caught:
        checked(folder)
    (folder / "dataset.toml").write_text(lines_of(str(caught.value)))
    corrected = checked(folder)
    assert corrected.checked == ()
    right = 1e-3 * logs()[0]["contraction_mm"]
    assert corrected.trials[0].trial.measurements["contraction"] == pytest.approx(right, abs=1e-6)


def test_one_file_in_another_unit_is_named(tmp_path):
    written = logs()
    written[1] = {**written[1], "contraction_mm": written[1]["contraction_mm"] / 25.4}
    written[2] = {**written[2], "contraction_mm": written[2]["contraction_mm"] / 25.4}
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
    written = [
        {
            k: v * {"contraction_mm": -1.0, "load_n": 1 / 9.80665}.get(k, 1.0)
            for k, v in each.items()
        }
        for each in logs()
    ]
    folder = write(tmp_path / "lab", written)
    with pytest.raises(TrialError) as caught:
        checked(folder)
    assert "the opposite sign" in str(caught.value)
    assert "kilograms-force" in str(caught.value)
    said = checked(folder, stop=False).checked
    assert len(said) == 2


def test_good_data_pass_unchanged(tmp_path):
    folder = write(tmp_path / "lab", logs())
    before, after = read_dataset(folder), checked(folder)
    assert after.checked == ()
    for one, other in zip(before.trials, after.trials, strict=True):
        assert np.array_equal(one.trial.time, other.trial.time)
        for name, values in one.trial.measurements.items():
            assert np.array_equal(values, other.trial.measurements[name])


LARGEST = [
    (each.name, row) for each in candidate_effects(GIVEN, [0, 1, 2]) for row in each.probes[-1:]
]


@pytest.mark.parametrize(("name", "row"), LARGEST, ids=[name for name, _ in LARGEST])
def test_missing_physics_is_no_unit(tmp_path, name, row):
    """Every effect of the catalogue at the largest size that is looked for."""
    candidate = next(each for each in candidate_effects(GIVEN, [0, 1, 2]) if each.name == name)
    truth = candidate.beside(GIVEN).replace(
        dict(zip(candidate.paths, map(float, row), strict=True))
    )
    named = []
    for number, each in enumerate(logs(truth=truth)):
        trial = Trial(
            each["time_s"],
            {
                "motor_voltage": each["motor_voltage_v"],
                "pressure_command": 1e3 * each["pressure_command_kpa"],
            },
            {
                "contraction": each["contraction_mm"] / 1e3,
                "rotation": np.radians(each["rotation_deg"]),
                "load": each["load_n"],
                "pressure": 1e3 * each["pressure_kpa"],
            },
        )
        named.append(NamedTrial(f"trial{number}", trial))
    data = check_dataset(Dataset("", None, tuple(named), tmp_path), GIVEN)
    assert [words for words in data.checked or () if "late" not in words] == []


def test_signals_that_are_late_together_are_named(tmp_path):
    late = []
    for each in logs(truth=GIVEN):
        moved = {k: np.interp(each["time_s"] - 0.04, each["time_s"], v) for k, v in each.items()}
        names = ("contraction_mm", "rotation_deg", "load_n")
        late.append({k: moved[k] if k in names else v for k, v in each.items()})
    (words,) = checked(write(tmp_path / "lab", late)).checked
    assert words.startswith("contraction_mm, rotation_deg, load_n are late by the same 40 ms")


def test_a_sensor_that_is_late_alone_is_named(tmp_path):
    late = [
        {**e, "load_n": np.interp(e["time_s"] - 0.03, e["time_s"], e["load_n"])}
        for e in logs(truth=GIVEN)
    ]
    folder = write(tmp_path / "lab", late)
    (words,) = checked(folder).checked
    assert words.startswith("load_n alone is late, by 30 ms") and words.endswith("lag or delay")
    named = GIVEN.with_effects({"load_cell_delay": {"share": 1.0, "delay_ms": 30.0}})
    assert check_dataset(read_dataset(folder), named).checked == ()


def test_commands_that_no_model_follows_are_left_to_the_fit(tmp_path):
    """A check says nothing where it has nothing to compare with."""
    columns = log(2.0, 300.0, 1)
    without = {
        k: v for k, v in columns.items() if k not in ("pressure_command_kpa", "pressure_kpa")
    }
    assert checked(write(tmp_path / "lab", [without])).checked == ()
    assert Plant(GIVEN).model.name == "serres2008"
