"""A plant as C and as an FMU moves as `Plant.simulate` does, events included."""

import importlib
import io
import shutil
import subprocess

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.export.c_plant import CPlant, ExportError
from pma_gym.export.fmu import FLAGS, fmu_bytes
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.sensors import deviations
from tests.export.axes import JOINT, SLIDE, axis, driven, joint_friction, slide_friction

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler cc")

SMOOTH = 1e-6
"""Largest difference without stick and slip, over the range."""

SLIPPING = 0.1
"""The same with stick and slip, in standard deviations of the sensor."""

SWINGS = {"joint_weight": {"moment_n_m": 0.2, "offset_deg": 10.0}}
RIGS = {
    "station": lambda: load_model("station"),
    "joint": lambda: axis(JOINT, **SWINGS),
    "late slide": lambda: axis(SLIDE, drive_delay={"share": 1, "delay_ms": 10}),
    "sticking joint": lambda: axis(JOINT, joint_friction=joint_friction(0.05), **SWINGS),
    "sticking slide": lambda: axis(SLIDE, coulomb_friction=slide_friction(8)),
}


def trial_of(model):
    if model.plant != "station":
        return driven(model)
    time = np.arange(0.0, 4.0, 0.01)
    motor = 1.0 + 0.5 * np.sin(2.0 * time) + 0.3 * np.sin(7.0 * time)
    return Trial(time, {"motor_voltage": motor, "regulator_voltage": 5.0 + 0.3 * np.sin(time)})


def columns(values):
    return np.stack(list(values), axis=1)


def agree(got, measured, model):
    """Whether readings are those of a simulation, to what a smooth or a sticking rig allows."""
    bounds = SMOOTH * np.ptp(measured, axis=0)
    if "friction" in str(model.parameters.keys() - {"symmetric_damping"}) and model.rig.is_free:
        bounds = SLIPPING * deviations(model)
    assert np.all(np.abs(got - measured).max(axis=0) <= bounds)


@pytest.mark.parametrize("name", RIGS)
def test_c_moves_as_the_plant_does(name, tmp_path):
    model = RIGS[name]()
    trial = trial_of(model)
    plant = CPlant(model, [column[0] for column in trial.commands.values()])
    texts = {**plant.files(), "main.c": plant.main()}
    for file, text in texts.items():
        (tmp_path / file).write_text(text)
        assert "alloc" not in text
    strict = ("-pedantic", "-Wall", "-Wextra", "-Werror")
    command = ["cc", *FLAGS, *strict, "-o", "main", "main.c", f"{plant.name}.c", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    rows = columns([trial.time, *trial.commands.values()]).tolist()
    given = "\n".join(" ".join(map(repr, row)) for row in rows)
    done = subprocess.run(
        tmp_path / "main", input=given, capture_output=True, text=True, check=True
    )
    got = np.loadtxt(io.StringIO(done.stdout))
    simulated = Plant(model).simulate(trial, noise=False)
    truth = [simulated.truth[name] for name in model.rig.outputs]
    agree(got[:, : len(truth)], columns(simulated.measurements.values()), model)
    agree(got[:, len(truth) :], columns(truth), model)


@pytest.mark.parametrize("version", [2, 3])
def test_an_fmu_is_valid_and_moves_as_the_plant_does(version, tmp_path):
    fmpy = pytest.importorskip("fmpy")
    model = RIGS["sticking joint"]()
    trial = driven(model)
    plant = CPlant(model, [float(trial.commands["torque_command"][0])])
    content = fmu_bytes(plant, version)
    assert len(content) <= 1e6 and content == fmu_bytes(plant, version)
    path = tmp_path / "own.fmu"
    path.write_bytes(content)
    assert importlib.import_module("fmpy.validation").validate_fmu(str(path)) == []
    described = fmpy.read_model_description(str(path))
    by_name = {each.name: each for each in described.modelVariables}
    assert (by_name["inertia.inertia"].unit, by_name["inertia.inertia"].start) == (
        "kg m^2",
        "0.005",
    )
    assert (by_name["torque_command"].causality, by_name["torque_command"].unit) == ("input", "N m")
    assert (by_name["angle"].unit, by_name["angle"].declaredType) == ("rad", None)
    heavier = {"inertia.inertia": 0.008, "state.angle": 0.1, "state.lag_encoder": 0.1}
    own = model.replace({"inertia.inertia_kg_m2": 0.008, "joint_start.angle_deg": np.degrees(0.1)})
    cases = [({}, model, "zoh"), (heavier, own, "zoh")] + [({}, model, "foh")] * (version == 2)
    for values, compared, interpolation in cases:
        got = stepped(fmpy, path, described, trial, values, interpolation == "foh")
        simulated = Plant(compared).simulate(trial, noise=False, interpolation=interpolation)
        # The encoder's lag follows the motion that a trial begins with.
        agree(got[10:], columns(simulated.measurements.values())[10:], compared)


def stepped(fmpy, path, described, trial, values, linear):
    """Readings of an FMU whose inputs are held from row to row, or linear."""
    unit = fmpy.instantiate_fmu(
        fmpy.extract(str(path), unzipdir=str(path.with_suffix(""))), described, "CoSimulation"
    )
    by_name = {each.name: each.valueReference for each in described.modelVariables}
    kind = "Real" if described.fmiVersion == "2.0" else "Float64"
    get, put = getattr(unit, f"get{kind}"), getattr(unit, f"set{kind}")
    if kind == "Real":
        unit.setupExperiment(startTime=0.0)
    put([by_name[name] for name in values], list(values.values()))
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    readings = [by_name["angle"], by_name["speed"]]
    rows = [get(readings)]
    torque, command = trial.commands["torque_command"], [by_name["torque_command"]]
    for k, duration in enumerate(np.diff(trial.time)):
        put(command, [float(torque[k])])
        if linear:
            unit.setRealInputDerivatives(command, [1], [(torque[k + 1] - torque[k]) / duration])
        unit.doStep(currentCommunicationPoint=trial.time[k], communicationStepSize=duration)
        rows.append(get(readings))
    unit.terminate()
    unit.freeInstance()
    return np.array(rows)


def test_what_cannot_be_c_is_said(monkeypatch):
    with pytest.raises(ExportError, match="must be torque_command, got 2 numbers"):
        CPlant(axis(JOINT), [0.0, 1.0])
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(ExportError, match="needs a C compiler .* with none; install gcc"):
        fmu_bytes(CPlant(axis(JOINT)))
