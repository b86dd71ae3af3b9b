"""Traced arithmetic as LLVM instructions, scalar or in SIMD lanes.

Loops, loads and stores are written by hand with llvmlite's builder; `SimdEmitter.emit` writes the
straight-line arithmetic between them. Instructions carry no fast-math flags, so that each lane of a
vector has the bits of the scalar code; `fused` gives that up for speed.

Order of sums in compiled code: products are fused, terms are added in order of availability.

A sum or product has a latency of about four cycles, in which the processor could start eight
others. A step of a plant is one long chain of dependent results. Nested sums therefore become one
sum of many terms, and the terms with the latest results are added last.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from llvmlite import ir

from pma_gym.codegen.graph import Kind, Number, Value
from pma_gym.codegen.machine.control import (
    DOUBLE,
    FLOAT,
    INDEX,
    INTEGER,
    TRUTH,
    Builder,
    Operand,
    integer,
    intrinsic,
    offset,
)

WAIT, WAITS = 4, {"divide": 14, "square_root": 18}
"""Latency of a result in cycles: about that of the last ten years' processors."""


@dataclass(frozen=True)
class Term:
    """A term of a sum.

    Attributes:
        is_negative: it is subtracted.
        factors: the term, or two values whose product it is.
    """

    is_negative: bool
    factors: tuple[Value, ...]


class Sums:
    """The sums of a calculation.

    Args:
        todo: what is to be computed, operands before what is made of them.
        outputs: what of it is asked for.

    Attributes:
        terms: the terms of each sum, in the order in which they are to be added, by its id.
        within: ids of what is computed as a part of sums alone.
    """

    def __init__(self, todo: Sequence[Value], outputs: Iterable[Value]) -> None:
        self.terms: dict[int, list[Term]] = {}
        self.within: set[int] = set()
        self._users: dict[int, list[Value]] = {}
        asked = {value.id for value in outputs}
        for value in todo:
            for part in value.operands:
                self._users.setdefault(part.id, []).append(value)
        # Users first.
        for value in reversed(todo):
            if value.id not in asked and self._belongs(value):
                self.within.add(value.id)
        ready: dict[int, int] = {}
        for value in todo:
            if value.id in self.within or not value.operands:
                continue
            if _is_sum(value):
                terms = self._flattened(value)
                self.terms[value.id], ready[value.id] = _ordered(terms, ready)
            else:
                start = max(ready.get(part.id, 0) for part in value.operands)
                ready[value.id] = start + WAITS.get(value.operation, WAIT)

    def _belongs(self, value: Value) -> bool:
        """Whether a value is needed in sums alone: a sum in one, a product in any number."""
        users = self._users.get(value.id, [])
        if _is_sum(value):
            return len(users) == 1 and _is_sum(users[0])
        if value.operation != "multiply" or value.kind != "real":
            return False
        return all(_is_sum(user) and user.operands[0] is not user.operands[1] for user in users)

    def _flattened(self, value: Value) -> list[Term]:
        terms: list[Term] = []
        waiting = [(False, value)]
        while waiting:
            is_negative, part = waiting.pop()
            if part is not value and part.id not in self.within:
                terms.append(Term(is_negative, (part,)))
            elif part.operation == "multiply":
                terms.append(Term(is_negative, part.operands))
            else:
                left, right = part.operands
                waiting.append((is_negative ^ (part.operation == "subtract"), right))
                waiting.append((is_negative, left))
        return terms


def _is_sum(value: Value) -> bool:
    return value.operation in ("add", "subtract") and value.kind == "real"


def _ordered(terms: list[Term], ready: Mapping[int, int]) -> tuple[list[Term], int]:
    """Terms in the order in which they are there, and when their sum is.

    The first is no product where there is anything else: it would take an operation of its own.
    """

    def there(term: Term) -> int:
        return max(ready.get(factor.id, 0) for factor in term.factors)

    soonest = sorted(terms, key=there)
    first = next((term for term in soonest if len(term.factors) == 1), soonest[0])
    ordered = [first, *(term for term in soonest if term is not first)]
    when = there(first) + (WAIT if len(first.factors) > 1 else 0)
    for term in ordered[1:]:
        when = max(when, there(term)) + WAIT
    return ordered, when


_BINARY: dict[str, dict[str, str]] = {
    "real": {"add": "fadd", "subtract": "fsub", "multiply": "fmul", "divide": "fdiv"},
    "integer": {
        "add": "add",
        "subtract": "sub",
        "multiply": "mul",
        "and": "and_",
        "or": "or_",
        "xor": "xor",
        "shift_left": "shl",
        "shift_right": "lshr",
    },
    "truth": {"and": "and_", "or": "or_", "xor": "xor"},
}
_SIGNS = {"less": "<", "less_equal": "<=", "equal": "==", "not_equal": "!="}
_INTRINSICS = {"square_root": "sqrt", "absolute": "fabs", "floor": "floor"}


class SimdEmitter:
    """Write traced arithmetic for a number of lanes.

    Args:
        width: lanes of a vector; 1 writes scalar code.
        real: LLVM type of reals, "double" or "float".
        paired: compute one lane as both halves of a register and never look at the second: with
            AVX-512, truths of vectors need not leave the mask registers.
        fused: write sums as `sums` has them: a * b + c as one operation with one rounding, and
            terms in the order in which they are there; faster, with other bits.

    Attributes:
        width: lanes.
        elements: how many numbers of memory a value takes: one a lane, or two of a pair.
        real: type of a real in LLVM; `integer` and `truth` those of the other kinds.
        element: type of one real in memory.
        size: bytes of one real in memory.
    """

    def __init__(
        self, width: int = 1, real: str = "double", fused: bool = False, paired: bool = False
    ) -> None:
        self.width = width
        self.elements = 2 if paired else width
        self.fused = fused
        self.element = {"double": DOUBLE, "float": FLOAT}[real]
        self.size = {"double": 8, "float": 4}[real]
        self.real = self._wide(self.element)
        self.integer = self._wide(INTEGER)
        self.truth = self._wide(TRUTH)

    def _wide(self, element: ir.Type) -> ir.Type:
        return element if self.elements == 1 else ir.VectorType(element, self.elements)

    def type(self, kind: Kind) -> ir.Type:
        """LLVM type of a kind of value."""
        return {"real": self.real, "integer": self.integer, "truth": self.truth}[kind]

    def constant(self, number: Number, kind: Kind = "real") -> Operand:
        """A number in every lane."""
        wide = self.type(kind)
        return ir.Constant(wide, number if self.elements == 1 else [number] * self.elements)

    def emit(
        self,
        builder: Builder,
        outputs: Sequence[Value],
        known: Mapping[int, Operand],
    ) -> dict[int, Operand]:
        """Write the arithmetic of the outputs at the builder's position.

        Args:
            builder: where to write.
            outputs: traced values.
            known: what is computed or loaded already, by `Value.id`; all live inputs at least.
        Returns:
            LLVM values by `Value.id`: the known ones, the outputs and all in between.
        Raises:
            KeyError: an input that is not among the known.
        """
        emitted = dict(known)
        todo = _missing(outputs, emitted)
        sums = Sums(todo, outputs) if self.fused else Sums((), ())
        for value in todo:
            if value.is_constant:
                emitted[value.id] = self.constant(value.data, value.kind)
            elif value.id in sums.terms:
                emitted[value.id] = self._sum(builder, sums.terms[value.id], emitted)
            elif value.id not in sums.within:
                parts = [emitted[part.id] for part in value.operands]
                emitted[value.id] = self._one(builder, value, parts)
        return emitted

    def _one(self, builder: Builder, value: Value, parts: list[Operand]) -> Operand:
        operation = value.operation
        kind = value.operands[-1].kind
        if method := _BINARY[kind].get(operation):
            return getattr(builder, method)(*parts)
        if operation in _SIGNS:
            return _comparison(builder, _SIGNS[operation], kind, parts)
        if operation in _INTRINSICS:
            return intrinsic(builder, _INTRINSICS[operation], *parts)
        return self._others[operation](self, builder, *parts)

    def _select(self, builder: Builder, condition: Operand, yes: Operand, no: Operand) -> Operand:
        return builder.select(condition, yes, no)

    def _negative(self, builder: Builder, a: Operand) -> Operand:
        return builder.fneg(a)

    def _not(self, builder: Builder, a: Operand) -> Operand:
        return builder.xor(a, self.constant(True, "truth"))

    def _to_real(self, builder: Builder, a: Operand) -> Operand:
        return builder.uitofp(a, self.real)

    def _bits(self, builder: Builder, a: Operand) -> Operand:
        # The bits are those of double precision in either case.
        wide = a if self.element is DOUBLE else builder.fpext(a, self._wide(DOUBLE))
        return builder.bitcast(wide, self.integer)

    def _from_bits(self, builder: Builder, a: Operand) -> Operand:
        wide = builder.bitcast(a, self._wide(DOUBLE))
        return wide if self.element is DOUBLE else builder.fptrunc(wide, self.real)

    _others: dict[str, Callable[..., Operand]] = {
        "select": _select,
        "negative": _negative,
        "not": _not,
        "to_real": _to_real,
        "bits": _bits,
        "from_bits": _from_bits,
    }

    def _sum(self, builder: Builder, terms: Sequence[Term], emitted: dict[int, Operand]) -> Operand:
        """A sum of terms in their order, products rounded together with their sum."""
        first, *others = terms
        total, is_negative = self._first(builder, first, emitted), first.is_negative
        for term in others:
            differs = term.is_negative != is_negative
            # What was subtracted so far is subtracted from the first term that is not.
            turns = differs and is_negative
            own, *factor = [emitted[value.id] for value in term.factors]
            if factor:
                if turns:
                    total = builder.fneg(total)
                elif differs:
                    own = builder.fneg(own)
                total = intrinsic(builder, "fma", own, *factor, total)
            elif turns:
                total = builder.fsub(own, total)
            else:
                total = (builder.fsub if differs else builder.fadd)(total, own)
            is_negative &= not turns
        return builder.fneg(total) if is_negative else total

    def _first(self, builder: Builder, term: Term, emitted: dict[int, Operand]) -> Operand:
        own, *factor = [emitted[value.id] for value in term.factors]
        return builder.fmul(own, *factor) if factor else own

    def load(
        self,
        builder: Builder,
        pointer: Operand,
        slot: Operand | int = 0,
        kind: Kind = "real",
    ) -> Operand:
        """The vector at `pointer` plus `slot` vectors.

        Rows of a block lie one behind the other, [slot, lane], so that `slot` is the row.

        Args:
            builder: where to write.
            pointer: address of reals.
            slot: which vector from there.
            kind: what is kept there: a truth is kept as 1.0 or 0.0, an integer as 64 bits, which
                fill the place of a real in double precision and of two in single.
        """
        where = self.address(builder, pointer, slot)
        if kind == "integer":
            return builder.load(where, align=8, typ=self.integer)
        loaded = builder.load(where, align=self.size, typ=self.real)
        return loaded if kind == "real" else self._truth(builder, loaded)

    def _truth(self, builder: Builder, kept: Operand) -> Operand:
        return builder.fcmp_unordered("!=", kept, self.constant(0.0))

    def store(
        self,
        builder: Builder,
        value: Operand,
        pointer: Operand,
        slot: Operand | int = 0,
        kind: Kind = "real",
    ) -> None:
        """Keep a vector at `pointer` plus `slot` vectors; see `load`."""
        where = self.address(builder, pointer, slot)
        if kind == "truth":
            value = builder.select(value, self.constant(1.0), self.constant(0.0))
        builder.store(value, where, align=8 if kind == "integer" else self.size)

    def address(self, builder: Builder, pointer: Operand, slot: Operand | int) -> Operand:
        """Address of the vector `slot` vectors behind a pointer."""
        if isinstance(slot, int):
            return offset(builder, pointer, slot * self.elements, self.element)
        return offset(builder, pointer, builder.mul(slot, integer(self.elements)), self.element)

    def spread(self, builder: Builder, scalar: Operand) -> Operand:
        """A scalar in every lane."""
        if self.elements == 1:
            return scalar
        wide = ir.VectorType(scalar.type, self.elements)
        undefined = ir.Constant(wide, ir.Undefined)
        first = builder.insert_element(undefined, scalar, ir.Constant(INDEX, 0))
        zeros = ir.Constant(ir.VectorType(INDEX, self.elements), [0] * self.elements)
        return builder.shuffle_vector(first, undefined, zeros)

    @property
    def numbers(self) -> Operand:
        """Each lane's own number, from 0."""
        own = list(range(self.elements)) if self.width > 1 else [0] * self.elements
        return ir.Constant(self.integer, own if self.elements > 1 else 0)

    def extract(self, builder: Builder, vector: Operand, lane: Operand | int) -> Operand:
        """The scalar in one lane."""
        return vector if self.elements == 1 else builder.extract_element(vector, integer(lane))

    def insert(
        self, builder: Builder, vector: Operand, scalar: Operand, lane: Operand | int
    ) -> Operand:
        """The vector with one lane replaced."""
        if self.width == 1:
            return self.spread(builder, scalar)
        return builder.insert_element(vector, scalar, integer(lane))

    def any(self, builder: Builder, truths: Operand) -> Operand:
        """Whether a truth holds in some lane."""
        return truths if self.elements == 1 else self._mask(builder, "!=", truths, 0)

    def all(self, builder: Builder, truths: Operand) -> Operand:
        """Whether a truth holds in every lane."""
        return truths if self.elements == 1 else self._mask(builder, "==", truths, -1)

    def _mask(self, builder: Builder, sign: str, truths: Operand, bits: int) -> Operand:
        mask = ir.IntType(self.elements)
        return builder.icmp_unsigned(sign, builder.bitcast(truths, mask), ir.Constant(mask, bits))


def _missing(outputs: Sequence[Value], emitted: Mapping[int, Operand]) -> list[Value]:
    """What is yet to be computed, in order."""
    seen: dict[int, Value] = {}
    waiting = [value for value in outputs if value.id not in emitted]
    while waiting:
        value = waiting.pop()
        if value.id in seen or value.id in emitted:
            continue
        if value.operation == "input":
            raise KeyError(f"input {value.data} is not given")
        seen[value.id] = value
        waiting.extend(value.operands)
    return [seen[i] for i in sorted(seen)]


def _comparison(builder: Builder, sign: str, kind: Kind, parts: Sequence[Operand]) -> Operand:
    if kind == "integer":
        return builder.icmp_unsigned(sign, *parts)
    # NaN differs from everything, itself included; no other comparison with it holds.
    compare = builder.fcmp_unordered if sign == "!=" else builder.fcmp_ordered
    return compare(sign, *parts)
