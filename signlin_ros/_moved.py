"""Old places of names that have moved: they still work, and warn."""

from __future__ import annotations

import importlib
import sys
import warnings
from types import ModuleType
from typing import Any


class MovedModule(ModuleType):
    """A module under its old name; called, it is the function of that name.

    ``import signlin_ros.simulate`` binds the name ``simulate`` of the package to a module, where the package offers the
    function: both are meant to work.
    """

    def __init__(self, old: str, new: str) -> None:
        super().__init__(old)
        self._new = new

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        warnings.warn(f"{self.__name__} is {self._new}", DeprecationWarning, stacklevel=2)
        return getattr(importlib.import_module(self._new), name)

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Call the function that has the name of the module."""
        function = getattr(importlib.import_module(self._new), self.__name__.rpartition(".")[2])
        return function(*arguments, **options)


def moved(old: str, new: str) -> None:
    """Put a `MovedModule` in the place of the module ``old``."""
    sys.modules[old] = MovedModule(old, new)


__all__ = ["moved"]
