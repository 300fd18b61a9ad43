"""The coefficients of the integrator are SciPy's, bit by bit."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
from scipy.integrate import RK45

from signlin_ros.engine import tableau


def test_coefficients_are_scipys() -> None:
    np.testing.assert_array_equal(tableau.A[:6, :5], RK45.A)
    np.testing.assert_array_equal(tableau.A[6], RK45.B)
    np.testing.assert_array_equal(tableau.A[:6, 5], 0.0)
    np.testing.assert_array_equal(tableau.E, RK45.E)
    np.testing.assert_array_equal(tableau.DENSE_WEIGHTS, RK45.P)


def test_a_process_that_simulates_does_without_scipys_integrators() -> None:
    code = "import sys, signlin_ros.simulation; print([m for m in sys.modules if m.startswith('scipy.integrate')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    assert done.stdout == "[]\n"
