"""The smooth right-hand side f_j: every recorded sign replaced by sign_j, with derivatives that stay exact."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import casadi as ca

from signlin_ros.engine.symbolic import symbolic
from signlin_ros.engine.terms import Change, Groups, TermSplitter
from signlin_ros.recording.trace import Structure, Trace, trace
from signlin_ros.sign import sign_j_change, sign_j_expression


@dataclass(frozen=True)
class _SmoothSign:
    """sign_j of one surface: value, slope ds/dg and argument z = g/scale, as expressions of x, u, p and the scales."""

    value: ca.SX
    slope: ca.SX
    z: ca.SX


class SmoothForm:
    """f_j(x, u, p, scale) of a structure at one order j, with its pieces for the linearization.

    Derivatives go through the closed-form slope of sign_j, never through automatic differentiation of its formula,
    which has a removable pole at z = ±1.
    """

    def __init__(self, base: Trace, order: int) -> None:
        self.trace, self.order = base, order
        self.scale = ca.SX.sym("scale", len(base.surfaces))
        self.symbols = ca.vertcat(*(s.symbol for s in base.surfaces)) if base.surfaces else ca.SX(0, 1)
        self.signs: list[_SmoothSign] = []
        for k, surface in enumerate(base.surfaces):
            self.signs.append(self._sign(surface.g, self.scale[k]))
        self.values = ca.vertcat(*(s.value for s in self.signs)) if self.signs else ca.SX(0, 1)

    def _sign(self, g: ca.SX, scale: ca.SX) -> _SmoothSign:
        known = [s.symbol for s in self.trace.surfaces[: len(self.signs)]]
        inner = ca.substitute([g], known, [s.value for s in self.signs])[0] if known else g
        z = inner / scale
        value, slope = sign_j_expression(z, self.order)
        return _SmoothSign(value, slope / scale, z)

    def smooth(self, e: ca.SX) -> ca.SX:
        """Return an expression with every sign's symbol replaced by sign_j."""
        return ca.substitute(e, self.symbols, self.values) if self.signs else e

    def jacobian(self, e: ca.SX, w: ca.SX) -> ca.SX:
        """Return the smooth total derivative of ``e`` with respect to ``w`` (x or u)."""
        total = ca.jacobian(e, w)
        for symbol, row in zip(ca.vertsplit(self.symbols) if self.signs else (), self._sign_rows(w), strict=True):
            total += ca.mtimes(ca.jacobian(e, symbol), row)
        return self.smooth(total)

    def _sign_rows(self, w: ca.SX) -> list[ca.SX]:
        """Return ds_k/dw for every surface, through earlier signs where they are nested."""
        rows: list[ca.SX] = []
        for surface, smooth_sign in zip(self.trace.surfaces, self.signs, strict=True):
            row = ca.jacobian(surface.g, w)
            for earlier, inner in zip(self.trace.surfaces, rows, strict=False):
                row = row + ca.jacobian(surface.g, earlier.symbol) * inner
            rows.append(smooth_sign.slope * row)
        return rows

    @functools.cached_property
    def affine_in_input(self) -> bool:
        """Whether F_j is affine in the inputs."""
        return not any(ca.which_depends(self.smooth(self.trace.f), self.trace.u, 2, True))

    def is_linear(self, e: ca.SX) -> bool:
        """Tell whether an expression is affine in the states and holds no sign that depends on them."""
        return not any(ca.which_depends(self.smooth(e), self.trace.x, 2, True))

    @functools.cached_property
    def change(self) -> Change:
        """Differences from x = 0, signs included; built sign by sign, because later ones may hold earlier ones."""
        zero = ca.SX.zeros(self.trace.x.numel())
        symbols, before, after = self.trace.x, zero, self.trace.x
        for k, surface in enumerate(self.trace.surfaces):
            inner = Change(symbols, before, after)
            z0 = ca.substitute(self.signs[k].z, self.trace.x, zero)
            dz = self.smooth(inner.of(surface.g)) / self.scale[k]
            symbols = ca.vertcat(symbols, surface.symbol)
            at_zero = ca.SX(0) if z0.is_zero() else ca.substitute(self.signs[k].value, self.trace.x, zero)
            before = ca.vertcat(before, at_zero)
            after = ca.vertcat(after, self._sign_change(self.signs[k], z0, dz))
        return Change(symbols, before, after)

    def _sign_change(self, smooth_sign: _SmoothSign, z0: ca.SX, dz: ca.SX) -> ca.SX:
        if z0.is_zero():
            return smooth_sign.value
        return ca.SX(0) if dz.is_zero() else sign_j_change(smooth_sign.z, z0, dz, self.order)

    def groups(self, row: ca.SX) -> Groups:
        """Return the additive terms of one row of f, grouped by the states that they depend on."""
        t = self.trace
        x = ca.vertsplit(t.x)
        sets = [frozenset({i}) for i in range(len(x))]
        own = TermSplitter(x, sets)
        for surface in t.surfaces:
            found = own.depends_on(surface.g)
            own = TermSplitter([*x, *(s.symbol for s in t.surfaces[: len(sets) - len(x) + 1])], [*sets, found])
            sets.append(found)
        return own.split(row)


@symbolic
@functools.lru_cache(maxsize=256)
def smooth_form(structure: Structure, order: int) -> SmoothForm:
    """Return the smooth form of a structure at one order; cached."""
    return SmoothForm(trace(structure), order)
