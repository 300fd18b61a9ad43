"""Friction that differs from record to record, as gears and their oil warm: a size of each joint's in each record.

Several records of one arm share its bodies, laws and motors, and not the temperature of its gears. A fit of one
friction to all of them takes what differs for bodies or laws, so the friction of each joint has a size of its own in
each record, around one; by how much such sizes scatter is told by the records.
[DerSimonian and Laird, Controlled Clinical Trials 7(3), 1986; Simoni et al., IEEE/RSJ IROS 2015]
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from signlin_ros.arms.fit import IN_RECORD, CoefficientEstimate, FitDesign, fit
from signlin_ros.arms.laws import JointLaw, Loads, column
from signlin_ros.arms.piece import RegressionRows
from signlin_ros.effects import find_effect

Array = NDArray[np.float64]
Friction = Sequence[tuple[int, JointLaw, float, float]]
FRICTION_SIZE_SPREAD = 1.0
"""Standard deviation of a record's size of friction where nothing is known of their scatter."""
DOUBT = 1e-4
"""Probability with which friction that is the same in all records is told to differ."""


@dataclass(frozen=True, eq=False)
class Warmth:
    """Relative sizes of friction by joint and record (n, R), their standard errors, and their scatter over all."""

    sources: tuple[str, ...]
    sizes: Array
    errors: Array
    spread: float


def sources_of(*rows: RegressionRows) -> tuple[str, ...]:
    """Return the records of some rows, each once."""
    return tuple(dict.fromkeys(piece.run.source for r in rows for piece in r.pieces))


def name_of_size(place: int, record: int) -> str:
    """Return the name of the column of a record's size of friction in a place."""
    return f"{place}{IN_RECORD}{record}"


def with_sizes(
    design: FitDesign, both: tuple[RegressionRows, RegressionRows], friction: Friction, loads: Loads, spread: float
) -> FitDesign:
    """Return a design with a size of friction for each place and record, of a standard deviation around one."""
    for k, source in enumerate(sources_of(*both)):
        among = [within(rows, source) for rows in both]
        for place in sorted({law[0] for law in friction}):
            own = [law for law in friction if law[0] == place]
            sides = [needed(own, rows, loads) * own_rows[:, None] for rows, own_rows in zip(both, among, strict=True)]
            design = design.plus((name_of_size(place, k),), sides[0], sides[1], 0.0, spread)
    return design


def _warms(law: JointLaw) -> bool:
    """Tell whether a law is friction; loads and springs are not, and do not depend on temperature."""
    return not find_effect(law.effect, "effects").external


def in_record(
    estimate: CoefficientEstimate, friction: Friction, record: int
) -> list[tuple[int, JointLaw, float, float]]:
    """Return laws of friction as large as they are in a record."""
    matched = dict(zip(estimate.design.names, estimate.matched.tolist(), strict=True))

    def size(i: int, law: JointLaw) -> float:
        return 1.0 + matched.get(name_of_size(i, record), 0.0) if _warms(law) else 1.0

    return [(i, law, shape, value * size(i, law)) for i, law, shape, value in friction]


def needed(laws: Friction, rows: RegressionRows, loads: Loads) -> Array:
    """Return the effort (N, 1) that the friction of a place needs."""
    parts = [value * column(law, shape, rows, i, loads) for i, law, shape, value in laws if _warms(law)]
    return np.sum(parts, axis=0) if parts else np.zeros((len(rows), 1))


def within(rows: RegressionRows, source: str) -> NDArray[np.bool_]:
    """Return which rows (N,) are of a record."""
    of = [np.full(int(p.moving[:, i].sum()), p.run.source == source) for p in rows.pieces for i in range(rows.n)]
    return np.concatenate(of)


def warmth(estimate: CoefficientEstimate, friction: Friction, loads: Loads) -> Warmth:
    """Return how friction differs between the records of a fit's rows: sizes, and how they scatter over all joints.

    Friction keeps the form that the fit gave it, and its sizes are free; their scatter is by what they differ beyond
    their errors.
    """
    rows, n = estimate.rows, estimate.rows.n
    sources = sources_of(rows)
    design = with_sizes(held(estimate, friction), (rows, rows), friction, loads, FRICTION_SIZE_SPREAD)
    free = fit(design, rows, rows, estimate.weights)
    errors = dict(zip(design.names, free.errors().tolist(), strict=True))
    names = [[name_of_size(i, k) for k in range(len(sources))] for i in range(n)]
    told = np.array([[name in errors for name in own] for own in names])
    sizes, own_errors = np.zeros(told.shape), np.full(told.shape, np.inf)
    for i, k in zip(*np.nonzero(told), strict=True):
        sizes[i, k], own_errors[i, k] = free[names[i][k]], errors[names[i][k]]
    own_errors[sizes == 0.0] = np.inf  # of a place without friction, or rows
    return Warmth(sources, sizes, own_errors, _scatter(sizes, own_errors))


def held(estimate: CoefficientEstimate, friction: Friction) -> FitDesign:
    """Return the design of an estimate, the coefficients of its friction held where they are."""
    design = estimate.design
    names = {f"{i}.{law.effect}{end}" for i, law, _, _ in friction if _warms(law) for end in ("", f".{law.linear}")}
    at = np.array([name in names for name in design.names])
    return replace(design, mean=np.where(at, estimate.theta, design.mean), sd=np.where(at, 0.0, design.sd))


def _scatter(sizes: Array, errors: Array) -> float:
    """Return by how much sizes (n, R) differ within their rows beyond their errors, as a standard deviation."""
    excess, scale = 0.0, 0.0
    for size, weight in zip(sizes, 1.0 / errors**2, strict=True):
        Q, count = _differences(size, weight)
        if count > 1:
            excess += Q - (count - 1)
            scale += float(weight.sum() - np.sum(weight**2) / weight.sum())
    return float(np.sqrt(max(excess, 0.0) / scale)) if scale > 0.0 else 0.0


def _differences(size: Array, weight: Array) -> tuple[float, int]:
    """Return the weighted squares of sizes (R,) around their mean, and how many there are."""
    total = float(weight.sum())
    mean = float(weight @ size) / total if total > 0.0 else 0.0
    return float(weight @ (size - mean) ** 2), int(np.count_nonzero(weight))


def differing(found: Warmth) -> Iterator[tuple[int, Array]]:
    """Yield the joints whose friction differs between records beyond doubt, with its sizes (R,) beside their mean.

    A record that tells nothing of a joint's friction has nan.
    """
    for i, (size, weight) in enumerate(zip(found.sizes, 1.0 / found.errors**2, strict=True)):
        Q, count = _differences(size, weight)
        if count > 1 and float(chi2.isf(DOUBT, count - 1)) < Q:
            mean = float(weight @ size) / float(weight.sum())
            yield i, np.where(weight > 0.0, (1.0 + size) / (1.0 + mean), np.nan)


__all__ = [
    "Warmth",
    "differing",
    "held",
    "in_record",
    "name_of_size",
    "needed",
    "sources_of",
    "warmth",
    "with_sizes",
    "within",
]
