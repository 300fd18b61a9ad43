"""A temperature that was recorded, and is not used."""

from __future__ import annotations

from collections.abc import Iterator

from signlin_ros.checks.base import Check
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look
from signlin_ros.recording.trace import TEMPERATURE
from signlin_ros.records.header import heading
from signlin_ros.units import is_temperature

MAX_COLUMNS_LISTED = 3
"""So many columns are listed."""


class SpareTemperature(Check):
    """A column holds a temperature that no input is read from.

    Test: its name or its unit says so. Never a fault. Cure: none, how the column is mapped is told.
    """

    name = "spare_temperature"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the columns."""
        if TEMPERATURE in look.model.inputs or look.model.plant.name == "arm":
            return
        found = [label for label in look.record.unused if _is_temperature(label)]
        if found:
            h = heading(found[0])
            column = h.name if is_temperature(h.unit) else f"{h.name} [degC]"
            listed = ", ".join(map(repr, found[:MAX_COLUMNS_LISTED])) + (
                ", ..." if len(found) > MAX_COLUMNS_LISTED else ""
            )
            yield self.note(
                "", f"not used: {listed}; with --signal 'temperature = {column}' friction that depends on it is tried"
            )


def _is_temperature(label: str) -> bool:
    h = heading(label)
    return is_temperature(h.unit) or "temperature" in h.name.lower()


__all__ = ["SpareTemperature"]
