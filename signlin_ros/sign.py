r"""sign_j: the rational approximation of the scalar sign function, and its relatives.

    sign_j(z) = ((1 + z)^j - (1 - z)^j) / ((1 + z)^j + (1 - z)^j)

As written this overflows for j of a few hundred. With b = |z| inside the unit interval and b = 1/|z| outside it,

    |sign_j(z)| = tanh(j artanh b)      (|z| <= 1, or j even)
                  coth(j artanh b)      (|z| > 1 and j odd)

which is evaluated here through q = ((1 - b)/(1 + b))^j. For even j the approximation falls off again at large
\|z\|, for odd j it grows without bound, so every use has a validity range: see `in_valid_range`.

Source: *Linearization Modeling for Non-smooth Dynamical Systems with Approximated Scalar Sign Function*, part II;
Shieh, Tsay and Yates, Some properties of matrix sign functions derived from continued fractions,
IEE Proc. D 130 (1983).
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from signlin_ros.errors import InputError

MAX_ORDER = 10_000
"""Largest order j that is accepted."""


class _NumpyOps:
    """The elementwise vocabulary that the formulas below need, on NumPy arrays."""

    abs, log, log1p, exp, expm1, sign, where = np.abs, np.log, np.log1p, np.exp, np.expm1, np.sign, np.where
    either = np.logical_or


class _CasadiOps:
    """The same vocabulary on CasADi expressions."""

    abs, log, log1p, exp, expm1, sign = ca.fabs, ca.log, ca.log1p, ca.exp, ca.expm1, ca.sign
    either = ca.logic_or

    @staticmethod
    def where(condition: Any, yes: Any, no: Any) -> Any:
        """Return ``yes`` where the condition holds; a NaN in the other branch does no harm."""
        return ca.if_else(condition, yes, no)


def _ratio_power(ops: Any, b: Any, order: int) -> Any:
    """Return ((1 - b)/(1 + b))^order for 0 <= b <= 1."""
    return ops.exp(order * (ops.log1p(-b) - ops.log1p(b)))


def _value(ops: Any, z: Any, order: int) -> Any:
    a = ops.abs(z)
    outside = a > 1
    b = ops.where(outside, 1 / a, a)
    q = _ratio_power(ops, b, order)
    fall = -ops.expm1(order * (ops.log1p(-b) - ops.log1p(b)))  # 1 - q
    inner = fall / (1 + q)
    if order % 2:
        return ops.sign(z) * ops.where(outside, (1 + q) / ops.where(outside, fall, 1), inner)
    return ops.sign(z) * inner


def _slope(ops: Any, z: Any, order: int) -> Any:
    """D sign_j / dz = 4 j r^(j-1) / ((1+a)(1+r^j))^2, with r = (1-a)/(1+a): no pole at a = 1."""
    a = ops.abs(z)
    outside = a > 1
    b = ops.where(outside, 1 / a, a)
    r_power = _ratio_power(ops, b, order - 1) if order > 1 else 1.0 + 0 * b
    q = _ratio_power(ops, b, order)
    fall = -ops.expm1(order * (ops.log1p(-b) - ops.log1p(b)))
    inner = 4 * order * r_power / ((1 + b) * (1 + q)) ** 2
    if order == 1:
        return inner
    if order % 2:
        outer = 4 * order * r_power * (b / ops.where(outside, (1 + b) * fall, 1)) ** 2
    else:
        outer = -4 * order * r_power * (b / ((1 + b) * (1 + q))) ** 2
    return ops.where(outside, outer, inner)


def check_order(order: int) -> int:
    """Return the order as an int; raise `InputError` unless it is a whole number from 1 to 10,000."""
    if isinstance(order, bool) or int(order) != order or not 1 <= order <= MAX_ORDER:
        raise InputError(f"sign_order is {order!r}; allowed: a whole number from 1 to {MAX_ORDER}")
    return int(order)


def _check_scale(scale: float) -> float:
    if not (scale > 0 and np.isfinite(scale)):
        raise InputError(f"sign_scale is {scale!r}; allowed: a positive finite number")
    return float(scale)


def _numpy(formula: Any, v: ArrayLike, order: int, scale: float) -> NDArray[np.float64]:
    check_order(order)
    with np.errstate(all="ignore"):
        z = np.asarray(v, dtype=float) / _check_scale(scale)
        out = formula(_NumpyOps, z, order)
    return np.asarray(np.where(np.isfinite(z), out, np.nan) if not np.all(np.isfinite(z)) else out)


def sign_j(v: ArrayLike, order: int, scale: float = 1.0) -> NDArray[np.float64]:
    """Return sign_j(v / scale), elementwise, for any real ``v``; NaN where ``v / scale`` is not finite.

    Raises `InputError` for an order outside 1 ... 10,000 or a scale that is not positive.
    """
    return _numpy(_value, v, order, scale)


def sign_j_slope(v: ArrayLike, order: int, scale: float = 1.0) -> NDArray[np.float64]:
    """Return the derivative of sign_j(v / scale) with respect to ``v``, elementwise; order/scale at v = 0."""
    return _numpy(_slope, v, order, scale) / scale


def sign_j_expression(z: Any, order: int) -> tuple[Any, Any]:
    """Return sign_j(z) and its derivative as CasADi expressions of the expression ``z``."""
    return _value(_CasadiOps, z, order), _slope(_CasadiOps, z, order)


def sign_j_change(z: Any, z0: Any, dz: Any, order: int) -> Any:
    """Return sign_j(z) - sign_j(z0) as a CasADi expression that does not cancel; ``dz`` is z - z0, known exactly.

    With X = artanh z, artanh z - artanh z0 = artanh(dz / (1 - z z0)) and tanh X - tanh Y = tanh(X - Y)(1 - tanh X
    tanh Y); the same identities hold for pairs outside the unit interval and for coth. Where z and z0 are far apart
    the values differ by O(1), and plain subtraction is exact enough.
    """
    s, s0 = _value(_CasadiOps, z, order), _value(_CasadiOps, z0, order)
    near = ca.logic_and(ca.fabs(dz) < 0.25 * ca.fabs(1 - z * z0), (1 - z * z) * (1 - z0 * z0) > 0)
    w = ca.if_else(near, dz / (1 - z * z0), 0)
    step = ca.tanh(order * 0.5 * (ca.log1p(w) - ca.log1p(-w)))
    return ca.if_else(near, step * (1 - s * s0), s - s0)


def valid_reach(order: int) -> float:
    """Return the |z| up to which sign_j(z) stands for the sign: j/3, or 1, below which only the slope matters.

    Orders below 8 may stand for it in places beyond: see `valid_surface`.
    """
    return max(order / 3, 1.0)


def _valid(ops: Any, z: Any, order: int) -> Any:
    near = ops.abs(z) <= valid_reach(order)
    if order >= 8:
        return near
    return ops.either(near, ops.abs(1 - ops.abs(_value(ops, z, order))) <= 0.005)


def valid_surface(z: ArrayLike, order: int) -> NDArray[np.bool_]:
    """Tell where sign_j(z) stands for the sign, z = g/scale; elementwise, False where z is not finite.

    True where |z| <= j/3, or |1 - |sign_j|| <= 0.005 for j < 8, or |z| <= 1 (only the slope at zero matters).
    """
    with np.errstate(all="ignore"):
        return np.asarray(_valid(_NumpyOps, np.asarray(z, dtype=float), check_order(order)))


def valid_expression(z: Any, order: int) -> Any:
    """Return `valid_surface` as a CasADi expression, 1 or 0, of the expression ``z``."""
    return _valid(_CasadiOps, z, order)
