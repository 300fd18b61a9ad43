"""Signals that say nothing: no state or output in the record, an input or channel that is nothing throughout."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.base import Check, without_channel
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.errors import joined
from signlin_ros.records import ModelData
from signlin_ros.records.converted import SMALLEST
from signlin_ros.records.inputs import JOIN
from signlin_ros.records.notes import as_notes

Array = NDArray[np.float64]

ONE_FILE = (
    f"the signals of one record must stand in one file; {JOIN}, and --signal NAME=COLUMN says which column is which"
)
"""What is to be done where signals are in several files."""
MAX_EMPTY_SIZE = 1e-15
"""Largest size in SI units of what no sensor and no drive says: memory that was never written, rounded zeros."""
RISES = 1.2
"""By how much a peak of the speed exceeds the one before it where something drives, beyond the noise,"""
OFTEN_SAMPLES = 3
"""and how often in a record: a motion that is let go only loses speed from peak to peak."""


class NothingMeasured(Check):
    """An input or a channel is nothing throughout while the machine moves: a driver that does not report it, or memory
    that was never written (1e-310).

    Test: no value is larger than `MAX_EMPTY_SIZE`. Of an input that is exactly 0 this may be true (a motion that is
    let go); it is refused where the speed rises from peak to peak again and again. Cure: a channel is left out; of an
    input there is none but another column.
    """

    name = "nothing_measured"
    of_nothing = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the whole record, else inputs, then channels."""
        if not look.channels:
            yield self._nothing(look)
            return
        if not any(_moves(look.finite(name)[1]) for name in look.channels):
            return
        for name in look.record.inputs:
            most = float(np.abs(look.of(name)).max(initial=0.0))
            if most <= MAX_EMPTY_SIZE and not _said(look.record, name):
                yield self._input(look, name, most)
        for name in look.channels:
            values = look.finite(name)[1]
            most = float(np.abs(values).max(initial=0.0))
            if values.size >= MIN_SAMPLES and most <= MAX_EMPTY_SIZE and (most > 0.0 or _tiny(look.record, name)):
                yield Finding(
                    self.name,
                    name,
                    "note",
                    f"the {name} is nothing ({_size(look, name, most)}) while the machine moves: nothing measures it",
                    cure=f"leave_out_{name}",
                    remedy="it is left out",
                    harmless=True,
                    action=without_channel(name),
                )

    def _nothing(self, look: Look) -> Finding:
        known = joined(list(dict.fromkeys((*look.model.states, *look.model.outputs))), "or")
        lost = [str(note) for note in as_notes(look.record.notes) if note.kind == "missing"]
        columns = joined([repr(name) for name in look.record.unused]) if look.record.unused else ""
        way = f"{'; '.join(lost)}; --signal NAME=COLUMN says which column it is: there are {columns}"
        return Finding(
            self.name,
            "",
            "refuse",
            f"nothing of what the model does ({known}) is in this record: {way if lost and columns else ONE_FILE}",
            final=True,
        )

    def _input(self, look: Look, name: str, most: float) -> Finding:
        moving = next(n for n in look.channels if _moves(look.finite(n)[1]))
        sentence = f"the {name} is nothing ({_size(look, name, most)}) while the {moving} changes"
        why = f"the driver does not report it; map the column of what drives it, --signal {name}=COLUMN"
        if most > 0.0 or _tiny(look.record, name) or _driven(look):
            return Finding(self.name, name, "refuse", f"{sentence}: {why}, or say that nothing does, --signal {name}=0")
        return self.note(name, f"{sentence}: nothing drives the machine, or {why}")


def _moves(values: Array) -> bool:
    return bool(values.size >= MIN_SAMPLES and np.ptp(values) > MAX_EMPTY_SIZE)


def _size(look: Look, name: str, most: float) -> str:
    if _tiny(look.record, name):
        return f"all values are smaller than {SMALLEST:g} {look.unit(name)}, as memory reads that was never written"
    if most == 0.0:
        return f"0 {look.unit(name)} from beginning to end"
    return f"at most {most:.2g} {look.unit(name)}"


def _said(record: ModelData, name: str) -> bool:
    """Tell whether somebody said what an input is, or that no column holds it."""
    of = [note for note in as_notes(record.notes) if note.channel == name]
    nowhere = name not in record.labels
    return any("throughout" in note or (nowhere and note.kind == "assumed") for note in of)


def _tiny(record: ModelData, name: str) -> bool:
    """Tell whether the reader has taken values for 0 that were too small for any measurement."""
    return any((note.kind, note.channel) == ("nothing", name) for note in as_notes(record.notes))


def _driven(look: Look) -> bool:
    """Tell whether the speed rises from peak to peak again and again: no motion that is let go does."""
    v = look.motion
    if v is None or not v.any():
        return False
    edges = np.flatnonzero(np.diff(np.sign(v)) != 0) + 1
    noise = look.noise(look.velocity).sigma if look.velocity in look.channels else 0.0
    peaks = np.array([float(np.abs(part).max()) for part in np.split(v, edges) if part.size and part.any()])
    peaks = peaks[peaks > 4.0 * noise]
    before = np.maximum(peaks[1:-1], peaks[:-2])  # noise crosses zero many times at a turn
    rises = peaks[2:] > RISES * before + 4.0 * noise
    return int(rises.sum()) >= OFTEN_SAMPLES


__all__ = ["NothingMeasured"]
