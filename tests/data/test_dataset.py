"""Data sets: what a lab's folder becomes, and one message for each thing that is wrong with it."""

import re
import warnings

import numpy as np
import pytest

from pma_gym.data.datasets.dataset import LabSensor, read_dataset
from pma_gym.data.files.even_clock import joined
from pma_gym.data.files.trial_files import TrialWarning
from pma_gym.data.quality.gaps import gaps
from pma_gym.data.trial import Trial, TrialError

ROWS = 60


def columns(**changed):
    """A pull at 300 kPa by the names of a file: plausible numbers of every sensor."""
    time = np.arange(ROWS) / 20
    swing = np.sin(2 * np.pi * time / 3.0) ** 2
    made = {
        "time_s": time,
        "motor_voltage_v": 4.0 * swing,
        "pressure_command_kpa": 200.0 + 100.0 * swing,
        "contraction_mm": 40.0 - 20.0 * swing,
        "rotation_deg": 44.0 * swing,
        "load_n": 390.0 * swing + 2.0,
        "pressure_kpa": 205.0 + 100.0 * swing,
    }
    made |= changed
    return {name: values for name, values in made.items() if values is not None}


def write(path, **changed):
    """A CSV file of `columns`; a string stands as it is in every row."""
    table = columns(**changed)
    rows = zip(*([v] * ROWS if isinstance(v, str) else v for v in table.values()), strict=True)
    path.write_text("\n".join([",".join(table), *(",".join(map(str, row)) for row in rows)]) + "\n")


def spoilt(name, value, *rows):
    """A column with some readings replaced."""
    values = NORMAL[name].copy()
    values[list(rows)] = value
    return {name: values}


NORMAL = columns()


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / "lab"
    made.mkdir()
    return made


def refusal(folder):
    """The message that a folder is refused with; warnings are not looked at."""
    with warnings.catch_warnings(), pytest.raises(TrialError) as caught:
        warnings.simplefilter("ignore", TrialWarning)
        read_dataset(folder)
    return str(caught.value)


def describe(folder, text):
    (folder / "dataset.toml").write_text(text)


def test_a_folder_of_csv_files_is_a_data_set(folder):
    for name in ("ramp10.csv", "ramp2.csv", ".hidden.csv", "~$ramp2.xlsx", "next.csv"):
        write(folder / name)
    (folder / "model.toml").write_text("")
    (folder / "old").mkdir()
    write(folder / "old" / "ramp3.csv")
    with (
        pytest.warns(TrialWarning, match=r"^~\$ramp2.xlsx is passed over: .* locks an open file"),
        pytest.warns(TrialWarning, match="next.csv is passed over"),
    ):
        dataset = read_dataset(folder)
    assert [each.name for each in dataset.trials] == ["ramp2.csv", "ramp10.csv"]
    assert (dataset.title, dataset.model, len(dataset)) == ("lab", None, 2)
    first = dataset.trials[0]
    assert (first.order, first.repeat_of, first.note) == (None, None, "")
    assert first.trial.measurements["contraction"][0] == pytest.approx(40e-3)


def test_a_description_names_title_model_columns_and_trials(folder):
    for name in ("a.csv", "b.csv"):
        write(folder / name, contraction_mm=None, Weg=60.0 - NORMAL["contraction_mm"])
    describe(
        folder,
        """
        title = "Rig 2"
        model = "rig.toml"
        [columns]
        "Weg" = { name = "contraction_mm", factor = -1.0, offset = 60.0 }
        [trials."b.csv"]
        repeat_of = "a.csv"
        order = 2
        note = "after lunch"
        """,
    )
    (folder / "rig.toml").write_text("")
    dataset = read_dataset(folder)
    assert (dataset.title, dataset.model) == ("Rig 2", str(folder / "rig.toml"))
    second = dataset.trials[1]
    assert (second.order, second.repeat_of, second.note) == (2, "a.csv", "after lunch")
    assert second.trial.measurements["contraction"][0] == pytest.approx(40e-3)
    # A shipped model stays a name.
    describe(folder, 'model = "serres2008"\n[columns]\n"Weg" = "contraction_mm"')
    assert read_dataset(folder).model == "serres2008"


def test_a_folder_that_is_none_is_refused(folder, tmp_path):
    write(tmp_path / "ramp.csv")
    assert "ramp.csv is a file; a data set is a folder" in refusal(tmp_path / "ramp.csv")
    assert "there is no folder" in refusal(tmp_path / "none")
    assert re.search("lab holds no trial: no .csv, .*file lies in it .it is empty", refusal(folder))
    (folder / "log.mat").write_text("")
    assert "lab holds no trial that can be read: log.mat is empty" in refusal(folder)
    (folder / "log.mat").rename(folder / "log.avi")
    assert "(its files end in .avi); save each trial as a CSV file" in refusal(folder)
    (folder / "runs").mkdir()
    write(folder / "runs" / "a.csv")
    assert re.search("some lie in .*lab/runs; name that folder", refusal(folder))


@pytest.mark.parametrize("twin", ["ramp.parquet", "Ramp.csv", "RAMP.CSV"])
def test_two_files_of_one_name_are_refused(folder, twin):
    write(folder / "ramp.csv")
    write(folder / twin)
    message = refusal(folder)
    assert twin in message and "two trials of one name; remove one, or rename" in message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "titel = 'x'",
            "trials, tolerance, standard_error, got 'titel' (did you mean 'title'?)",
        ),
        ("title = 3", 'title in dataset.toml must be a text, title = "...", got 3'),
        ("title 3", "dataset.toml is not valid TOML: .*line 1"),
        ("columns = 3", "columns in dataset.toml must be a table, [columns], got 3"),
        ("model = 'rig.toml'", "there is no file .*rig.toml; a path counts from the data set's"),
        ("[trials.'ram.csv']", "names no file of the data set (did you mean 'ramp.csv'?)"),
        ("[trials.'ramp.csv']\nodrer = 1", "got 'odrer' (did you mean 'order'?)"),
        ("[trials.'ramp.csv']\norder = 'a'", "must be a number, the larger the later"),
        (
            "[trials.'ramp.csv']\nrepeat_of = 'ramp'",
            "'ramp', which names no trial; write the file's whole",
        ),
        ("[trials.'ramp.csv']\nrepeat_of = 'ramp.csv'", "which is itself a repeat"),
        ("[columns]\n'U' = 'motor_volt'", "dataset.toml: [columns] 'U' must name one of"),
        ("[columns]\n'U' = { name = 'load_n', factor = 0 }", "'U' factor must not be 0"),
        ("[sensors]\nload = { noise = 1 }", "got 'load' (did you mean 'load_n'?)"),
        ("[sensors]\nload_n = 1", "load_n in [sensors] of dataset.toml must be a table of resol"),
        ("[sensors]\nload_n = { nose = 1 }", "must be a table of resolution, noise, range, got"),
        ("[sensors]\nload_n = { noise = 0 }", "noise of load_n in [sensors] of dataset.toml must"),
        ("[sensors]\nload_n = { range = [5, 1] }", "must be two numbers in N, the lowest and"),
    ],
)
def test_a_description_that_cannot_be_used_is_refused(folder, text, message):
    write(folder / "ramp.csv")
    describe(folder, text)
    pattern = re.escape(message).replace(r"\.\*", ".*")
    assert re.search(pattern, refusal(folder))


def test_a_description_under_another_name_is_refused(folder):
    write(folder / "ramp.csv")
    (folder / "Dataset.toml").write_text("")
    if not (folder / "dataset.toml").exists():
        assert "must be called dataset.toml" in refusal(folder)


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("Contraction_mm", '"Contraction_mm" = "contraction_mm"'),
        ("contraction (m)", '"contraction (m)" = { name = "contraction_mm", factor = 1000 }'),
        ("displacement", '"displacement" = "contraction_mm"'),
        ("PressureBar", '"PressureBar" = { name = "pressure_kpa", factor = 100 }'),
    ],
)
def test_a_look_alike_of_the_only_measurement_is_refused(folder, name, line):
    gone = dict.fromkeys(("rotation_deg", "load_n", "pressure_kpa", "contraction_mm"))
    write(folder / "ramp.csv", **gone, **{name: NORMAL["contraction_mm"]})
    message = refusal(folder)
    assert "ramp.csv has no measurement" in message
    assert "looks like" in message and message.endswith(line)


SLIPS = {
    "contraction_mm": [
        (1e-3, "metres, or its sensor was not connected", "factor = 1000"),
        (1e3, "micrometres", "factor = 0.001"),
        (1e5, "raw counts", "give .columns. of dataset.toml a factor"),
    ],
    "pressure_kpa": [
        (1e-2, "bar", "factor = 100"),
        (1e3, "pascals", "factor = 0.001"),
        (1 / 6.894757, "psi", "factor = 6.894757"),
    ],
    "pressure_command_kpa": [(1e-2, "bar", "factor = 100")],
    "load_n": [(1e-3, "kilonewtons", "factor = 1000"), (1e3, "millinewtons", "factor = 0.001")],
    "rotation_deg": [(np.pi / 180, "radians", "factor = 57.29578"), (1 / 360, "turns", "360")],
}


@pytest.mark.parametrize(
    ("name", "factor", "unit", "fix"),
    [(name, *slip) for name, slips in SLIPS.items() for slip in slips],
)
def test_a_unit_slip_is_refused_with_its_fix(folder, name, factor, unit, fix):
    write(folder / "ramp.csv", **{name: factor * NORMAL[name]})
    message = refusal(folder)
    assert message.startswith(name) and re.search(r"\(row \d+ of ramp.csv\)", message)
    assert f"it looks like {unit}" in message and re.search(fix, message)
    if "write under" in message:
        describe(folder, "[columns]\n" + message.partition("dataset.toml: ")[2])
        assert len(read_dataset(folder)) == 1


def test_a_slip_in_a_mapped_column_names_the_labs_own(folder):
    write(folder / "ramp.csv", contraction_mm=None, Weg=1e-3 * NORMAL["contraction_mm"])
    describe(folder, "[columns]\n'Weg' = 'contraction_mm'")
    assert "multiply factor and offset of 'Weg' in [columns] by 1000" in refusal(folder)


def test_pressures_that_are_both_in_bar_are_refused(folder):
    both = ("pressure_kpa", "pressure_command_kpa")
    write(folder / "ramp.csv", **{name: NORMAL[name] / 100 for name in both})
    assert "pressure_kpa reaches 3.05 kPa and no more, and so does its command" in refusal(folder)


@pytest.mark.parametrize("name", ["contraction_mm", "rotation_deg", "load_n", "pressure_kpa"])
def test_a_sensor_that_says_nothing_is_refused(folder, name):
    write(folder / "ramp.csv", **{name: np.full(ROWS, 25.0)})
    message = refusal(folder)
    assert f"{name} of ramp.csv is 25 in all 60 readings although" in message
    assert message.endswith("if the sensor was not connected, remove the column")


def test_what_may_rightly_stand_still_is_read(folder):
    """A hold: commands do not move, so nothing needs to."""
    still = {name: np.full(ROWS, NORMAL[name][0]) for name in NORMAL if name != "time_s"}
    write(folder / "hold.csv", **still)
    write(folder / "slack.csv", motor_voltage_v="0.0", rotation_deg="0.0", load_n=None)
    assert len(read_dataset(folder)) == 2


def test_gaps_are_read_and_long_ones_are_warned_of(folder):
    gap = np.where(np.arange(ROWS) < 40, np.nan, NORMAL["load_n"])
    short = np.where(np.arange(ROWS) < 20, np.nan, NORMAL["contraction_mm"])
    write(folder / "a.csv", load_n=gap, contraction_mm=short, rotation_deg="")
    with pytest.warns(TrialWarning) as caught:
        dataset = read_dataset(folder)
    said = [str(warning.message) for warning in caught]
    assert said == [
        "a.csv: rotation_deg is empty in every row; it counts as not measured",
        "a.csv: load_n is empty in 40 of 60 rows, the longest gap from row 2 to row 41; there it "
        "counts as not measured",
    ]
    assert np.isnan(dataset.trials[0].trial.measurements["load"]).sum() == 40


def test_a_broken_file_is_named(folder):
    write(folder / "a.csv")
    write(folder / "b.csv", time_s=-NORMAL["time_s"])
    assert "time_s must increase strictly, row 3 of b.csv" in refusal(folder)
    write(folder / "b.csv", load_n="n/a")
    assert "load_n must hold numbers, row 2 of b.csv has 'n/a', as have most of" in refusal(folder)


@pytest.mark.parametrize("outlier", [-4321.5, 1e6])
def test_a_unit_is_not_guessed_from_one_reading(folder, outlier):
    write(folder / "ramp.csv", **spoilt("contraction_mm", outlier, 20))
    message = refusal(folder)
    assert re.match(r"contraction_mm is \S+ mm in row 22, beyond the 250 mm that a muscle", message)
    assert message.endswith("empty these cells if nothing was measured there")
    write(folder / "ramp.csv", **spoilt("contraction_mm", np.nan, 20))
    assert len(read_dataset(folder)) == 1


def test_a_wild_reading_is_warned_of(folder):
    write(folder / "ramp.csv", **spoilt("load_n", 54321.5, 20))
    with pytest.warns(TrialWarning, match="load_n is 54321.5 N in row 22, far from its other rea"):
        assert len(read_dataset(folder)) == 1


def test_a_mark_of_nothing_measured_is_no_unit(folder):
    write(folder / "ramp.csv", **spoilt("contraction_mm", -999.0, 10, 20, 30))
    message = refusal(folder)
    assert "contraction_mm of ramp.csv is -999 in row 12, 22, 32, while" in message
    assert "micrometres" not in message
    describe(folder, "[format]\n" + re.findall(r"missing = \[.*?\]", message)[0])
    (trial,) = read_dataset(folder).trials
    assert np.isnan(trial.trial.measurements["contraction"]).sum() == 3


@pytest.mark.parametrize(
    ("gone", "there", "said"),
    [
        (
            "load_n", {"Load_kN": NORMAL["load_n"] / 1e3, "Temp": "21"},
            "^all files: unknown columns are ignored: 'Load_kN', 'Temp'; 'Load_kN'"
            '.*"Load_kN" = { name = "load_n", factor = 1000 }$',
        ),
        ("rotation_deg", {"Angle (°)": NORMAL["rotation_deg"]}, '"Angle .°." = "rotation_deg"$'),
    ],
)  # fmt: skip
def test_a_look_alike_beside_measurements_is_warned_of_once(folder, gone, there, said):
    for name in ("a.csv", "b.csv"):
        write(folder / name, **{gone: None, **there})
    with pytest.warns(TrialWarning, match=said) as caught:
        read_dataset(folder)
    assert len(caught) == 1


def test_what_a_lab_states_of_its_sensors_is_read(folder):
    write(folder / "ramp.csv")
    describe(folder, "[sensors]\nload_n = { resolution = 0.5, noise = 1.5, range = [0, 50] }\n")
    with pytest.warns(TrialWarning, match="load_n is at an end of its range, 0 to 50 N, in"):
        dataset = read_dataset(folder)
    assert dataset.sensors == {"load": LabSensor(0.5, 1.5, (0.0, 50.0))}
    load = np.concatenate([each.trial.measurements["load"] for each in dataset.trials])
    assert np.isnan(load).any() and np.nanmax(load) < 50.0


@pytest.mark.parametrize("every", [2, 12])
def test_a_slower_writers_commands_are_held_or_joined_as_one_key_says(folder, every):
    volts = 4.0 + 3.0 * np.sin(3.0 * NORMAL["time_s"])
    kept = np.arange(volts.size) % every == 0
    write(folder / "a.csv", motor_voltage_v=np.where(kept, volts, np.nan))
    line = 'if it goes to its next value in a line, write interpolation = "foh" under .format.'
    with pytest.warns(TrialWarning, match=f"held at the value before; {line}"):
        trial = read_dataset(folder).trials[0].trial
    (folder / "dataset.toml").write_text('[format]\ninterpolation = "zoh"')
    with pytest.warns(TrialWarning, match='held at the value before, as interpolation = "zoh"'):
        held = read_dataset(folder).trials[0].trial
    for each in (trial, held):
        np.testing.assert_array_equal(np.isfinite(each.commands["motor_voltage"]), kept)
    assert gaps(held) == []
    (folder / "dataset.toml").write_text('[format]\ninterpolation = "foh"')
    with pytest.warns(TrialWarning, match='are joined linearly, as interpolation = "foh"'):
        trial = read_dataset(folder).trials[0].trial
    last = np.flatnonzero(kept)[-1]
    between = np.interp(NORMAL["time_s"], NORMAL["time_s"][kept], volts[kept])
    np.testing.assert_allclose(trial.commands["motor_voltage"][:last], between[:last])


@pytest.mark.parametrize("form", ["zoh", "foh"])
def test_a_gap_of_a_slower_writer_is_neither_held_nor_joined(form):
    time = np.arange(2000) * 0.01
    volts = np.where(np.arange(2000) % 12 == 0, 4.0 + np.sin(time), np.nan)
    volts[600:800] = np.nan
    volts = joined(volts, time) if form == "foh" else volts
    (gap,) = gaps(Trial(time, {"motor_voltage": volts}))
    assert (gap.last, gap.first) == (588, 804)
