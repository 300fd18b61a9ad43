"""Values and standard errors as text."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from signlin_ros.digits import with_error


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (1.19971, 0.00026, "1.19971 ± 0.00026"),
        (0.0805, 3.1e-06, "0.0805000 ± 0.0000031"),
        (0.0323, 0.00099, "0.03230 ± 0.00099"),
        (0.0323, 0.000996, "0.0323 ± 0.0010"),
        (0.0850149, 0.25, "0.09 ± 0.25"),
        (55.79, 170.0, "60 ± 170"),
        (3420.0, 7700.0, "3400 ± 7700"),
        (-0.01176, 0.00035, "-0.01176 ± 0.00035"),
        (-2e-6, 0.013, "0.000 ± 0.013"),
        (0.0, 7.9, "0.0 ± 7.9"),
        (92.88, 0.21, "92.88 ± 0.21"),
        (1.234e9, 1.0e7, "1.234e+09 ± 0.010e+09"),
        (2.084e-05, 7e-07, "2.084e-05 ± 0.070e-05"),
        (0.123456789, 1e-12, "0.12345679 ± 1.0e-12"),
    ],
)
def test_the_digits_that_the_error_leaves(value, std, text):
    assert " ± ".join(with_error(value, std)) == text


@pytest.mark.parametrize("std", [None, 0.0, math.inf, math.nan])
def test_without_an_error_there_are_five_digits(std):
    assert with_error(95.109, std) == ("95.109", "")
    assert with_error(0.00654, std) == ("0.00654", "")


@given(st.floats(-1e9, 1e9), st.floats(1e-9, 1e9))
def test_nothing_is_lost_that_the_error_leaves(value, std):
    shown, error = with_error(value, std)
    assert float(error) == pytest.approx(std, rel=0.051)
    assert abs(float(shown) - value) <= max(0.051 * std, 1e-7 * abs(value))
    assert not re.fullmatch(r"-0(\.0*)?(e.*)?", shown)
