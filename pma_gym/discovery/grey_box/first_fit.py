"""The fit of the model as it came."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pma_gym.discovery.grey_box.hypothesis import Hypothesis, precise_fit
from pma_gym.discovery.grey_box.kept_fits import fit
from pma_gym.discovery.grey_box.prepared_trials import PreparedTrials
from pma_gym.discovery.grey_box.slots import own_coordinates
from pma_gym.estimation.innovations import GreyBox, Point, is_rugged, log_likelihood
from pma_gym.estimation.likelihood_fit import Coordinate, value_of, with_tied, with_values

STARTS, SMOOTH_STARTS = 5, 3
"""Of the first fit, with and without dry friction, whose likelihood is rugged."""

AGREEING, ALIKE = 3, 0.5
"""Starts that agree end the first fit, and the log likelihood within which they do."""

SCATTER = 0.2
"""Standard deviation of a start's parameters, as a share of them."""

SHARES = (0.1, 0.03, 0.1, 0.01)
"""Latent force at the starts, as a share of the drive's.

Small, so that it swallows nothing at first.
"""

LESS = (0.5, 0.1, 0.02)
"""Shares of the latent force that fits begin again with."""

SOONER = 0.1
"""Share of the presliding distance that a fit begins again with."""

DELAY_ROWS = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0)
"""Delays (rows) of which a start takes the likeliest."""


def first_fit(
    trials: PreparedTrials, seed: int, tell: Callable[[str, int, int], None]
) -> Hypothesis:
    """The model as it came, fitted; `tell` is called with what is done of its total."""
    own, tied = own_coordinates(trials.box(trials.model))
    coordinates = [*own, *trials.nuisances()]
    rough = is_rugged(trials.model)
    count = STARTS if rough else SMOOTH_STARTS
    kinds: Sequence[bool] = (False, True)
    fits: dict[bool, list[Hypothesis]] = {linear: [] for linear in kinds}

    def best(linear: bool) -> Hypothesis:
        return max(fits[linear], key=lambda each: each.fit.value)

    def start(k: int) -> None:
        for linear in kinds:
            # It may end after `AGREEING`: between that and all, until then.
            tell("refitting parameters", k, count + 2 if k > AGREEING else (count + AGREEING) // 2)
            box = trials.box(trials.model, linear)
            begin = _begin(trials, seed, box, coordinates, tied, k)
            fits[linear].append(precise_fit(trials, box, begin, coordinates, tied, linear=linear))

    for k in range(count):
        start(k)
        kinds = (max(fits, key=lambda each: best(each).fit.value),) if k else kinds
        values = sorted(each.fit.value for each in fits[kinds[0]])
        if len(values) >= AGREEING and values[-1] - values[-AGREEING] < ALIKE:
            break
    trials.linear = kinds[0]
    if rough:
        now = best(trials.linear)
        for linear in fits:
            fits[linear] += hold_fits(trials, now, linear)
        trials.linear = max(fits, key=lambda each: best(each).fit.value)
    return lighter(trials, best(trials.linear))


def lighter(trials: PreparedTrials, now: Hypothesis) -> Hypothesis:
    """Fitted again beside less of a latent force that stays, for as long as that is likelier.

    It makes up for a parameter that is off, and hides that it is.
    """
    while trials.is_bent(now.fit.point):
        point, fitted = now.fit.point, now.fit
        short = replace(weaker(trials, point, 1.0), memory=trials.memory[0])
        starts = [
            replace(short, forces=tuple(share * force for force in point.forces)) for share in LESS
        ]
        fits = [
            precise_fit(trials, now.box, start, fitted.coordinates, fitted.tied, rough=True)
            for start in (*starts, weaker(trials, point, LESS[0]))
        ]
        best = max(fits, key=lambda each: each.fit.value)
        if best.fit.value < fitted.value + ALIKE:
            break
        now = replace(now, box=best.box, fit=best.fit)
    return now


def weaker(trials: PreparedTrials, point: Point, share: float) -> Point:
    """A point with a share of its latent force, in no trial more than thrice the least one.

    And with no more noise than the readings show: what stood in for an effect makes room for
    it.
    """
    most = 3.0 * min(point.forces) if share < 1.0 else max(point.forces)
    least = min(SHARES) * trials.force
    forces = tuple(max(share * min(each, most), least) for each in point.forces)
    noise = tuple(map(min, point.deviations, trials.noise))
    return replace(point, forces=forces, deviations=noise)


def _begin(
    trials: PreparedTrials,
    seed: int,
    box: GreyBox,
    coordinates: Sequence[Coordinate],
    tied: Mapping[str, str],
    k: int,
) -> Point:
    """Start number k: the first is the model as it came."""
    generator = np.random.default_rng((seed, k))
    memory = float(np.sqrt(trials.memory[0] * trials.memory[1])) if k % 2 else trials.memory[0]
    forces = (SHARES[k % 4] * trials.force,) * len(trials.logged)
    point = Point(box.numbers(), tuple(trials.noise), forces, memory)
    own = [c for c in coordinates if c.name in point.numbers]
    factors = np.exp(SCATTER * generator.standard_normal(len(own))) if k else np.ones(len(own))
    values = {
        c.name: float(np.clip(value_of(point, c.name) * f, c.lower, c.upper))
        for c, f in zip(own, factors, strict=True)
    }
    point = with_values(point, with_tied(values, tied))
    late = [
        replace(point, delay=rows * trials.span)
        for rows in DELAY_ROWS[: 1 if k == 0 or coordinates[-1].name != "delay" else None]
    ]
    return late[int(np.argmax(log_likelihood(box.innovations(late), box.rows)))]


def hold_fits(trials: PreparedTrials, now: Hypothesis, linear: bool) -> list[Hypothesis]:
    """Fits with commands held or linear between rows, from one that has them either way.

    A held command is a line half a row later. Friction that begins to slip too late hides which it
    is, and its fits end where they began: both begin again with a share of the presliding distance
    for as long as that is likelier.
    """
    fit_, point = now.fit, now.fit.point
    row = 0.5 * trials.span / trials.stride / trials.block * (int(linear) - int(trials.linear))
    late = any(c.name == "delay" for c in fit_.coordinates)
    start = with_values(point, {"delay": max(0.0, point.delay + row * late)})
    fits = list[Hypothesis]()
    while True:
        made = precise_fit(
            trials, now.box, start, fit_.coordinates, fit_.tied, rough=True, linear=linear
        )
        fits.append(replace(now, box=made.box, fit=made.fit))
        last = made.fit.point
        slip = {n: SOONER * v for n, v in last.numbers.items() if n.endswith(".presliding")}
        start = with_values(
            last, {c.name: max(c.lower, slip[c.name]) for c in fit_.coordinates if c.name in slip}
        )
        before = max((each.fit.value for each in fits[:-1]), default=-np.inf)
        if start == last or made.fit.value < before + ALIKE:
            return fits


def unmoved(trials: PreparedTrials, base: Hypothesis) -> Hypothesis:
    """The model's own parameters as they came, with noise and latent force fitted."""
    own = base.box.numbers()
    free = [c for c in base.fit.coordinates if c.name not in own and c.name != "delay"]
    start = Point(
        own, base.fit.point.deviations, (0.1 * trials.force,) * len(trials.logged), trials.memory[0]
    )
    made = fit(base.box, start, free, {})
    return replace(base, fit=replace(made, coordinates=base.fit.coordinates, tied=base.fit.tied))
