"""Writes how a thread begins an episode: pressure, rest, sensors' zero, first observation."""

from llvmlite import ir

from pma_gym.envs.block_memory import narrowed
from pma_gym.envs.cuda_memory import ThreadMemory
from pma_gym.kernels.control import DOUBLE, FLOAT, INTEGER, Builder, Operand, integer, loop, offset
from pma_gym.kernels.llvm import Lanes
from pma_gym.plant.program import FIRST_S, balanced

_BYTE = ir.IntType(8)

_AT_REST = {
    "contraction": "zero",
    "pressure": "pressure",
    "lag_lvdt": "zero",
    "lag_pressure_transducer": "pressure",
}
"""States that are not 0 where the cable hangs slack; see `pma_gym.plant.settle.NoLoad`."""


class BeginWriter(ThreadMemory):
    """Writes beginnings: the numbers that `Engine.reset` finds, in the same order of rounding."""

    def begin(
        self, b: Builder, given: dict[str, Operand], thread: Operand, threads: Operand
    ) -> None:
        """Write new beginnings of those environments of a thread whose episode has ended."""
        with loop(b, given["count"], thread, threads) as job:
            flags = [
                b.load(offset(b, given[name], job, _BYTE), typ=_BYTE)
                for name in ("terminated", "truncated")
            ]
            with b.if_then(b.icmp_unsigned("!=", b.or_(*flags), ir.Constant(_BYTE, 0))):
                records, tables = self._block(b, given, job)
                self._keep_final(b, given, records, job)
                self._settle(b, given, records, tables)
                lanes, first = self._lanes(1), integer(0)
                self._zero_sensors(b, lanes, records, tables, first)
                self._first(b, lanes, given, records, tables, first, job)

    def _keep_final(
        self, b: Builder, given: dict[str, Operand], records: Operand, job: Operand
    ) -> None:
        """Put aside the last observation, and what the episode's score is made of."""
        size = len(self.kernel.observed.rows)
        for i in range(size):
            at = b.add(b.mul(job, integer(size)), integer(i))
            last = b.load(offset(b, given["observations"], at, FLOAT), typ=FLOAT)
            b.store(last, offset(b, given["finals"], at, FLOAT))
        for i, name in enumerate(("sample", "ended", *self.sums)):
            at = b.add(b.mul(self._spacing, integer(i)), job)
            number = self._number(b, records, name)
            b.store(number, offset(b, given["scores"], at, self.element))

    def _settle(
        self, b: Builder, given: dict[str, Operand], records: Operand, tables: Operand
    ) -> None:
        """Draw a pressure, find the rest there and write it down; in double precision."""
        exact = Lanes(1)
        known = self._fixed(b, exact, tables, 0)
        before = self._count(b, self._cell(b, records, "episode"))
        episode = b.and_(b.add(before, integer(1)), integer(0xFFFFFFFF))
        drawn = {self.circuit.slot("episode").id: episode}
        for name in ("key_0", "key_1"):
            drawn[self.circuit.slot(name).id] = self._count(b, self._cell(b, records, name))
        share = exact.emit(b, [self.share], drawn)[self.share.id]
        pressure = self._pressure(b, given, share)
        gain, start = (known[value.id] for value in self.line)
        regulator = b.fdiv(b.fsub(pressure, start), gain)
        known[self.eq["pressure"].id] = pressure
        reach = [known[value.id] for value in self.reach]
        none = ir.Constant(DOUBLE, 0.0)
        zero = balanced(b, self.eq, self.force, known, none, reach)
        found = {"zero": zero, "pressure": pressure}
        real = {name: found[what] for name, what in _AT_REST.items()}
        real |= {"zero_contraction": zero, "size": ir.Constant(DOUBLE, FIRST_S)}
        real |= {"regulator_voltage": regulator, "rest_regulator": regulator}
        real |= self._asked_before(b, regulator)
        whole = {"episode": episode, "count": integer(0)}
        for name in self.places:
            if name in whole:
                self._keep(b, exact, whole[name], self._cell(b, records, name), "integer")
            elif self.record.kind(name) == "real":
                number = narrowed(b, real.get(name, none), self.element)
                b.store(number, self._cell(b, records, name))

    def _pressure(self, b: Builder, given: dict[str, Operand], share: Operand) -> Operand:
        """Gauge pressure (Pa) for a number between 0 and 1."""
        if self.ranged:
            low, high = (b.load(offset(b, given["pressures"], i), typ=DOUBLE) for i in range(2))
            return b.fadd(low, b.fmul(share, b.fsub(high, low)))
        count = b.uitofp(given["choices"], DOUBLE)
        at = b.fptoui(b.fmul(share, count), INTEGER)
        return b.load(offset(b, given["pressures"], at), typ=DOUBLE)

    def _asked_before(self, b: Builder, regulator: Operand) -> dict[str, Operand]:
        """Actions and volts on the wire before the first step, as if the station had been held."""
        share = b.fmul(ir.Constant(DOUBLE, 0.2), regulator)
        action = b.fsub(share, ir.Constant(DOUBLE, 1.0))
        for sign, bound in (("<", -1.0), (">", 1.0)):
            end = ir.Constant(DOUBLE, bound)
            action = b.select(b.fcmp_ordered(sign, action, end), end, action)
        found = {}
        actions = ir.Constant(DOUBLE, -1.0), action
        volts = ir.Constant(DOUBLE, 0.0), regulator
        for i in range(self.record.actions):
            found[f"action_{i}"] = actions[i]
            for k in range(self.record.options.action_delay):
                found[f"wire_{k}_{i}"] = volts[i]
        return found
