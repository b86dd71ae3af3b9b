"""Plot styles: one colour and one marker for each controller, in every picture."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from benchmarks.suites.reproduction import ReproductionSuite

Dashes = Literal["-", "--", "-.", ":"]

# Okabe and Ito's palette, told apart by the colour-blind and in grey by the order of lightness;
# then three of Tol's darker ones. Marker and line tell apart what a weak printer does not.
_FIXED: dict[str, tuple[str, str, Dashes]] = {
    "serres_replay": ("#D55E00", "s", "-"),
    "serres_feedforward": ("#CC79A7", "D", "-"),
    "improved_feedforward": ("#E69F00", "^", "-"),
    "pid": ("#0072B2", "v", "-"),
    "feedforward_pid": ("#009E73", "o", "-"),
    "lqg": ("#882255", "<", "--"),
    "adrc": ("#999933", "X", "--"),
    "sliding_mode": ("#CC79A7", "h", "--"),
    "mpc": ("#332288", "p", "--"),
    "ilc": ("#D55E00", "d", "--"),
    "oracle": ("#000000", "*", ":"),
    "ppo": ("#56B4E9", "P", "-"),
    "ppo_ilc": ("#56B4E9", "d", "--"),
    # Those of exercises never meet those of other tasks above, but for the policy.
    "constant_pressure": ("#CC79A7", "D", "-."),
    "scheduled_pressure": ("#E69F00", "^", "-."),
    "speed_pid": ("#0072B2", "v", "-."),
    "moment_pid": ("#009E73", "o", "-."),
    "exercise_mpc": ("#332288", "p", "--"),
}
_OTHERS: tuple[tuple[str, str, Dashes], ...] = (
    ("#CC79A7", "D", "-."),
    ("#56B4E9", "P", "-."),
    ("#8C564B", "X", "-."),
    ("#7F7F7F", "*", "-."),
)

REFERENCE = {"color": "#000000", "linestyle": (0, (5, 3)), "linewidth": 1.1}
MEASURED = {"color": "#666666", "linewidth": 2.6, "alpha": 0.75}
BOUND = {"color": "#000000", "linestyle": (0, (1, 1.5)), "linewidth": 1.4}


@dataclass(frozen=True)
class Style:
    """Plot style of a controller.

    Attributes:
        label: in legends.
        color: of its lines, bars and markers.
        marker: of its points.
        line: dashes of its lines, where many are drawn in one panel.
    """

    label: str
    color: str
    marker: str
    line: Dashes = "-"


def controller_styles(suite: ReproductionSuite) -> dict[str, Style]:
    """A style for each controller of a suite, by name."""
    return styles_of({controller.name: controller.label for controller in suite.controllers})


def styles_of(labels: Mapping[str, str]) -> dict[str, Style]:
    """A style for each controller of a report.

    Args:
        labels: what people call the controllers, by name.
    Returns:
        Its own for one that the package has, one of the free ones for another, by name.
    """
    taken = {_FIXED[name][0] for name in labels if name in _FIXED}
    free = [other for other in _OTHERS if other[0] not in taken]
    others = [name for name in labels if name not in _FIXED]
    own = {name: free[at % len(free)] for at, name in enumerate(others)} | _FIXED
    return {name: Style(label, *own[name]) for name, label in labels.items()}
