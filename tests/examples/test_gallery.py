"""The gallery: every example runs to its end, and notebooks are their scripts and execute.

Make notebooks from the examples: `python -m tests.examples.test_gallery` writes them anew.

A cell begins where the script has `# %%`; the script's docstring is the first cell, as text. The
notebooks hold no outputs: `make examples` executes them.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"
NOTEBOOKS = ("open_and_closed_loop", "pid_from_linear_model", "random_stations", "hidden_effect")


def notebook(script: str) -> str:
    """A script as a notebook (nbformat 4.5)."""
    head, *parts = re.split(r"^# %%", script, flags=re.MULTILINE)
    cells = [_cell("markdown", head.strip().strip('"').strip(), 0)]
    for number, part in enumerate(parts, start=1):
        title, _, code = part.partition("\n")
        text = f"# {title.strip()}\n{code}" if title.strip() else code
        cells.append(_cell("code", text.strip(), number))
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    metadata = {"kernelspec": kernel, "language_info": {"name": "python"}}
    document = {"cells": cells, "metadata": metadata, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _cell(kind: str, text: str, number: int) -> dict[str, object]:
    cell = {"cell_type": kind, "id": f"cell-{number}", "metadata": {}}
    cell["source"] = text.splitlines(keepends=True)
    return cell | ({"execution_count": None, "outputs": []} if kind == "code" else {})


if __name__ == "__main__":
    for name in NOTEBOOKS:
        script = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
        (EXAMPLES / f"{name}.ipynb").write_text(notebook(script), encoding="utf-8")

ROOT = EXAMPLES.parents[1]
# What the examples need beyond the core and controllers.
LIBRARIES = {"policy_to_onnx": "onnx"}
GALLERY = (
    *("open_and_closed_loop", "pid_from_linear_model", "mpc_with_limits", "many_environments"),
    *(
        "random_stations",
        "exercise_device",
        "hidden_effect",
        "joint",
        "servo_pendulum",
        "servo_wheel",
        "tensile_test",
    ),
    *("cylinder_seal", "band_brake", "own_effect"),
    "policy_to_onnx",
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
    assert made == notebook(script), "run python -m tests.examples.test_gallery"


def test_the_page_of_examples_has_them_all():
    page = (EXAMPLES.parent / "reference" / "gallery.md").read_text(encoding="utf-8")
    for name in GALLERY:
        assert f"examples/{name}.py" in page
    for name in NOTEBOOKS:
        assert f"examples/{name}.ipynb" in page
