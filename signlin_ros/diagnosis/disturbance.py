"""What moves a mass at random: noise in its input, or a force that lasts? Or does a sensor drift?

What an observer leaves is the noise of the sensors and what disturbs the motion, each through its own response. Their
spectra are known but for the size of a disturbance and how long it lasts; the likelihood is that of Fourier
coefficients, which do not depend on each other [Whittle, J. R. Stat. Soc. B 15 (1953) 125].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from signlin_ros.diagnosis.fit import Fit
from signlin_ros.diagnosis.problem import Problem, linear_base, stepped

Array = NDArray[np.float64]

LASTING, PART = 16, 0.1
"""How many correlation times of a force are tried, from a step to this part of the longest record."""
SIZES = np.linspace(-10.0, 14.0, 13)
"""Logarithms of sizes, in squares of what the sensors' noise would hide, of which the most likely is looked for."""


@dataclass(frozen=True)
class Disturbance:
    """What disturbs a motion, as far as a record tells.

    ``input``, ``white``: the most likely standard deviation of white noise in the first input, in its unit, and in the
    force, in that of the plant. ``force``: that of a force which ``lasts`` for the most likely correlation time, s; a
    step if it is white. ``doubt``, ``lasting``: by how much -2 log likelihood is larger with noise in the input, and in
    the force, than with that. ``drifting``: the channel whose sensor most likely drifts instead; ``rather``: by how
    much -2 log likelihood is less with that than with a force. ``gone``: whether an observer follows what disturbs the
    motion so closely at the highest gain that only the noise of the sensors is left.

    By how much a sensor drifts is not told: an observer follows it, and what is left at low frequencies is mostly what
    the parameters are off by.
    """

    input: float
    white: float
    force: float
    lasts: float
    doubt: float
    lasting: float
    drifting: str
    rather: float
    gone: bool = True


def disturbance(problem: Problem, f: Fit, noise: Array, rho: Array) -> Disturbance:
    """Return what disturbs the motion of a fitted model, from what an observer at the gain of its fit leaves.

    ``noise``, ``rho`` (ny): standard deviation of the sensors' noise and its correlation from sample to sample.
    """
    dt = problem.scale.step
    parts = [_seen(problem, f, e, noise, rho) for e in f.innovations]
    w, by_input, by_force, *by_sensor = (np.concatenate(one, axis=-1) for one in zip(*parts, strict=True))
    size, cost = _most_likely(by_input, np.ones_like(w))
    times = np.geomspace(dt, max(PART * max(float(s.t[-1] - s.t[0]) for s in problem.segments), 2 * dt), LASTING)
    shapes = [_lasting(w, float(np.exp(-dt / t)) if t > dt else 0.0) for t in times]
    forces = [_most_likely(by_force, shape) for shape in shapes]
    best = int(np.argmin([one[1] for one in forces]))
    (white, without), (lasting, least) = forces[0], forces[best]
    first, force = problem.scale.inertia * np.sqrt([white, lasting])
    sensors = [min(_most_likely(seen, shape)[1] for shape in shapes[1:]) for seen in by_sensor]
    channel = int(np.argmin(sensors))
    return Disturbance(
        input=float(np.sqrt(size)),
        white=float(first),
        force=float(force),
        lasts=float(times[best]),
        doubt=cost - least,
        lasting=without - least,
        drifting=problem.channels[channel],
        rather=least - sensors[channel],
    )


def _seen(problem: Problem, f: Fit, left: Array, noise: Array, rho: Array) -> tuple[Array, ...]:
    """Return frequencies (F,) in radians per sample and, for a disturbance of size 1 in the input, in the force, and in
    what every sensor shows, (2, F): its power in noise of size 1, and what is ``left`` (T, ny) has of it.
    """
    (states, A, B, C), (n, ny) = linear_base(f.fitted(), problem.channels), f.gains.values.shape[1:]
    push = np.zeros((n, 2))
    push[:, 0], push[states.index(problem.base.plant.velocity), 1] = B[:, 0], 1.0
    (onward, moved), K, count = stepped(A, push, problem.scale.step), f.gains.rows(states)[-1], len(left)
    w = 2 * np.pi * np.arange(1, count // 2) / count
    through = C @ np.linalg.inv(np.exp(1j * w)[:, None, None] * np.eye(n) - onward @ (np.eye(n) - K @ C))
    shown = np.eye(ny) - through @ onward @ K
    sensors = shown * (noise * np.sqrt(_lasting(w[:, None], rho)))[:, None, :]
    coefficients = np.fft.rfft(np.nan_to_num(left), axis=0)[1 : count // 2] / np.sqrt(count)
    whitened = np.linalg.solve(sensors, np.concatenate([through @ moved, shown, coefficients[:, :, None]], axis=2))
    powers = np.sum(np.abs(whitened[:, :, :-1]) ** 2, axis=1)
    there = np.abs(np.sum(whitened[:, :, :-1].conj() * whitened[:, :, -1:], axis=1)) ** 2
    return w, *(np.array([powers[:, i], there[:, i]]) for i in range(2 + ny))


def _lasting(w: Array, rho: float | Array) -> Array:
    """Return the spectrum of noise of variance 1 with a correlation from sample to sample, at frequencies w."""
    return np.asarray((1.0 - np.square(rho)) / np.abs(1.0 - rho * np.exp(-1j * w)) ** 2)


def _most_likely(seen: Array, shape: Array) -> tuple[float, float]:
    """Return the size, in squares, of a disturbance with a spectrum (F,) that makes what is ``seen`` (2, F) of it most
    likely, and -2 log likelihood against none.
    """
    power, there = seen * shape
    usual = float(np.mean(power))
    if not usual > 0.0:
        return 0.0, 0.0

    def cost(size: float) -> float:
        squares = np.exp(size) / usual
        return 2.0 * float(np.sum(np.log1p(squares * power) - squares * there / (1.0 + squares * power)))

    near = int(np.argmin([cost(size) for size in SIZES]))
    step = SIZES[1] - SIZES[0]
    best = minimize_scalar(cost, bounds=(SIZES[near] - step, SIZES[near] + step), method="bounded")
    return float(np.exp(best.x)) / usual, float(best.fun)


__all__ = ["Disturbance", "disturbance"]
