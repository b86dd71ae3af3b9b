"""Examples for other libraries: each runs to its end in a subprocess and says its error."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.examples.test_gallery import GALLERY

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "docs" / "examples"
LIBRARIES = {"ppo_torch": "torch", "sb3_ppo": "stable_baselines3", "rllib_ppo": "ray.rllib"}
# RLlib starts processes of its own, which takes its time beside other tests.
SECONDS = {"rllib_ppo": 300}


@pytest.mark.example
@pytest.mark.parametrize("name", LIBRARIES)
def test_it_runs_and_prints_its_error(name, tmp_path):
    library = LIBRARIES[name].split(".")[0]
    pytest.importorskip(library, reason=f"{library} is not installed, see docs/other-libraries.md")
    env = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    if library == "ray":
        env["HOME"] = str(tmp_path)  # Ray leaves a token and folders of results there.
    done = subprocess.run(
        [sys.executable, EXAMPLES / f"{name}.py", "8192"],
        cwd=tmp_path,
        env=env,
        capture_output=True,
        text=True,
        timeout=SECONDS.get(name, 120),
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (rmse,) = re.findall(r"^RMSE (\d+\.\d{3}) mm$", done.stdout, re.MULTILINE)
    assert 0.0 < float(rmse) < 40.0


def test_every_example_is_run_by_a_test_and_shown_on_a_page():
    page = (ROOT / "docs" / "other-libraries.md").read_text(encoding="utf-8")
    names = {path.stem for path in EXAMPLES.glob("*.py")}
    assert names == {*LIBRARIES, *GALLERY, "integral"}
    for name in LIBRARIES:
        assert f"`python docs/examples/{name}.py`" in page
        assert f"<!-- generate: example {name} -->" in page
