"""Learns the curve of a `learned_force` from samples of the force that a model lacks.

The knots are chosen one by one where they help most (as in MARS [Friedman 1991, doi:10.1214/aos/1176347963]); how many
there are, and whether the curve jumps at standstill, is decided on blocks of samples that the curve has not seen: the
fewest whose validation error is within a standard error of the best. Samples are binned over the coordinates first, so
that a hundred thousand cost no more than the bins.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from signlin_ros.effects.learned_force import LEARNED_OVER
from signlin_ros.errors import InputError, choices
from signlin_ros.learning.splines import (
    REFINING_STEPS,
    Bins,
    KnotPlan,
    Knots,
    Samples,
    binned,
    curve,
    fitted,
    grown,
    shown,
)

Array = NDArray[np.float64]

SHAPES = ("free", "rising", "dissipative")
"""Any curve; one that only rises with the (first) coordinate; one that only takes energy, over the speed."""
LEARNING_FOLDS = 5
"""Groups of blocks, each of which is left out once."""
DEFAULT_BLOCKS = 10
"""Blocks that samples are divided into, in their order, where none are given."""
MIN_JUMP_ERRORS = 2.0
"""Standard errors by which a jump must lower the validation error."""
MIN_LEARNING_SAMPLES = 20
"""Samples beneath which no curve is learned."""


@dataclass(frozen=True)
class Learned:
    """A learned curve f(over) + jump sign(v), the force on the moving mass being its negative.

    Errors are weighted RMS values in the force's unit: ``before`` is the missing force, ``unseen`` what the curve
    leaves of it in blocks that it has not seen, ``seen`` in all that it was made from. ``counts``: validation error by
    number of values.
    """

    over: str
    knots: Knots
    values: Array
    jump: float
    before: float
    unseen: float
    seen: float
    counts: dict[int, float] = field(default_factory=dict)

    @property
    def explained(self) -> float:
        """Share of the missing force's square that it takes away on what it has not seen; negative: it adds to it."""
        return 1.0 - (self.unseen / self.before) ** 2 if self.before > 0 else 0.0

    def parameters(self) -> dict[str, Any]:
        """Return the parameters of the effect `learned_force`, as ``Model.with_effect`` takes them."""
        second = {"knots_2": self.knots[1].tolist()} if len(self.knots) > 1 else {}
        over = self.over.split(", ")
        return {
            "over": over if len(over) > 1 else over[0],
            "knots": self.knots[0].tolist(),
            **second,
            "values": self.values.tolist(),
            "jump": self.jump,
        }

    def force(self, *at: ArrayLike) -> Array:
        """Return the force on the moving mass (T,) at coordinates (T,) each, in the order of ``over``."""
        columns = [np.asarray(x, dtype=float) for x in at]
        found = -curve(columns, self.knots, self.values)
        names = self.over.split(", ")
        return found - self.jump * np.sign(columns[names.index("speed")]) if "speed" in names else found


def learn(
    coordinates: Mapping[str, ArrayLike],
    force: ArrayLike,
    weights: ArrayLike | None = None,
    blocks: ArrayLike | None = None,
    *,
    shape: str = "free",
    jump: bool | None = None,
) -> Learned:
    """Learn the curve of a missing force.

    Parameters
    ----------
    coordinates : one or two of ``speed``, ``position``, ``load``, each (T,), in SI units.
    force : (T,), the force on the moving mass that the model lacks; what is not finite is left out.
    weights : (T,), of the samples; all alike without it.
    blocks : (T,), whole numbers: samples of a block are left out together. Without it samples in their order are parted
        into ten. Blocks should be longer than what correlates the samples, records for instance.
    shape : one of `SHAPES`.
    jump : whether dry friction, a jump at standstill, is learned with it; None: where it lowers the validation error.

    Raises
    ------
    InputError
        A coordinate or shape that is not known, arrays of different lengths, or too few samples.
    """
    over, samples = _samples(coordinates, force, weights, blocks)
    if shape not in SHAPES or (shape == "dissipative" and over != "speed"):
        allowed = f"{choices(SHAPES)}; dissipative over the speed alone"
        raise InputError(f"shape: found {shape!r} over {over}; allowed: {allowed}")
    straddles = "speed" in over and np.ptp(np.sign(samples.x[over.split(", ").index("speed")])) == 2
    tried = [False, True] if jump is None and straddles else [bool(jump) and bool(straddles)]
    plans = [KnotPlan(over, shape, jumps) for jumps in tried]
    bins = binned(samples, plans[0])
    found = [_learned(plan, bins) for plan in plans]
    return _better(*found) if len(found) > 1 else found[0][1]


# -------------------------------------------------------------------- samples


def _samples(
    coordinates: Mapping[str, ArrayLike], force: ArrayLike, weights: ArrayLike | None, blocks: ArrayLike | None
) -> tuple[str, Samples]:
    over = ", ".join(coordinates)
    if over not in LEARNED_OVER:
        raise InputError(f"coordinates: found {over or 'none'}; allowed: {'; '.join(LEARNED_OVER)}")
    f = -np.asarray(force, dtype=float)
    count = f.size
    x = [np.asarray(c, dtype=float) for c in coordinates.values()]
    w = np.ones(count) if weights is None else np.asarray(weights, dtype=float)
    b = np.arange(count) * DEFAULT_BLOCKS // max(count, 1) if blocks is None else np.asarray(blocks)
    for name, column in (*zip(coordinates, x, strict=True), ("weights", w), ("blocks", b)):
        if column.shape != (count,):
            raise InputError(f"{name}: found shape {column.shape}; allowed: ({count},), that of the force")
    good = np.isfinite(f) & np.isfinite(w) & (w > 0) & np.all(np.isfinite(x), axis=0)
    if good.sum() < MIN_LEARNING_SAMPLES:
        raise InputError(f"force: found {good.sum()} samples that are numbers; allowed: {MIN_LEARNING_SAMPLES} or more")
    _, block = np.unique(b[good], return_inverse=True)
    if block.max() == 0:
        raise InputError("blocks: found one; allowed: two or more, to have some that the curve has not seen")
    return over, Samples(np.array(x)[:, good], f[good], w[good] / w[good].mean(), block % LEARNING_FOLDS)


@dataclass(frozen=True)
class _Tried:
    """Unseen sums of squares (folds, sets) of growing sets of knots, and how many values each has."""

    left: Array
    sizes: list[int]

    def chosen(self) -> int:
        """Return the fewest knots within a standard error of the best, going by the folds' differences."""
        total = self.left.sum(axis=0)
        best = int(np.argmin(total))
        for i in range(best):
            if total[i] - total[best] <= _spread(self.left[:, i] - self.left[:, best]):
                return i
        return best


def _spread(differences: Array) -> float:
    """Return the standard error of a sum of differences (folds,)."""
    return float(np.sqrt(differences.size) * np.std(differences, ddof=1)) if differences.size > 1 else 0.0


def _learned(plan: KnotPlan, bins: Bins) -> tuple[Array, Learned]:
    """Return the unseen sums of squares of each fold and the curve, its number of knots chosen by them."""
    folds = range(len(bins.w))
    rows = [_unseen(bins.without(fold), bins.only(fold), plan) for fold in folds]
    depth = min(len(row) for row in rows)
    left = np.array([row[:depth] for row in rows])
    sets = grown(bins, plan)
    depth = min(depth, len(sets))
    tried = _Tried(left[:, :depth], [int(np.prod([k.size for k in knots])) for knots in sets[:depth]])
    i, weight = tried.chosen(), bins.w.sum()
    knots = sets[i]
    theta = fitted(bins, knots, plan, REFINING_STEPS)

    def rms(square: float) -> float:
        return float(np.sqrt(square / weight))

    counts = {size: rms(float(total)) for size, total in zip(tried.sizes, tried.left.sum(axis=0), strict=True)}
    values, jump = (theta[:-1], float(theta[-1])) if plan.jump else (theta, 0.0)
    seen, unseen = rms(bins.left(shown(bins.x, knots, theta, plan))), rms(float(tried.left[:, i].sum()))
    found = Learned(plan.over, knots, values, jump, rms(float(bins.square.sum())), unseen, seen, counts)
    return tried.left[:, i], found


def _unseen(seen: Bins, unseen: Bins, plan: KnotPlan) -> list[float]:
    """Return the cross-validation errors of growing sets of knots, fitted to some bins, on others."""
    sets = grown(seen, plan)
    steps = 1 if len(seen.x) == 1 else 0  # of a surface, refining takes long and changes little
    return [unseen.left(shown(unseen.x, knots, fitted(seen, knots, plan, steps), plan)) for knots in sets]


def _better(smooth: tuple[Array, Learned], jumping: tuple[Array, Learned]) -> Learned:
    """Return the curve without a jump, unless one with it is better by more than a standard error."""
    gained, told = smooth[0] - jumping[0], jumping[1].explained > 0
    return jumping[1] if told and gained.sum() > MIN_JUMP_ERRORS * _spread(gained) else smooth[1]


__all__ = ["SHAPES", "Learned", "learn"]
