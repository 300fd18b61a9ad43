"""Weighted least squares over the rows of all joints, with a prior at the URDF for what is inertial.

Each joint's rows are weighted by what is left of them (IDIM-WLS); without priors, a payload is swallowed by links of
any mass.   [Gautier and Poignet, Control Engineering Practice 9(12), 2001]
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.piece import RegressionRows
from signlin_ros.robots import Robot
from signlin_ros.robots.inertia import INERTIAL_NAMES, TEN

Array = NDArray[np.float64]
LEAST_MASS, LEAST_INERTIA = 0.05, 1e-3
"""kg and kg·m² of a body of which a prior is relative to no less."""
OFFSET, SPREAD = 0.12, 0.003
"""m by which centres of mass are off, and kg·m² per kg, at a tolerance of one."""
WEIGHT_ROUNDS = 4
"""Times that the weights are worked out anew."""
IN_RECORD = ".size_in_record."
"""Within the names of columns that are a record's own: how large its friction is beside that of all records."""
LEAST_LEFT = 1e-6
"""Part of a row that its own block leaves to others, at least: what one block alone tells has no error otherwise."""
RIDGE = 1e-9
"""Of the largest column: what no column tells from another stays where it was."""


def prior(robot: Robot, tolerance: float) -> Array:
    """Return standard deviations (10 n,) of the inertial parameters around those of the URDF.

    A body of which the URDF says nothing may be as heavy as the heaviest one.
    """
    heaviest = max((joint.pi for joint in robot.joints), key=lambda pi: float(pi[0]))
    found = []
    for own in (joint.pi for joint in robot.joints):
        pi, part = (own, tolerance) if own[0] > 0.0 or heaviest[0] <= 0.0 else (heaviest, 1.0)
        m = max(float(pi[0]), LEAST_MASS)
        moment = OFFSET * m + np.abs(pi[1:4]).max()
        inertia = 2.5 * max(float(np.abs(pi[4:]).max()), LEAST_INERTIA) + 10 * SPREAD * m
        found += [part * sd for sd in (m, *[moment] * 3, *[inertia] * 6)]
    return np.array(found)


class Products:
    """Products of columns joint by joint: ``G`` (n, k, k) of columns, ``b`` (n, k) of columns and the effort."""

    def __init__(self, X: Array, rows: RegressionRows) -> None:
        self.at = [np.flatnonzero(rows.joint == i) for i in range(rows.n)]
        self.G = np.stack([X[at].T @ X[at] for at in self.at])
        self.b = np.stack([X[at].T @ rows.y[at] for at in self.at])

    def plus(self, X: Array, C: Array, rows: RegressionRows) -> Products:
        """Return the products of columns X (N, k), which these are of, with more columns C (N, c) beside them."""
        other = copy(self)
        P = np.stack([X[at].T @ C[at] for at in self.at])
        S = np.stack([C[at].T @ C[at] for at in self.at])
        other.G = np.concatenate(
            [np.concatenate([self.G, P], axis=2), np.concatenate([np.swapaxes(P, 1, 2), S], axis=2)], axis=1
        )
        other.b = np.concatenate([self.b, np.stack([C[at].T @ rows.y[at] for at in self.at])], axis=1)
        return other


@dataclass(frozen=True, eq=False)
class FitDesign:
    """Columns of a regression on the rows of a fit and on unseen ones, each with a prior.

    ``known`` (N, k), ``unseen`` (M, k); ``mean`` and ``sd`` (k,), infinite where nothing is known before. Products of
    columns are worked out once, and only those of new ones when there are more: ``before`` is the design of the first
    of these columns whose products are known.
    """

    names: tuple[str, ...]
    known: Array
    unseen: Array
    mean: Array
    sd: Array
    before: FitDesign | None = field(default=None, repr=False)
    worked: dict[int, Products] = field(default_factory=dict, repr=False)

    def plus(
        self, names: tuple[str, ...], known: Array, unseen: Array, mean: float = 0.0, sd: float = np.inf
    ) -> FitDesign:
        """Return a design with more columns, of one prior."""
        k = len(names)
        return FitDesign(
            (*self.names, *names),
            np.concatenate([self.known, known], axis=1),
            np.concatenate([self.unseen, unseen], axis=1),
            np.concatenate([self.mean, np.full(k, mean)]),
            np.concatenate([self.sd, np.full(k, sd)]),
            self if self.worked else self.before,
        )

    def products(self, rows: RegressionRows) -> Products:
        """Return the products of the columns on the rows of the fit."""
        found = self.worked.get(id(rows))
        if found is None:
            before = self.before
            if before is not None and id(rows) in before.worked:
                k = len(before.names)
                found = before.worked[id(rows)].plus(before.known, self.known[:, k:], rows)
            else:
                found = Products(self.known, rows)
            self.worked[id(rows)] = found
        return found

    def without(self, *names: str) -> FitDesign:
        """Return a design without some columns."""
        keep = np.array([name not in names for name in self.names])
        kept = tuple(name for name in self.names if name not in names)
        return FitDesign(kept, self.known[:, keep], self.unseen[:, keep], self.mean[keep], self.sd[keep])

    def swapped(self) -> FitDesign:
        """Return the design with its two sides exchanged."""
        before = None if self.before is None else self.before.swapped()
        return replace(self, known=self.unseen, unseen=self.known, before=before)

    def at(self, name: str) -> int:
        """Return the place of a column."""
        return self.names.index(name)


@dataclass(frozen=True, eq=False)
class CoefficientEstimate:
    """A fitted design: ``theta`` (k,), its curvature ``G`` (k, k), residuals, and the weights (n,) of the joints."""

    design: FitDesign
    theta: Array
    G: Array
    residual: Array
    weights: Array
    rows: RegressionRows = field(repr=False)
    new: RegressionRows = field(repr=False)

    def __getitem__(self, name: str) -> float:
        return float(self.theta[self.design.at(name)])

    @property
    def pi(self) -> Array:
        """The inertial parameters (10 n,)."""
        return self.theta[: TEN * self.rows.n]

    @property
    def unseen(self) -> Array:
        """What is left of unseen rows (M,)."""
        return self.new.y - self.design.unseen @ self.theta

    @property
    def known_rms(self) -> Array:
        """RMS of what is left of the rows of the fit, joint by joint (n,)."""
        return self.rows.by_joint(self.residual)

    @property
    def rms(self) -> Array:
        """RMS of what is left of unseen rows, joint by joint (n,)."""
        return self.new.by_joint(self.unseen)

    @property
    def matched(self) -> Array:
        """The coefficients (k,) with which unseen records are as they were: the size of their friction is their own.

        A record does not tell how warm it was before it is seen; all else stays as the fit has it.
        """
        own = np.array([IN_RECORD in name for name in self.design.names])
        if not own.any():
            return self.theta
        w = self.weights[self.new.joint]
        C, r = self.design.unseen[:, own] * w[:, None], self.unseen * w
        theta: Array = self.theta.copy()
        theta[own] += np.linalg.solve(self.G[np.ix_(own, own)] + C.T @ C, C.T @ r)
        return theta

    @property
    def matched_unseen(self) -> Array:
        """What is left of unseen rows (M,) where their records' friction is as large as it was."""
        return np.asarray(self.new.y - self.design.unseen @ self.matched)

    @property
    def matched_rms(self) -> Array:
        """RMS of that, joint by joint (n,)."""
        return np.asarray(self.new.by_joint(self.matched_unseen))

    @property
    def tension(self) -> float:
        """Mean square distance of the inertial parameters from their priors, in standard deviations."""
        sd = self.design.sd[: TEN * self.rows.n]
        finite = np.isfinite(sd) & (sd > 0)
        away = (self.pi - self.design.mean[: TEN * self.rows.n])[finite] / sd[finite]
        return float(np.mean(away**2)) if away.size else 0.0

    @property
    def objective(self) -> float:
        """Half the sum of squares of weighted residuals and of distances from the priors."""
        finite = np.isfinite(self.design.sd) & (self.design.sd > 0.0)
        away = (self.theta - self.design.mean)[finite] / self.design.sd[finite]
        weighted = self.residual * self.weights[self.rows.joint]
        return 0.5 * float(weighted @ weighted + away @ away)

    def inverse(self) -> Array:
        """Return the inverse (k, k) of the curvature."""
        scale = 1.0 / np.sqrt(np.diag(self.G))
        return np.asarray(scale[:, None] * np.linalg.inv(self.G * scale[:, None] * scale) * scale)

    def errors(self) -> Array:
        """Return standard errors (k,) that allow for residuals that are alike within a block."""
        return self.errors_along(np.eye(len(self.theta)))

    def errors_along(self, directions: Array) -> Array:
        """Return the same of sums of coefficients, each a row of their factors (m, k)."""
        along = self.inverse() @ directions.T
        robust = np.linalg.norm(self.scores @ along, axis=0)
        return np.asarray(np.maximum(robust, np.sqrt(np.maximum(np.sum(directions.T * along, axis=0), 0.0))))

    @cached_property
    def unabsorbed(self) -> Array:
        """Weighted residuals (N,) as large as the noise of their block, whatever of it the fit absorbed.

        What is left of rows that a fit sees is less than their noise, and most where few blocks tell a coefficient: by
        (I - H)^(1/2), H what a block's own rows make of its fit. (I - H) would be the residuals of rows that the fit
        does not see, too large where few blocks tell.   [CR2 of Bell and McCaffrey, Survey Methodology 28(2), 2002]
        """
        w = self.weights[self.rows.joint]
        index, inside = in_blocks(self.rows.block)
        X = (self.design.known * w[:, None])[index] * inside[:, :, None]
        r = (self.residual * w)[index] * inside
        scale = 1.0 / np.sqrt(np.diag(self.G))
        values, vectors = np.linalg.eigh(self.G * scale[:, None] * scale)
        Z = X @ (scale[:, None] * vectors / np.sqrt(values))  # H = Z Z'
        found = np.empty(len(self.rows.joint))
        found[index[inside]] = (r + _raised(Z, r))[inside]
        return found

    @cached_property
    def scores(self) -> Array:
        """Sums over each block (B, k) of columns times residuals as large as their noise."""
        w = self.weights[self.rows.joint]
        return blocks(self.design.known * (w * self.unabsorbed)[:, None], self.rows.block)


def _raised(Z: Array, r: Array) -> Array:
    """Return ((I - H)^(-1/2) - I) r for r (B, m) and H = Z Z' of Z (B, m, k), by the smaller side of Z."""
    if Z.shape[1] <= Z.shape[2]:
        share, ways = np.linalg.eigh(Z @ np.swapaxes(Z, 1, 2))
        more, along = 1.0 / np.sqrt(np.maximum(1.0 - share, LEAST_LEFT)) - 1.0, np.einsum("bij,bi->bj", ways, r)
        return np.asarray(np.einsum("bij,bj->bi", ways, more * along))
    share, ways = np.linalg.eigh(np.swapaxes(Z, 1, 2) @ Z)
    left = np.sqrt(np.maximum(1.0 - share, LEAST_LEFT))
    more = 1.0 / (left * (1.0 + left))  # (1 / left - 1) / share, also where that is 0
    along = np.einsum("bji,bj->bi", ways, np.einsum("bij,bi->bj", Z, r))
    return np.asarray(np.einsum("bij,bj->bi", Z, np.einsum("bij,bj->bi", ways, more * along)))


def in_blocks(block: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the rows of each block (B, most), and which of them there are; shorter blocks are filled with any row."""
    order = np.argsort(block, kind="stable")
    _, first, count = np.unique(block[order], return_index=True, return_counts=True)
    place = np.arange(int(count.max(initial=0)))
    inside = place[None, :] < count[:, None]
    return order[np.where(inside, first[:, None] + place[None, :], 0)], inside


def blocks(values: Array, block: NDArray[np.int64]) -> Array:
    """Return sums of rows (N, k) over their blocks."""
    count = int(block.max(initial=0)) + 1
    return np.stack([np.bincount(block, column, count) for column in values.T], axis=1)


def fit(
    design: FitDesign, rows: RegressionRows, new: RegressionRows, weights: Array | None = None
) -> CoefficientEstimate:
    """Fit a design; ``weights`` (n,) of the joints are worked out where they are not given."""
    if weights is not None:
        return _solved(design, rows, new, weights)
    found = np.ones(rows.n)
    for _ in range(WEIGHT_ROUNDS):
        left = _solved(design, rows, new, found).known_rms
        found = 1.0 / np.maximum(np.where(rows.counts > 0, np.nan_to_num(left), 1.0), 1e-9)
    return _solved(design, rows, new, found)


def _solved(design: FitDesign, rows: RegressionRows, new: RegressionRows, weights: Array) -> CoefficientEstimate:
    products = design.products(rows)
    precision = np.where(np.isfinite(design.sd), 1.0 / np.maximum(design.sd, 1e-12) ** 2, 0.0)
    data = np.tensordot(weights**2, products.G, axes=1)
    G = data + np.diag(precision)
    size = np.diag(G).copy()
    size[size <= 0.0] = 1.0
    scale = 1.0 / np.sqrt(size)
    scaled = G * scale[:, None] * scale + RIDGE * np.eye(len(size))
    right = weights**2 @ products.b - data @ design.mean
    theta = design.mean + scale * np.linalg.solve(scaled, scale * right)
    G = scaled / scale[:, None] / scale
    return CoefficientEstimate(design, theta, G, rows.y - design.known @ theta, weights, rows, new)


def rigid(
    robot: Robot, tolerance: float, rows: RegressionRows, new: RegressionRows, carried: Array | float = 0.0
) -> FitDesign:
    """Return the rigid body as a design, its parameters near those of the URDF and what it carries (10 n,)."""
    names = tuple(f"{name}.{par}" for name in robot.names for par in INERTIAL_NAMES)
    return FitDesign(names, rows.Y, new.Y, robot.pi + carried, np.maximum(prior(robot, tolerance), 1e-12))


__all__ = ["IN_RECORD", "LEAST_LEFT", "CoefficientEstimate", "FitDesign", "blocks", "fit", "prior", "rigid"]
