"""Dormand and Prince's Runge-Kutta pair of orders 5 and 4, with Shampine's interpolant of order 4.

The coefficients are those of `scipy.integrate.RK45`, which a test compares; they are written out because its import
takes every process that simulates, each node and each command, longer than all else that it imports but Numba.

Sources: Dormand and Prince, A family of embedded Runge-Kutta formulae, J. Comput. Appl. Math. 6, 1980; Shampine, Some
practical Runge-Kutta formulas, Math. Comput. 46, 1986.
"""

from __future__ import annotations

import numpy as np

A = np.array(
    [
        [0, 0, 0, 0, 0, 0],
        [1 / 5, 0, 0, 0, 0, 0],
        [3 / 40, 9 / 40, 0, 0, 0, 0],
        [44 / 45, -56 / 15, 32 / 9, 0, 0, 0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
"""Weights (7, 6) of the slopes before each stage; the last row leads to the end of the step."""
E = np.array([-71 / 57600, 0, 71 / 16695, -71 / 1920, 17253 / 339200, -22 / 525, 1 / 40])
"""Weights (7,) of the slopes in the error of the step."""
DENSE_WEIGHTS = np.array(
    [
        [1, -8048581381 / 2820520608, 8663915743 / 2820520608, -12715105075 / 11282082432],
        [0, 0, 0, 0],
        [0, 131558114200 / 32700410799, -68118460800 / 10900136933, 87487479700 / 32700410799],
        [0, -1754552775 / 470086768, 14199869525 / 1410260304, -10690763975 / 1880347072],
        [0, 127303824393 / 49829197408, -318862633887 / 49829197408, 701980252875 / 199316789632],
        [0, -282668133 / 205662961, 2019193451 / 616988883, -1453857185 / 822651844],
        [0, 40617522 / 29380423, -110615467 / 29380423, 69997945 / 29380423],
    ]
)
"""Weights (7, 4) of the slopes in the powers 1 to 4 of the share of the step, inside the step."""

__all__ = ["DENSE_WEIGHTS", "A", "E"]
