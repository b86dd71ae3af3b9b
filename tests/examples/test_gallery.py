"""The gallery: every example runs to its end, and notebooks are their scripts and execute."""

import os
import subprocess
import sys

import pytest

from tests.examples.notebooks import EXAMPLES, NOTEBOOKS, notebook

ROOT = EXAMPLES.parents[1]
# What the examples need beyond the core and controllers.
LIBRARIES = {"policy_to_onnx": "onnx", "behaviour_cloning": "pyarrow"}
GALLERY = (
    *("open_and_closed_loop", "pid_from_linear_model", "mpc_with_limits", "many_environments"),
    *(
        "random_stations",
        "exercise_device",
        "hidden_effect",
        "joint",
        "servo_pendulum",
        "logs_to_policy",
        "servo_wheel",
        "tensile_test",
    ),
    *("cylinder_seal", "band_brake", "antagonistic_pair", "own_effect"),
    *("policy_to_onnx", "behaviour_cloning"),
)
SECONDS = 400


@pytest.mark.example
@pytest.mark.parametrize("name", GALLERY)
def test_an_example_runs_and_prints_figures(name, tmp_path):
    pytest.importorskip(LIBRARIES.get(name, "numpy"))
    env = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, EXAMPLES / f"{name}.py"]
    done = subprocess.run(
        command, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=SECONDS
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert any(character.isdigit() for character in done.stdout)


@pytest.mark.example
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_opens_and_executes(name, tmp_path):
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    read = nbformat.read(EXAMPLES / f"{name}.ipynb", as_version=4)
    nbformat.validate(read)
    client = nbclient.NotebookClient(read, timeout=SECONDS, resources={"metadata": {"path": ROOT}})
    executed = client.execute()
    outputs = [output for cell in executed.cells for output in cell.get("outputs", [])]
    assert outputs and all(output.output_type != "error" for output in outputs)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_is_its_script(name):
    script = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
    made = (EXAMPLES / f"{name}.ipynb").read_text(encoding="utf-8")
    assert made == notebook(script), "run python -m tests.examples.notebooks"


def test_the_page_of_examples_has_them_all():
    page = (EXAMPLES.parent / "reference" / "gallery.md").read_text(encoding="utf-8")
    for name in GALLERY:
        assert f"examples/{name}.py" in page
    for name in NOTEBOOKS:
        assert f"examples/{name}.ipynb" in page
