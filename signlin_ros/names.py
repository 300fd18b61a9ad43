"""Names that mean the same in every model file and record, and in every verb and page."""

from __future__ import annotations

PROGRESS_ASKED = "SIGNLIN_PROGRESS"
"""Variable of the environment that says that a program, no terminal, reads what is told of progress."""
TIME_NAMES = ("t", "time", "timestamp", "stamp")
"""What the time column of a record may be called, in the order in which it is looked for."""

AS_GIVEN, REFITTED_ROW, SENSOR_NOISE_ROW, MISSING_FORCE_ROW = (
    "model as given",
    "refitted",
    "noise of the sensors",
    "missing force",
)
"""The first rows by which models are told apart, the same in every verb, and the last; and what stands in every group
beside the channels."""
AT_NOISE_RATIO = 1.1
"""Times the noise of a channel up to which an error is no larger than it."""

__all__ = ["AS_GIVEN", "AT_NOISE_RATIO", "MISSING_FORCE_ROW", "REFITTED_ROW", "SENSOR_NOISE_ROW", "TIME_NAMES"]
