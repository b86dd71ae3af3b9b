"""The baselines by name."""

import importlib.util
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from pma_gym.data.datasets.dataset import Dataset

Ask = Callable[[Dataset, int, int], Mapping[str, Any]]
"""A data set, a seed and a number of threads to an answer with the keys of `diagnosis.json`."""

_HERE = "benchmarks.hidden_effects.baselines"


@dataclass(frozen=True)
class Baseline:
    """A diagnosis that ours is compared with.

    Attributes:
        title: for readers.
        place: its function, `module:name` in this package.
        needs: modules beyond the core of this project.
    """

    title: str
    place: str
    needs: tuple[str, ...] = ()

    @property
    def absence(self) -> str:
        """What it lacks here and the fix; nothing if it can be asked."""
        lacking = [name for name in self.needs if importlib.util.find_spec(name) is None]
        if not lacking:
            return ""
        return f"needs {', '.join(lacking)}: pip install -c constraints.txt -e '.[baselines]'"

    @property
    def ask(self) -> Ask:
        """The function."""
        module, _, name = self.place.partition(":")
        return getattr(import_module(f"{_HERE}.{module}"), name)


BASELINES: dict[str, Baseline] = {
    "ours": Baseline("ours", "ablations:ours"),
    "no_whitening": Baseline("ours without whitening", "ablations:no_whitening"),
    "no_refit": Baseline("ours without parameter refit", "ablations:no_refit"),
    "no_gate": Baseline("ours without the resampled gate", "ablations:no_gate"),
    "bic_stepwise": Baseline("plain BIC stepwise", "stepwise:bic_stepwise"),
    "sparse_regression": Baseline(
        "PySINDy on the residual", "sparse:sparse_regression", ("pysindy",)
    ),
    "gaussian_process": Baseline(
        "a Gaussian process only", "gaussian_process:gaussian_process", ("sklearn",)
    ),
    "random_forest": Baseline(
        "a random forest on signatures", "forest:random_forest", ("sklearn",)
    ),
}  # fmt: skip
"""Ours first, then ours with one part off, then simpler ones."""
