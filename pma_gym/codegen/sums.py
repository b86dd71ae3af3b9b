"""Order of sums in compiled code: products are fused, terms are added in order of availability.

A sum or product has a latency of about four cycles, in which the processor could start eight
others. A step of a plant is one long chain of dependent results. Nested sums therefore become one
sum of many terms, and the terms with the latest results are added last.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from pma_gym.codegen.graph import Value

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
