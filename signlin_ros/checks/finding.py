"""What a check says of a record."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from signlin_ros.records import ModelData


SEVERITIES = ("note", "offer", "refuse")
"""To be known; to be decided by whoever knows the rig; nothing may be concluded before it is."""


@dataclass(frozen=True)
class Finding:
    """One thing that is odd about a record.

    ``channel``: of what, empty where it is the whole record. ``cure``: the name by which `check` is asked to apply what
    would help, empty where there is nothing to apply; ``action`` does it. ``harmless``: it is applied without being
    asked for. ``remedy``: what is done then, in words. ``source``: the record. ``columns``: it is a matter of the
    columns of the log, and so of every record that has them. ``final``: no cure helps, nor to take the record as it is.
    """

    check: str
    channel: str
    severity: str
    sentence: str
    cure: str = ""
    remedy: str = ""
    applied: bool = False
    source: str = ""
    harmless: bool = field(default=False, repr=False)
    columns: bool = field(default=False, repr=False)
    final: bool = field(default=False, repr=False)
    action: Callable[[ModelData], ModelData] | None = field(default=None, repr=False, compare=False)

    def to_json(self) -> dict[str, Any]:
        """Return the entry of ``findings`` in schemas/check.json."""
        return {
            "check": self.check,
            "channel": self.channel,
            "severity": self.severity,
            "sentence": self.said,
            "cure": self.cure or None,
            "applied": self.applied,
            "record": self.source,
        }

    @property
    def said(self) -> str:
        """The sentence, and what was done where it was."""
        return f"{self.sentence}; {self.remedy}" if self.applied else self.sentence

    @property
    def way_out(self) -> str:
        """The cure in words, where there is one to be asked for."""
        return f"--cure {self.cure}: {self.remedy}" if self.cure and not self.applied else ""

    @property
    def open(self) -> bool:
        """Whether nothing may be concluded from the record as it is."""
        return self.severity == "refuse" and not self.applied

    @property
    def doubtful(self) -> bool:
        """Whether what it is about is in doubt."""
        return self.severity != "note" and not self.applied

    @property
    def about(self) -> tuple[str, ...]:
        """The inputs and channels that it is about."""
        return tuple(self.channel.split(", ")) if self.channel else ()

    def done(self) -> Finding:
        """Return the finding with its cure applied."""
        return replace(self, applied=True)


def to_json(findings: Iterable[Finding]) -> dict[str, Any]:
    """Return the object of ``signlin check --json``."""
    return {"findings": [finding.to_json() for finding in findings]}


__all__ = ["SEVERITIES", "Finding", "to_json"]
