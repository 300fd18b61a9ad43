"""`Record`: one time base and named signals with units. What every reader returns and every verb takes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from signlin_ros import units
from signlin_ros.errors import RecordError, suggest
from signlin_ros.lazy import frame
from signlin_ros.records.header import heading, tidy
from signlin_ros.records.notes import Note, as_notes

if TYPE_CHECKING:
    from signlin_ros.model import Model
    from signlin_ros.records.mapping import ModelData

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

LONG_AGO = 1e6
"""From so many s on a time is told to the ms."""
MAX_SAME = 1e-3
"""What two columns of one quantity differ by at most, as a part of its range: their digits."""


def frozen(values: npt.ArrayLike) -> Array:
    """A read-only float copy of `values`; a read-only float array that owns its data is returned as it is."""
    array = np.asarray(values, dtype=np.float64)
    if array.flags.writeable or array.base is not None:
        array = array.copy()
        array.flags.writeable = False
    return array


def at(t: float | np.floating) -> str:
    """``t = 1.9 s``: a time of a record in words, with digits enough for a clock of the calendar's seconds."""
    return f"t = {t:.9g} s" if abs(t) < LONG_AGO else f"t = {t:.3f} s"


MAX_SHOWN_NAME = 80
"""Characters of a name that a message shows."""


@dataclass(frozen=True, eq=False)
class Signal:
    """One measured or commanded quantity.

    Attributes
    ----------
    values : (T,) float, read-only; NaN is a missing sample.
    unit : as stated by the file, "" where it states none (then the model's unit is meant).
    label : the whole column head or bag path that the signal came from, "" for a signal made in memory.
    number : its column in the file, from 1; 0 where it has none.
    of_mapping : whether a mapping has made it of columns; no further formula may be made of it.
    """

    values: Array
    unit: str = ""
    label: str = ""
    number: int = 0
    of_mapping: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", frozen(self.values))
        if self.values.ndim != 1:
            raise RecordError(f"a signal's values must have the shape (T,), not {self.values.shape}")


@dataclass(frozen=True, eq=False)
class Series:
    """A signal of a bag with stamps of its own.

    `t` : (N,) s, increasing. `names`: further spellings by which it may be asked for (``speed``,
    ``velocity``).
    """

    t: Array
    values: Array
    unit: str = ""
    label: str = ""
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", frozen(self.t))
        object.__setattr__(self, "values", frozen(self.values))

    @property
    def step(self) -> float:
        """The median time between samples, s; infinite for fewer than two."""
        return float(np.median(np.diff(self.t))) if self.t.size > 1 else float("inf")


@dataclass(frozen=True, eq=False)
class Rows:
    """Where each sample stood in its file, to name it in messages: data rows and lines of text, both counted
    from 1.
    """

    number: Integers
    line: Integers | None = None

    def name(self, i: int | np.integer) -> str:
        """``row 17 (line 18)``, or ``row 17`` where the file has no lines."""
        line = "" if self.line is None else f" (line {self.line[i]})"
        return f"row {self.number[i]}{line}"

    def take(self, index: npt.NDArray[np.intp] | npt.NDArray[np.bool_]) -> Rows:
        """The rows at `index`, an index array or a mask."""
        return Rows(self.number[index], None if self.line is None else self.line[index])


@dataclass(frozen=True, eq=False)
class Record:
    """Signals on one time base.

    Attributes
    ----------
    t : (T,) s, strictly increasing, read-only.
    signals : name -> Signal. The name is the mapped one, or the column's name without unit and note, or a bag
        path. source : the file, for messages. notes : what the reader did to the data or noticed in it, one
        sentence each, see `signlin_ros.records.notes`. rows : where each sample stood in the file, None for a
        record made in memory or read from a bag. series : the signals of a bag on their own stamps; `for_model`
        aligns them anew, knowing the inputs. alignment : those of `notes` that tell how the series were put on
        one time base. acts : (T,) s, from when the held ones of a bag's signals act; None: from their own
        sample on. clocks : the columns of which t was made, as they stand: no signals, but formulas may use them.
        fields : numbers that the file states of the whole record, by name: known conditions. words : what columns
        say that hold one word throughout, by label: names of joints.
    """

    t: Array
    signals: dict[str, Signal]
    source: str = "record"
    notes: tuple[Note | str, ...] = ()
    rows: Rows | None = field(default=None, repr=False)
    series: dict[str, Series] = field(default_factory=dict, repr=False)
    alignment: tuple[str, ...] = field(default=(), repr=False)
    acts: Array | None = field(default=None, repr=False)
    clocks: dict[str, Signal] = field(default_factory=dict, repr=False)
    fields: Mapping[str, float] = field(default_factory=dict)
    words: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", frozen(self.t))
        object.__setattr__(self, "signals", dict(self.signals))
        object.__setattr__(self, "notes", as_notes(self.notes))
        _check_time(self)
        for name, signal in self.signals.items():
            if signal.values.shape != self.t.shape:
                shapes = f"{signal.values.size} values for {self.t.size} time stamps"
                raise RecordError(f"{self.source}: signal {name!r} has {shapes}")

    def __len__(self) -> int:
        return int(self.t.size)

    def where(self, i: int | np.integer) -> str:
        """Sample i in words, for messages: ``row 17 (line 18)``, else ``t = 0.08 s``."""
        return self.rows.name(i) if self.rows is not None else at(self.t[i])

    @property
    def labels(self) -> dict[str, str]:
        """The whole text that stood over each signal, as the user knows it, by name."""
        return {name: signal.label or name for name, signal in self.signals.items()}

    def find(self, name: str, further: bool = True) -> str | None:
        """The key in `signals` of what the user calls `name`, or None.

        Compared whole, then without unit and trailing note, then (`further`) by the other spellings of a
        bag's signal, then without regard to capital letters, or by the column's number.

        Raises
        ------
        RecordError
            Where two signals answer to the name.
        """
        wanted = tidy(name)
        if wanted in self.signals:
            return wanted
        for matches in (self._whole, self._bare, *((self._other,) if further else ()), self._loose):
            found = [key for key in self.signals if matches(key, wanted)]
            if len(found) > 1 and not self._say_the_same(found):
                listed = ", ".join(repr(self.labels[key]) for key in found)
                raise RecordError(f"{self.source}: {name!r} is ambiguous: {listed}; give the whole name")
            if found:
                return found[0]
        return None

    def _say_the_same(self, keys: Sequence[str]) -> bool:
        """Whether signals are one quantity in several units, to what their digits show: ``q_rad`` and ``q_deg``."""
        first, *others = (self.signals[key] for key in keys)
        for other in others:
            how = units.conversion(other.unit, first.unit) if first.unit and other.unit else None
            if how is None or how[1] != first.unit:
                return False
            apart = np.abs(how[0] * other.values - first.values)
            known = np.isfinite(apart)
            if not known.any() or apart[known].max() > MAX_SAME * np.ptp(first.values[known]):
                return False
        return True

    def _label(self, key: str) -> str:
        return self.signals[key].label or key

    def _whole(self, key: str, wanted: str) -> bool:
        return heading(self._label(key)).whole(wanted)

    def _bare(self, key: str, wanted: str) -> bool:
        return heading(self._label(key)).bare(wanted)

    def _loose(self, key: str, wanted: str) -> bool:
        return heading(self._label(key), self.signals[key].number).loose(wanted)

    def _other(self, key: str, wanted: str) -> bool:
        return key in self.series and wanted in self.series[key].names

    def require(self, name: str, role: str = "signal", advice: str = "") -> str:
        """As `find`, but refuses a name that is not there with the names that are, and `advice`."""
        key = self.find(name)
        if key is None:
            shown = name if len(name) <= MAX_SHOWN_NAME else f"{name[:MAX_SHOWN_NAME]} ..."
            raise RecordError(f"{self.source}: no {role} {shown!r}; {self.listing()}{advice or self.nearest(name)}")
        return key

    def listing(self) -> str:
        """The signals' labels for a message, at most 30."""
        return listing(self.labels.values())

    def nearest(self, name: str) -> str:
        """``; did you mean 'q_meas [m]'?`` or nothing."""
        return nearest(name, self.labels.values())

    def to_frame(self) -> Any:
        """Return the signals (T,) as a pandas DataFrame over t in s, columns as ``speed [rad/s]``."""
        heads = {name: f"{name} [{signal.unit}]" if signal.unit else name for name, signal in self.signals.items()}
        return frame({"t": self.t, **{head: self.signals[name].values for name, head in heads.items()}}, index="t")

    def for_model(
        self,
        model: Model,
        signals: Mapping[str, str] | None = None,
        require: str = "inputs",
        base: str | None = None,
    ) -> ModelData:
        """Inputs and measurements in the model's names, order and units: see
        `signlin_ros.records.mapping.for_model`.
        """
        from signlin_ros.records.mapping import for_model

        return for_model(self, model, signals, require=require, base=base)


def listing(labels: Iterable[str]) -> str:
    """``it has 'a [m]', 'b'``, at most 30 names."""
    names = list(labels)
    shown = ", ".join(repr(name) for name in names[:30])
    more = f" and {len(names) - 30} more" if len(names) > 30 else ""
    return f"it has {shown}{more}" if names else "it has no signals"


def nearest(name: str, labels: Iterable[str]) -> str:
    """``; did you mean 'q_meas [m]'?`` comparing without units, naming the whole label; or nothing."""
    whole = {heading(label).name: label for label in labels}
    hint = suggest(name, list(whole))
    for bare in sorted(whole, key=len, reverse=True):
        if repr(bare) in hint:
            return hint.replace(repr(bare), repr(whole[bare]))
    return hint


def _check_time(record: Record) -> None:
    if record.t.ndim != 1:
        raise RecordError(f"{record.source}: the time stamps must have the shape (T,), not {record.t.shape}")
    if not np.all(np.isfinite(record.t)):
        raise RecordError(f"{record.source}: a time stamp is not finite")
    if np.any(np.diff(record.t) <= 0):
        i = int(np.argmax(np.diff(record.t) <= 0))
        raise RecordError(
            f"{record.source}: the stamps must increase; sample {i + 2} does not ({record.t[i + 1]:.9g} s)"
        )
