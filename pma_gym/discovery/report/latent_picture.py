"""The latent force of a free rig before and after, over all that it may go with."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.report.figure_text import figure
from pma_gym.discovery.report.pictures import AFTER, PARAMETERS, after_name
from pma_gym.discovery.result.misfit import LatentForce, ResidualLaw, rms
from pma_gym.pages.figures import legend_below, picture, png

Array = NDArray[np.float64]

MOST_POINTS = 1000
"""Of a panel and a colour."""

BEFORE = "#9a9a9a"
LAW: dict[str, Any] = {"color": PARAMETERS, "linewidth": 2.2}
_MOST_OVER_TIME, _MOST_TRIALS = 4, 12


def latent_picture(diagnosis: Diagnosis) -> bytes:
    """Over time, position, speed and command, with its law drawn in, and its size by trial."""
    forces = [(each.name, each.time, each.latent) for each in diagnosis.trials if each.latent]
    forces.sort(key=lambda each: -rms(each[2].before))
    latent, timed = [force for *_, force in forces], forces[:_MOST_OVER_TIME]
    names, quantity = list(latent[0].over), latent[0].quantity
    law = diagnosis.law if drawn_in(diagnosis) else None
    rows = [[i, i] for i in range(len(timed))] + [names[:2], [names[2], "rms"]]
    heights = [1.4] * len(timed) + [2.9, 2.9]
    with picture(9.6, 0.5 + sum(heights)) as drawn:
        panels: dict[Any, Axes] = drawn.subplot_mosaic(rows, height_ratios=heights)  # type: ignore[arg-type]
        for i, (name, time, force) in enumerate(timed):
            _draw(panels[i], time, force, "-", 1.4)
            panels[i].set_title(name, loc="left")
            panels[i].set_xlabel("time (s)" if i == len(timed) - 1 else "")
        for name in names:
            over = np.concatenate([force.over[name] for force in latent])
            _draw(panels[name], over, _joined(latent), ".", 0.5)
            panels[name].set_xlabel(name)
            if law and law.variable == name:
                _law(panels[name], law)
        ends = [each for force in latent for each in (force.before, force.after)]
        values = np.concatenate([each for each in ends if each is not None])
        room = 0.05 * float(np.ptp(values))
        for key, panel in panels.items():
            if key != "rms":
                panel.set_ylim(float(values.min()) - room, float(values.max()) + room)
                panel.axhline(0.0, color="#000000", linewidth=0.8, zorder=0)
                panel.set_ylabel(quantity.replace(" on ", "\non "))
        _by_trial(panels["rms"], forces[:_MOST_TRIALS])
        handles: list[Any] = [Patch(color=BEFORE, label="before: parameters refitted")]
        if latent[0].after is not None:
            handles.append(Patch(color=AFTER, label=f"after: {after_name(diagnosis)}"))
        if law:
            handles.append(Line2D([], [], label="law of what is missing", **LAW))
        legend_below(drawn, handles, 3)
        return png(drawn)


def drawn_in(diagnosis: Diagnosis) -> bool:
    """Whether the law of what is missing is a force, and drawn in beside the latent force."""
    forces = [each.latent.quantity for each in diagnosis.trials if each.latent]
    return bool(diagnosis.law) and diagnosis.law.quantity in forces


def _joined(forces: list[LatentForce]) -> LatentForce:
    """All trials as one."""
    after = [each.after for each in forces if each.after is not None]
    before = np.concatenate([each.before for each in forces])
    return LatentForce(forces[0].quantity, before, np.concatenate(after) if after else None, {})


def _draw(panel: Axes, x: Array, force: LatentForce, style: str, size: float) -> None:
    """Before and after, thinned."""
    thin = slice(None, None, -(-len(x) // MOST_POINTS))
    for values, color in ((force.before, BEFORE), (force.after, AFTER)):
        if values is not None:
            panel.plot(x[thin], values[thin], style, color=color, linewidth=size, markersize=3)


def _law(panel: Axes, law: ResidualLaw) -> None:
    panel.fill_between(law.at, law.low, law.high, color=PARAMETERS, alpha=0.25, linewidth=0)
    panel.plot(law.at, law.law, **LAW)


def _by_trial(panel: Axes, forces: list[tuple[str, Array, LatentForce]]) -> None:
    """Root mean square of each trial, the largest on top."""
    at = -np.arange(float(len(forces)))
    for shift, color, part in ((0.2, BEFORE, "before"), (-0.2, AFTER, "after")):
        sizes = [rms(v) for *_, each in forces if (v := getattr(each, part)) is not None]
        if sizes:
            bars = panel.barh(at + shift, sizes, 0.38, color=color)
            panel.bar_label(bars, [figure(each) for each in sizes], padding=2, fontsize="small")
    # What tells long names apart is mostly at their ends.
    panel.set_yticks(at, [name if len(name) < 17 else f"...{name[-14:]}" for name, *_ in forces])
    panel.margins(x=0.15)
    panel.grid(visible=False, axis="y")
    panel.set_xlabel(f"{forces[0][2].quantity}, rms")
