"""Which effects, or parameters that differ by trial, carry the latent force."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.free_parameters import free_parameters, prior
from pma_gym.discovery.grey_box.kept_fits import fit
from pma_gym.discovery.grey_box.thresholds import (
    CONFIDENCE,
    FAINT,
    LIKE,
    LINE,
    LOUD,
    MATERIAL,
    MOST_EFFECTS,
    ODD,
    TRIED,
)
from pma_gym.effects import CATALOGUE
from pma_gym.effects.effect import signals
from pma_gym.estimation.innovations import (
    TREND,
    TRIAL,
    GreyBox,
    Point,
    Rows,
    log_likelihood,
    value_in_trial,
)
from pma_gym.estimation.likelihood_fit import (
    BLOCKS,
    STEP,
    Coordinate,
    Fit,
    value_of,
    with_tied,
    with_values,
)
from pma_gym.estimation.logged import Logged
from pma_gym.plant.model import Model
from pma_gym.units import Quantity

Array = NDArray[np.float64]

WIDER = (1.0, 0.2, 5.0)
"""Times the usual shape (a Stribeck speed) from which the fuller law of an effect is fitted."""

PARTS, LESS, SLIPS = (0.3, 1.0, 3.0), (0.5, 0.1, 0.02), (0.01, 0.1, 1.0, 10.0, 100.0)
"""Starts of a candidate.

Times the size that the screening promises, shares of the latent force, and times the usual
presliding distance.
"""

FITTED, FURTHER = 1, 2
"""How many of them are fitted, the likeliest as they are, and in a careful fit."""

PRECISE, MOST_STEPS, SHORTEST_S = 1.0, 200_000, 1e-4
"""Integration steps are halved until that changes all innovations by less.

Sum of their squares, in their deviations, so that log likelihoods are right to about one unit. And
steps of all trials together at most, and the shortest step: where friction turns, no step is short
enough for such precision.
"""

MOST_ROWS = 8_000
"""Of all trials together.

More are averaged in blocks, as long as the motion bends less in one than its noise; of what is more
still, every second, third ... block is read.
"""

BENT = 0.2
"""That bend at most, in standard deviations of a block's noise."""

STARTS, SMOOTH_STARTS = 8, 3
"""Of the first fit, with and without dry friction, whose likelihood is rugged."""

BEAM, BESIDE = 3, 3
"""Hypotheses that a stage hands on, and moves that each but the likeliest is extended by."""

COST, AFTER = 3, 1.5
"""For the time left.

What an effect's fits take, in those of a parameter by trial; the same for fits that begin far off,
in others. What a stage takes, in its moves' fits.
"""

MOST_TRIALS = 6
"""With so many trials at most, each is once taken for an odd one.

With a large latent force of its own at the start.
"""

ODD_SHARE = 0.005
"""Latent force, as a share of the drive's, from which on that is done."""

ALIKE = 0.5
"""Log likelihood within which three starts agree."""

SCATTER = 0.2
"""Standard deviation of a start's parameters, as a share of them."""

SHARES = (0.1, 0.01, 0.03, 0.003)
"""Latent force at the starts, as a share of the drive's.

Small, so that it swallows nothing at first.
"""

LEAST_FORCE = 1e-6
"""Least latent force, as a share of the drive's."""

WIDE = 5.0
"""Standard deviation of the own parameters' priors.

In those that the parameters' list has (10 % of them).
"""

MOST_DELAY = 20.0
"""Longest delay, in rows."""

MOST_FACTOR = 5.0
"""Factor that a parameter of one trial may differ by.

Beyond it no cable chain jams, and another thing is missing.
"""

DELAY_ROWS = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0)
"""Delays (rows) of which a start takes the likeliest."""

DELAYS = ("drive_delay", "lvdt_delay", "tachometer_delay", "encoder_delay", "gyroscope_delay")
"""Candidates that are not tried: the delay between command and readings is free in every fit."""

LAGS = ("lvdt_lag", "tachometer_lag", "encoder_lag", "gyroscope_lag")
"""The same where there is one signal."""


@dataclass(frozen=True)
class Move:
    """One thing that a model may lack: an effect, or a parameter that differs by trial.

    Attributes:
        name: of the effect, or the parameter's slot with its mark.
        promise: gain of log likelihood that the screening promises.
        numbers: how many it adds.
        candidate: the effect.
        probe: its most promising probe.
        amount: how many times the probe's size.
        slots: of parameters by trial.
        start: where its fit begins, if not at what it is added to.
    """

    name: str
    promise: float
    numbers: int
    candidate: CandidateEffect | None = None
    probe: int = 0
    amount: float = 0.0
    slots: tuple[str, ...] = ()
    start: Point | None = None


@dataclass(frozen=True)
class Hypothesis:
    """A model with what was added, and its fit.

    Attributes:
        box: its filter.
        fit: its fit.
        moves: what was added.
        rivals: names of moves that would have done as well as the last one.
        alike: hypotheses with these in the place of the last move.
    """

    box: GreyBox
    fit: Fit
    moves: tuple[Move, ...] = ()
    rivals: tuple[tuple[str, ...], ...] = ()
    alike: tuple["Hypothesis", ...] = ()


class EffectSelection:
    """A selection of what a model lacks.

    Args:
        model: the model as it came.
        logged: the trials.
        candidates: effects that may be missing.
        linear: whether commands are linear between rows; None: what is likelier.
        seed: of the starts.
        tell: called with what is being done, what is done of it and its total.
        threads: that filters run in at once.
    """

    def __init__(
        self,
        model: Model,
        logged: Sequence[Logged],
        candidates: Sequence[CandidateEffect],
        linear: bool | None = None,
        seed: int = 0,
        tell: Callable[[str, int, int], None] = lambda step, done, total: None,
        threads: int = 1,
    ) -> None:
        self.threads = threads
        self.model, self.logged, self.seed, self.tell = model, list(logged), seed, tell
        self.linear = linear
        self.channels = [
            i for i in range(len(model.rig.signals)) if any(each.measures[i] for each in logged)
        ]
        # The delay between command and readings is free in every fit; a lag of the only sensor
        # is no other thing.
        late = DELAYS[:1] if len(self.channels) > 1 else (*DELAYS, *LAGS)
        self.candidates = [each for each in candidates if each.name not in late]
        readings = [
            [each.measured[c][each.counts[c] > 0] for each in logged] for c in self.channels
        ]
        self.steps_of_readings = [reading_step(rows) for rows in readings]
        self.noise = [
            max(white_noise(rows), s / 12**0.5)
            for rows, s in zip(readings, self.steps_of_readings, strict=True)
        ]
        self.coarse = [
            white_noise(rows) < s for rows, s in zip(readings, self.steps_of_readings, strict=True)
        ]
        self.block = self._block(readings)
        total = sum(len(each.time) for each in logged) / self.block
        self.stride = max(1, int(total / MOST_ROWS))
        self.steps = max(1, self.stride * self.block // 8)
        self.span = (
            self.stride
            * self.block
            * float(np.median(np.concatenate([np.diff(each.time) for each in logged])))
        )
        longest = max(float(each.time[-1] - each.time[0]) for each in logged)
        self.memory = 4.0 * self.span, max(longest / 5.0, 8.0 * self.span)
        self.gains: dict[str, float] = {}
        self.fitted: dict[frozenset[str], Hypothesis] = {}
        self.noise = [n / self.block**0.5 for n in self.noise]
        self._rows: dict[tuple[int, bool, bool], list[Rows]] = {}
        self.force = self._force()

    def _block(self, readings: Sequence[Sequence[Array]]) -> int:
        total, block = sum(len(each.time) for each in self.logged), 1
        while total / block > MOST_ROWS:
            wider = block + 1
            bends = [
                np.sqrt(np.mean(np.concatenate([np.diff(row[::wider], 2) for row in rows]) ** 2))
                / 24.0
                for rows in readings
            ]
            if any(b > BENT * n / wider**0.5 for b, n in zip(bends, self.noise, strict=True)):
                break
            block = wider
        return block

    def box(self, model: Model, linear: bool | None = None, steps: int = 0) -> GreyBox:
        """The filter of a model over the trials, with so many integration steps a row."""
        steps = steps or self.steps
        linear = bool(self.linear if linear is None else linear)
        # Where friction turns nothing is smooth: extrapolation would only make more of it.
        key = steps, linear, not is_rough(model)
        if key not in self._rows:
            how = self.channels, steps, linear, self.block, self.stride, self.coarse, key[2]
            self._rows[key] = [Rows(each, *how) for each in self.logged]
        return GreyBox(model, self._rows[key], self.channels, self.threads)

    def precise(
        self, model: Model, point: Point, steps: int = 0, linear: bool | None = None
    ) -> GreyBox:
        """The filter of a model with as many steps as it needs at a point, at least so many.

        Beside next to no latent force: what it makes uncertain needs less.
        """
        rows, steps = self.stride * self.block, steps or self.steps
        point = replace(point, forces=(LEAST_FORCE * self.force,) * len(self.logged))
        total = sum(float(each.time[-1] - each.time[0]) for each in self.logged)
        most = min(MOST_STEPS * self.span / total, self.span / SHORTEST_S)
        box = self.box(model, linear, steps)
        white = self.white(box, [point])
        while 2 * steps <= most:
            # Where several rows are one step, the next has each by itself.
            steps = rows if steps < rows < 2 * steps else 2 * steps
            finer = self.box(model, linear, steps)
            before, white = white, self.white(finer, [point])
            if np.sum((white - before) ** 2) < PRECISE:
                break
            box = finer
        return box

    def _force(self) -> float:
        """Force of the drive (N, N m) at the root mean square of its command."""
        motor = np.concatenate([each.motor for each in self.logged])
        middle = float(np.median(motor))
        level = float(np.sqrt(np.mean((motor - middle) ** 2))) or 1.0
        (drive,) = [e for e in self.model.effects.values() if e.port == self.model.rig.drive_port]
        assert drive.law is not None
        known = {"p": self.model.parameters[drive.name], "spin": 0.0}
        forces = []
        for command in (middle + level, middle):
            at = {**known, "command": command, "motor_voltage": command}
            forces.append(drive.law(*(at[name] for name in signals(drive.law))))
        return abs(forces[0] - forces[1]) or 1.0

    def gains_of_drive(self) -> list[str]:
        """Slots of the drive's gain, which one trial cannot tell from the inertia.

        But several can from each other.
        """
        drives = [e for e in self.model.effects.values() if e.port == self.model.rig.drive_port]
        return [
            f"{e.name}.{stem}"
            for e in drives
            for stem in e.quantities
            if stem in ("gain", "torque_constant")
        ]

    def own(self) -> tuple[list[Coordinate], dict[str, str]]:
        """Coordinates of the model's own parameters, and slots that follow another one."""
        numbers = self.box(self.model, False).numbers()
        coordinates, tied = list[Coordinate](), dict[str, str]()
        for path in free_parameters(self.model).free:
            name, quantity = slot(path), _quantity(path)
            effect, _, stem = name.partition(".")
            law = self.model.effects[effect]
            if path in self.model.rig.start_paths.values() or quantity.unit.endswith("/kPa"):
                continue
            tie = next((t for t in law.ties if stem in t[1:]), None)
            if tie and numbers[f"{effect}.{tie[0]}"] == numbers[f"{effect}.{tie[1]}"]:
                tied |= {name: f"{effect}.{tie[0]}"} if stem == tie[1] else {}
                continue
            spread = WIDE * abs(quantity.to_si(prior(self.model, path)) - quantity.to_si(0.0))
            inertial = tuple(name.split(".")) == self.model.rig.inertia
            scale = 1.0 if inertial else abs(numbers[name]) or spread
            lower, upper = quantity.to_si(quantity.lower), quantity.to_si(quantity.upper)
            coordinates.append(
                Coordinate(name, scale, inertial, lower, upper, 1.0 if inertial else spread / scale)
            )
        for effect in self.model.effects.values():
            coordinates += [_presliding(effect.name)] if "presliding" in effect.scanned else []
        return coordinates, tied

    def nuisances(self) -> list[Coordinate]:
        """Coordinates of the noises, the latent force and the delay."""
        pairs = zip(self.noise, self.steps_of_readings, strict=True)
        noise = [
            Coordinate(f"noise {i}", 1.0, True, max(1e-3 * n, s / 12**0.5), 1e3 * n)
            for i, (n, s) in enumerate(pairs)
        ]
        forces = [
            Coordinate(f"force {i}", 1.0, True, LEAST_FORCE * self.force, 10.0 * self.force)
            for i in range(len(self.logged))
        ]
        least, most = self.memory
        memory = Coordinate("memory", 1.0, True, 0.75 * least, most)
        late = any(effect.port == "drive_delay" for effect in self.model.effects.values())
        delay = [] if late else [Coordinate("delay", self.span, False, 0.0, MOST_DELAY * self.span)]
        return [*noise, *forces, memory, *delay]

    def base(self) -> Hypothesis:
        """The model as it came, fitted."""
        own, tied = self.own()
        coordinates = [*own, *self.nuisances()]
        rough, trials = is_rough(self.model), len(self.logged)
        count = STARTS if rough else SMOOTH_STARTS
        kinds: Sequence[bool] = (False, True) if self.linear is None else (self.linear,)
        fits: dict[bool, list[Fit]] = {linear: [] for linear in kinds}
        first = self._begin(self.box(self.model, False), coordinates, tied, 0, -1)
        boxes = [self.precise(self.model, first, linear=linear) for linear in kinds]
        self.steps = max(box.rows[0].steps for box in boxes)

        def start(k: int, odd: int) -> None:
            for linear in kinds:
                # It may end after three: between that and all, until then.
                self.tell("refitting parameters", k, count + 2 if k > 3 else (count + 3) // 2)
                box = self.box(self.model, linear)
                fits[linear].append(
                    fit(box, self._begin(box, coordinates, tied, k, odd), coordinates, tied)
                )

        for k in range(count):
            start(k, -1)
            kinds = (max(fits, key=lambda each: max(f.value for f in fits[each])),) if k else kinds
            values = sorted(f.value for f in fits[kinds[0]])
            if len(values) > 2 and values[-1] - values[-3] < ALIKE:
                break
        self.linear = kinds[0]
        if rough and len(fits) > 1:
            best = max(fits[self.linear], key=lambda each: each.value)
            for linear in fits:
                fits[linear] += self.hold_fits(best, self.model, linear, self.steps)
            self.linear = max(fits, key=lambda each: max(f.value for f in fits[each]))
        forces = max(fits[self.linear], key=lambda each: each.value).point.forces
        if (
            3 <= trials <= MOST_TRIALS
            and max(forces) > ODD * min(forces)
            and max(forces) > ODD_SHARE * self.force
        ):
            for odd in range(trials):
                start(0, odd)
        best = max(fits[self.linear], key=lambda each: each.value)
        return Hypothesis(self.box(self.model), best)

    def _begin(
        self,
        box: GreyBox,
        coordinates: Sequence[Coordinate],
        tied: Mapping[str, str],
        k: int,
        odd: int,
    ) -> Point:
        """Start number k: the first is the model as it came, the last have one odd trial."""
        generator = np.random.default_rng((self.seed, k))
        memory = float(np.sqrt(self.memory[0] * self.memory[1])) if k % 2 else self.memory[0]
        shares = [SHARES[k % 4] if odd < 0 or i != odd else 1.0 for i in range(len(self.logged))]
        point = Point(
            box.numbers(), tuple(self.noise), tuple(share * self.force for share in shares), memory
        )
        own = [c for c in coordinates if c.name in point.numbers]
        factors = (
            np.exp(SCATTER * generator.standard_normal(len(own)))
            if k and odd < 0
            else np.ones(len(own))
        )
        values = {
            c.name: float(np.clip(value_of(point, c.name) * f, c.lower, c.upper))
            for c, f in zip(own, factors, strict=True)
        }
        point = with_values(point, with_tied(values, tied))
        late = [
            replace(point, delay=rows * self.span)
            for rows in DELAY_ROWS[: 1 if k == 0 or coordinates[-1].name != "delay" else None]
        ]
        return late[int(np.argmax(log_likelihood(box.innovations(late), box.rows)))]

    def white(self, box: GreyBox, points: Sequence[Point]) -> Array:
        """Innovations over their deviations, shape (points, readings)."""
        with np.errstate(all="ignore"):
            rows = [
                (errors / np.sqrt(spreads)).reshape(len(points), -1)[:, trial.there.ravel()]
                for (errors, spreads), trial in zip(box.innovations(points), box.rows, strict=True)
            ]
        return np.concatenate(rows, axis=1)

    def moves(self, now: Hypothesis) -> list[Move]:
        """All that may be added, by what it promises less its price, the most first."""
        fitted, box = now.fit, now.box
        own = {c.name for c in fitted.coordinates}
        drive = [
            Coordinate(name, abs(fitted.point.numbers[name]))
            for name in self.gains_of_drive()
            if name not in own
        ]
        mean = [
            *drive,
            *(c for c in fitted.coordinates if " " not in c.name and c.name != "memory"),
        ]
        beside = [
            with_values(
                fitted.point, with_tied({c.name: c.value(c.of(fitted.point) + STEP)}, fitted.tied)
            )
            for c in mean
        ]
        white = self.white(box, [fitted.point, *beside])
        error, slopes = white[0], np.nan_to_num((white[1:] - white[0]) / STEP)
        basis = np.linalg.qr(slopes[len(drive) :].T)[0]

        def beyond(rows: Array) -> Array:
            return rows - (rows @ basis) @ basis.T

        left = beyond(error)
        moves = [
            *self._effects(now, error, left, beyond),
            *self._by_trial(now, mean, slopes, left, beyond),
        ]
        price = 0.5 * np.log(len(error))
        return sorted(moves, key=lambda move: move.numbers * price - move.promise)

    def _effects(
        self, now: Hypothesis, error: Array, left: Array, beyond: Callable[[Array], Array]
    ) -> list[Move]:
        added = {move.candidate.name for move in now.moves if move.candidate}
        moves = []
        for number, candidate in enumerate(self.candidates):
            self.tell("screening effects", number, len(self.candidates))
            if candidate.name in added:
                continue
            box = self.box(candidate.beside(now.box.model), steps=now.box.rows[0].steps)
            whole = replace(now.fit.point, numbers={**box.numbers(), **now.fit.point.numbers})
            probes = self.white(
                box, [with_values(whole, _values(candidate.paths, row)) for row in candidate.probes]
            )
            best = Move(candidate.name, -np.inf, 0)
            for i, row in enumerate(probes):
                change = beyond(row - error)
                square = float(change @ change)
                if not np.isfinite(square) or square < 1e-9:
                    continue
                amount = -float(left @ change) / square
                if amount < 0.0 and not candidate.signs[i]:
                    continue
                if (promise := 0.5 * amount**2 * square) > best.promise:
                    best = Move(
                        candidate.name, promise, len(self._added(candidate)), candidate, i, amount
                    )
            moves += [best] if best.candidate else []
        return moves

    def _by_trial(
        self,
        now: Hypothesis,
        mean: Sequence[Coordinate],
        slopes: Array,
        left: Array,
        beyond: Callable[[Array], Array],
    ) -> list[Move]:
        """Each parameter in one trial alone, with a trend over the trials."""
        count = len(now.box.rows)
        if count < 3:
            return []
        of = np.concatenate(
            [np.full(int(trial.there.sum()), i) for i, trial in enumerate(now.box.rows)]
        )
        moves = []
        for c, slope in zip(mean, slopes, strict=True):
            alone = TREND in c.name or TRIAL in c.name
            if alone or c.name == "delay" or c.name.endswith("presliding"):
                continue
            columns = {f"{c.name}{TREND}": slope * now.box.order[of]}
            columns |= {f"{c.name}{TRIAL}{i}": slope * (of == i) for i in range(count)}
            for name, column in columns.items():
                change = beyond(column)
                square = float(change @ change)
                if square > 1e-9:
                    promise = 0.5 * float(left @ change) ** 2 / square
                    moves.append(Move(name, promise, 1, slots=(name,)))
        return moves

    def _added(self, candidate: CandidateEffect) -> list[str]:
        """Paths of a candidate that are fitted with it: ties and further terms stay out."""
        law = CATALOGUE[candidate.effect]
        apart = {stem for tie in law.ties for stem in tie[1:]} | {
            stem for term in law.terms for stem in term
        }
        return [
            path for path in candidate.fitted_paths if slot(path).partition(".")[2] not in apart
        ]

    def tried(self, now: Hypothesis, move: Move, careful: bool = False) -> Hypothesis:
        """Fit with a move added; `careful` from further starts."""
        candidate = move.candidate
        if candidate is None:
            return self._varied(now, move, careful)
        box = self.box(candidate.beside(now.box.model), steps=now.box.rows[0].steps)
        law, tied = CATALOGUE[candidate.effect], dict(now.fit.tied)
        tied |= {f"{candidate.effect}.{tie[1]}": f"{candidate.effect}.{tie[0]}" for tie in law.ties}
        absent = _values(candidate.paths, candidate.absent)
        at = _values(
            candidate.paths, candidate.grown(move.probe, float(np.clip(move.amount, -20.0, 20.0)))
        )
        at |= {
            n: absent[n]
            for term in law.terms
            for n in [f"{candidate.effect}.{term[0]}"]
            if n in absent
        }
        lower, upper = candidate.bounds
        reach = np.abs(candidate.probes - candidate.absent).max(axis=0)
        more = []
        for path, low, high, far in zip(candidate.paths, lower, upper, reach, strict=True):
            if path in self._added(candidate):
                zero, size, least, most = (
                    _quantity(path).to_si(float(v)) for v in (0.0, far, low, high)
                )
                more.append(Coordinate(slot(path), abs(size - zero) or 1.0, False, least, most))
        more += [_presliding(candidate.effect)] if "presliding" in law.scanned else []
        here = move.start or now.fit.point
        whole = replace(here, numbers={**box.numbers(), **here.numbers})
        best, starts = None, self._starts(box, whole, at, absent, more, tied)
        box = self.precise(box.model, starts[0], now.box.rows[0].steps)
        for start in starts[FITTED:][:FURTHER] if careful else starts[:FITTED]:
            made = fit(box, start, [*now.fit.coordinates, *more], tied)
            best = made if best is None or made.value > best.value else best
        if best is None or best.value < now.fit.value:
            # From none of it, a fit is no less likely than without.
            none = with_values(whole, with_tied({**at, **absent}, tied))
            made = fit(box, none, [*now.fit.coordinates, *more], tied, rough=True)
            best = made if best is None or made.value > best.value else best
        assert best is not None
        return Hypothesis(box, best, (*now.moves, move), now.rivals)

    def _starts(
        self,
        box: GreyBox,
        whole: Point,
        at: Mapping[str, float],
        absent: Mapping[str, float],
        more: Sequence[Coordinate],
        tied: Mapping[str, str],
    ) -> list[Point]:
        """Starts of a candidate's fit, the likeliest as they are first.

        One for each presliding distance, else for each latent force: these lead to other optima.
        """
        slips = [c for c in more if c.name not in absent]
        points, kinds = [], []
        for part in PARTS:
            for less in LESS:
                for slip in SLIPS if slips else (1.0,):
                    values = dict(at)
                    for c in more:
                        size = absent.get(c.name, 0.0)
                        values[c.name] = (
                            float(np.clip(whole.numbers[c.name] * slip, c.lower, c.upper))
                            if c in slips
                            else size + part * (at[c.name] - size)
                        )
                    start = with_values(whole, with_tied(values, tied))
                    points.append(self._weaker(start, less))
                    kinds.append(slip if slips else less)
        likely = log_likelihood(box.innovations(points), box.rows)
        order = np.argsort(-likely)
        first = {kind: at for at, kind in reversed([(i, kinds[i]) for i in order])}
        return [points[i] for i in order if first[kinds[i]] == i]

    def _weaker(self, point: Point, share: float) -> Point:
        """A point with a share of its latent force, in no trial more than thrice the least one.

        And with no more noise than the readings show: what stood in for an effect makes room for
        it.
        """
        most = 3.0 * min(point.forces) if share < 1.0 else max(point.forces)
        least = min(SHARES) * self.force
        forces = tuple(max(share * min(each, most), least) for each in point.forces)
        noise = tuple(map(min, point.deviations, self.noise))
        return replace(point, forces=forces, deviations=noise)

    def _varied(self, now: Hypothesis, move: Move, careful: bool) -> Hypothesis:
        """Fit with a parameter that differs by trial.

        From more starts where the latent force of that trial stands out.
        """
        (name,) = move.slots
        forces = np.array(now.fit.point.forces)
        odd = name.endswith(f"{TRIAL}{int(np.argmax(forces))}") and forces.max() > ODD * float(
            np.median(forces)
        )
        mark = TREND if TREND in name else TRIAL
        base, _, number = name.partition(mark)
        value = value_of(now.fit.point, base)
        old = next((c for c in now.fit.coordinates if c.name == base), Coordinate(base, abs(value)))
        scale = abs(value) if old.logarithmic else old.scale
        ends = sorted((value / MOST_FACTOR, value * MOST_FACTOR))
        alone = max(old.lower, ends[0]), min(old.upper, ends[1])
        first, bounds = (0.0, (-np.inf, np.inf)) if mark == TREND else (value, alone)
        tied = dict(now.fit.tied)
        tied_slots = [slot_ for slot_, of in now.fit.tied.items() if of == base]
        tied |= {f"{tied_slot}{mark}{number}": name for tied_slot in tied_slots}
        coordinates = [*now.fit.coordinates, Coordinate(name, scale, False, *bounds)]
        best = None
        further = ((0.5, 0.1), (1.0, 0.1), (-0.3, 0.1))[: 3 if careful else 1]
        further = further if odd and mark == TRIAL else ()
        for amount, share in ((0.0, 0.5), *further):
            there = float(np.clip(first + amount * abs(value), *bounds))
            start = with_values(now.fit.point, with_tied({name: there}, tied))
            made = fit(now.box, self._weaker(start, share), coordinates, tied, rough=not careful)
            best = made if best is None or made.value > best.value else best
        assert best is not None
        return Hypothesis(now.box, best, (*now.moves, move), now.rivals)

    def _worth_a_fit(self, now: Hypothesis) -> list[Move]:
        """The moves that promise half their price.

        Where there is a latent force, the first ones whatever they promise, and each parameter of a
        trial whose latent force stands out.
        """
        moves = self.moves(now)
        if not now.moves:
            # A model that lacks much is bent by its fit: its lack is looked for from the model as
            # it came too.
            fresh = [
                replace(move, start=self.unmoved.fit.point)
                for move in self.moves(self.unmoved)
                if move.candidate
            ]
            if self._is_bent(now):
                moves = [*moves[:TRIED], *fresh[:TRIED], *moves[TRIED:]]
                return moves[: 2 * TRIED] + self._odd(now, moves[2 * TRIED :])
        readings = self._readings(now)
        price = 0.5 * (0.5 * np.log(readings) + np.log(len(moves)))
        if not self._is_bent(now):
            return [move for move in moves[:TRIED] if move.promise > price]
        return [*moves[:TRIED], *self._odd(now, moves[TRIED:])]

    def _is_bent(self, now: Hypothesis, share: float = FAINT) -> bool:
        """Whether a latent force, or more noise than the readings show, stands in for something."""
        point = now.fit.point
        noisy = [d > LOUD * n for d, n in zip(point.deviations, self.noise, strict=True)]
        return max(point.forces) > share * self.force or any(noisy)

    def _odd(self, now: Hypothesis, moves: Sequence[Move]) -> list[Move]:
        """Each parameter of the trial whose latent force stands out."""
        forces = np.array(now.fit.point.forces)
        odd = int(np.argmax(forces))
        alone = len(forces) > 2 and forces[odd] > ODD * float(np.median(forces))
        return [move for move in moves if alone and move.name.endswith(f"{TRIAL}{odd}")]

    def _unmoved(self, base: Hypothesis) -> Hypothesis:
        """The model's own parameters as they came, with noise and latent force fitted."""
        own = base.box.numbers()
        free = [c for c in base.fit.coordinates if c.name not in own and c.name != "delay"]
        start = Point(
            own, base.fit.point.deviations, (0.1 * self.force,) * len(self.logged), self.memory[0]
        )
        made = fit(base.box, start, free, {})
        return replace(
            base, fit=replace(made, coordinates=base.fit.coordinates, tied=base.fit.tied)
        )

    def _refined(self, now: Hypothesis) -> Hypothesis:
        """With the simpler laws of the added effects freed where that is worth its price."""
        for candidate in [move.candidate for move in now.moves if move.candidate]:
            law = CATALOGUE[candidate.effect]
            for row in (*law.ties, *law.terms):
                larger = self._freed(now, candidate, row, tie=row in law.ties)
                gain = larger.fit.value - now.fit.value
                numbers = len(larger.fit.coordinates) - len(now.fit.coordinates)
                if gain > 0.5 * numbers * np.log(self._readings(now)) + LIKE:
                    now = larger
        return now

    def _freed(
        self, now: Hypothesis, candidate: CandidateEffect, row: Sequence[str], tie: bool
    ) -> Hypothesis:
        """A hypothesis with the parameters of a tie, or of a further term, free."""
        point, effect = now.fit.point, candidate.effect
        names = [f"{effect}.{stem}" for stem in (row[1:] if tie else row)]
        probe = _values(candidate.paths, candidate.probes[len(candidate.probes) // 2])
        tied = {slot_: of for slot_, of in now.fit.tied.items() if slot_ not in names}
        more, values = [], {}
        for path in candidate.paths:
            if (name := slot(path)) in names and path in candidate.fitted_paths:
                quantity = _quantity(path)
                low, high = (quantity.to_si(end) for end in (quantity.lower, quantity.upper))
                follows = now.fit.tied.get(name)
                values[name] = 0.8 * point.numbers[follows] if follows else probe[name]
                more.append(Coordinate(name, abs(values[name]) or 1.0, False, low, high))
        if not more:
            return now
        # What is free already begins again from other shapes.
        coordinates = {c.name: c for c in (*now.fit.coordinates, *more)}.values()
        best = now.fit
        for wide in WIDER:
            shaped = {n: v * (1.0 if n in now.fit.tied else wide) for n, v in values.items()}
            start = with_values(point, with_tied(shaped, tied))
            made = fit(now.box, self._weaker(start, 0.3), list(coordinates), tied)
            best = made if made.value > best.value else best
        return replace(now, fit=best)

    @staticmethod
    def _readings(each: Hypothesis) -> int:
        return sum(int(trial.there.sum()) for trial in each.box.rows)

    def hold_fits(self, best: Fit, model: Model, linear: bool, steps: int) -> list[Fit]:
        """Fits with commands held or linear between rows, from a fit that has them either way.

        A held command is a line half a row later. Friction that begins to slip too late hides
        which it is, so that both begin a second time with a tenth of the presliding distance.
        """
        box, point = self.box(model, linear, steps), best.point
        row = 0.5 * self.span / self.stride / self.block * (int(linear) - int(bool(self.linear)))
        late = any(c.name == "delay" for c in best.coordinates)
        fits = []
        for sooner in (1.0, 0.1) if is_rough(model) else (1.0,):
            slip = {n: sooner * v for n, v in point.numbers.items() if n.endswith(".presliding")}
            start = with_values(point, {**slip, "delay": max(0.0, point.delay + row * late)})
            fits.append(fit(box, start, best.coordinates, best.tied, rough=True))
        return fits

    def _other_hold(self, now: Hypothesis) -> Hypothesis:
        """The same hypothesis, with commands between rows the other way if that is likelier."""
        steps, kinds = now.box.rows[0].steps, (bool(self.linear), not self.linear)
        fits = [(f, k) for k in kinds for f in self.hold_fits(now.fit, now.box.model, k, steps)]
        made, linear = max(fits, key=lambda pair: pair[0].value)
        if made.value < now.fit.value + LIKE:
            return now
        self.linear = linear
        return replace(now, box=self.box(now.box.model, linear, steps), fit=made)

    def _trend_instead(self, now: Hypothesis) -> Hypothesis:
        """With a trend in place of several trials that each have a parameter of their own."""
        of = [slot_.partition(TRIAL)[0] for move in now.moves for slot_ in move.slots]
        for base in {each for each in of if of.count(each) > 1}:
            gone = {name for name in now.fit.point.numbers if name.startswith(f"{base}{TRIAL}")}
            gone |= {slot_ for slot_, name in now.fit.tied.items() if name in gone}
            numbers = {n: v for n, v in now.fit.point.numbers.items() if n not in gone}
            less = replace(
                now.fit,
                point=replace(now.fit.point, numbers=numbers),
                coordinates=tuple(c for c in now.fit.coordinates if c.name not in gone),
                tied={n: of_ for n, of_ in now.fit.tied.items() if n not in gone},
            )
            kept = tuple(move for move in now.moves if not gone & set(move.slots))
            order, trials = now.box.order, range(len(now.box.rows))
            values = [value_in_trial(now.fit.point, base, i, order) for i in trials]
            off = values - np.polyval(np.polyfit(order, values, 1), order)
            if np.abs(off).max() < LINE * np.ptp(values):
                move = Move(f"{base}{TREND}", 0.0, 1, slots=(f"{base}{TREND}",))
                now = self._varied(Hypothesis(now.box, less, kept, now.rivals), move, careful=True)
        return now

    def _at_end(self, each: Hypothesis) -> bool:
        """Whether a parameter of one trial has gone as far as it may."""
        for name in each.moves[-1].slots:
            coordinate, value = each.fit.coordinates[-1], value_of(each.fit.point, name)
            if TRIAL in name and not coordinate.lower * 1.01 < value < coordinate.upper * 0.99:
                return True
        return False

    def _again(self, now: Hypothesis, larger: Hypothesis) -> Hypothesis:
        """A hypothesis fitted again from where another one ended."""
        shared = {c.name for c in larger.fit.coordinates}
        values = {
            c.name: value_of(larger.fit.point, c.name)
            for c in now.fit.coordinates
            if c.name in shared
        }
        start = with_values(now.fit.point, with_tied(values, now.fit.tied))
        made = fit(now.box, start, now.fit.coordinates, now.fit.tied)
        return replace(now, fit=max(made, now.fit, key=lambda each: each.value))

    def price(self, one: Hypothesis, other: Hypothesis) -> float:
        """Log likelihood that a larger hypothesis must gain over a smaller.

        BIC's, and that of the search.
        """
        numbers = len(one.fit.coordinates) - len(other.fit.coordinates)
        looked = len(self.candidates) + len(self.logged) * len(self.own()[0])
        moves = len(one.moves) - len(other.moves)
        return self.price_of(one, numbers) + moves * np.log(looked)

    def price_of(self, each: Hypothesis, numbers: int) -> float:
        """Log likelihood that so many further numbers must gain (BIC)."""
        return 0.5 * numbers * float(np.log(self._readings(each)))

    def run(self) -> list[Hypothesis]:
        """From the model as it came to the last hypothesis that is worth its price.

        A beam: the likeliest hypotheses of a stage are all extended in the next, for an effect that
        is likeliest alone may have no part in the likeliest pair.
        """
        free = self.linear is None
        base = self.base()
        self.unmoved = self._unmoved(base)
        best, beam = [base], [[base]]
        for stage in range(MOST_EFFECTS):
            tried = self._extended(beam, f"effect {stage + 1}")
            self._keep(tried)
            if not tried or self._lead(tried[0], best) < 0.0:
                break
            bent = self._is_bent(tried[0][-1], MATERIAL)
            for at, chain in enumerate(tried[: 2 if bent else 1]):
                self.tell(f"effect {stage + 1}", self.planned * (4 + at) // 6, self.planned)
                *before, last = chain
                again = self.tried(before[-1], last.moves[-1], careful=True)
                if again.fit.value > last.fit.value:
                    tried[at] = [*before, again]
            tried.sort(key=self._worth, reverse=True)
            self.tell(f"effect {stage + 1}", self.planned * 5 // 6, self.planned)
            # Others begin where the likeliest one ended: no start is ahead.
            for at, (*before, last) in enumerate(tried[1:BEAM], 1):
                tried[at] = [*before, self._again(last, tried[0][-1])]
            tried.sort(key=self._worth, reverse=True)
            self._keep(tried)
            *before, now, last = tried[0]
            chain = [*before, self._again(now, last), last]
            if len(chain) == 2:
                best = chain[:1]
            if self._lead(chain[:-1], best) > 0.0:
                best = chain[:-1]
            if self._lead(chain, best) < LIKE:
                break
            near = [
                other[-1]
                for other in tried[1:]
                if other[:-1] == tried[0][:-1] and self._is_rival(other, chain)
            ]
            alike = {each.moves[-1].name: each for each in reversed(near)}
            names = tuple(dict.fromkeys(each.moves[-1].name for each in near))
            rivals = tuple(name for name in names if name != last.moves[-1].name)
            last = replace(
                last, rivals=(*now.rivals, rivals), alike=tuple(alike[name] for name in rivals)
            )
            last = self._refined(self._other_hold(last) if free else last)
            best = [*chain[:-1], self._trend_instead(last)]
            beam = [best]
            if self._is_bent(best[-1], MATERIAL):
                beam += [c for c in tried[1:BEAM] if self._lead(c, c[:-1]) > 0.0]
        return best

    def _cost(self, now: Hypothesis, move: Move) -> int:
        """How long a move's fits take, in those of one that needs no shorter steps."""
        rougher = move.candidate and is_rough(move.candidate.beside(now.box.model))
        return COST if rougher and not is_rough(now.box.model) else 1

    def _keep(self, tried: Sequence[Sequence[Hypothesis]]) -> None:
        """Keep what was fitted last by what was added, the likeliest of each."""
        for *_, last in reversed(tried):
            self.fitted[frozenset(move.name for move in last.moves)] = last

    def _worth(self, chain: Sequence[Hypothesis]) -> float:
        """Log likelihood of a chain's last hypothesis, less its price."""
        return chain[-1].fit.value - self.price(chain[-1], chain[0])

    def _lead(self, chain: Sequence[Hypothesis], other: Sequence[Hypothesis]) -> float:
        return self._worth(chain) - self._worth(other)

    def _is_rival(self, other: Sequence[Hypothesis], best: Sequence[Hypothesis]) -> bool:
        """Whether other readings of the same rigs might well be likelier by another chain.

        The lead is within its own scatter over blocks of readings: where no model is quite right,
        a lead of many units may be chance (Q. H. Vuong 1989, "Likelihood ratio tests for model
        selection and non-nested hypotheses", Econometrica 57).
        """
        lead = self._lead(best, other)
        if lead < LIKE:
            return True
        differ = self._densities(best[-1]) - self._densities(other[-1])
        edges = np.linspace(0, len(differ), BLOCKS + 1).astype(int)[:-1]
        scatter = BLOCKS**0.5 * float(np.std(np.add.reduceat(differ, edges)))
        return lead < CONFIDENCE * scatter

    @staticmethod
    def _densities(each: Hypothesis) -> Array:
        """Log likelihood of each reading, less a constant."""
        results = zip(each.box.innovations([each.fit.point]), each.box.rows, strict=True)
        rows = [(e[0] ** 2 / s[0] + np.log(s[0]))[trial.there] for (e, s), trial in results]
        return -0.5 * np.concatenate(rows)

    def _extended(self, beam: Sequence[list[Hypothesis]], step: str) -> list[list[Hypothesis]]:
        """Every chain with each of its most promising moves, the likeliest for its price first."""
        seen, tried = set[tuple[frozenset[str], bool]](), list[list[Hypothesis]]()
        plans = [
            (chain, move)
            for rank, chain in enumerate(beam)
            for move in self._worth_a_fit(chain[-1])[: BESIDE if rank else None]
        ]
        costs = np.cumsum([0, *(self._cost(chain[-1], move) for chain, move in plans)])
        self.planned = int(AFTER * costs[-1])
        for (chain, move), done in zip(plans, costs.tolist(), strict=False):
            now = chain[-1]
            key = frozenset(each.name for each in (*now.moves, move)), move.start is not None
            if key in seen:
                continue
            seen.add(key)
            self.tell(step, done, self.planned)
            larger = self.tried(now, move)
            self.gains.setdefault(move.name, larger.fit.value - now.fit.value)
            tried += [[*chain, larger]] if not self._at_end(larger) else []
        return sorted(tried, key=self._worth, reverse=True)


def is_rough(model: Model) -> bool:
    """Whether a model has dry friction, or another law of the way."""
    return any(effect.rate_independent_law for effect in model.effects.values())


def reading_step(rows: Sequence[Array]) -> float:
    """Step that readings keep to (SI); 0 where they keep to none."""
    levels = np.unique(np.concatenate(rows))
    apart = np.diff(levels)
    apart = apart[apart > 1e-9 * max(float(np.abs(levels).max()), 1e-300)]
    if not len(apart):
        return 0.0
    step = float(np.median(apart[apart < 1.5 * apart.min()]))
    whole = np.abs(apart / step - np.round(apart / step)) < 0.1
    return step if whole.mean() > 0.9 else 0.0


def white_noise(rows: Sequence[Array]) -> float:
    """Standard deviation of white noise by third differences (squared weights sum to 20)."""
    third = np.concatenate([np.diff(row, 3) for row in rows if len(row) > 3])
    robust = 1.4826 * float(np.median(np.abs(third)))
    return max(robust, 0.3 * float(np.std(third)), 1e-12) / 20**0.5


def slot(path: str) -> str:
    """`effect.parameter` of a path."""
    effect, _, key = path.partition(".")
    return f"{effect}.{CATALOGUE[effect].names_in_files()[key]}"


def _quantity(path: str) -> Quantity:
    effect, _, stem = slot(path).partition(".")
    return CATALOGUE[effect].quantities[stem]


def _values(paths: Sequence[str], row: Array) -> dict[str, float]:
    """Values (SI) by slot of values in file units."""
    return {
        slot(path): _quantity(path).to_si(float(value))
        for path, value in zip(paths, row, strict=True)
    }


def _presliding(effect: str) -> Coordinate:
    quantity = CATALOGUE[effect].quantities["presliding"]
    low, high = quantity.to_si(quantity.lower), quantity.to_si(quantity.upper)
    return Coordinate(f"{effect}.presliding", 1.0, True, low, high, 2.0)
