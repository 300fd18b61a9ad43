"""The longest step of a fixed-step method that a model bears, measured."""

from __future__ import annotations

import numpy as np

from signlin_ros.engine.tape import Tape
from signlin_ros.export.base import Array, ExportedDrive
from signlin_ros.export.functions import constants, smooth_rates
from signlin_ros.model import Model

STEPS_TRIED = (5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5)
"""Steps in s that are tried, from the longest on."""
ACCURATE = 1e-3
"""A step is taken if it and its half differ by no more than this part of a state's RMS."""


def longest_step(model: Model, drive: ExportedDrive) -> float:
    """Return the longest of `STEPS_TRIED` at which the classical Runge-Kutta method of order 4 is accurate on a drive.

    The states of the smooth run are carried on by one step and by two halves of it, from each sample; stability is
    told by the eigenvalues of the Jacobian there.
    """
    from signlin_ros.linearization import Linearizer
    from signlin_ros.simulation import simulate

    path = simulate(model, drive.t, drive.u, drive.x0, kind="smooth", acts=drive.acts)
    points = slice(None, None, max(1, len(path.t) // 400))
    x, u = path.x[points], path.u[points]
    A = Linearizer(model.with_options(operating_point="start"), "jacobian").batch(x, u).A
    fastest = float(np.abs(np.linalg.eigvals(A)).max())
    size = np.sqrt(np.mean(path.x**2, axis=0)) + 1e-12
    for step in STEPS_TRIED:
        if fastest * step > 2.5:
            continue
        whole = _rk4(model, x, u, step)
        half = _rk4(model, _rk4(model, x, u, step / 2), u, step / 2)
        error = np.sqrt(np.mean((whole - half) ** 2, axis=0)) / size
        if np.isfinite(error).all() and error.max() <= ACCURATE * min(1.0, 100 * step):
            return step
    return STEPS_TRIED[-1]


def _rk4(model: Model, x: Array, u: Array, dt: float) -> Array:
    """Carry many states x (T, n) on by dt."""
    tape = Tape.of(smooth_rates(model))
    numbers = [c.value for group in constants(model) for c in group]

    def f(z: Array) -> Array:
        return np.asarray(tape.batch([*z.T, *u.T, *numbers]).T)

    k1 = f(x)
    k2 = f(x + dt / 2 * k1)
    k3 = f(x + dt / 2 * k2)
    k4 = f(x + dt * k3)
    return x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


__all__ = ["ACCURATE", "STEPS_TRIED", "longest_step"]
