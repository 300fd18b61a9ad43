"""Friction that changes within a record, as a gear warms up while it is recorded: told, and laws are judged beside it.

Of each joint and record the size of friction is a straight line in time, beside which bodies and laws stay as they are.
What a model has is the friction in the middle of a record.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from signlin_ros.arms.fit import CoefficientEstimate, FitDesign, fit
from signlin_ros.arms.laws import Loads
from signlin_ros.arms.piece import RegressionRows
from signlin_ros.arms.warmth import (
    DOUBT,
    FRICTION_SIZE_SPREAD,
    Friction,
    held,
    name_of_size,
    needed,
    sources_of,
    with_sizes,
    within,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Drift:
    """Relative changes of friction over a record by joint and record (n, R), and their standard errors."""

    sources: tuple[str, ...]
    changes: Array
    errors: Array

    def told(self) -> Iterator[tuple[int, Array]]:
        """Yield the joints whose friction changes beyond doubt, with the changes (R,); NaN where one tells nothing."""
        for i, (change, error) in enumerate(zip(self.changes, self.errors, strict=True)):
            count = int(np.isfinite(error).sum())
            if count and float(np.sum((change / error) ** 2)) > float(chi2.isf(DOUBT / len(self.changes), count)):
                yield i, np.where(np.isfinite(error), change, np.nan)

    @property
    def size(self) -> float:
        """RMS of the changes of joints that change; 0 where none does."""
        told = [change for _, change in self.told()]
        return float(np.sqrt(np.nanmean(np.square(told)))) if told else 0.0


def name_of_change(place: int, record: int) -> str:
    """Return the name of the column of a change of friction in a place over a record."""
    return f"{name_of_size(place, record)}.change"


def with_changes(
    design: FitDesign, both: tuple[RegressionRows, RegressionRows], friction: Friction, loads: Loads, sd: float
) -> FitDesign:
    """Return a design with a change of friction for each place and record, of a standard deviation."""
    pieces = [piece for rows in both for piece in rows.pieces]
    for k, source in enumerate(sources_of(*both)):
        own = [piece.run.t for piece in pieces if piece.run.source == source]
        first, last = min(float(t[0]) for t in own), max(float(t[-1]) for t in own)
        clocks = [(_times(rows) - 0.5 * (first + last)) / (last - first) * within(rows, source) for rows in both]
        for place in sorted({law[0] for law in friction}):
            laws = [law for law in friction if law[0] == place]
            known, unseen = (needed(laws, r, loads) * t[:, None] for r, t in zip(both, clocks, strict=True))
            design = design.plus((name_of_change(place, k),), known, unseen, 0.0, sd)
    return design


def _times(rows: RegressionRows) -> Array:
    """Return the times (N,) of rows in their records, in s."""
    of = [(p.run.t[0] + p.index * p.step)[p.moving[:, i]] for p in rows.pieces for i in range(rows.n)]
    return np.concatenate(of)


def drift(estimate: CoefficientEstimate, friction: Friction, loads: Loads) -> Drift:
    """Return how friction changes within the records of a fit's rows; its form stays, its sizes are free."""
    rows = estimate.rows
    sources = sources_of(rows)
    design = with_sizes(held(estimate, friction), (rows, rows), friction, loads, FRICTION_SIZE_SPREAD)
    free = fit(with_changes(design, (rows, rows), friction, loads, FRICTION_SIZE_SPREAD), rows, rows, estimate.weights)
    errors = dict(zip(free.design.names, free.errors().tolist(), strict=True))
    names = [[name_of_change(i, k) for k in range(len(sources))] for i in range(rows.n)]
    changes = np.array([[free[name] if name in errors else 0.0 for name in own] for own in names])
    own_errors = np.array([[errors.get(name, np.inf) for name in own] for own in names])
    own_errors[changes == 0.0] = np.inf  # of a place without friction, or rows
    return Drift(sources, changes, own_errors)


__all__ = ["Drift", "drift", "name_of_change", "with_changes"]
