"""The paper's equations as they are printed, against the package. Numbers in brackets are its equations.

Part II is evaluated in exact rational arithmetic, so that nothing cancels; part IV entry by entry on the
shipped models.
"""

from __future__ import annotations

from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from signlin_ros.effects.bouc_wen_hysteresis import BoucWenHysteresis
from signlin_ros.linearization import linearize
from signlin_ros.mathops import NumpyMath
from signlin_ros.model import Model
from signlin_ros.sign import sign_j, sign_j_slope

TABLE_1 = {"R_a": 0.764, "L_a": 0.0026, "K_t": 0.0805, "K_m": 0.0805, "B": 0.0, "J": 0.0022, "mu": 0.033}
FIG_5 = {"m": 1, "c": 1, "alpha": 0.5, "k": 1, "D": 1, "lambda": 1, "beta": 1, "gamma": -1.5, "n": 2}
ORDER = 50
MOTOR, OSCILLATOR = Model.load("dc_motor"), Model.load("bouc_wen")

Number = Any  # Fraction, or float
FRACTIONS = st.fractions(-12, 12, max_denominator=1000)
ORDERS = st.integers(1, 60)
COORDINATES = st.floats(-3, 3).filter(lambda v: abs(v) > 1e-6)


def printed_sign(z: Number, j: int) -> Number:
    """(5), for a real argument (9)."""
    return ((1 + z) ** j - (1 - z) ** j) / ((1 + z) ** j + (1 - z) ** j)


def printed_slope(z: Number, j: int) -> Number:
    """(10)."""
    above = 2 * j * ((1 - z) ** (j - 1) * (1 + z) ** j + (1 + z) ** (j - 1) * (1 - z) ** j)
    return above / ((1 + z) ** j + (1 - z) ** j) ** 2


def defined(z: Fraction, j: int) -> bool:
    """Tell whether (9) has a value: for j = 1 always, otherwise unless the two powers cancel."""
    return (1 + z) ** j + (1 - z) ** j != 0


# -------------------------------------------------------------------- part II


@given(FRACTIONS.filter(bool), st.integers(1, 15))
def test_the_truncated_continued_fraction_is_3c(z: Fraction, j: int) -> None:
    """(3b) cut off after j terms is (3c), and z over it is (5)."""
    tail = Fraction(0)
    for _ in range(j - 1):
        tail = (z * z - 1) / (2 + tail)
    root = 1 + tail
    plus, minus = (1 + z) ** j, (1 - z) ** j
    assert root * (plus - minus) == z * (plus + minus)
    assert float(sign_j(float(z), j)) == pytest.approx(float(z / root) if root else np.inf, rel=1e-11)


@given(FRACTIONS, ORDERS)
def test_sign_j_is_as_printed(z: Fraction, j: int) -> None:
    if defined(z, j):
        assert float(sign_j(float(z), j)) == pytest.approx(float(printed_sign(Fraction(float(z)), j)), rel=1e-12)


@given(FRACTIONS, ORDERS)
def test_its_derivative_is_as_printed(z: Fraction, j: int) -> None:
    if defined(z, j):
        assert float(sign_j_slope(float(z), j)) == pytest.approx(
            float(printed_slope(Fraction(float(z)), j)), rel=1e-11, abs=1e-300
        )


@pytest.mark.parametrize("j", [1, 2, 7, 50])
def test_the_largest_derivative_is_the_order(j: int) -> None:
    slopes = sign_j_slope(np.linspace(-0.5, 0.5, 1001), j)
    assert sign_j_slope(0.0, j) == j
    assert slopes.max() == pytest.approx(j, rel=1e-14)


@given(st.floats(-8, 8).filter(lambda z: abs(z) > 1e-3))
def test_sign_j_tends_to_the_sign(z: float) -> None:
    """(6), (8): the larger j, the closer; at 0 it is 0 for every j."""
    gaps = np.array([abs(sign_j(z, j) - np.sign(z)) for j in (100, 1000, 10_000)])
    assert (np.diff(gaps) <= 1e-15).all()
    assert gaps[-1] < 1e-8
    assert sign_j(0.0, 50) == 0


def test_on_the_imaginary_axis_there_is_no_limit() -> None:
    """The misprint in (7): sign_j(iy) = i tan(j arctan y), which does not tend to 0."""
    y, orders = 0.7, np.arange(100, 140)
    values = np.array([complex(printed_sign(1j * y, int(j))) for j in orders])
    np.testing.assert_allclose(values, 1j * np.tan(orders * np.arctan(y)), rtol=1e-8)
    assert np.abs(values[-20:]).max() > 1


# -------------------------------------------------------------------- part III


@given(st.lists(COORDINATES, min_size=3, max_size=3), st.lists(st.floats(-1, 1), min_size=3, max_size=3))
def test_no_other_row_that_is_exact_at_the_point_is_closer_to_the_gradient(x: list[float], off: list[float]) -> None:
    """(21) and (22b): any admissible row a + d with d x = 0 is at least as far from the gradient."""
    optimal, jacobian = (linearize(OSCILLATOR, x, method=m) for m in ("optimal", "jacobian"))
    np.testing.assert_allclose(optimal.A @ optimal.x, optimal.f, rtol=1e-9, atol=1e-9)
    d = np.array(off) - np.dot(off, x) / np.dot(x, x) * np.array(x)
    best = np.linalg.norm(optimal.A[2] - jacobian.A[2])
    assert np.linalg.norm(optimal.A[2] + d - jacobian.A[2]) >= best * (1 - 1e-9)


@pytest.mark.parametrize("x", [-3.0, 0.02, 5.0])
def test_of_a_scalar_function_the_optimal_line_goes_through_the_origin(x: float) -> None:
    """Remark 2, Fig. 3: f(x)/x; the tangent (14) has f'(x), and the rest in its constant."""
    free = {"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.0, "k": 0.0}}
    model = Model.from_dict(free).with_effect("quadratic_drag", c2=0.3)
    f, slope = (-0.3 * x * x * w for w in (sign_j(x, ORDER), sign_j_slope(x, ORDER)))
    slope += -0.3 * 2 * x * sign_j(x, ORDER)
    line, tangent = (linearize(model, [0.0, x], method=m) for m in ("termwise", "jacobian"))
    assert (line.A[1, 1], line.c[1]) == (pytest.approx(f / x), 0)
    assert tangent.A[1, 1] == pytest.approx(slope)
    assert tangent.c[1] == pytest.approx(f - slope * x)


# -------------------------------------------------------------------- part IV, A: the motor


def test_the_shipped_motor_has_the_numbers_of_table_1() -> None:
    model = MOTOR
    assert {**model.parameters, **model.effects["coulomb_friction"].parameters} == TABLE_1
    assert (model.sign_order, model.sign_scale, model.linearization) == (ORDER, 1.0, "termwise")
    assert (model.operating_point, model.update_period) == ("start", 0.2)


@given(st.floats(-16, 16).filter(lambda w: abs(w) > 1e-9))
def test_the_motor_s_friction_stands_in_its_own_entry(w: float) -> None:
    """(32), (33): K_f in the damping, nothing else changed against (29)."""
    p = TABLE_1
    K_f = p["mu"] * float(printed_sign(Fraction(w), ORDER)) / w
    want = [[-p["R_a"] / p["L_a"], -p["K_m"] / p["L_a"]], [p["K_t"] / p["J"], -(p["B"] + K_f) / p["J"]]]
    found = linearize(MOTOR, [0.7, w], [2.0])
    np.testing.assert_allclose(found.A, want, rtol=1e-12)
    np.testing.assert_allclose(found.B, [[1 / p["L_a"]], [0]], rtol=1e-14)
    np.testing.assert_array_equal(found.c, 0)


def test_at_standstill_the_motor_s_friction_coefficient_is_mu_j() -> None:
    found = linearize(MOTOR, [0.7, 0.0], [2.0])
    assert found.A[1, 1] == pytest.approx(-TABLE_1["mu"] * ORDER / TABLE_1["J"], rel=1e-14)


# -------------------------------------------------------------------- part IV, B: the oscillator


def oscillator(**other: float) -> Model:
    return OSCILLATOR.with_parameters(other)


def printed_row(p: dict[str, float], v: float, h: float) -> tuple[float, float, float]:
    """Third row of (39) for n even; D_32 and D_33 of (40)."""
    z = {name: Fraction(value) for name, value in p.items()}
    V, H, n = Fraction(v), Fraction(h), int(p["n"])
    sv, sh, dv, dh = (f(q, ORDER) for f in (printed_sign, printed_slope) for q in (V, H))
    beta, gamma = z["beta"], z["gamma"]
    f = (z["lambda"] * V - beta * V * sv * H**n * sh - gamma * V * H**n) / z["D"]
    D32 = (z["lambda"] - beta * sv * H**n * sh - beta * V * dv * H**n * sh - gamma * H**n) / z["D"]
    D33 = -beta * V * sv * n * H ** (n - 1) * sh - beta * V * sv * H**n * dh - gamma * V * n * H ** (n - 1)
    return float(f), float(D32), float(D33 / z["D"])


def upper_rows(p: dict[str, float]) -> list[list[float]]:
    """First and second row of (40), and of (42) where its signs are not lost in print."""
    m, c, alpha, k, D = (p[name] for name in ("m", "c", "alpha", "k", "D"))
    return [[0, 1, 0], [-alpha * k / m, -c / m, -(1 - alpha) * D * k / m]]


def test_the_shipped_oscillator_has_the_numbers_of_figure_5() -> None:
    model = OSCILLATOR
    assert model.parameters == FIG_5
    assert (model.sign_order, model.sign_scale, model.linearization) == (ORDER, 1.0, "optimal")
    assert (model.operating_point, model.update_period) == ("start", 0.2)
    assert not model.effects


OTHERS = st.fixed_dictionaries(
    {"m": st.floats(0.1, 9), "c": st.floats(0, 9), "k": st.floats(0.1, 9), "alpha": st.floats(0, 1)}
    | {"D": st.floats(0.1, 3), "lambda": st.floats(-2, 2), "beta": st.floats(-2, 2), "gamma": st.floats(-2, 2)}
)


@pytest.mark.parametrize("n", [2.0, 4.0])
@given(others=OTHERS, x=st.lists(COORDINATES, min_size=3, max_size=3))
def test_40_and_42_entry_by_entry(n: float, others: dict[str, float], x: list[float]) -> None:
    s, v, h = x
    p = {**FIG_5, **others, "n": n}
    model = oscillator(**others, n=n)
    f, D32, D33 = printed_row(p, v, h)
    near = {"rtol": 1e-9, "atol": 1e-9 * (1 + abs(f) + abs(D32) + abs(D33))}
    jacobian = linearize(model, x, method="jacobian")
    np.testing.assert_allclose(jacobian.A, [*upper_rows(p), [0, D32, D33]], **near)
    assert jacobian.f[2] == pytest.approx(f, rel=1e-9, abs=1e-12)
    Phi = (f - D32 * v - D33 * h) / (s * s + v * v + h * h)
    found = linearize(model, x, method="optimal")
    np.testing.assert_allclose(found.A, [*upper_rows(p), [Phi * s, D32 + Phi * v, D33 + Phi * h]], **near)
    np.testing.assert_array_equal(found.c, 0)


def test_41_at_the_origin_and_the_input_of_43() -> None:
    others = {"m": 2.0, "D": 0.5, "lambda": 0.75}
    found = linearize(oscillator(**others), [0.0, 0.0, 0.0])
    want = [*upper_rows({**FIG_5, **others}), [0, 0.75 / 0.5, 0]]
    np.testing.assert_allclose(found.A, want, rtol=1e-14)
    np.testing.assert_allclose(found.B, [[0], [0.5], [0]], rtol=1e-14)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
@given(v=COORDINATES, h=COORDINATES)
def test_36_is_37_for_odd_and_for_even_exponents_and_f_j_follows(n: int, v: float, h: float) -> None:
    """n odd: |s'| h^n and s' |h|^n; n even: |s'| h^(n-1) |h| and s' h^n. f_j by Remark 1, as (39) for n even."""
    p = {**FIG_5, "n": n}
    coordinates = SimpleNamespace(velocity=v, own=SimpleNamespace(h=h))
    law = BoucWenHysteresis().rates(NumpyMath(), coordinates, SimpleNamespace(**p, lambda_=p["lambda"]))["h"]
    odd = n % 2
    printed = v - abs(v) * (h**n if odd else h ** (n - 1) * abs(h)) + 1.5 * v * (abs(h) ** n if odd else h**n)
    assert law == pytest.approx(printed, rel=1e-12, abs=1e-12)
    sv, sh = (float(printed_sign(Fraction(q), ORDER)) for q in (v, h))
    smooth = v - v * sv * h**n * (1 if odd else sh) + 1.5 * v * h**n * (sh if odd else 1)
    found = linearize(OSCILLATOR.with_parameters(n=float(n)), [0.1, v, h])
    assert found.f[2] == pytest.approx(smooth, rel=1e-9, abs=1e-12)
