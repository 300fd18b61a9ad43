"""Names of a package that are imported when first asked for."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any

from signlin_ros.errors import MissingExtraError


def exports(package: str, names: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` of a package whose ``names`` stand in the modules given.

    A module with a dot in its name is one of another package.
    """

    def find(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module = names[name] if "." in names[name] else f"{package}.{names[name]}"
        return getattr(importlib.import_module(module), name)

    return find, lambda: sorted(names)


def drawn_by(module: str, function: str) -> Callable[[Any], Any]:
    """Return a method ``plot`` that a function of a module above draws: pictures are looked up when asked for."""

    def plot(self: Any) -> Any:
        """Return a picture of the result, a matplotlib Figure; raise `MissingExtraError` without matplotlib."""
        return getattr(importlib.import_module(module), function)(self)

    return plot


def frame(columns: Mapping[str, Any], index: str = "") -> Any:
    """Return a pandas DataFrame of columns by name; raise `MissingExtraError` without pandas."""
    try:
        import pandas as pd
    except ImportError as error:
        raise MissingExtraError("A table as a DataFrame", "frames") from error
    table = pd.DataFrame(dict(columns))
    return table.set_index(index) if index else table


__all__ = ["drawn_by", "exports", "frame"]
