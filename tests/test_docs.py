"""Documentation: what is rendered from the code is complete, and what is shown runs."""

import importlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
from dataclasses import fields
from functools import cache
from pathlib import Path

import pytest

from controllers import CONTROLLERS
from pma_gym.data.serres2008 import corrections
from pma_gym.data.trial_columns import BY_NAME
from pma_gym.discovery import thresholds
from pma_gym.discovery.grey_box import thresholds as likelihood
from pma_gym.effects import CATALOGUE
from pma_gym.envs import ENVIRONMENTS, Options
from pma_gym.plant.model import load_model, shipped_models
from pma_gym.studies import compare_all
from pma_gym.tasks import DISTURBANCES, EVERY_TASK, RANDOMISATIONS, REWARDS

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))


@pytest.fixture(scope="module")
def generators():
    sys.path.insert(0, str(DOCS))
    try:
        return importlib.import_module("generators")
    finally:
        sys.path.remove(str(DOCS))


@pytest.fixture(scope="module")
def page(generators):
    # Expanding the effects takes a second, and every effect looks at them.
    return cache(lambda name: generators.expand((DOCS / name).read_text(encoding="utf-8")))


MARKED = [
    str(path.relative_to(DOCS)) for path in PAGES if "<!-- generate:" in path.read_text("utf-8")
]


@pytest.mark.parametrize("name", MARKED)
def test_every_mark_is_filled(page, name):
    assert "<!-- generate:" not in page(name)


def test_a_mark_that_names_nothing_is_refused(generators):
    with pytest.raises(KeyError, match="no generator 'efects'; there are"):
        generators.expand("<!-- generate: efects -->")


def test_every_effect_has_its_law_and_parameters(page):
    section = re.split(r"^## ", page("reference/effect-catalogue.md"), flags=re.MULTILINE)
    for name, effect in CATALOGUE.items():
        if effect.of:
            continue
        (own,) = (text for text in section if text.startswith(f"{name} "))
        assert effect.port in own and effect.signature in own
        for stem, quantity in effect.quantities.items():
            (row,) = (x for x in own.splitlines() if x.startswith(f"| `{quantity.name(stem)}`"))
            assert quantity.source in row and quantity.unit in row
            assert quantity.usual is None or f"| {quantity.usual:.6g} |" in row
        for law in effect.laws():
            assert law.__doc__.split("\n")[0].rstrip(":") in own


@pytest.mark.parametrize("name", shipped_models())
def test_every_model_has_its_values_and_intervals(page, name):
    model, text = load_model(name), page("reference/model-parameters.md")
    assert model.title in text
    own = text[re.search(rf"^##+ `{name}`$", text, re.MULTILINE).start() :]
    base = load_model("serres2008").parameters
    for effect in model.parameters:
        if name not in ("station", "cascade", "serres2008"):
            # Shown as what differs from serres2008.
            if base.get(effect) == model.parameters[effect]:
                continue
        for file_key in model.values_in_files(effect):
            (row, *_) = (x for x in own.splitlines() if x.startswith(f"| `{effect}.{file_key}`"))
            note = model.notes.get(f"{effect}.{file_key}")
            assert note is None or note.source in row
            assert note is None or note.low is None or f"{note.low:.6g} to {note.high:.6g}" in row


def test_every_error_of_the_source_is_listed(page):
    text = page("reference/errata.md")
    single = [item for item in corrections() if not item.reason.startswith("printed as a fraction")]
    assert single and all(item.reason in text for item in single)
    wrong = [row for row in compare_all() if row.verdict == "wrong in print"]
    assert wrong and text.count("\n| ") > len(wrong) + len(single)
    assert all(row.quantity.replace("_", " ") in text for row in wrong)


def test_environments_page_is_complete(page):
    text = page("reference/environment-options.md")
    names = [field.name for field in fields(Options)]
    for name in (*names, *REWARDS, *RANDOMISATIONS, *DISTURBANCES, *EVERY_TASK, *ENVIRONMENTS):
        assert f"`{name}`" in text


@pytest.mark.parametrize(
    ("name", "method"), [("thresholds", thresholds), ("grey_box/thresholds", likelihood)]
)
def test_every_decision_number_is_listed_with_its_meaning(generators, page, name, method):
    listed = generators.GENERATORS["decision_numbers"](name)
    assert listed in page("reference/diagnosis-method.md")
    numbers = {key: value for key, value in vars(method).items() if key.isupper()}
    for key, value in numbers.items():
        (stated,) = re.findall(rf"^\| `[^`]*\b{key}\b[^`]*` \| `(.+?)` \| \w.+ \|$", listed, re.M)
        read = eval(stated, dict(numbers))
        assert value == read or value in read


def test_numerics_are_listed_apart(generators, page):
    listed = generators.GENERATORS["numerics"]()
    assert listed in page("reference/diagnosis-method.md") and "thresholds" not in listed
    assert "| `fitting/levenberg_marquardt` | `CLOSE` | `0.001` |" in listed


def test_columns_and_controllers_are_listed(page):
    assert all(f"`{name}`" in page("reference/data-files.md") for name in BY_NAME)
    assert all(f"`{name}`" in page("controllers.md") for name in CONTROLLERS)


def test_example_of_a_model_has_names_that_exist():
    text = (DOCS / "physics" / "models.md").read_text(encoding="utf-8")
    document = tomllib.loads(re.search(r"```toml\n(.*?)```", text, re.DOTALL)[1])
    values = {k: v["value"] if isinstance(v, dict) else v for k, v in document["cable"].items()}
    assert CATALOGUE["cable"].parse(values)


EXAMPLES = [
    pytest.param(language, code, id=f"{path.stem}-{language}-{number}")
    for path in PAGES
    for number, (language, code) in enumerate(
        re.findall(r"```(python|bash)\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL)
    )
    if not re.search(
        r"^(make|pip|(\.venv/bin/)?python -m (benchmarks|rl_zoo3))", code, re.MULTILINE
    )
]


@pytest.mark.example
@pytest.mark.parametrize(("language", "code"), EXAMPLES)
def test_example_runs(language, code, tmp_path):
    for module in ("stable_baselines3", "sympy", "pyarrow"):
        if module in code:
            pytest.importorskip(module)
    program = [sys.executable, "-c"] if language == "python" else [shutil.which("bash"), "-ec"]
    # The installed program lies beside the interpreter.
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [*program, code], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_docstrings_are_made_ready(monkeypatch):
    pytest.importorskip("griffe")
    monkeypatch.syspath_prepend(DOCS)
    docstrings = importlib.import_module("docstrings")
    assert docstrings.spaced("A.\n\nArgs:\n    x: b.\nReturns:\n    c.") == (
        "A.\n\nArgs:\n    x: b.\n\nReturns:\n    c."
    )
    fenced = docstrings.fenced
    text = "Text.\n\n    >>> f(1)\n    [1]\n\nMore."
    assert fenced(text) == "Text.\n\n    ```pycon\n    >>> f(1)\n    [1]\n    ```\n\nMore."
    assert fenced(">>> 1\n1") == "```pycon\n>>> 1\n1\n```"
