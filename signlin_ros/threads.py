"""Linear algebra on one thread: matrices of some hundred rows are slower on several, and much slower beside others."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


def one_thread(f: Callable[P, T]) -> Callable[P, T]:
    """Return a function during which the libraries of linear algebra keep to one thread."""

    @functools.wraps(f)
    def run(*args: P.args, **kwargs: P.kwargs) -> T:
        from threadpoolctl import threadpool_limits

        with threadpool_limits(limits=1, user_api="blas"):
            return f(*args, **kwargs)

    return run


__all__ = ["one_thread"]
