"""JSON that is no log of a servo: columns as lists, ``{"t": [...], "motor": {"u": [...]}}``, or rows as objects,
``[{"t": 0.0, "motor": {"u": 1.2}}, ...]``, at any depth.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt


def arrays(content: Any) -> dict[str, Any]:
    """Return what is in it as named arrays, objects as mappings; what holds no numbers as text."""
    found = _value(content)
    return dict(found) if isinstance(found, Mapping) else {"data": found}


def _value(content: Any) -> Any:
    if isinstance(content, Mapping):
        return {str(name): _value(value) for name, value in content.items()}
    if isinstance(content, list) and content and all(isinstance(row, dict) for row in content):
        return _rows(content)
    try:
        values = np.array(content, dtype=np.float64) if not isinstance(content, str) else np.array(["text"])
    except (TypeError, ValueError):
        return np.array(["text"])
    return values if values.ndim else values.reshape(1)


def _rows(content: list[dict[str, Any]]) -> dict[str, npt.NDArray[np.float64]]:
    """Return the numbers of objects (R,) by their names, NaN where one has none."""
    rows = [dict(leaves(row)) for row in content]
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row.get(name, np.nan) for row in rows], dtype=np.float64) for name in names}


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Yield the numbers of what JSON holds: ``motor.u`` of an object in another one, ``q[0]`` of a list."""
    if isinstance(value, dict):
        for key, one in value.items():
            yield from leaves(one, f"{name}.{key}" if name else str(key))
    elif isinstance(value, list):
        for k, one in enumerate(value):
            yield from leaves(one, f"{name}[{k}]")
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield name, float(value)


__all__ = ["arrays", "leaves"]
