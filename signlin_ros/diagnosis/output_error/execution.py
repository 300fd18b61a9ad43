"""Work side by side that tells how far it is, and stops when somebody asks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from signlin_ros.errors import SignlinError

Progress = Callable[[str], None]


class CancelledError(SignlinError):
    """Somebody asked to stop."""


class Execution:
    """The seam through which a diagnosis tells its progress and is stopped; ``jobs``: how much is done side by side."""

    def __init__(self, jobs: int, progress: Progress | None, cancelled: Callable[[], bool] | None) -> None:
        self.jobs = jobs
        self._tell, self._cancelled = progress or (lambda what: None), cancelled or (lambda: False)

    def say(self, what: str) -> None:
        """Tell what is being done, after `check`."""
        self.check()
        self._tell(what)

    def check(self) -> None:
        """Raise `CancelledError` if somebody asked to stop."""
        if self._cancelled():
            raise CancelledError("stopped")

    def each(self, do: Callable[[Any], Any], items: Sequence[Any]) -> list[Any]:
        """Do a thing to each, side by side."""
        if self.jobs == 1 or len(items) < 2:
            return [do(item) for item in items]
        with ThreadPoolExecutor(self.jobs) as pool:
            return list(pool.map(do, items))


__all__ = ["CancelledError", "Execution", "Progress"]
