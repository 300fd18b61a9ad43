"""`Note`: one sentence on what a reader did to a record or noticed in it, with what it is about.

A note is text, so that it prints and compares as its sentence; `kind` and `channel` are for programs.

=============  =====================================================================================
kind           what was done or noticed
=============  =====================================================================================
sorted         late rows or messages were put in their place
cut            a clock that jumped back, or a header that returned: the file holds several runs
repeated       rows or messages that were there twice were dropped
truncated      a last line that was cut off, or lines that are no rows, were dropped
left_out       a column or topic is not used: text, infinite values, another length
converted      a unit other than the model's was converted
assumed        what the file did not say was taken as said here (a unit, an order, a missing input as 0)
mapped         a column was made from others, as the mapping says
clock          where the time comes from: an epoch, a clock time, sec and nanosec, a sampling time
unit_of_time   the time states no unit, and its steps would be long for s: a question
gap            steps of the time that are much longer than the others
uneven         steps of the time that differ
held           a channel with stamps of its own was held from sample to sample
interpolated   a channel with stamps of its own was interpolated
filled         missing samples of an input hold the value before them, or lie on the line between their neighbours
started        the record is taken from where its inputs begin
derived        a channel was computed from another one: a velocity from a position
missing        a channel holds no sample, a topic no message
nothing        values smaller than any measurement were taken as 0, numbers that stand for none as missing
undefined      a formula has no value in some rows: it divides by zero
format         how the file was taken: a preamble, a row of units, decimal commas, no header
=============  =====================================================================================
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

NOTE_KINDS = (
    "sorted",
    "cut",
    "repeated",
    "truncated",
    "left_out",
    "converted",
    "assumed",
    "mapped",
    "clock",
    "unit_of_time",
    "gap",
    "uneven",
    "held",
    "interpolated",
    "filled",
    "started",
    "derived",
    "missing",
    "nothing",
    "undefined",
    "format",
)


@dataclass(frozen=True, eq=False, repr=False)
class Note(str):
    """A sentence about a record.

    Attributes
    ----------
    sentence : the text itself.
    kind : one of `NOTE_KINDS`, "" where there is none.
    channel : the column, topic or quantity of the model that it is about, "" for the whole record.
    """

    sentence: str
    kind: str = ""
    channel: str = ""

    def __new__(cls, sentence: str, kind: str = "", channel: str = "") -> Note:
        """Return the sentence as text."""
        return super().__new__(cls, sentence)


def as_notes(sentences: Iterable[str]) -> tuple[Note, ...]:
    """Sentences as notes; one that is plain text has no kind."""
    return tuple(one if isinstance(one, Note) else Note(one) for one in sentences)
