"""Who watches a diagnosis: one object that is told how far it is, is shown what was fitted, and may stop it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any

from signlin_ros.errors import SignlinError

Report = Callable[[str, float], None]
STAGE_SHARE = 0.2
"""Part of the work left that a stage is told as: how many stages there are shows on the way."""


class CancelledError(SignlinError):
    """Somebody asked to stop."""


def _ignore(*what: Any) -> None:
    """Do nothing."""


def _go_on() -> bool:
    return False


def _shares() -> Iterator[float]:
    return (1.0 - (1.0 - STAGE_SHARE) ** n for n in count())


@dataclass(frozen=True)
class Progress:
    """What watches a diagnosis; all may be called from any thread.

    Parameters
    ----------
    report : called with the name of a stage and the share (0 to 1) of all work that is done.
    cancelled : asked whether to stop, at every stage and fit.
    seen : called with the `EquationErrorResult`, and with every `FittedModel` that is the best of its effects by then.
    """

    report: Report = _ignore
    cancelled: Callable[[], bool] = _go_on
    seen: Callable[[Any], None] = _ignore
    _share: Iterator[float] = field(default_factory=_shares, repr=False, compare=False)

    @classmethod
    def of(cls, watcher: Progress | Report | None) -> Progress:
        """Return a watcher as a `Progress`: a function is told of stages, None is told nothing."""
        if isinstance(watcher, Progress):
            return watcher
        return cls(watcher) if watcher else cls()

    def say(self, stage: str) -> None:
        """Tell which stage begins; raises `CancelledError` if somebody asked to stop."""
        self.check()
        self.report(stage, next(self._share))

    def check(self) -> None:
        """Raise `CancelledError` if somebody asked to stop."""
        if self.cancelled():
            raise CancelledError("stopped")

    def without_seen(self) -> Progress:
        """Return one that is not shown fits, for trials that are no part of the answer."""
        return replace(self, seen=_ignore)


__all__ = ["CancelledError", "Progress", "Report"]
