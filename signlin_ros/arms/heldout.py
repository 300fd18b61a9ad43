"""What rows that no fit saw say of a law: by themselves, and of what a fit to the others promises for them."""

from __future__ import annotations

from copy import copy

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.fit import LEAST_LEFT, CoefficientEstimate, FitDesign, fit
from signlin_ros.arms.piece import RegressionRows

Array = NDArray[np.float64]
MIN_VALIDATION_ERRORS = 2.5
"""Standard errors, of the same sign, on unseen rows."""
ABOVE_CRAWL = 0.05
"""Part of a joint's fastest speed below which it crawls."""
MIN_UNSEEN_BLOCKS = 6
"""Blocks of unseen rows from which on the scatter between them tells an error."""


def again(trial: CoefficientEstimate, names: tuple[str, ...]) -> bool:
    """Tell whether unseen rows by themselves say the same of the largest of some coefficients of a fit."""
    own, other, errors = _both(trial, names)
    largest = int(np.argmax(np.abs(own[0])))
    return bool(other[largest] * np.sign(own[0][largest]) >= MIN_VALIDATION_ERRORS * errors[largest])


def foretells(before: CoefficientEstimate, trial: CoefficientEstimate, names: tuple[str, ...], joint: int) -> bool:
    """Tell whether what a law changes in the efforts that a fit foretells for unseen rows is there in a joint.

    A short record in which a joint is moved little does not tell its friction from its bodies by itself; it may tell
    that a law known from elsewhere is right. What is left of unseen rows without the law is held against what the law
    changes there, all coefficients being those of the fit: the slope is one if the law is right, nothing if it is not.
    Unseen rows by themselves must not say otherwise.
    [Harvey, Leybourne and Newbold, Journal of Business and Economic Statistics 16(2), 1998]
    """
    return agree(trial, names) and _slope_errors(before, trial, joint) >= MIN_VALIDATION_ERRORS


def agree(trial: CoefficientEstimate, names: tuple[str, ...]) -> bool:
    """Tell whether unseen rows by themselves do not say otherwise of some coefficients than a fit."""
    own, other, errors = _both(trial, names)
    return bool((np.abs(own[0] - other) <= MIN_VALIDATION_ERRORS * np.hypot(own[1], errors)).all())


def foretold_both_ways(before: CoefficientEstimate, trial: CoefficientEstimate) -> Array:
    """Return by what part (n,) the squares of unseen rows fall by a law, and those of the fit foretold from the others.

    Bodies of one motion are wrong for another, with a law that they imitate and without it, by chance in one way more
    than in the other. Of the two ways each row is unseen in one.   [Stone, J. Royal Statistical Society B 36(2), 1974]
    """
    ways = [[e, fit(e.design.swapped(), e.new, e.rows, e.weights)] for e in (before, trial)]
    squares = [[e.new.counts * np.nan_to_num(e.matched_rms) ** 2 for e in pair] for pair in ways]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(1.0 - np.sum(squares[1], axis=0) / np.sum(squares[0], axis=0))


def ratio_on_all(trial: CoefficientEstimate, names: tuple[str, ...]) -> float:
    """Return the largest of some coefficients in standard errors, of a fit to all rows, unseen ones as well.

    A body imitates what a law does in one motion, and hardly in two.
    """
    whole = on_all(trial)
    at = [trial.design.at(name) for name in names]
    return float(np.abs(whole.theta[at] / np.maximum(whole.errors()[at], 1e-300)).max())


def on_all(trial: CoefficientEstimate) -> CoefficientEstimate:
    """Return the fit of the same design to all rows, first those of the fit, then unseen ones, weights as they are."""
    rows, new, design = copy(trial.rows), trial.new, trial.design
    rows.joint, rows.y = np.concatenate([rows.joint, new.joint]), np.concatenate([rows.y, new.y])
    rows.block = np.concatenate([rows.block, new.block + 1 + rows.block.max(initial=0)])
    X = np.concatenate([design.known, design.unseen])
    return fit(FitDesign(design.names, X, X, design.mean, design.sd), rows, rows, trial.weights)


def above_crawl(
    design: FitDesign, both: tuple[RegressionRows, RegressionRows], joint: int
) -> tuple[FitDesign, RegressionRows, RegressionRows]:
    """Return a design and its two sides of rows where a joint's own rows say nothing while it crawls.

    There a law of the speed looks like dry friction that sets in gradually.
    """
    crawl = [(r.joint == joint) & ~r.faster(joint, ABOVE_CRAWL) for r in both]
    known, unseen = (np.where(c[:, None], 0.0, X) for c, X in zip(crawl, (design.known, design.unseen), strict=True))
    rows, new = (_without(r, c) for r, c in zip(both, crawl, strict=True))
    return FitDesign(design.names, known, unseen, design.mean, design.sd), rows, new


def ratio_above_crawl(trial: CoefficientEstimate, names: tuple[str, ...], joint: int) -> float:
    """Return the largest of some coefficients in standard errors, of a fit to all rows above the crawl of a joint."""
    design, rows, new = above_crawl(trial.design, (trial.rows, trial.new), joint)
    return ratio_on_all(fit(design, rows, new, trial.weights), names)


def _without(rows: RegressionRows, left_out: NDArray[np.bool_]) -> RegressionRows:
    """Return rows of which some (N,) say nothing."""
    found = copy(rows)
    found.y = np.where(left_out, 0.0, rows.y)
    return found


def _both(trial: CoefficientEstimate, names: tuple[str, ...]) -> tuple[tuple[Array, Array], Array, Array]:
    """Return coefficients and standard errors (k,) of a fit, then those of unseen rows by themselves."""
    other = fit(trial.design.swapped(), trial.new, trial.rows, trial.weights)
    at = [trial.design.at(name) for name in names]
    return (trial.theta[at], trial.errors()[at]), other.theta[at], np.maximum(other.errors()[at], 1e-300)


def _slope_errors(before: CoefficientEstimate, trial: CoefficientEstimate, joint: int) -> float:
    """Return by how many standard errors the slope of unseen residuals over what a law changes there is positive."""
    own = before.new.joint == joint
    left, block = before.matched_unseen[own], before.new.block[own]
    change = left - trial.matched_unseen[own]
    size = float(change @ change)
    if size <= 0.0 or np.unique(block).size < MIN_UNSEEN_BLOCKS:
        return 0.0
    slope = float(change @ left) / size
    leverage = np.bincount(block, change**2) / size
    score = np.bincount(block, change * (left - slope * change)) / np.maximum(1.0 - leverage, LEAST_LEFT)
    return slope * size / max(float(np.linalg.norm(score)), 1e-300)


__all__ = [
    "MIN_VALIDATION_ERRORS",
    "above_crawl",
    "again",
    "agree",
    "foretells",
    "foretold_both_ways",
    "on_all",
    "ratio_above_crawl",
    "ratio_on_all",
]
