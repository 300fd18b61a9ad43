"""One step of the filter as an expression: where the state and its covariance are after h seconds.

The mean follows the set-valued law: a second-order L-stable Rosenbrock method (ROS2, gamma = 1 - 1/sqrt(2)) is run with
either sign of every switch, and as F is affine in the signs, the step for any sign lies in between. The sign is +-1 off
the surface; a surface that is crossed inside the step keeps its sign up to the crossing, and beyond it slips or
sticks, which is s = -r/c clipped to [-1, 1] with the rate r + c s of g. So a stuck shaft stands still.

The covariance cannot know on which side of a surface the state is: its slope of sign(g) is that of the mean over the
Gaussian, 2 phi(g/sigma)/sigma with sigma^2 = G P G^T (statistical linearization), which is honest near g = 0 and
the ordinary Jacobian far from it. A stuck shaft has g = 0, but a mean sign s of which its friction is held: the
Gaussian of that mean sign lies sqrt(2) erfinv(s) of its sigmas aside. So the nearer a shaft is to breaking away, the
less does friction hold the spread of its speed, and when it breaks away is as uncertain as the force on it.
An error of the level of friction changes sides with the sign, at once: a push that was learnt while a switch slipped
one way is not known where it will slip the other way. And where an input jumps, what it drives is wrong by a share of
the jump, at once: a guard must allow for that, who weighs a model against what is measured need not.

[ROS2: Verwer, Spee, Blom and Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456; statistical linearization: Gelb, Applied
Optimal Estimation, 1974, sec. 6.2; inverse of erf: Winitzki, A handy approximation for the error function and its
inverse, 2008; signs across a crossing: docs/theory.md.]
"""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from signlin_ros.engine.native import native
from signlin_ros.engine.symbolic import symbolic
from signlin_ros.engine.tape import Tape
from signlin_ros.plants import Plant
from signlin_ros.recording.trace import Structure, Trace, trace

Array = NDArray[np.float64]

GAMMA = 1.0 - np.sqrt(0.5)
DISTURBANCE_TIME = 0.3
"""How long, in s, an error of the model lasts in the filter's picture of it."""
SIZE_MEMORY = 2.0
"""How far back, in s, the usual size of what an equation holds is remembered."""
SWITCH_SWEEPS = 2
"""Over several switches, each given the others' signs."""
ERRATIC_TIME = 1e-3
"""How long, in s, what is erratic in an equation lasts, beside the push: a stuck shaft's speed stays uncertain."""
MIN_INTENSITY = 1e-12
"""Least intensity of the noise in an equation, in the square of its state's SI unit a second."""
MIN_VARIANCE = 1e-30
"""Variances below this are none: their products would leave the range of numbers."""
CERTAIN_SHARE = 0.95
"""Share of the level of breaking away that certainly holds, and for a guard of what a jump of an input does: both are
known as well as base parameters are by default."""
MAX_MEAN_SIGN = 0.9999
"""A mean sign beyond this counts as this: friction that is overcome holds next to nothing of the spread."""


class _Equations:
    """F of a trace as a function of the state and of the switches' signs; kinks take the branch that they are on."""

    def __init__(self, t: Trace, pushed: tuple[int, ...]) -> None:
        self.t, self.u, self.pushed = t, t.u, pushed
        push = ca.SX.sym("push", len(pushed))
        rates = ca.SX(t.f)
        for k, i in enumerate(pushed):
            rates[i] += push[k]
        self.x, self.f = ca.vertcat(t.x, push), ca.vertcat(rates, -push / DISTURBANCE_TIME)
        self.n = self.x.numel()
        self.switches = [s for s in t.surfaces if s.kind == "switch"]
        self.signs = [s.symbol for s in self.switches]
        symbols: list[ca.SX] = []
        values: list[ca.SX] = []
        for surface in t.surfaces:
            if surface.kind != "switch":
                inner = ca.substitute([surface.g], symbols, values)[0] if symbols else surface.g
                symbols.append(surface.symbol)
                values.append(ca.sign(inner))
        self._kinks = (symbols, values)
        self.slopes = ca.jacobian(self.f, self.x)
        self.by_sign = ca.jacobian(self.f, ca.vertcat(*self.signs)) if self.signs else ca.SX(self.n, 0)

    def at(self, e: ca.SX, x: ca.SX, signs: list[ca.SX]) -> ca.SX:
        """Return an expression at a state and at signs of the switches."""
        flat = ca.substitute([e], *self._kinks)[0] if self._kinks[0] else e
        return ca.substitute([flat], [self.x, *self.signs], [x, *signs])[0]

    def surface(self, i: int, x: ca.SX, signs: list[ca.SX]) -> ca.SX:
        """Return g of a switch."""
        return self.at(self.switches[i].g, x, signs)

    def flow(self, h: ca.SX, x: ca.SX, signs: list[ca.SX]) -> ca.SX:
        """Return the state after h with the signs held."""
        matrix = ca.SX.eye(self.n) - GAMMA * h * self.at(self.slopes, x, signs)
        k1 = ca.solve(matrix, self.at(self.f, x, signs))
        k2 = ca.solve(matrix, self.at(self.f, x + h * k1, signs) - 2 * k1)
        return x + 1.5 * h * k1 + 0.5 * h * k2


def _moved(e: _Equations, h: ca.SX) -> tuple[ca.SX, list[ca.SX]]:
    """Return the state after h, and the mean sign of every switch on the way."""
    before: list[ca.SX] = []
    for i in range(len(e.switches)):
        known = before + [ca.SX(0)] * (len(e.switches) - i)
        before.append(ca.if_else(e.surface(i, e.x, known) < 0, -1, 1))
    base = e.flow(h, e.x, before)
    others = [e.flow(h, e.x, [-s if i == j else s for i, s in enumerate(before)]) for j in range(len(before))]
    per_sign = [(other - base) / (-2 * s) for other, s in zip(others, before, strict=True)]
    signs = list(before)
    for _ in range(SWITCH_SWEEPS if len(before) > 1 else 1):
        for i, s0 in enumerate(before):
            held = [s0 if i == j else s for j, s in enumerate(signs)]
            signs[i] = _mean_sign(e, i, held, _combined(base, per_sign, before, held), per_sign[i])
    return _combined(base, per_sign, before, signs), signs


def _combined(base: ca.SX, per_sign: list[ca.SX], before: list[ca.SX], signs: list[ca.SX]) -> ca.SX:
    return base + sum((d * (s - s0) for d, s, s0 in zip(per_sign, signs, before, strict=True)), ca.SX(0))


def _mean_sign(e: _Equations, i: int, signs: list[ca.SX], end: ca.SX, per_sign: ca.SX) -> ca.SX:
    """Return the mean sign of a switch over a step that ends at ``end`` if it keeps the sign it starts with."""
    s0 = signs[i]
    start, there = e.surface(i, e.x, signs), e.surface(i, end, signs)
    there_other = e.surface(i, end - 2 * s0 * per_sign, signs)
    change = (there_other - there) / (-2 * s0)
    free = there - start - change * s0
    held = ca.fmin(ca.fmax(-free / ca.if_else(change < 0, change, 1), -1), 1)
    beyond = ca.if_else(change < 0, held, -s0)
    share = start / ca.if_else(start == there, 1, start - there)
    return ca.if_else(there * s0 < 0, share * s0 + (1 - share) * beyond, s0)


def _sizes(e: _Equations, plant: type[Plant], J: ca.SX, by_sign: ca.SX, signs: list[ca.SX]) -> ca.SX:
    """Return the squared size (n,) of what the equation of each state holds, in units of its rate.

    What hangs on the machine counts by where it is relative to the machine: a spring between them holds what it is
    bent by, wherever both are.
    """
    B = e.at(ca.jacobian(e.f, e.u), e.x, signs)
    relative = _relative(e.t.states, plant, e.n)
    columns = ca.vertcat(ca.mtimes(relative, e.x), e.u, *signs)
    slopes = ca.mtimes(J, ca.DM(np.linalg.inv(relative)))
    return ca.mtimes(ca.horzcat(slopes, B, by_sign) ** 2, columns**2) + e.at(e.f, e.x, signs) ** 2


def _relative(states: tuple[str, ...], plant: type[Plant], n: int) -> Array:
    """Return the matrix (n, n) that takes the machine's own position and velocity off those of what hangs on it."""
    matrix = np.eye(n)
    for own, kind in ((plant.position, ".position"), (plant.velocity, ".velocity")):
        if own in states:
            hanging = [i for i, name in enumerate(states) if name.endswith(kind)]
            matrix[hanging, states.index(own)] = -1.0
    return matrix


@symbolic
def _step(structure: Structure) -> ca.Function:
    t = trace(structure)
    e = _Equations(t, pushed_states(structure))
    n = e.n
    h, trust, doubt = ca.SX.sym("h"), ca.SX.sym("trust"), ca.SX.sym("doubt")
    U, D, last = ca.SX.sym("U", n, n), ca.SX.sym("D", n), ca.SX.sym("last", e.u.numel())
    usual, disturbed = ca.SX.sym("usual", n), ca.SX.sym("disturbed", n)
    end, signs = _moved(e, h)
    J, by_sign = e.at(e.slopes, e.x, signs), e.at(e.by_sign, e.x, signs)
    size = _sizes(e, structure.plant, J, by_sign, signs)
    P = ca.mtimes([U, ca.diag(D), U.T])
    Z = h * _spread(e, signs, P)
    transition = ca.solve(ca.SX.eye(n) - Z + ca.mtimes(Z, Z) / 2, U)
    own = ca.fmax(0, -ca.diag(J))
    intensity = 2 * DISTURBANCE_TIME / (1 + DISTURBANCE_TIME * own) * trust**2 * ca.fmax(size, usual) * disturbed
    for k, i in enumerate(e.pushed):
        intensity[t.x.numel() + k] = 2 / DISTURBANCE_TIME * trust**2 * ca.fmax(size, usual)[i]
        intensity[i] = ERRATIC_TIME * trust**2 * ca.fmax(size, usual)[i] + MIN_INTENSITY
    noise = ca.fmax(h * intensity, _turned(e, by_sign, signs, P) - ca.mtimes(U**2, D)) + doubt**2 * _jumped(
        e, signs, last
    )
    U_end, D_end = _orthogonal(ca.horzcat(transition, ca.SX.eye(n)), ca.vertcat(D, noise))
    remembered = usual + ca.fmin(1, h / SIZE_MEMORY) * (size - usual)
    flat = ca.densify(ca.cse(ca.vertcat(end, ca.vec(U_end.T), D_end, remembered)))
    # row-major U: the symbol is its transpose
    by_rows = ca.SX.sym("U_rows", n, n)
    flat = ca.substitute(flat, U, by_rows.T)
    return ca.Function("step", [e.x, by_rows, D, usual, e.u, last, h, trust, doubt, disturbed, t.p], [flat])


def _turned(e: _Equations, by_sign: ca.SX, signs: list[ca.SX], P: ca.SX) -> ca.SX:
    """Return the least variances (N,): of a push, while a switch in its equation may stick.

    What the switch holds changes by up to twice its level until it slips again, and is known no better than that.
    """
    least = ca.SX.zeros(e.n)
    unsure = ca.vertcat(*(_unsure(e, i, signs, P) for i in range(len(signs)))) if signs else ca.SX(0, 1)
    for k, i in enumerate(e.pushed):
        levels = by_sign[i, :].T if signs else ca.SX(0, 1)
        least[e.t.x.numel() + k] = (2 * (1 - CERTAIN_SHARE)) ** 2 * ca.sum1(levels**2 * unsure)
    return least


def _unsure(e: _Equations, i: int, signs: list[ca.SX], P: ca.SX) -> ca.SX:
    """Return the variance of a switch's sign: 1 where it sticks, and what its Gaussian over both sides leaves else."""
    g, G = e.surface(i, e.x, signs), e.at(ca.jacobian(e.switches[i].g, e.x), e.x, signs)
    z = g / ca.sqrt(2 * ca.fmax(ca.mtimes([G, P, G.T]), MIN_VARIANCE))
    return ca.fmax(ca.fabs(signs[i]) < MAX_MEAN_SIGN, 1 - _erf(z) ** 2)


def _jumped(e: _Equations, signs: list[ca.SX], last: ca.SX) -> ca.SX:
    """Return the squares (N,) by which the rates of pushed states jump where inputs were ``last`` (m,) a moment ago."""
    rates = e.at(e.f, e.x, signs)
    jump = rates - ca.substitute([rates], [e.u], [last])[0] if last.numel() else ca.SX.zeros(e.n)
    grown = ca.SX.zeros(e.n)
    for k, i in enumerate(e.pushed):
        grown[e.t.x.numel() + k] = jump[i] ** 2
    return grown


def _orthogonal(W: ca.SX, weights: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return U (n, n), unit upper triangular, and D (n,) with U diag(D) U^T = W diag(weights) W^T.

    Modified weighted Gram-Schmidt [Thornton, Triangular covariance factorizations for Kalman filtering, 1976]: the
    covariance stays positive definite in whatever units its states are.
    """
    n = W.shape[0]
    U, D = ca.SX.eye(n), ca.SX.zeros(n)
    rows = [W[i, :].T for i in range(n)]
    for j in range(n - 1, -1, -1):
        weighted = rows[j] * weights
        D[j] = ca.dot(rows[j], weighted)
        for i in range(j):
            U[i, j] = ca.if_else(D[j] > MIN_VARIANCE, ca.dot(rows[i], weighted) / ca.fmax(D[j], MIN_VARIANCE), 0)
            rows[i] = rows[i] - U[i, j] * rows[j]
    return U, D


def _spread(e: _Equations, signs: list[ca.SX], P: ca.SX) -> ca.SX:
    """Return the slopes (N, N) that the covariance sees: those of the mean over where the state may be.

    Of sign(g) that is 2 phi(g/sigma)/sigma, of |g| erf(g/(sqrt(2) sigma)). A switch that sticks has g = 0: how far
    it leans tells its mean sign.
    """
    values = dict(zip((s.name for s in e.switches), signs, strict=True))
    known: list[ca.SX] = []
    slopes: list[ca.SX] = []
    symbols = [s.symbol for s in e.t.surfaces]
    for surface in e.t.surfaces:
        before = symbols[: len(known)]
        g = ca.substitute([surface.g], before, known)[0] if known else surface.g
        G = ca.jacobian(surface.g, e.x)
        G = ca.substitute([G], before, known)[0] if known else G
        z = g / ca.sqrt(2 * ca.fmax(ca.mtimes([G, P, G.T]), MIN_VARIANCE))
        known.append(values[surface.name] if surface.kind == "switch" else _erf(z))
        if surface.kind == "switch":
            lean = ca.fmin(ca.fabs(values[surface.name]) / CERTAIN_SHARE, MAX_MEAN_SIGN)
            z = ca.fmax(ca.fabs(z), _inverse_erf(lean))
        slopes.append(_bell(z, G, P))
    J = e.slopes
    for surface, slope in zip(e.t.surfaces, slopes, strict=True):
        if surface.kind != "kink":
            J = J + ca.mtimes(ca.jacobian(e.f, surface.symbol), slope)
    return ca.substitute([J], symbols, known)[0] if symbols else J


def _bell(z: ca.SX, G: ca.SX, P: ca.SX) -> ca.SX:
    """Return the row (1, N) of slopes of the mean sign of a surface with gradient G: 2 phi(g/sigma)/sigma G."""
    bell: ca.SX = np.sqrt(2 / np.pi) * ca.exp(-(z**2)) / ca.sqrt(ca.fmax(ca.mtimes([G, P, G.T]), MIN_VARIANCE)) * G
    return bell


def _erf(z: ca.SX) -> ca.SX:
    """Return erf(z), right to 4e-4."""
    return ca.tanh(z * (1.12838 + 0.10277 * z**2))


def _inverse_erf(y: ca.SX) -> ca.SX:
    """Return the inverse of erf at y in [0, 1), right to 0.4 %."""
    a, log = 0.147, ca.log(1 - y**2)
    half = 2 / (np.pi * a) + log / 2
    root: ca.SX = ca.sqrt(ca.fmax(ca.sqrt(half**2 - log / a) - half, 0))
    return root


def pushed_states(structure: Structure) -> tuple[int, ...]:
    """Return the states of the plant whose equations may be wrong: all but a position that has its velocity.

    In each stands an unknown push, which is a state of the filter.
    """
    states, plant = trace(structure).states, structure.plant
    own = [i for i, name in enumerate(states) if "." not in name and name not in plant.own_state_names.values()]
    return tuple(i for i in own if not (states[i] == plant.position and plant.velocity in states))


@functools.lru_cache(maxsize=64)
@symbolic
def step_tape(structure: Structure) -> Tape:
    """Return the step as a tape: (x, U, D, usual, u, last, h, trust, doubt, disturbed, p) to (x, U, D, usual).

    ``last`` (m,) are the inputs that acted before, u (m,) those that act during the step. x (N,) holds the states and
    then the pushes; the covariance is U diag(D) U^T, U (N, N) unit upper triangular, by rows. ``usual`` (N,): the mean
    square of what each equation held lately; ``trust``: the share of it by which the model may be wrong; ``doubt``: the
    share of what a jump of the inputs does; ``disturbed`` (N,): 1 for equations that may be wrong.
    """
    return Tape.of(_step(structure))


@functools.lru_cache(maxsize=256)
def step_address(structure: Structure) -> int:
    """Return the address of that step's machine code."""
    return native(step_tape(structure))[0]


__all__ = ["CERTAIN_SHARE", "DISTURBANCE_TIME", "SIZE_MEMORY", "step_address", "step_tape"]
