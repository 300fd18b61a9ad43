"""Where a search for a load behind a coupling starts: what a model lacks over its motion, as a rational function.

A load J on a coupling k, c takes the torque T = (k + c s) J s² q / (J s² + c s + k). Its coefficients follow by linear
least squares from the spectra of the missing force and of the motion, weighted anew a few times by the denominator
[Sanathanan and Koerner, IEEE Trans. Autom. Control 8 (1963) 56]. What the driven side's inertia is wrong by, a nominal
value of all that moves for one, is among them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.force_segment import best_cutoff, force_segment, missing_force, recorded, tells_force
from signlin_ros.errors import RecordError
from signlin_ros.fitting.problem import Problem
from signlin_ros.model import Model

Array = NDArray[np.float64]
Spectrum = NDArray[np.complex128]

DENOMINATOR_ROUNDS = 8
"""Times that the weights follow the denominator."""
MAX_MOTION_NOISE_SHARE = 0.1
"""Share of the effort up to which noise of the motion may go, which sets the band."""


def load_start(problem: Problem, model: Model) -> tuple[dict[str, float], float] | None:
    """Return stiffness k, damping c and inertia J of a load behind a coupling, and the inertia of the driven side, as
    the missing force of the training data tells them; None where it tells of none.
    """
    no_driven_mass = model.plant.motion_is_imposed() or not model.plant.inertia_parameter
    if no_driven_mass or not tells_force(model, recorded(model, problem.parts)):
        return None
    theta = _coefficients(*_spectra(problem, model))
    if theta is None:
        return None
    a, b, third, _, fifth = theta
    excess = -fifth / b if b > 0.0 else 0.0
    J, driven = third + excess, model.plant.moved(model.parameters) - excess
    if not (b > 0.0 and J > 0.0 and driven > 0.0):
        return None
    k = J / b
    return {"k": float(k), "c": float(max(a, 0.0) * k), "J": float(J)}, float(driven)


def _spectra(problem: Problem, model: Model) -> tuple[Spectrum, Spectrum, Spectrum]:
    """Return s = j omega in rad/s and the spectra (K,) of position and missing force, one record after the other."""
    found: list[Spectrum] = []
    try:
        cutoff = best_cutoff(model, problem.parts, MAX_MOTION_NOISE_SHARE)
        pieces = [force_segment(model, part, cutoff) for part in problem.parts]
    except RecordError:
        pieces = []
    for piece in pieces:
        q, force = piece.values[model.plant.position], missing_force(model, piece)
        w = 2 * np.pi * np.fft.rfftfreq(q.size, piece.step)
        inside = (w > 0.0) & (w < 2 * np.pi * cutoff)
        window = np.hanning(q.size)
        spectra = (np.fft.rfft(window * (x - x.mean()))[inside] for x in (q, force))
        found.append(np.stack([1j * w[inside], *spectra]))
    s, shown, lacking = np.concatenate([np.zeros((3, 0), dtype=complex), *found], axis=1)
    return s, shown, lacking


def _coefficients(s: Spectrum, q: Spectrum, force: Spectrum) -> Array | None:
    """Return (a, b, third, fourth, fifth) of -F (1 + a s + b s²) = q s² (third + fourth s + fifth s²) in SI units."""
    if s.size < DENOMINATOR_ROUNDS or not np.any(force):
        return None
    typical = float(np.sqrt(np.mean(np.abs(s) ** 2)))
    z, torque, size = s / typical, -force, float(np.abs(force).max())
    columns = np.column_stack([-z * torque, -(z**2) * torque, *(z**n * q for n in (2, 3, 4))]) / size
    scale = np.maximum(np.abs(columns).max(axis=0), 1e-300)
    theta, weight = np.zeros(5), np.ones(s.size)
    for _ in range(DENOMINATOR_ROUNDS):
        X, y = weight[:, None] * columns / scale, weight * torque / size
        real, shown = np.vstack([X.real, X.imag]), np.concatenate([y.real, y.imag])
        theta = np.linalg.lstsq(real, shown, rcond=None)[0] / scale
        weight = 1.0 / np.maximum(np.abs(1.0 + theta[0] * z + theta[1] * z**2), 1e-3)
    return np.asarray(theta / typical ** np.array([1, 2, 2, 3, 4]))


__all__ = ["load_start"]
