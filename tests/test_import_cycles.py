"""No module imports itself by way of others, `TYPE_CHECKING` and imports in functions included.

What a layer contract allows within a layer can still be a circle, which nobody can read from the
bottom up. Pyright and readers follow imports that only types need; so does this test.
"""

import ast
from collections import defaultdict
from pathlib import Path

from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

ROOT = Path(__file__).parent.parent
PACKAGES = ("pma_gym", "controllers", "benchmarks")


def module_files(root: Path) -> dict[str, Path]:
    """Files of all modules of the packages in a folder, by module name."""
    files = {}
    for package in PACKAGES:
        for path in (root / package).rglob("*.py"):
            parts = path.relative_to(root).with_suffix("").parts
            files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return files


def imported(path: Path, names: set[str]) -> set[str]:
    """Those of these modules that a file imports, anywhere in it."""
    modules = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                modules.add(inner if inner in names else node.module)
    return modules & names


def circles(root: Path) -> list[tuple[str, ...]]:
    """Groups of modules each of which imports all others of its group, directly or not."""
    files = module_files(root)
    names = sorted(files)
    place = {name: i for i, name in enumerate(names)}
    edges = [
        (place[name], place[other])
        for name in names
        for other in imported(files[name], set(names)) - {name}
    ]
    rows, columns = zip(*edges, strict=True)
    shape = (len(names), len(names))
    matrix = csr_matrix(([1] * len(edges), (rows, columns)), shape=shape)
    _, labels = connected_components(matrix, directed=True, connection="strong")
    groups = defaultdict(list)
    for name, label in zip(names, labels, strict=True):
        groups[label].append(name)
    return sorted(tuple(group) for group in groups.values() if len(group) > 1)


def test_no_module_imports_itself_by_way_of_others():
    assert circles(ROOT) == []
