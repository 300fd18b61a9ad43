"""The force residual as a regression: base parameters within their tolerances, laws beside them.

theta = argmin |y - X theta|^2 + sum ((theta_i - 0) / spread_i)^2 s^2, with s the size of what is left; base parameters
count by their relative change, effort and motion may be stamped apart by half a sample. Standard errors are those of
blocks of time, which need no white residual [Liang and Zeger, Biometrika 73 (1986) 13].
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.equations import inertia
from signlin_ros.comparison.force_segment import (
    MAX_STAMP_DISTANCE,
    MIN_DRIVING_PART,
    ForceSegment,
    asked_effort,
    missing_force,
)
from signlin_ros.diagnosis.blocks import MIN_DIVISOR, mean_t_ratio
from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.equation_error.laws import LawRegressor, Shape
from signlin_ros.fitting.candidate import KNOWN_EFFECT
from signlin_ros.model import Model

Array = NDArray[np.float64]
Member = tuple[str, Shape]
"""A law of a set: its name, and its shape."""

DERIVATIVE_STEP = 1e-4
"""Relative step of the derivative with respect to a parameter."""
MAX_BOUND_ROUNDS = 9
"""Most rounds in which coefficients beyond their bounds are held there."""


def scaling(current: bool) -> tuple[str, ...]:
    """Return the parameters that only scale the measured effort: a ``current``, or a voltage."""
    return ("K_t",) if current else ("K_t", "R_a", "L_a")


def base_of(model: Model, current: bool) -> dict[str, float]:
    """Return the parameters that the base columns move, and their relative tolerances.

    What only scales the measured effort is left out: the effort must not explain itself. Its tolerance goes to what it
    scales. ``current``: whether a motor's current is measured.
    """
    scales = scaling(current)
    scale = np.hypot.reduce([0.0, *(model.tolerance_of(n) for n in scales if n in model.parameters)])
    spread = {n: model.tolerance_of(n) for n, value in model.parameters.items() if n not in scales and value}
    found = {n: float(np.hypot(one, scale)) for n, one in spread.items() if one}
    for key, use in model.effects.items():
        found |= {f"{key}.{n}": KNOWN_EFFECT for n, v in use.parameters.items() if isinstance(v, float) and v}
    return {n: one for n, one in found.items() if n in model.trace.parameters}


@dataclass(frozen=True)
class RegressionData:
    """Training or validation records, stacked: force residual y (K,) in N or N·m, base columns X (K, n_base), the force
    per relative change of each parameter; block of each sample (K,).

    ``effort``: RMS of what drives, that forces are compared with; of the inertial force where nothing does (``free``).
    """

    pieces: tuple[ForceSegment, ...]
    y: Array
    X: Array
    blocks: NDArray[np.intp]
    effort: float
    free: bool = False

    @classmethod
    def of(cls, model: Model, pieces: Sequence[ForceSegment], moved: Iterable[str]) -> RegressionData:
        """Return the regression of one side's records; ``moved``: parameters of the base columns, lateness beside."""
        y, X, effort = (np.concatenate(parts) for parts in zip(*(_rows(model, p, moved) for p in pieces), strict=True))
        before = np.cumsum([0, *(p.blocks.max() + 1 for p in pieces)])
        blocks = np.concatenate([p.blocks + count for p, count in zip(pieces, before, strict=False)])
        free = not np.any(effort)
        if free:
            effort = np.concatenate([p.seen(p.acceleration) for p in pieces]) * inertia(model)
        return cls(tuple(pieces), y, X, blocks, float(np.sqrt(np.mean(effort**2))), free)

    def columns(self, law: LawRegressor, shape: Shape) -> Array:
        """Return the columns (K, c) of a law."""
        return np.vstack([law.columns(p, shape) for p in self.pieces])

    @property
    def noise_mse(self) -> float:
        """Mean square of the force residual that the sensors' noise alone makes, in N² or (N·m)²."""
        return float(np.mean([p.noise**2 for p in self.pieces]))

    @property
    def travel(self) -> float:
        """How far a record goes at most."""
        return max(float(np.ptp(p.q)) for p in self.pieces)

    def later(self, seconds: float) -> RegressionData:
        """Return the same records with every input later by some seconds; base columns and effort stay."""
        return replace(self, pieces=tuple(p.with_later_inputs(seconds) for p in self.pieces))

    @property
    def late(self) -> Array:
        """What the effort (K,) changes by if it is stamped a sample late."""
        return np.concatenate([p.seen(p.late) for p in self.pieces])

    def split(self, values: Array) -> list[Array]:
        """Return values (K,) by record."""
        return list(np.split(values, np.cumsum([p.kept.size for p in self.pieces])[:-1]))

    def mse_by_block(self, left: Array) -> Array:
        """Return the mean squares (blocks,) of what is left (K,)."""
        return np.asarray(np.bincount(self.blocks, left**2) / np.bincount(self.blocks))

    def force_residual(self, model: Model) -> Array:
        """Return the force (K,) that a model lacks, as the effort that it asks for."""
        return np.concatenate([asked_effort(model, p) for p in self.pieces])


def _rows(model: Model, piece: ForceSegment, moved: Iterable[str]) -> tuple[Array, Array, Array]:
    """Return the missing force (K,), its change by each base parameter (K, n_base) and the effort (K,) of a piece."""
    y = missing_force(model, piece)
    others = [model.with_parameters({name: model.value(name) * (1 + DERIVATIVE_STEP)}) for name in moved]
    columns = [(y - missing_force(other, piece)) / DERIVATIVE_STEP for other in others]
    seen = piece.seen(np.column_stack([y, *columns, piece.late, piece.effort]))
    return seen[:, 0], seen[:, 1:-1], seen[:, -1]


@dataclass(frozen=True, eq=False)
class RegressionFit:
    """A fitted set of laws: coefficients ``theta`` (n,), n_base of the base (relative changes) and those of the laws in
    their own units; ``training_residual`` (K,) in N or N·m; ``n_parameters``: free ones of the laws. Validation
    residual and covariance are computed at their first use.
    """

    members: tuple[Member, ...]
    theta: Array
    training_residual: Array
    _validation_residual: Callable[[], Array] = field(repr=False)
    _covariance: Callable[[], Array] = field(default=lambda: np.zeros((0, 0)), repr=False)
    spans: Mapping[str, slice] = field(default_factory=dict)
    n_parameters: int = 0

    @functools.cached_property
    def validation_residual(self) -> Array:
        """Residual (K,) of validation data in N or N·m."""
        return self._validation_residual()

    @functools.cached_property
    def covariance(self) -> Array:
        """Covariance (n, n) of the coefficients."""
        return self._covariance()

    @property
    def std(self) -> Array:
        """Standard errors (n,) of the coefficients, inf at a bound."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def names(self) -> frozenset[str]:
        """The laws in it."""
        return frozenset(n for n, _ in self.members)

    @functools.cached_property
    def training_mse(self) -> float:
        """Mean square of the training residual."""
        return float(np.mean(self.training_residual**2))

    @functools.cached_property
    def validation_mse(self) -> float:
        """Mean square of the validation residual."""
        return float(np.mean(self.validation_residual**2))


@dataclass(frozen=True, eq=False)
class Regression:
    """Records, the laws that may be missing, and how sets of laws are fitted to them.

    ``names`` of the base columns, and the prior standard deviations ``prior_std`` (n_base,) of their coefficients;
    ``current``: whether a motor's current is measured.
    """

    model: Model
    laws: Mapping[str, LawRegressor]
    training: RegressionData
    validation: RegressionData
    names: tuple[str, ...]
    prior_std: Array
    criteria: Criteria
    current: bool

    @property
    def visible_mse(self) -> float:
        """Mean square from which on a residual of validation data is seen above the sensors' noise."""
        return float(self.criteria.min_force_over_noise**2 * self.validation.noise_mse)

    @property
    def n_base(self) -> int:
        """Number of base columns."""
        return len(self.names)

    def fitted(self, members: Sequence[Member]) -> RegressionFit:
        """Return the least-squares fit of a set of laws to the training data."""
        members = tuple(members)
        X = self._matrix(self.training, members)
        spread, floor, ceiling = (np.full(X.shape[1], value) for value in (np.inf, -np.inf, np.inf))
        spread[: self.n_base], floor[: self.n_base] = self.prior_std, np.expm1(-3 * np.minimum(self.prior_std, 50.0))
        floor[self.n_base - 1], ceiling[self.n_base - 1] = -MAX_STAMP_DISTANCE, MAX_STAMP_DISTANCE
        spans, at = {}, self.n_base
        for n, shape in members:
            positive = self.laws[n].positive(shape)
            spans[n] = slice(at, at + len(positive))
            floor[spans[n]] = np.where(positive, 0.0, -np.inf)
            at += len(positive)
        theta, held, size, left = _bounded(self.training.y, X, spread, floor, ceiling)

        def as_effort(side: RegressionData, left: Array) -> Array:
            part = np.ones_like(left)
            for n, shape in members:
                if self.laws[n].follows_effort:
                    part += np.concatenate([self.laws[n].loads(p, shape) @ theta[spans[n]] for p in side.pieces])
            return left / np.maximum(part, MIN_DRIVING_PART)

        def unseen() -> Array:
            return as_effort(self.validation, self.validation.y - self._matrix(self.validation, members) @ theta)

        def covariance() -> Array:
            return _covariance(self.training, self._matrix(self.training, members), spread, held, size, left)

        cost = sum(self.laws[n].free(shape) for n, shape in members)
        return RegressionFit(members, theta, as_effort(self.training, left), unseen, covariance, spans, cost)

    def _matrix(self, side: RegressionData, members: Sequence[Member]) -> Array:
        """Return the base columns and those of laws, side by side (K, n)."""
        return np.hstack([side.X, *(side.columns(self.laws[n], z) for n, z in members)])

    def surely(self, a: RegressionFit, b: RegressionFit) -> float:
        """Return the t ratio by which a leaves less than b of validation data, over blocks of time."""
        v = self.validation
        first, second = (np.bincount(v.blocks, f.validation_residual**2).astype(float) for f in (a, b))
        return mean_t_ratio(second, first, np.asarray(v.noise_mse * np.bincount(v.blocks), dtype=np.float64))

    def alike(self, best: RegressionFit, f: RegressionFit) -> bool:
        """Tell whether a fit is as good as a better one on validation data."""
        c = self.criteria
        return self.surely(best, f) < c.tie_t or f.validation_mse < (1 + c.visible_change) ** 2 * best.validation_mse

    def least_that_suffices(self, fits: Sequence[RegressionFit]) -> RegressionFit:
        """Return the fit of the fewest parameters of those within a standard error or 1 % RMS of the best one."""
        best = min(fits, key=lambda f: f.validation_mse)
        near = [f for f in fits if f is best or self.alike(best, f)]
        return min(near, key=lambda f: (f.n_parameters, f.validation_mse))

    def percent(self, fit: RegressionFit) -> float:
        """Return the force that is left of validation data in per cent of the effort (RMS)."""
        return 100.0 * float(np.sqrt(fit.validation_mse)) / max(self.validation.effort, MIN_DIVISOR)


def _bounded(
    y: Array, X: Array, spread: Array, floor: Array, ceiling: Array
) -> tuple[Array, NDArray[np.bool_], float, Array]:
    """Return coefficients (n,) between ``floor`` and ``ceiling``, which of them are held there, the size of what is
    left by which tolerances weighed in the last round, and what is left (K,).
    """
    scale = np.sqrt(np.mean(X**2, axis=0)) + MIN_DIVISOR
    theta, held = np.zeros(X.shape[1]), np.zeros(X.shape[1], dtype=bool)
    new, beyond = float(np.sqrt(np.mean(y**2))) + MIN_DIVISOR, ~held
    for sweep in range(MAX_BOUND_ROUNDS):
        if beyond.any():
            free = ~held
            Z = X[:, free] / scale[free]
            gram, side = Z.T @ Z, Z.T @ (y - X[:, held] @ theta[held])
        size = new
        theta[free] = np.linalg.solve(gram + np.diag(precision(spread, scale, size, y.size)[free]), side) / scale[free]
        left = y - X @ theta
        new = float(np.sqrt(np.mean(left**2))) + MIN_DIVISOR
        beyond = free & ((theta < floor) | (theta > ceiling))
        if beyond.any() and sweep < MAX_BOUND_ROUNDS - 1:
            theta, held = np.clip(theta, floor, ceiling), held | beyond
        elif sweep >= 2:
            break
    return theta, ~free, size, left


def precision(spread: Array, scale: Array, size: float, n: int) -> Array:
    """Return the prior information (c,) on coefficients of scaled columns, where n samples leave a ``size``."""
    known = np.minimum(size / (spread * scale + MIN_DIVISOR), 1e9)  # a column may be nothing but zeros
    return np.where(np.isfinite(spread), np.minimum(known**2, 1e12 * n), 1e-9 * n)


def _covariance(
    side: RegressionData, X: Array, spread: Array, held: NDArray[np.bool_], size: float, left: Array
) -> Array:
    """Return the covariance (n, n) of what `_bounded` fitted; inf for what is held at a bound."""
    free, n = ~held, side.y.size
    scale = np.sqrt(np.mean(X**2, axis=0)) + MIN_DIVISOR
    Z, known = X[:, free] / scale[free], precision(spread, scale, size, n)[free]
    scores = np.zeros((int(side.blocks.max()) + 1, int(free.sum())))
    np.add.at(scores, side.blocks, Z * left[:, None])
    inverse = np.linalg.inv(Z.T @ Z + np.diag(known))
    prior = np.diag(np.where(np.isfinite(spread[free]), known * np.mean(left**2), 0.0))
    covariance = inverse @ (scores.T @ scores + prior) @ inverse
    every = np.zeros((X.shape[1], X.shape[1]))
    every[held, held] = np.inf
    with np.errstate(over="ignore"):  # nothing is known of what moves nothing
        every[np.ix_(free, free)] = covariance / scale[free] / scale[free, None]
    return every


__all__ = [
    "Member",
    "Regression",
    "RegressionData",
    "RegressionFit",
    "base_of",
    "precision",
    "scaling",
]
