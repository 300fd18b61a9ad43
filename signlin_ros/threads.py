"""Threads: linear algebra on one (matrices of some hundred rows are slower on several); fits side by side."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")
R = TypeVar("R")


def one_thread(f: Callable[P, T]) -> Callable[P, T]:
    """Return a function during which the libraries of linear algebra keep to one thread."""

    @functools.wraps(f)
    def run(*args: P.args, **kwargs: P.kwargs) -> T:
        from threadpoolctl import threadpool_limits

        with threadpool_limits(limits=1, user_api="blas"):
            return f(*args, **kwargs)

    return run


def side_by_side(do: Callable[[T], R], items: Sequence[T], jobs: int) -> list[R]:
    """Return the results of a function for each item, in their order, by so many threads."""
    if jobs == 1 or len(items) < 2:
        return [do(item) for item in items]
    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(do, items))


__all__ = ["one_thread", "side_by_side"]
