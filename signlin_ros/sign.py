r"""sign_j: the rational approximation of the scalar sign function, and its relatives.

    sign_j(z) = ((1 + z)^j - (1 - z)^j) / ((1 + z)^j + (1 - z)^j)

As written this overflows for j of a few hundred. With b = z inside the unit interval and b = 1/z outside it,

    sign_j(z) = tanh(j artanh b)      (|z| <= 1, or j even)
                coth(j artanh b)      (|z| > 1 and j odd)

which is evaluated here by the addition theorem of tanh, in about log2 j steps without a transcendental function:

    sign_{j+k} = (sign_j + sign_k) / (1 + sign_j sign_k). For even j the approximation falls off again at large
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

    abs, where, either = np.abs, np.where, np.logical_or

    @staticmethod
    def clip(s: Any) -> Any:
        """Take off the last bit beyond 1 that rounding may leave."""
        return np.clip(s, -1.0, 1.0)


class _CasadiOps:
    """The same vocabulary on CasADi expressions."""

    abs, either = ca.fabs, ca.logic_or

    @staticmethod
    def where(condition: Any, yes: Any, no: Any) -> Any:
        """Return ``yes`` where the condition holds; a NaN in the other branch does no harm."""
        return ca.if_else(condition, yes, no)

    @staticmethod
    def clip(s: Any) -> Any:
        """Take off the last bit beyond 1 that rounding may leave."""
        return ca.fmin(ca.fmax(s, -1.0), 1.0)


def _inside(ops: Any, b: Any, fall: Any, order: int) -> tuple[Any, Any]:
    """Return s = sign_j(b) and (ds/db)/j for |b| <= 1: from 1 to j by doubling and adding 1; no sum in it cancels.

    ``fall`` is 1 - b^2, to all its digits. With e = (1 - s^2)/(1 - b^2), which is (ds/db)/j, the step from j to j + k
    is, beside that of s above, e_{j+k} = (1 - b^2) e_j e_k / (1 + s_j s_k)^2.
    """
    s, e = b, 1.0 + 0 * b
    for digit in bin(order)[3:]:
        part = 1 / (1 + s * s)
        s, e = 2 * s * part, fall * (e * part) ** 2
        if digit == "1":
            part = 1 / (1 + s * b)
            s, e = (s + b) * part, fall * e * (part * part)
    return ops.clip(s), e


def _value_and_slope(ops: Any, z: Any, order: int) -> tuple[Any, Any]:
    outside = ops.abs(z) > 1
    b = ops.where(outside, 1 / z, z)
    fall = ops.where(outside, ((z - 1) * b) * ((z + 1) * b), (1 - z) * (1 + z))
    s, e = _inside(ops, b, fall, order)
    if order == 1:
        return z, e
    if order % 2:
        t = ops.where(outside, s, 1)
        return ops.where(outside, 1 / t, s), order * e * ops.where(outside, (b / t) ** 2, 1)
    return s, order * e * ops.where(outside, -b * b, 1)


def _value(ops: Any, z: Any, order: int) -> Any:
    return _value_and_slope(ops, z, order)[0]


def _slope(ops: Any, z: Any, order: int) -> Any:
    return _value_and_slope(ops, z, order)[1]


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
    """Return the rational approximation sign_j(v / scale) of sign(v).   [paper eq. (3)]

    Parameters
    ----------
    v : array_like
        Any real numbers.
    order : int
        j, 1 to 10,000.
    scale : float
        Positive, in the unit of ``v``; sign_j is within 0.5 % of sign for scale << |v| <= scale j/3.

    Returns
    -------
    ndarray
        Values of the shape of ``v``; NaN where ``v / scale`` is not finite.

    Raises
    ------
    InputError
        The order or the scale is out of range.

    Examples
    --------
    >>> float(sign_j(2.0, 50))
    1.0
    """
    return _numpy(_value, v, order, scale)


def sign_j_slope(v: ArrayLike, order: int, scale: float = 1.0) -> NDArray[np.float64]:
    """Return the derivative of sign_j(v / scale) with respect to ``v``, elementwise; order/scale at v = 0."""
    return _numpy(_slope, v, order, scale) / scale


def sign_j_expression(z: Any, order: int) -> tuple[Any, Any]:
    """Return sign_j(z) and its derivative as CasADi expressions of the expression ``z``."""
    return _value_and_slope(_CasadiOps, z, order)


def sign_j_change(z: Any, z0: Any, dz: Any, order: int) -> Any:
    """Return sign_j(z) - sign_j(z0) as a CasADi expression that does not cancel; ``dz`` is z - z0, known exactly.

    With X = artanh z, artanh z - artanh z0 = artanh(dz / (1 - z z0)) and tanh X - tanh Y = tanh(X - Y)(1 - tanh X
    tanh Y); the same identities hold for pairs outside the unit interval and for coth. Where z and z0 are far apart
    the values differ by O(1), and plain subtraction is exact enough.
    """
    s, s0 = _value(_CasadiOps, z, order), _value(_CasadiOps, z0, order)
    near = ca.logic_and(ca.fabs(dz) < 0.25 * ca.fabs(1 - z * z0), (1 - z * z) * (1 - z0 * z0) > 0)
    w = ca.if_else(near, dz / (1 - z * z0), 0)
    step, _ = _inside(_CasadiOps, w, 1.0, order)
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
