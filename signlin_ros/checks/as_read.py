"""What the reader did to a record, where that is a fault of the record."""

from __future__ import annotations

from collections.abc import Iterator

from signlin_ros.checks.base import Check
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look

MENDED_KINDS = ("sorted", "cut", "repeated", "truncated", "gap", "filled", "missing", "undefined", "assumed", "nothing")
"""Kinds of notes of a reader (`signlin_ros.records`) that tell of a fault which it put right."""


class AsRead(Check):
    """Time that jumps back, rows twice, a last line cut off, gaps: what only the reader sees, since it puts it right.

    Test: the reader's; it compares stamps and counts cells, which leaves nothing to chance. Cure: the reader's: a late
    message is sorted in, a restart cuts the record in two, repetitions are dropped.
    """

    name = "as_read"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield notes of the reader that tell of faults."""
        for note in look.record.notes:
            kind, channel = getattr(note, "kind", ""), getattr(note, "channel", "")
            if kind in MENDED_KINDS:
                yield Finding(kind, channel, "note", str(note))
