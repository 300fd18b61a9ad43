"""Aligned columns, numbers and units as the command line writes them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def table(rows: Iterable[Sequence[str]], indent: str = "  ", right: Sequence[int] = ()) -> str:
    """Return rows of cells as aligned columns; those in ``right`` are set flush right."""
    cells = [list(row) for row in rows]
    widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))] if cells else []

    def line(row: list[str]) -> str:
        pairs = enumerate(zip(row, widths, strict=True))
        return "  ".join(cell.rjust(width) if i in right else cell.ljust(width) for i, (cell, width) in pairs)

    return "\n".join((indent + line(row)).rstrip() for row in cells)


def number(value: float) -> str:
    """Return a number with six digits."""
    return f"{value:.6g}"


def per_second(unit: str) -> str:
    """Return the unit of a rate of change."""
    return {"-": "1/s", "m/s": "m/s²", "rad/s": "rad/s²"}.get(unit, f"{unit}/s")


def short(value: float) -> str:
    """Return a number with three digits, a large one with those before its point."""
    return f"{value:.0f}" if 1000 <= abs(value) < 1e7 else f"{value:.3g}"


__all__ = ["number", "per_second", "short", "table"]
