"""What the termwise linearization needs of an expression: its additive terms, and changes that do not cancel.

Both walk CasADi SX graphs that were recorded with signs as symbols, once per structure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca

Groups = dict[frozenset[int], ca.SX]
"""Additive terms, summed over those that depend on the same coordinates; the empty set is the constant part."""


class TermSplitter:
    """Splits a scalar expression into additive terms, grouped by the states that each depends on.

    Products of sums are multiplied out, so that ``(1 + a T) i^2`` gives a term over i and a term over i and T. The
    optimal linearization over one set of coordinates is linear in f, so terms over equal sets are summed.
    """

    def __init__(self, symbols: Sequence[ca.SX], dependencies: Sequence[frozenset[int]]) -> None:
        self._dependencies = {s.element_hash(): d for s, d in zip(symbols, dependencies, strict=True)}
        self._cache: dict[int, tuple[ca.SX, Groups]] = {}  # the expression is kept: hashes are addresses

    def depends_on(self, e: ca.SX) -> frozenset[int]:
        """Return the indices of the states that an expression depends on, through signs too."""
        found = (self._dependencies.get(s.element_hash(), frozenset()) for s in ca.symvar(e))
        return frozenset().union(*found)

    def split(self, e: ca.SX) -> Groups:
        """Return the groups of a scalar expression; their sum is the expression."""
        key = e.element_hash()
        if key not in self._cache:
            self._cache[key] = (e, self._split(e))
        return self._cache[key][1]

    def _split(self, e: ca.SX) -> Groups:
        if e.is_constant() or e.is_symbolic() or not self.depends_on(e):
            return {self.depends_on(e): e}
        op, a = e.op(), e.dep(0)
        if op == ca.OP_ADD:
            return _add(self.split(a), self.split(e.dep(1)))
        if op == ca.OP_SUB:
            return _add(self.split(a), _scale(self.split(e.dep(1)), -1))
        if op == ca.OP_NEG:
            return _scale(self.split(a), -1)
        if op == ca.OP_TWICE:
            return _scale(self.split(a), 2)
        if op == ca.OP_MUL:
            return _multiply(self.split(a), self.split(e.dep(1)))
        if op == ca.OP_SQ:
            return _multiply(self.split(a), self.split(a))
        if op == ca.OP_DIV:
            return _multiply(self.split(a), {self.depends_on(e.dep(1)): 1 / e.dep(1)})
        return {self.depends_on(e): e}


def _add(a: Groups, b: Groups) -> Groups:
    total = dict(a)
    for key, term in b.items():
        total[key] = total[key] + term if key in total else term
    return total


def _scale(a: Groups, factor: ca.SX | float) -> Groups:
    return {key: factor * term for key, term in a.items()}


def _multiply(a: Groups, b: Groups) -> Groups:
    total: Groups = {}
    for key, term in a.items():
        total = _add(total, {key | other: ca.SX(0) for other in b})
        for other, factor in b.items():
            total[key | other] = total[key | other] + term * factor
    return total


class Change:
    """The difference e(at) - e(reference) of an expression, formed without subtracting nearly equal numbers.

    ``at``, ``reference`` and ``difference`` give the three for every symbol; symbols not named stay as they are.
    """

    def __init__(self, symbols: ca.SX, reference: ca.SX, difference: ca.SX) -> None:
        self._symbols, self._reference = symbols, reference
        pairs = zip(ca.vertsplit(symbols), ca.vertsplit(difference), strict=True) if symbols.numel() else ()
        self._known = {s.element_hash(): (s, d) for s, d in pairs}  # kept: hashes are addresses

    def at_reference(self, e: ca.SX) -> ca.SX:
        """Return the expression's value at the reference."""
        return ca.substitute(e, self._symbols, self._reference)

    def of(self, e: ca.SX) -> ca.SX:
        """Return e(at) - e(reference)."""
        key = e.element_hash()
        if key not in self._known:
            self._known[key] = (e, self._of(e))
        return self._known[key][1]

    def _of(self, e: ca.SX) -> ca.SX:
        if e.is_constant() or e.is_symbolic():
            return ca.SX(0)
        inner = [e.dep(i) for i in range(e.n_dep())]
        changes = [self.of(d) for d in inner]
        if all(d.is_zero() for d in changes):
            return ca.SX(0)
        before = [self.at_reference(d) for d in inner]
        rule = _RULES.get(e.op())
        if rule is None or (e.op() in _NEEDS_NONZERO and before[0].is_zero()):
            return e - self.at_reference(e)
        return rule(inner, before, changes)


def _ratio(numerator: ca.SX, denominator: ca.SX) -> ca.SX:
    return ca.if_else(denominator != 0, numerator / denominator, 0)


def _power_change(a: list[ca.SX], b: list[ca.SX], d: list[ca.SX]) -> ca.SX:
    direct = a[0] ** a[1] - b[0] ** b[1]
    near = ca.logic_and(b[0] > 0, ca.fabs(d[0]) < 0.5 * b[0])
    ratio = ca.if_else(near, d[0] / b[0], 0)
    return ca.if_else(near, b[0] ** b[1] * ca.expm1(a[1] * ca.log1p(ratio)), direct) if d[1].is_zero() else direct


Rule = Callable[[list[ca.SX], list[ca.SX], list[ca.SX]], ca.SX]
_RULES: dict[int, Rule] = {
    ca.OP_ADD: lambda a, b, d: d[0] + d[1],
    ca.OP_SUB: lambda a, b, d: d[0] - d[1],
    ca.OP_MUL: lambda a, b, d: d[0] * a[1] + b[0] * d[1],
    ca.OP_DIV: lambda a, b, d: (d[0] - b[0] / b[1] * d[1]) / a[1],
    ca.OP_NEG: lambda a, b, d: -d[0],
    ca.OP_TWICE: lambda a, b, d: 2 * d[0],
    ca.OP_SQ: lambda a, b, d: d[0] * (a[0] + b[0]),
    ca.OP_INV: lambda a, b, d: -d[0] / (a[0] * b[0]),
    ca.OP_EXP: lambda a, b, d: ca.exp(b[0]) * ca.expm1(d[0]),
    ca.OP_SIN: lambda a, b, d: 2 * ca.cos((a[0] + b[0]) / 2) * ca.sin(d[0] / 2),
    ca.OP_COS: lambda a, b, d: -2 * ca.sin((a[0] + b[0]) / 2) * ca.sin(d[0] / 2),
    ca.OP_SQRT: lambda a, b, d: _ratio(d[0], ca.sqrt(a[0]) + ca.sqrt(b[0])),
    ca.OP_FABS: lambda a, b, d: _ratio(d[0] * (a[0] + b[0]), ca.fabs(a[0]) + ca.fabs(b[0])),
    ca.OP_LOG: lambda a, b, d: ca.log1p(d[0] / b[0]),
    ca.OP_POW: _power_change,
    ca.OP_CONSTPOW: _power_change,
}
_NEEDS_NONZERO = (ca.OP_POW, ca.OP_CONSTPOW, ca.OP_LOG)

__all__ = ["Change", "Groups", "TermSplitter"]
