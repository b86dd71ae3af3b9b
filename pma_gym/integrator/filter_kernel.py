"""Compiled extended Kalman filter of a rig: innovations row by row, one parameter vector per lane.

Between two rows mean and covariance move together in short steps of the Rosenbrock method ROS2
(order 2, L-stable), whose transition matrix is the exact derivative of the linearised step:

    (I - g h J) k1 = h f(x),   (I - g h J) k2 = h f(x + k1) - 2 k1,   x+ = x + 3/2 k1 + 1/2 k2,   g
    = 1 - 1/sqrt(2)

Dry friction is the bristle of the catalogue: while it sticks it is a stiff spring, which takes the
variance of the speed away by itself. J has its slope over the way of the step. A step in which a
slipping mass comes to rest, or a held one breaks away, is divided there. What is left of it begins
with steps that are short enough for the bristle to give way, so that friction does not act in the
old direction after the stop. At a row the readings correct mean and covariance one after the other.

Source:
    J. G. Verwer, E. J. Spee, J. G. Blom, W. Hundsdorfer 1999, "A second-order Rosenbrock method
    applied to photochemical dispersion problems", SIAM J. Sci. Comput. 20; A. H. Jazwinski 1970,
    "Stochastic Processes and Filtering Theory", for the filter.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

from llvmlite import ir

from pma_gym.codegen.derivative import derivatives
from pma_gym.codegen.generic import where
from pma_gym.codegen.graph import CHANGING, FIXED, HELD, Value
from pma_gym.codegen.machine.control import (
    INTEGER,
    POINTER,
    Builder,
    Module,
    Operand,
    function,
    integer,
    loop,
    offset,
    repeat,
    variable,
)
from pma_gym.codegen.machine.simd import SimdEmitter
from pma_gym.codegen.trace import live_inputs, split, substitute, trace
from pma_gym.effects.arithmetic import clip
from pma_gym.integrator.equations import COMMANDS, Equations
from pma_gym.integrator.exponential_rosenbrock import solver
from pma_gym.integrator.integration import memory
from pma_gym.integrator.step_attempt import _signs, step_start

FULL = 1.0 - 1e-9
"""Largest deflection of bristles at which their way's slope is taken: at 1 it has none.

Their force is taken there too: at 0.9999 that of a sliding mass was 5 parts in 100 000 too small.
"""

POLE = 1.0 - 0.5**0.5

FAR = 1.0
"""Way (m, rad) after which every bristle slips: far beyond any presliding distance."""

LEAST_WAY = 1e-12
"""Way (m, rad) over which the slope of friction is taken at least."""

SLIPPING = 0.9
"""Deflection of a bristle from which on its mass slips; below it is held. Assumption: bristles
begin to slip at 0.7, and all slip at 1."""

AFTER = 12
"""Steps after the mass came to rest: the first two are the shortest, a 2048th of what is left; each
further one is twice as long as the one before."""

Entry = Value | None


@dataclass
class FilterEquations:
    """The arithmetic of one step and of one correction.

    Args:
        eq: the rig's equations, the latent force among its effects.
        noisy: by the name of a state that process noise drives, the name of its intensity.
        readings: the value that each sensor reads.
        bristles: names of memories that are deflections of bristles, between -1 and 1.
    """

    eq: Equations
    noisy: Mapping[str, str]
    readings: Sequence[Value]
    bristles: Sequence[str] = ()
    frozen: dict[int, Value] = field(init=False)
    step: list[Value] = field(init=False)
    transition: list[list[Entry]] = field(init=False)
    correction: list[Value] = field(init=False)

    def __post_init__(self) -> None:
        eq, graph = self.eq, self.eq.graph
        self.states = [*eq.states, *eq.rate_independent_states]
        self.mean = [state.value for state in self.states]
        n = len(self.mean)
        self.covariance = {
            (i, j): graph.input(f"covariance {i} {j}", CHANGING)
            for i in range(n)
            for j in range(i + 1)
        }
        self.length = graph.input("substep", CHANGING)
        self.true_length = self.length * graph.input("pace", FIXED)
        self.drives = {state: graph.input(name, FIXED) for state, name in self.noisy.items()}
        self.variances = [graph.input(f"variance {i}", FIXED) for i in range(len(self.readings))]
        self.read = [graph.input(f"reading {i}", CHANGING) for i in range(len(self.readings))]
        self.counts = [graph.input(f"counts {i}", CHANGING) for i in range(len(self.readings))]
        self.moved, self.transition = self._moved()
        self.stops, self.share = self._stop()
        self.step = [*self.moved, *self._spread()]
        self.correction = self._corrected()

    def _stop(self) -> tuple[Value | None, Value]:
        """Whether a slipping mass stops within a step, or a held one breaks away, and where.

        A held one breaks away where its bristle, as stiff as at the start, would bend beyond 1.

        Returns:
            The truth, None without dry friction; and the share of the step until then.
        """
        eq, one = self.eq, self.eq.graph.constant(1.0)
        held = [m for m in eq.rate_independent_states if m.name in self.bristles]
        if eq.travelled is None or not held:
            return None, one
        own = [state.value for state in eq.states]
        way, speed = eq.travelled
        ends = {v.id: new for v, new in zip(own, self.moved, strict=False)}
        turned = speed * ends[speed.id] < 0.0
        stops, share = None, speed / where(turned, speed - ends[speed.id], 1.0)
        for each in held:
            slips = turned & (each.value * where(speed > 0.0, 1.0, -1.0) > SLIPPING)
            ((slope,),) = derivatives([each.after], [way])
            assert slope is not None
            bent = each.value + substitute([slope], self.frozen)[0] * (ends[way.id] - way)
            now, then = (where(z < 0.0, -z, z) for z in (each.value, bent))
            breaks = (now < SLIPPING) & (then > 1.0)
            share = where(breaks, (1.0 - now) / where(breaks, then - now, 1.0), share)
            either = slips | breaks
            stops = either if stops is None else stops | either
        return stops, share

    @property
    def stopping(self) -> list[Value]:
        """What tells where a mass stops."""
        return [] if self.stops is None else [self.stops, self.share]

    def p(self, i: int, j: int) -> Value:
        """Entry of the covariance."""
        return self.covariance[max(i, j), min(i, j)]

    def _moved(self) -> tuple[list[Value], list[list[Entry]]]:
        eq, h = self.eq, self.true_length
        frozen, here = step_start(eq)
        frozen = {**frozen, **_signs(eq, frozen)}
        own, memories = eq.states, eq.rate_independent_states
        rates = [state.rate for state in own]
        origin = [eq["origin"]] if memories else []
        wrt = [*self.mean, *origin]
        bounded = {
            state.value.id: trace(clip, state.value, -FULL, FULL)
            for state in memories
            if state.name in self.bristles
        }
        frozen, here = (
            {**frozen, **bounded},
            {**here, **{m.after.id: bounded.get(m.value.id, m.value) for m in memories}},
        )
        start = {**frozen, **here}
        travel = [eq.travel] if eq.travel is not None else []
        slopes = [
            [None if s is None else substitute([s], start)[0] for s in row]
            for row in derivatives(rates, [*wrt, *travel])
        ]
        if travel:
            self._along_the_way(slopes, rates, {**frozen, **bounded}, start)
        n = len(own)
        jacobian = [row[:n] for row in slopes]
        solve = solver(jacobian, POLE * h)
        first = solve([h * rate for rate in substitute(rates, start)])
        ends = {**frozen, **{s.value.id: s.value + k for s, k in zip(own, first, strict=True)}}
        bent = substitute(rates, ends)
        second = solve([h * rate - 2.0 * k for rate, k in zip(bent, first, strict=True)])
        moved = [s.value + 1.5 * a + 0.5 * b for s, a, b in zip(own, first, second, strict=True)]
        self.frozen = frozen
        columns = []
        for j in range(len(self.mean)):
            unit: list[Entry] = [None] * len(wrt)
            unit[j] = eq.graph.constant(1.0)
            if origin and eq.travelled is not None and self.mean[j] is eq.travelled[0]:
                unit[-1] = eq.graph.constant(1.0)
            columns.append(self._column(slopes, solve, unit, n))
        transition: list[list[Entry]] = [[column[i] for column in columns] for i in range(n)]
        after = {**frozen, **{s.value.id: new for s, new in zip(own, moved, strict=True)}}
        if memories:
            moved += substitute([m.after for m in memories], after)
            for row in derivatives([m.after for m in memories], wrt):
                known = [None if s is None else substitute([s], after)[0] for s in row]
                out: list[Entry] = []
                for j in range(len(self.mean)):
                    total: Entry = None
                    for i in range(n):
                        total = _plus(total, _times(known[i], columns[j][i]))
                    if j >= n:
                        total = _plus(total, known[j])
                    if eq.travelled is not None and self.mean[j] is eq.travelled[0]:
                        total = _plus(total, known[-1])
                    out.append(total)
                transition.append(out)
        return moved, transition

    def _along_the_way(
        self,
        slopes: list[list[Entry]],
        rates: Sequence[Value],
        frozen: Mapping[int, Value],
        start: Mapping[int, Value],
    ) -> None:
        """Take the slope of friction over the way of a whole step in place of that at its start.

        A bristle that slides is as stiff as ever at the start of a step and gives way within a
        micrometre; ROS2 is of order 2 with any slopes. The way ends where the mass would stop: one
        that is held does not get far.
        """
        eq, h = self.eq, self.true_length
        assert eq.travel is not None and eq.travelled is not None
        way, speed = eq.travelled
        direction = frozen[eq["direction"].id]
        (slips,) = substitute([eq.rate_of(speed)], {**frozen, eq.travel.id: FAR * direction})
        slows, forwards = -direction * slips, direction * speed
        stopped = forwards / where(slows > 0.0, slows, 1.0)
        lasts = where((slows > 0.0) & (stopped < h), stopped, h)
        expected = lasts * speed
        far = direction * expected > LEAST_WAY
        ahead = eq.graph.select(far, expected, LEAST_WAY * direction)
        there = substitute(rates, {**frozen, eq.travel.id: ahead})
        here = substitute(rates, start)
        place = next(i for i, value in enumerate(self.mean) if value is way)
        for row, after, before in zip(slopes, there, here, strict=True):
            if row.pop() is not None:
                slope = (after - before) / ahead
                row[place], row[-1] = _plus(row[place], slope), _minus(slope)

    def _column(
        self,
        slopes: Sequence[Sequence[Entry]],
        solve: Callable[[Sequence[Entry]], list[Value]],
        unit: list[Entry],
        n: int,
    ) -> list[Entry]:
        """What one unit of a state becomes of all states in the linearised step."""
        h = self.true_length

        def right(vector: list[Entry]) -> list[Entry]:
            out: list[Entry] = []
            for row in slopes:
                total: Entry = None
                for slope, part in zip(row, vector, strict=True):
                    total = _plus(total, _times(slope, part))
                out.append(_times(h, total))
            return out

        a = [None if _zero(k) else k for k in solve(right(unit))]
        there = [_plus(u, k) for u, k in zip(unit, a, strict=False)] + unit[n:]
        rhs = [
            _plus(r, _times(self.eq.graph.constant(-2.0), k))
            for r, k in zip(right(there), a, strict=True)
        ]
        b = [None if _zero(k) else k for k in solve(rhs)]
        half = self.eq.graph.constant
        return [
            _plus(u, _plus(_times(half(1.5), x), _times(half(0.5), y)))
            for u, x, y in zip(unit, a, b, strict=False)
        ]

    def _spread(self) -> list[Value]:
        """Covariance after the step, row by row of its lower half."""
        n, zero = len(self.mean), self.eq.graph.constant(0.0)
        # Half of the noise before the step and half after it: of order 2, as the step is.
        added = {
            (i, i): 0.5 * self.drives[state.name] * self.true_length
            for i, state in enumerate(self.states)
            if state.name in self.drives
        }
        half = []
        for row in self.transition:
            across: list[Entry] = []
            for j in range(n):
                total: Entry = None
                for k in range(n):
                    total = _plus(total, _times(row[k], _plus(self.p(k, j), added.get((k, j)))))
                across.append(total)
            half.append(across)
        out = {}
        for i, j in self.covariance:
            total: Entry = None
            for k in range(n):
                total = _plus(total, _times(half[i][k], self.transition[j][k]))
            total = _plus(total, added.get((i, j)))
            out[i, j] = zero if total is None else total
        for place, state in enumerate(self.states):
            if state.name in self.bristles:
                # Between -1 and 1 it has a deviation of 1 at most, whatever its slope says.
                variance = out[place, place]
                share = where(variance > 1.0, variance, 1.0) ** -0.5
                self.transition[place] = [_times(entry, share) for entry in self.transition[place]]
                for i, j in out:
                    for _ in range((i == place) + (j == place)):
                        out[i, j] = out[i, j] * share
        return list(out.values())

    def _corrected(self) -> list[Value]:
        """Mean and covariance after the readings, then each reading's innovation and variance."""
        eq, n = self.eq, len(self.mean)
        zero = eq.graph.constant(0.0)
        mean = list(self.mean)
        p = {(i, j): self.p(i, j) for i in range(n) for j in range(n)}
        shown: list[Value] = []
        readings = substitute(
            list(self.readings), {m.after.id: m.value for m in eq.rate_independent_states}
        )
        rows = derivatives(readings, self.mean)
        for expected, slopes, reading, counts, variance in zip(
            readings, rows, self.read, self.counts, self.variances, strict=True
        ):
            # Linear in the change of the mean that former readings of the same row have made.
            for slope, new, old in zip(slopes, mean, self.mean, strict=True):
                if slope is not None and new is not old:
                    expected = expected + slope * (new - old)
            along: list[Entry] = []
            for i in range(n):
                total: Entry = None
                for k in range(n):
                    total = _plus(total, _times(slopes[k], p[i, k]))
                along.append(total)
            spread: Entry = variance
            for k in range(n):
                spread = _plus(spread, _times(slopes[k], along[k]))
            assert spread is not None
            off = reading - expected
            innovation = off * counts
            share = counts / spread
            gains = [None if a is None else a * share for a in along]
            mean = [
                m if g is None else m + g * innovation for m, g in zip(mean, gains, strict=True)
            ]
            before, p = p, {}
            for i in range(n):
                for j in range(i + 1):
                    less = _plus(before[i, j], _minus(_times(gains[i], along[j])))
                    p[i, j] = p[j, i] = zero if less is None else less
            shown += [off, spread]
        return [*mean, *(p[key] for key in self.covariance), *shown]


def _zero(value: Entry) -> bool:
    return value is None or (value.is_constant and value.data == 0.0)


def _times(a: Entry, b: Entry) -> Entry:
    return None if a is None or b is None or _zero(a) or _zero(b) else a * b


def _plus(a: Entry, b: Entry) -> Entry:
    if a is None or b is None:
        return b if a is None else a
    return a + b


def _minus(a: Entry) -> Entry:
    return None if a is None else -a


ARGUMENTS = ("firsts", "times", "commands", "readings", "parameters", "start", "out", "kept")
"""Addresses that the function takes, after the number of rows.

firsts: number of the first step that leads to each row, (rows + 1,), integers; times: length of
    each step, (steps,); commands: [step, lane]; readings: [row, sensor, (reading, counts)];
    parameters: [slot, lane]; start: [state and covariance, lane]; out: [row, sensor, (reading less
    what was expected, variance), lane]; kept: per row the predicted mean and covariance, the
    corrected ones and the transition from the row before, one lane.
"""


def _everything(made: FilterEquations, keeps: bool) -> list[Value]:
    transition = [
        entry for row in made.transition for entry in row if entry is not None and not _zero(entry)
    ]
    return [*made.step, *made.correction, *made.stopping, *(transition if keeps else ())]


def _fixed_inputs(values: Sequence[Value]) -> list[Value]:
    return [value for value in live_inputs(values) if value.level == FIXED]


def parameter_slots(made: FilterEquations, keeps: bool) -> list[str]:
    """Names of the parameters that the compiled filter takes, in their order."""
    return [str(value.data) for value in _fixed_inputs(_everything(made, keeps))]


def write_filter(module: Module, made: FilterEquations, width: int, keeps: bool) -> None:
    """Write the function `innovations`; `keeps` for one lane that keeps what a smoother needs."""
    eq, n = made.eq, len(made.mean)
    simd = SimdEmitter(width, fused=True)
    b, (rows, *pointers) = function(
        module, "innovations", [("rows", INTEGER), *((name, POINTER) for name in ARGUMENTS)]
    )
    firsts, times, commands, readings, parameters, start, out, kept = pointers
    everything = _everything(made, keeps)
    transition = everything[len(made.step) + len(made.correction) + len(made.stopping) :]
    fixed, inputs = split(everything, FIXED), _fixed_inputs(everything)
    loaded = {value.id: simd.load(b, parameters, i) for i, value in enumerate(inputs)}
    known_fixed = simd.emit(b, fixed, loaded)
    size = n + len(made.covariance)
    state = memory(b, ir.ArrayType(simd.real, size))
    cells = [*made.mean, *made.covariance.values()]
    held = {
        value.id: simd.constant(0.0)
        for value in live_inputs(everything)
        if value.level == HELD and value.data not in COMMANDS
    }
    held[eq[COMMANDS[1]].id] = simd.constant(0.0)
    phi = memory(b, ir.ArrayType(simd.real, 2 * n * n))
    slot = 2 * size + n * n

    def load() -> dict[int, Operand]:
        return {
            **known_fixed,
            **held,
            **{v.id: simd.load(b, state, i) for i, v in enumerate(cells)},
        }

    for i in range(size):
        simd.store(b, simd.load(b, start, i), state, i)
    with loop(b, rows) as row:
        if keeps:
            for i in range(n * n):
                simd.store(b, simd.constant(float(i % (n + 1) == 0)), phi, i)
        ends = (row, b.add(row, integer(1)))
        first, end = (b.load(offset(b, firsts, at, INTEGER), typ=INTEGER) for at in ends)
        with loop(b, end, first) as step:
            whole = simd.spread(b, b.load(offset(b, times, step), typ=simd.element))
            command = simd.load(b, commands, step)
            with _parts(b, simd, made, whole) as (length, finish):
                known = load()
                known[made.length.id] = length
                known[eq[COMMANDS[0]].id] = command
                emitted = simd.emit(b, [*made.step, *transition, *made.stopping], known)
                ends = finish(emitted)
                for i, value in enumerate(made.step):
                    after = emitted[value.id]
                    after = after if ends is None else b.select(ends, after, simd.load(b, state, i))
                    simd.store(b, after, state, i)
                if keeps:
                    _chain(b, simd, made, emitted, phi, ends)
        base = b.mul(row, integer(slot))
        if keeps:
            for i in range(size):
                simd.store(b, simd.load(b, state, i), kept, b.add(base, integer(i)))
            for i in range(n * n):
                simd.store(b, simd.load(b, phi, i), kept, b.add(base, integer(2 * size + i)))
        known = load()
        m = len(made.readings)
        for i in range(m):
            where = b.mul(b.add(b.mul(row, integer(m)), integer(i)), integer(2))
            for at, value in enumerate((made.read[i], made.counts[i])):
                number = b.load(offset(b, readings, b.add(where, integer(at))), typ=simd.element)
                known[value.id] = simd.spread(b, number)
        emitted = simd.emit(b, made.correction, known)
        for i, value in enumerate(made.correction[:size]):
            simd.store(b, emitted[value.id], state, i)
        for i, value in enumerate(made.correction[size:]):
            simd.store(b, emitted[value.id], out, b.add(b.mul(row, integer(2 * m)), integer(i)))
        if keeps:
            for i in range(size):
                simd.store(b, simd.load(b, state, i), kept, b.add(base, integer(size + i)))
    b.ret_void()


@contextmanager
def _parts(
    b: Builder, simd: SimdEmitter, made: FilterEquations, whole: Operand
) -> Iterator[tuple[Operand, Callable[[dict[int, Operand]], Operand | None]]]:
    """Write a step once; in lanes in which a mass stops it ends there, and short ones follow.

    Yields the length of a part, and a function that is called with what was emitted of it and gives
    the lanes in which it counts; None for all.
    """
    if made.stops is None:
        yield whole, lambda emitted: None
        return
    lengths, rests = (variable(b, simd.real, first) for first in (whole, simd.constant(0.0)))
    stopped = variable(b, simd.truth, simd.constant(False, "truth"))
    number = variable(b, INTEGER, integer(0))
    with repeat(b) as leave_if:
        length, now = b.load(lengths, typ=simd.real), b.load(number, typ=INTEGER)
        is_first = b.icmp_signed("==", now, integer(0))
        stops: list[Operand] = []

        def finish(emitted: dict[int, Operand]) -> Operand:
            assert made.stops is not None
            first = simd.spread(b, is_first)
            stops.append(b.select(first, emitted[made.stops.id], b.load(stopped, typ=simd.truth)))
            stops.append(b.fmul(emitted[made.share.id], whole))
            return b.xor(first, stops[0])

        yield length, finish
        leave_if(b.and_(is_first, b.not_(simd.any(b, stops[0]))))
        leave_if(b.icmp_signed("==", now, integer(AFTER + 1)))
        b.store(stops[0], stopped)
        with b.if_then(is_first):
            b.store(b.fsub(whole, stops[1]), rests)
        shortest = b.fmul(b.load(rests, typ=simd.real), simd.constant(2.0 ** (1 - AFTER)))
        following = b.fmul(length, simd.constant(2.0))
        for place, taken in ((2, length), (1, shortest), (0, stops[1])):
            at = b.icmp_signed("==", now, integer(place))
            following = b.select(at, taken, following)
        b.store(following, lengths)
        b.store(b.add(now, integer(1)), number)


def _chain(
    b: Builder,
    simd: SimdEmitter,
    made: FilterEquations,
    emitted: dict,
    phi: Operand,
    counts: Operand | None,
) -> None:
    """Multiply the transition since the last row by that of one more step."""
    n = len(made.mean)
    before = [simd.load(b, phi, i) for i in range(n * n)]
    for i in range(n):
        for j in range(n):
            total = None
            for k in range(n):
                entry = made.transition[i][k]
                if _zero(entry):
                    continue
                assert entry is not None
                part = b.fmul(emitted[entry.id], before[k * n + j])
                total = part if total is None else b.fadd(total, part)
            made_of = simd.constant(0.0) if total is None else total
            kept = made_of if counts is None else b.select(counts, made_of, before[i * n + j])
            simd.store(b, kept, phi, i * n + j)
