"""Every set of a few laws at once, from inner products alone: what one law hides, two may show together. All pairs are
solved, then the best of them with every other member beside [Furnival and Wilson, Technometrics 16 (1974) 499].
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.blocks import MIN_DIVISOR
from signlin_ros.diagnosis.equation_error.laws import Shape
from signlin_ros.diagnosis.equation_error.regression import Member, Regression, precision

Array = NDArray[np.float64]
Sets = NDArray[np.intp]

MAX_SUBSETS, BATCH = 150, 4096
"""Sets of two and more laws that are tried with every other member beside; sets that are solved together."""


class Subsets:
    """Sets of members (laws with their shapes): about what each leaves of the fitted data."""

    def __init__(self, regression: Regression, shapes: Mapping[str, Sequence[Shape]]) -> None:
        self.regression, self.members = regression, list[Member]()
        names, parts = list(regression.laws), list[list[int]]()
        columns, positive = [regression.training.X], [False] * regression.n_base
        families, kinds = [law.family for law in regression.laws.values()], list[tuple[int, int]]()
        for name, shape in [(n, shape) for n in names for shape in shapes.get(n, ())]:
            law, C = regression.laws[name], regression.training.columns(regression.laws[name], shape)
            if not np.isfinite(C).all():
                continue  # a law of somebody's own, with a root or a power of what crosses zero
            columns.append(C)
            whole = list(range(len(positive), len(positive) + C.shape[1]))
            positive += law.positive(shape)
            apart = [[j] for j in whole] if len(whole) > 1 and all(law.positive(shape)) else []
            for part in [whole, *apart]:
                self.members.append((name, shape))
                parts.append(part)
                kinds.append((names.index(name), families.index(law.family)))
        A = np.hstack(columns)
        self._scale = np.sqrt(np.mean(A**2, axis=0)) + MIN_DIVISOR
        A = A / self._scale
        n = A.shape[1]
        self._gram, self._moments = np.zeros((n + 1, n + 1)), np.zeros(n + 1)  # the last one is no column at all
        self._gram[:n, :n], self._moments[:n] = A.T @ A, A.T @ regression.training.y
        self._gram[n, n] = 1.0
        self._size, self._total = regression.training.y.size, float(regression.training.y @ regression.training.y)
        self._positive = np.array([*positive, False])
        width = max((len(p) for p in parts), default=1)
        self._parts = np.array([[*p, *[n] * (width - len(p))] for p in parts], dtype=np.intp).reshape(-1, width)
        self._law, self._kind = np.array(kinds, dtype=np.intp).reshape(-1, 2).T
        self._free = np.array([regression.laws[name].free(shape) for name, shape in self.members], dtype=float)

    def squared_error(self, sets: Sets, size: float) -> Array:
        """Return about the squared error (S,) that sets (S, k) leave, inf beside a wrong sign; ``size``: mean left."""
        regression = self.regression
        base = np.arange(regression.n_base)
        known = precision(regression.prior_std, self._scale[: regression.n_base], np.sqrt(size), self._size)
        found = np.empty(len(sets))
        for at in range(0, len(sets), BATCH):
            some = sets[at : at + BATCH]
            index = np.hstack(
                [np.broadcast_to(base, (len(some), regression.n_base)), self._parts[some].reshape(len(some), -1)]
            )
            normal, moments = self._gram[index[:, :, None], index[:, None, :]], self._moments[index]
            diagonal = np.arange(index.shape[1])
            none = index == len(self._moments) - 1
            normal[none] = 0.0
            normal[:, diagonal, diagonal] += np.where(none, 1.0, 1e-9 * self._size)
            normal[:, base, base] += known
            theta = np.linalg.solve(normal, moments[:, :, None])[:, :, 0]
            error = np.maximum(self._total - np.sum(theta * moments, axis=1), 0.0)
            found[at : at + BATCH] = np.where(np.any((theta < 0.0) & self._positive[index], axis=1), np.inf, error)
        return found

    def best(self, count: int, size: float) -> list[tuple[Member, ...]]:
        """Return the best sets of ``count`` members, one for each set of laws, the best first; ``size``: see
        `squared_error`.
        """
        return [tuple(self.members[j] for j in row) for row in self._best(count, size)]

    def _best(self, count: int, size: float) -> Sets:
        sets = self._sets(count, size)
        rank = (
            self.squared_error(sets, size)
            / self._size
            * (1.0 + self.regression.criteria.min_share_per_parameter * self._free[sets].sum(axis=1))
        )
        order = np.argsort(rank, kind="stable")
        order = order[np.isfinite(rank[order])]
        _, first = np.unique(np.sort(self._law[sets[order]], axis=1), axis=0, return_index=True)
        return np.asarray(sets[order[np.sort(first)]])

    def _sets(self, count: int, size: float) -> Sets:
        """Return sets (S, count) of members of different laws and families: smaller ones with one member more."""
        every = np.arange(len(self.members), dtype=np.intp)[:, None]
        if count == 1:
            return every
        smaller = every if count == 2 else self._best(count - 1, size)[:MAX_SUBSETS]
        sets = np.hstack([np.repeat(smaller, len(every), axis=0), np.tile(every, (len(smaller), 1))])
        kinds = self._kind[sets]
        return np.asarray(sets[np.all(kinds[:, :-1] != kinds[:, -1:], axis=1)])

    def beside(self, members: Sequence[Member], names: Sequence[str], size: float) -> Iterator[tuple[Member, ...]]:
        """Yield members with one law more, for each of ``names`` at the shape that leaves least."""
        fixed = [self.members.index(m) for m in members]
        for name in names:
            more = [j for j, m in enumerate(self.members) if m[0] == name]
            sets = np.array([[*fixed, j] for j in more], dtype=np.intp)
            left = self.squared_error(sets, size) if more else np.zeros(0)
            if np.isfinite(left).any():
                yield (*members, self.members[more[int(np.argmin(left))]])


__all__ = ["Subsets"]
