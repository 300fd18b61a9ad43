"""What a check is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look
from signlin_ros.records import ModelData
from signlin_ros.records.table import frozen

Array = NDArray[np.float64]


class Check(ABC):
    """One thing that may be wrong with a record.

    The docstring of each says what it looks for, how often its test is wrong, and what the cure is.
    """

    name: ClassVar[str]
    needs_time: ClassVar[bool] = False
    """Whether it means nothing where the time is in doubt, or nothing moves."""
    needs_input: ClassVar[bool] = False
    """Whether it means nothing where an input is not what it is said to be."""
    holding_out: ClassVar[bool] = False
    """Whether it only means something where a part of the record itself is held out."""
    of_nothing: ClassVar[bool] = False
    """Whether it means something where no state and no output is measured."""
    exclusive: ClassVar[bool] = False
    """Whether its findings are alternatives: where one is applied, the others are none."""

    @abstractmethod
    def find(self, look: Look) -> Iterable[Finding]:
        """Yield the findings in a record."""

    def find_each(self, looks: Sequence[Look]) -> list[list[Finding]]:
        """Return the findings in each of some records whose columns are the same."""
        return [list(self.find(look)) for look in looks]

    def note(self, channel: str, sentence: str) -> Finding:
        """Return a note: a finding that needs no cure."""
        return Finding(self.name, channel, "note", sentence)


class OfColumns(Check):
    """A check of what belongs to the columns of a log: a unit, a sign, which signal is which.

    What is found in one record holds for all with the same columns; where two of them ask for different things, neither
    is to be believed.
    """

    def find_each(self, looks: Sequence[Look]) -> list[list[Finding]]:
        """Return the findings in each record, and those in another one with the same columns."""
        found = super().find_each(looks)
        first = {f.cure: (f, look) for told, look in zip(found, looks, strict=True) for f in told if f.columns}
        cures = [{f.cure for f in told if f.columns} for told in found]
        asked = [own for own in cures if own]
        if len(looks) < 2 or not asked:
            return found
        common = set.intersection(*asked)
        if not common:
            return [[self._at_odds(f, first) if f.columns else f for f in told] for told in found]
        shared = [first[cure] for cure in first if cure in common]
        pairs = list(zip(looks, cures, strict=True))
        against = {f.cure: [o for o, own in pairs if f.cure not in own and self.contradicts(o, f)] for f, _ in shared}
        return [
            [_but_not_in(f, against.get(f.cure, [])) for f in told if not f.columns or f.cure in common]
            + [_as_in(f, look) for f, look in shared if f.cure not in own and one not in against[f.cure]]
            for told, (one, own) in zip(found, pairs, strict=True)
        ]

    def contradicts(self, look: Look, f: Finding) -> bool:
        """Tell whether a record shows that what is found in another one does not hold for it."""
        return False

    def _at_odds(self, f: Finding, first: Mapping[str, tuple[Finding, Look]]) -> Finding:
        """Return a finding beside those of other records that ask for something else."""
        others = {cure: one for cure, one in first.items() if cure != f.cure}
        told = "; ".join(f"in {look.record.source} {one.sentence}" for one, look in list(others.values())[:1])
        why = f"{f.sentence}, but {told}: a unit belongs to the columns, so that neither is to be believed"
        return replace(f, severity="refuse", sentence=why)


class OfRecordsTogether(Check):
    """A check of columns that all records with them decide together: each gets the same findings."""

    def found(self, looks: Sequence[Look]) -> Iterator[Finding]:
        """Yield what one or more records with the same columns show."""
        raise NotImplementedError

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the findings in one record."""
        yield from self.found([look])

    def find_each(self, looks: Sequence[Look]) -> list[list[Finding]]:
        """Return the findings of all records, for each of them."""
        found = list(self.found(looks)) if looks else []
        return [list(found) for _ in looks]


def _as_in(f: Finding, look: Look) -> Finding:
    return replace(f, sentence=f"{f.sentence} (as in {look.record.source}, whose columns are the same)")


def _but_not_in(f: Finding, others: Sequence[Look]) -> Finding:
    """Return a finding with the records of the same columns that it does not hold for."""
    if not others:
        return f
    files = ", ".join(look.record.source for look in others)
    return replace(f, sentence=f"{f.sentence}; not so in {files}, where the same column fits as it is: two units")


def with_channel(record: ModelData, name: str, values: Array) -> ModelData:
    """Return a record with other values (T,) of an input or a measured channel."""
    if name in record.measured:
        measured = {**record.measured, name: frozen(values)}
        return replace(record, measured=measured, x0=_start(measured, record.states))
    u = record.u.copy()
    u[:, record.inputs.index(name)] = values
    return replace(record, u=frozen(u))


def changed(name: str, change: Callable[[Array], Array]) -> Callable[[ModelData], ModelData]:
    """Return the cure that changes the values (T,) of one input or channel."""
    return lambda record: with_channel(record, name, change(values_of(record, name)))


def without_channel(name: str) -> Callable[[ModelData], ModelData]:
    """Return the cure that leaves a measured channel out."""

    def cure(record: ModelData) -> ModelData:
        measured = {key: values for key, values in record.measured.items() if key != name}
        return replace(record, measured=measured, x0=_start(measured, record.states))

    return cure


def set_to(look: Look, name: str, values: Array) -> Callable[[ModelData], ModelData]:
    """Return the cure that gives one input or channel other values (T,), at the stamps that are left by then."""
    return lambda record: with_channel(record, name, values[np.isin(look.t, record.t)])


def without_samples(look: Look, names: tuple[str, ...], drop: NDArray[np.bool_]) -> Callable[[ModelData], ModelData]:
    """Return the cure that makes samples (T,) of channels missing; rows that then hold nothing, not even a change of
    a command that is held for some of them, are left out.
    """

    def cure(record: ModelData) -> ModelData:
        off = drop[np.isin(look.t, record.t)]  # another cure may have left rows out before
        measured = {n: frozen(np.where(off, np.nan, v)) if n in names else v for n, v in record.measured.items()}
        kept = np.isfinite(np.stack(list(measured.values()))).any(axis=0)
        new = np.diff(record.u, axis=0, prepend=record.u[:1]) != 0.0
        kept |= np.any(new[:, 2.0 * new.sum(axis=0) < len(new)], axis=1)
        measured = {n: frozen(v[kept]) for n, v in measured.items()}
        rest = timed(record, lambda stamps: stamps[kept])
        return replace(rest, u=frozen(record.u[kept]), measured=measured, x0=_start(measured, record.states))

    return cure


def timed(record: ModelData, change: Callable[[Array], Array]) -> ModelData:
    """Return a record with its stamps (T,) changed, and with them those from which its inputs act, where it has any."""
    stamps = {name: getattr(record, name, None) for name in ("t", "acts")}
    new: dict[str, Any] = {name: frozen(change(t)) for name, t in stamps.items() if t is not None}
    return replace(record, **new)


def values_of(record: ModelData, name: str) -> Array:
    """Return the values (T,) of an input or a measured channel."""
    return record.measured[name] if name in record.measured else record.u[:, record.inputs.index(name)]


def _start(measured: dict[str, Array], states: tuple[str, ...]) -> Array | None:
    known = all(name in measured and measured[name].size and np.isfinite(measured[name][0]) for name in states)
    return frozen(np.array([measured[name][0] for name in states])) if known else None


__all__ = [
    "Check",
    "OfColumns",
    "OfRecordsTogether",
    "changed",
    "set_to",
    "timed",
    "values_of",
    "with_channel",
    "without_channel",
    "without_samples",
]
