"""Make notebooks from the examples: `python -m tests.examples.notebooks` writes them anew.

A cell begins where the script has `# %%`; the script's docstring is the first cell, as text. The
notebooks hold no outputs: `make examples` executes them.
"""

import json
import re
from pathlib import Path

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
