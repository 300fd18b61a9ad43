"""Tables in HTML, as results show themselves in a notebook."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence


def html_table(head: Sequence[str], rows: Iterable[Sequence[str]], above: str = "") -> str:
    """Return a table with a line of text ``above`` it."""
    text = f"<p>{html.escape(above)}</p>" if above else ""
    return f"{text}<table>{_row('th', head)}{''.join(_row('td', row) for row in rows)}</table>"


def _row(tag: str, cells: Sequence[str]) -> str:
    return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"


__all__ = ["html_table"]
