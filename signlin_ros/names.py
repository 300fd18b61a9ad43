"""Names that mean the same in every model file and record."""

from __future__ import annotations

TIME = ("t", "time", "timestamp", "stamp")
"""What the time column of a record may be called, in the order in which it is looked for."""

__all__ = ["TIME"]
