"""A, B and c of an arm, joint by joint: the rigid body by its derivatives, friction by the secant of its own velocity.

With a = M^-1 (K u + P^T F - h), da/dx = -M^-1 d(inverse dynamics)/dx at that a: the derivatives of the recursion, and
M^-1 unrolled, a fraction of the derivative of M^-1.   [Carpentier and Mansard, RSS 2018, doi:10.15607/RSS.2018.XIV.038]
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from signlin_ros.recording.arm import ArmParts, placed
from signlin_ros.recording.smooth import SmoothForm
from signlin_ros.recording.trace import Trace
from signlin_ros.robots.recorded import Factors

SECANT_MIN_SPEED = 1e-9
"""Velocity (rad/s, m/s) below which the secant through standstill is the slope."""


def arm_terms(form: SmoothForm, parts: ArmParts, secant: bool) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return A, B, c and F_j of an arm at (x, u) as expressions; A x + B u + c = F_j.

    ``secant``: the force of each joint enters with its secant from standstill to its motor's velocity,
    (F(v) - F(0)) / v, as a linear damper would; else with its slope. Loads that friction depends on are held. c has
    gravity and what is constant.
    """
    t, n = form.trace, parts.M.shape[0]
    q, v, own = t.x[:n], t.x[n : 2 * n], t.x[2 * n :]
    held = _Held(t, parts, form)
    P = ca.sparsify(ca.SX(parts.P))
    factors = Factors(parts.M)
    a = factors.solve(ca.sparsify(ca.SX(parts.acting)) @ parts.drives + P.T @ held.of(parts.forces) - parts.bias)
    damping = ca.diag(held.secants() if secant else held.own_slopes(parts.speed))
    force_q = P.T @ ca.diag(held.own_slopes(parts.angle)) @ P
    force_v = P.T @ damping @ P
    by_q = -ca.jacobian(parts.needed, q) + force_q
    by_v = -ca.jacobian(parts.needed, v) + force_v
    by_own = P.T @ held.slopes(parts.forces, own)
    into, driven = ca.jacobian(parts.drives, t.u), ca.sparsify(ca.SX(parts.driven))
    by_u = (ca.sparsify(ca.SX(parts.acting)) + P.T @ held.slopes(parts.forces, parts.drive) @ driven) @ held.of(into)
    columns = ca.horzcat(by_q, by_v, by_own, by_u)
    solved = ca.horzcat(*(factors.solve(columns[:, k]) for k in range(columns.shape[1])))
    lower = held.rates(P, q, v, own)
    k, size = own.numel(), t.x.numel()
    A = ca.vertcat(ca.horzcat(ca.SX(n, n), ca.SX.eye(n), ca.SX(n, k)), solved[:, :size], lower[:, :size])
    B = ca.vertcat(ca.SX(n, n), solved[:, size:], lower[:, size:])
    f = ca.vertcat(v, a, held.of(parts.rates))
    A, B = (ca.substitute(e, parts.a, a) for e in (A, B))
    return A, B, f - A @ t.x - B @ t.u, f


class _Held:
    """Smooth forces of all joints in the coordinates of their motors, loads held."""

    def __init__(self, t: Trace, parts: ArmParts, form: SmoothForm) -> None:
        n = parts.M.shape[0]
        self.q, self.v = t.x[:n], t.x[n : 2 * n]
        self.parts = parts
        self.form = SmoothForm(replace(t, surfaces=parts.surfaces), form.order)
        self._scales = self.form.scale, form.scale

    def _placed(self, e: ca.SX) -> ca.SX:
        return placed(self.parts, ca.substitute(e, *self._scales) if self.form.signs else e, self.q, self.v)

    def of(self, e: ca.SX) -> ca.SX:
        """Return an expression with its signs smooth, at the joints' coordinates."""
        return self._placed(self.form.smooth(e))

    def slopes(self, e: ca.SX, w: ca.SX) -> ca.SX:
        """Return the derivatives of an expression, through its signs."""
        return self._placed(self.form.jacobian(e, w)) if w.numel() else ca.SX(e.numel(), 0)

    def own_slopes(self, w: ca.SX) -> ca.SX:
        """Return the derivative of each joint's force by its own coordinate (n)."""
        found = [self.form.jacobian(self.parts.forces[i], w[i]) for i in range(w.numel())]
        return self._placed(ca.vertcat(*found))

    def secants(self) -> ca.SX:
        """Return (F(v) - F(0)) / v of each joint's force (n), its slope at standstill."""
        speed, found = self.parts.speed, []
        for i in range(speed.numel()):
            force, w = self.parts.forces[i], speed[i]
            moving = ca.fabs(w) > SECANT_MIN_SPEED
            rise = self.form.smooth(force) - self._at_rest(force, w)
            slope = self.form.jacobian(force, w)
            found.append(ca.if_else(moving, rise / ca.if_else(moving, w, 1), slope))
        return self._placed(ca.vertcat(*found))

    def _at_rest(self, force: ca.SX, w: ca.SX) -> ca.SX:
        """Return a joint's smooth force at standstill."""
        symbols, values = list(self.form.trace.surfaces), []
        for surface, sign in zip(symbols, self.form.signs, strict=True):
            if not ca.depends_on(surface.g, w):
                values.append(sign.value)
                continue
            rest = ca.substitute(sign.z, w, 0)
            values.append(ca.SX(0) if rest.is_zero() else ca.substitute(sign.value, w, 0))
        still = ca.substitute(force, w, 0)
        return ca.substitute(still, self.form.symbols, ca.vertcat(*values)) if values else still

    def rates(self, P: ca.SX, q: ca.SX, v: ca.SX, own: ca.SX) -> ca.SX:
        """Return the derivatives of the own states' rates by q, v, own and u."""
        rates = self.parts.rates
        if not own.numel():
            return ca.SX(0, q.numel() * 3)
        parts = self.parts
        by_u = (
            self.slopes(rates, parts.drive)
            @ ca.sparsify(ca.SX(parts.driven))
            @ ca.jacobian(parts.drives, self.form.trace.u)
        )
        return ca.horzcat(
            self.slopes(rates, parts.angle) @ P, self.slopes(rates, parts.speed) @ P, self.slopes(rates, own), by_u
        )


__all__ = ["arm_terms"]
