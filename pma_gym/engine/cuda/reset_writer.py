"""Writes which episodes a thread begins, and what it keeps of those that have ended."""

from llvmlite import ir

from pma_gym.codegen.machine.control import (
    DOUBLE,
    FLOAT,
    INTEGER,
    Builder,
    Operand,
    integer,
    loop,
    offset,
)
from pma_gym.engine.cuda.thread_memory import ThreadMemory

_BYTE = ir.IntType(8)


class CudaResetWriter(ThreadMemory):
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
                simd, first = self._lanes(1), integer(0)
                self._settle(b, given, records, tables, first, job)
                self._zero_sensors(b, records, tables, first)
                self._first(b, simd, given, records, tables, first, job)

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

    def _pressure(
        self, b: Builder, given: dict[str, Operand], share: Operand, row: Operand
    ) -> Operand:
        """Gauge pressure (Pa) for a number between 0 and 1: of one range, or one of several."""
        if self.ranged:
            low, high = (b.load(offset(b, given["pressures"], i), typ=DOUBLE) for i in range(2))
            return b.fadd(low, b.fmul(share, b.fsub(high, low)))
        count = b.uitofp(given["choices"], DOUBLE)
        at = b.fptoui(b.fmul(share, count), INTEGER)
        return b.load(offset(b, given["pressures"], at), typ=DOUBLE)
