"""One thread at a time writes expressions.

CasADi lets other threads run while it works, and its expressions share constants: of two threads, one may forget the
last use of a number just as the other finds it, which ends the process. So expressions are written, and forgotten, in
functions that are `symbolic`. These ask nothing of a model, whose cached properties have locks of their own. A cache
of expressions goes inside (`symbolic` first), where they are forgotten alone, too; a cache of anything else goes
outside, where what is known waits for nobody. What a `Linearizer` holds beyond its cache is the exception.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])

_alone = threading.RLock()


def symbolic(function: Function) -> Function:
    """Decorate a function that writes expressions: one thread at a time runs any of these."""

    @functools.wraps(function)
    def one(*args: Any, **kwargs: Any) -> Any:
        with _alone:
            return function(*args, **kwargs)

    return one  # type: ignore[return-value]


__all__ = ["symbolic"]
