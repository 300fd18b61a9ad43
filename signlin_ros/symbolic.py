"""One thread at a time writes expressions.

CasADi lets other threads run while it works, and its expressions share constants: of two threads, one may forget the
last use of a number just as the other finds it, which ends the process. So expressions are written, and forgotten, only
where `alone` is held. Who holds it asks nothing of a model, whose cached properties have locks of their own.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])

alone = threading.RLock()
"""What a thread holds that writes expressions."""


def symbolic(function: Function) -> Function:
    """Decorate a function that writes expressions: one thread at a time runs any of these."""

    @functools.wraps(function)
    def one(*args: Any, **kwargs: Any) -> Any:
        with alone:
            return function(*args, **kwargs)

    return one  # type: ignore[return-value]


__all__ = ["alone", "symbolic"]
