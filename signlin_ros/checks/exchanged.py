"""Two columns taken for each other."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence

from signlin_ros.checks.base import OfColumns, values_of, with_channel
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look
from signlin_ros.checks.unit_or_sign import EACH, MAX_ERROR_RATIO, MAX_GOOD_RESIDUAL, driven
from signlin_ros.errors import joined
from signlin_ros.records import ModelData


class Exchanged(OfColumns):
    """The model follows the record if two of its signals are exchanged, and not as they are mapped.

    Test: that of `UnitOrSign`, with the values of two inputs or channels exchanged, or of three turned round, in place
    of another unit or sign; only where the model does not follow the record as it is. None of 240 records with hidden
    effects (benchmarks/checks.py) reads better so. Cure: the exchange (``exchange_current_and_speed``); the same as
    mapping the columns anew.
    """

    name = "exchanged"
    needs_time = True
    needs_input = True
    exclusive = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the order of the signals after which the least is left."""
        p = look.resisted
        if p is None or ((left := p.left()) < MAX_GOOD_RESIDUAL and p.shares().max() < EACH):
            return
        limit, names = min(MAX_ERROR_RATIO * left, MAX_GOOD_RESIDUAL), (*look.record.inputs, *p.channels)
        found = _fitting(look, itertools.combinations(names, 2), limit) or _fitting(look, _rounds(names), limit)
        if found:
            yield self._finding(min(found)[1])

    def _finding(self, order: tuple[str, ...]) -> Finding:
        sentence = f"{_how(order)} the model follows the record; as it is, it fits no model: are the columns mixed up?"
        cure = f"exchange_{'_and_'.join(order)}"
        remedy = "they are exchanged"
        action = lambda record: exchanged(record, order)  # noqa: E731
        channels = ", ".join(order)
        return Finding(self.name, channels, "refuse", sentence, cure=cure, remedy=remedy, columns=True, action=action)


def exchanged(record: ModelData, order: Sequence[str]) -> ModelData:
    """Return a record in which each of some inputs or channels has the values of the next one."""
    values = [values_of(record, name).copy() for name in (*order[1:], order[0])]
    for name, column in zip(order, values, strict=True):
        record = with_channel(record, name, column)
    return record


def _how(order: Sequence[str]) -> str:
    """Return an exchange in words."""
    if len(order) == 2:
        return f"with {joined(order)} exchanged"
    pairs = zip(order, (*order[1:], order[0]), strict=True)
    return "with " + joined([f"{name} in the place of {other}" for other, name in pairs])


def _rounds(names: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Yield three signals in both orders in which each becomes another one."""
    for one, two, three in itertools.combinations(names, 3):
        yield from ((one, two, three), (one, three, two))


def _fitting(look: Look, orders: Iterable[tuple[str, ...]], limit: float) -> list[tuple[float, tuple[str, ...]]]:
    """Return the orders with which less than the limit is left, and what is."""
    return [(left, order) for order in orders if (left := _left(look, order)) < limit]


def _left(look: Look, order: Sequence[str]) -> float:
    """Return the residual of a record with signals exchanged; inf where the model does not follow it then."""
    p = Look(look.model, exchanged(look.record, order)).resisted
    if p is None or p.shares().max() >= EACH:
        return math.inf
    left = p.left()
    return left if driven(look, p, left) else math.inf


__all__ = ["Exchanged", "exchanged"]
