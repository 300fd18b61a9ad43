"""sign_j against 60-digit arithmetic, and its properties for any real argument and every order."""

import casadi as ca
import mpmath
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from signlin_ros.errors import InputError
from signlin_ros.sign import (
    MAX_ORDER,
    sign_j,
    sign_j_change,
    sign_j_expression,
    sign_j_slope,
    valid_expression,
    valid_reach,
    valid_surface,
)

ORDERS = st.integers(1, MAX_ORDER)
REALS = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False),
    st.floats(-3.0, 3.0),
    st.floats(-1e4, 1e4),
    st.sampled_from([0.0, -0.0, 1.0, -1.0, 1e-300, -1e-300, 5e-324, 1e308, -1e308, 1 + 2**-52, 1 - 2**-53]),
)


def digits(z: float, order: int) -> int:
    """Digits with which the definition, which cancels, still gives 20 at z."""
    return 40 + 2 * len(str(order)) + int(abs(mpmath.log10(abs(z)))) if z else 40


def definition(z: float, order: int) -> mpmath.mpf:
    """The paper's formula as it is written."""
    a, b = (1 + mpmath.mpf(z)) ** order, (1 - mpmath.mpf(z)) ** order
    return mpmath.inf if a + b == 0 else (a - b) / (a + b)


def definition_slope(z: float, order: int) -> mpmath.mpf:
    """The derivative of that formula: 4 j (1 - z^2)^(j-1) / ((1+z)^j + (1-z)^j)^2."""
    a, b = 1 + mpmath.mpf(z), 1 - mpmath.mpf(z)
    return 4 * order * (a * b) ** (order - 1) / (a**order + b**order) ** 2


@given(REALS, ORDERS)
@example(1.0, 2)
@example(-1.0, 10_000)
@example(1e308, 9_999)
@example(5e-324, 1)
def test_value_is_the_papers_formula(z, order):
    with mpmath.workdps(digits(z, order)):
        want = definition(z, order)
        found = float(sign_j(z, order))
        if abs(want) > mpmath.mpf("1.7e308"):
            assert abs(found) > 1e308
        else:  # up to 26 steps of three roundings each
            assert abs(found - want) <= 1e-14 * abs(want) + mpmath.mpf("1e-307")


@given(REALS, ORDERS)
@example(1.0, 1)
@example(1.0, 2)
@example(1.0, 3)
@example(-1.0, 7)
@example(0.0, 10_000)
@example(1e308, 10_000)
@example(1.0000000070733184, 7)
def test_slope_is_the_derivative_of_the_papers_formula(z, order):
    with mpmath.workdps(digits(z, order)):
        want = definition_slope(z, order)
        found = float(sign_j_slope(z, order))
        # 1 - z^2, good to a few bits, is raised to the power j - 1
        assert abs(found - want) <= 1e-15 * (order + 5) * abs(want) + mpmath.mpf("1e-300")


@given(REALS, ORDERS)
def test_odd_bounded_and_of_the_sign_of_its_argument(z, order):
    s = float(sign_j(z, order))
    assert sign_j(-z, order) == -s
    assert s * z >= 0
    assert s != 0 or z == 0 or abs(z) < 1e-307 or (order % 2 == 0 and abs(z) > 1e300)
    if abs(z) > 1.7e308:
        return  # order 1 is z itself, and its last bits overflow
    if abs(z) <= 1 or order % 2 == 0:
        assert abs(s) <= 1
    elif order > 1:
        assert 1 <= abs(s) <= abs(z)
    else:
        assert s == pytest.approx(z, rel=1e-14)


@given(REALS, ORDERS)
def test_slope_is_even_and_finite(z, order):
    slope = float(sign_j_slope(z, order))
    assert np.isfinite(slope)
    assert sign_j_slope(-z, order) == slope
    if abs(z) <= 1:
        assert 0 <= slope <= order * (1 + 1e-12)


@pytest.mark.parametrize("order", [1, 2, 3, 50, 51, 9_999, 10_000])
def test_slope_at_zero_is_the_order_over_the_scale(order):
    assert sign_j_slope(0.0, order, 0.25) == pytest.approx(order / 0.25, rel=1e-14)
    assert sign_j(0.0, order, 0.25) == 0.0


@pytest.mark.parametrize(
    ("order", "z", "value"),
    [(50, 20.9, 0.983), (50, 50, 0.76), (50, 100, 0.46), (50, 500, 0.10), (51, 20.9, 1.015)],
)
def test_known_values(order, z, value):
    """The table in the design notes: it falls off for even orders and overshoots for odd ones."""
    assert float(sign_j(z, order)) == pytest.approx(value, abs=0.005)


@given(st.integers(8, MAX_ORDER), st.floats(0.0, 1.0))
def test_valid_range_keeps_the_error_below_half_a_percent(order, part):
    z = 1 + part * max(order / 3 - 1, 0.0)
    assert valid_surface(z, order)
    if np.exp(-2 * order / z) < 1e-3 and order >= 20:
        assert abs(1 - abs(float(sign_j(z, order)))) <= 0.0051
    assert not valid_surface(order / 3 * 1.001 + 1e-9, order)


@pytest.mark.parametrize("order", range(1, 8))
def test_valid_range_at_low_orders(order):
    z = np.linspace(0, 20, 4001)
    want = (z <= order / 3) | (z <= 1) | (np.abs(1 - np.abs(sign_j(z, order))) <= 0.005)
    np.testing.assert_array_equal(valid_surface(z, order), want)


@pytest.mark.parametrize("order", [*range(1, 10), 50, 51, MAX_ORDER])
def test_the_valid_range_is_one_rule_for_numbers_and_expressions(order):
    reach = valid_reach(order)
    z = np.concatenate([np.linspace(-2 * reach, 2 * reach, 2001), [np.nextafter(reach, 0), reach], [1e300, np.inf]])
    symbol = ca.SX.sym("z")
    expression = ca.Function("valid", [symbol], [valid_expression(symbol, order)])
    np.testing.assert_array_equal([bool(expression(one)) for one in z], valid_surface(z, order))
    assert valid_surface(reach, order)
    assert not valid_surface([np.inf, np.nan], order).any()


@given(REALS, ORDERS, st.floats(1e-3, 1e3))
def test_scale_divides_the_argument(v, order, scale):
    if not np.isfinite(v / scale):
        assert np.isnan(sign_j(v, order, scale))
        return
    assert sign_j(v, order, scale) == sign_j(v / scale, order)
    slope = float(sign_j_slope(v / scale, order))
    assert sign_j_slope(v, order, scale) == pytest.approx(slope / scale, rel=1e-14)


def test_arrays_keep_their_shape_and_bad_numbers_give_nan():
    v = np.array([[0.0, 1.0, np.nan], [-2.0, np.inf, -np.inf]])
    for function in (sign_j, sign_j_slope):
        out = function(v, 50)
        assert out.shape == v.shape
        np.testing.assert_array_equal(np.isnan(out), ~np.isfinite(v))


@given(st.floats(-50, 50), st.integers(1, 200))
def test_expression_is_the_numpy_value(z, order):
    import casadi as ca

    x = ca.SX.sym("x")
    value, slope = ca.Function("s", [x], list(sign_j_expression(x, order)))(z)
    assert float(value) == pytest.approx(float(sign_j(z, order)), rel=1e-12, abs=1e-300)
    assert float(slope) == pytest.approx(float(sign_j_slope(z, order)), rel=1e-11, abs=1e-300)


@given(st.floats(-3, 3), st.floats(1e-30, 1e-6), st.integers(1, 100))
def test_change_does_not_cancel(z0, dz, order):
    import casadi as ca

    z = z0 + dz
    if (1 - abs(z)) * (1 - abs(z0)) <= 0 or abs(1 - abs(z0)) < 1e-3:
        return  # across the unit interval's end the values are subtracted
    a, b, d = (ca.SX.sym(name) for name in "abd")
    found = float(ca.Function("c", [a, b, d], [sign_j_change(a, b, d, order)])(z, z0, dz))
    with mpmath.workdps(80):
        want = definition(mpmath.mpf(z0) + mpmath.mpf(dz), order) - definition(z0, order)
        # 1 - s s0 keeps the rounding of s: an error of the change, in proportion to d, not of the values
        allowed = 1e-14 * abs(want) + 4e-15 * order * dz / abs(1 - z0 * z0)
        assert abs(found - want) <= allowed


@pytest.mark.parametrize("order", [0, -1, 10_001, 2.5, True])
def test_bad_orders_are_refused(order):
    with pytest.raises(InputError, match="a whole number from 1 to 10000"):
        sign_j(0.5, order)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_bad_scales_are_refused(scale):
    with pytest.raises(InputError, match="a positive finite number"):
        sign_j(0.5, 50, scale)
