"""The CasADi functions of a model: built when first needed, cached by structure, with the numbers as inputs."""

from __future__ import annotations

import functools
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from signlin_ros.engine.symbolic import symbolic
from signlin_ros.engine.tape import Tape
from signlin_ros.errors import ModelError
from signlin_ros.model import Model
from signlin_ros.recording.arm_linear import arm_terms
from signlin_ros.recording.smooth import SmoothForm, smooth_form
from signlin_ros.recording.trace import Structure, Trace, trace
from signlin_ros.sign import valid_expression

MIN_COORDINATE = 1e-290
"""Coordinates below this are 0 to the linearization: their products leave the range of normal numbers."""


class Row(NamedTuple):
    """Where a block of a flat output vector begins, and its shape."""

    start: int
    shape: tuple[int, ...]

    @property
    def stop(self) -> int:
        """Where it ends."""
        return self.start + int(np.prod(self.shape, dtype=int))


def _row_major(e: ca.SX) -> ca.SX:
    return ca.vec(e.T)


def linear_terms(form: SmoothForm, weights: ca.SX, method: str) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return A, B, c and F_j at (x, u) as expressions, by one of the three methods of docs/theory.md.

    F_j is summed from f(0) and the changes too: near x = 0 that is more accurate than the formula as written.
    """
    t = form.trace
    n, m = t.x.numel(), t.u.numel()
    B = form.jacobian(t.f, t.u)
    shift = ca.mtimes(B, t.u) if not form.affine_in_input else ca.SX.zeros(n)
    A, c, f = ca.SX.zeros(n, n), -shift, ca.mtimes(B, t.u) - shift
    for i in range(n):
        for members, term in _terms(form, i, method):
            slopes = form.jacobian(term, t.x)
            change = form.smooth(form.change.of(term))
            rest = ca.SX(0) if form.is_linear(term) else change - ca.mtimes(slopes, t.x)
            rest, coefficients = _absorb(rest, t.x, weights, members, method)
            at_zero = form.smooth(form.change.at_reference(term))
            A[i, :] += slopes + coefficients
            c[i] += at_zero + rest
            f[i] += at_zero + change
    if form.affine_in_input:
        offset = ca.mtimes(B, t.u)
        A, c, f = (ca.substitute(e, t.u, ca.SX.zeros(m)) for e in (A, c, f - offset))
        f += offset
    return A, B, c, f


def _terms(form: SmoothForm, row: int, method: str) -> list[tuple[frozenset[int], ca.SX]]:
    if method == "termwise":
        return list(form.groups(form.trace.f[row]).items())
    return [(frozenset(range(form.trace.x.numel())), form.trace.f[row])]


def _absorb(rest: ca.SX, x: ca.SX, weights: ca.SX, members: frozenset[int], method: str) -> tuple[ca.SX, ca.SX]:
    """Put f~ - J x into A over the weighted coordinates: rest x^T W / (x^T W x); what cannot go there stays in c.

    Lengths are divided by the largest coordinate first, so that nothing under- or overflows near x = 0. Numbers
    below `MIN_COORDINATE`, which lose digits, count as 0.
    """
    coefficients = ca.SX.zeros(1, x.numel())
    if method == "jacobian" or not members:
        return rest, coefficients
    largest = ca.SX(0)
    for i in members:
        largest = ca.fmax(largest, ca.if_else(weights[i] > 0, ca.fabs(x[i]), 0))
    usable = largest > MIN_COORDINATE
    size = ca.if_else(usable, largest, 1)
    ratio = {i: ca.if_else(weights[i] > 0, x[i], 0) / size for i in members}
    square = sum((weights[i] * ratio[i] ** 2 for i in members), ca.SX(0))
    per_size = ca.if_else(usable, rest / size / ca.if_else(usable, square, 1), 0)
    for i in members:
        coefficients[i] = per_size * weights[i] * ratio[i]
    return ca.if_else(usable, 0, rest), coefficients


def _valid(form: SmoothForm) -> ca.SX:
    """Return 1 where every surface lies in the valid range of sign_j (docs/theory.md), else 0."""
    good = ca.SX(1)
    for s in form.signs:
        good = ca.logic_and(good, valid_expression(s.z, form.order))
    return good


@symbolic
@functools.lru_cache(maxsize=256)
def linear_function(structure: Structure, order: int, method: str) -> tuple[ca.Function, dict[str, Row]]:
    """Return the function (x, u, p, scale, weights) -> flat [A row-major, B row-major, c, f, valid]."""
    form = smooth_form(structure, order)
    t = form.trace
    n, m = t.x.numel(), t.u.numel()
    weights = ca.SX.sym("w", n)
    if t.parts is not None:
        A, B, c, f = arm_terms(form, t.parts, secant=method == "per_joint")
    else:
        A, B, c, f = linear_terms(form, weights, method)
    blocks = {"A": _row_major(A), "B": _row_major(B), "c": c, "f": f, "valid": _valid(form)}
    flat = ca.vertcat(*blocks.values())
    rows, start = {}, 0
    for name, shape in (
        ("A", (n, n)),
        ("B", (n, m)),
        ("c", (n,)),
        ("f", (n,)),
        ("valid", ()),
    ):
        rows[name] = Row(start, shape)
        start = rows[name].stop
    flat = ca.densify(ca.cse(flat))
    return ca.Function("linear", [t.x, t.u, t.p, form.scale, weights], [flat]), rows


@symbolic
@functools.lru_cache(maxsize=256)
def smooth_function(structure: Structure, order: int) -> ca.Function:
    """Return the function (x, u, p, scale) -> f_j (n), J = df_j/dx (n x n, row-major), outputs y."""
    form = smooth_form(structure, order)
    t = form.trace
    outputs = [form.smooth(t.f), _row_major(form.jacobian(t.f, t.x)), form.smooth(t.y)]
    flat = ca.densify(ca.cse(ca.vertcat(*outputs)))
    return ca.Function("smooth", [t.x, t.u, t.p, form.scale], [flat])


@symbolic
@functools.lru_cache(maxsize=256)
def exact_function(structure: Structure) -> ca.Function:
    """Return the function (x, u, p, s) -> what the set-valued simulation needs, flat.

    F at s (n), all surfaces g (q), dg_k/dt at s for all surfaces (q), dF/ds for the switches (n x k, row-major),
    d(dg_k/dt)/ds for the switches (k x k, row-major), outputs y.
    """
    t = trace(structure)
    symbols = ca.vertcat(*(s.symbol for s in t.surfaces)) if t.surfaces else ca.SX(0, 1)
    switches = _stack([s.symbol for s in t.surfaces if s.kind == "switch"])
    g = _stack([s.g for s in t.surfaces])
    g_switch = _stack([s.g for s in t.surfaces if s.kind == "switch"])
    rates = ca.mtimes(ca.jacobian(g, t.x), t.f)
    coupling = ca.jacobian(ca.mtimes(ca.jacobian(g_switch, t.x), t.f), switches)
    flat = ca.vertcat(t.f, g, rates, _row_major(ca.jacobian(t.f, switches)), _row_major(coupling), t.y)
    return ca.Function("exact", [t.x, t.u, t.p, symbols], [ca.densify(ca.cse(flat))])


def _stack(items: list[ca.SX]) -> ca.SX:
    return ca.vertcat(*items) if items else ca.SX(0, 1)


@functools.lru_cache(maxsize=256)
@symbolic
def exact_tape(structure: Structure) -> Tape:
    """Return `exact_function` as a tape whose head is F, g and dg/dt: what a step without stuck surfaces needs."""
    t = trace(structure)
    return Tape.of(exact_function(structure), t.x.numel() + 2 * len(t.surfaces))


@functools.lru_cache(maxsize=256)
@symbolic
def smooth_tape(structure: Structure, order: int) -> Tape:
    """Return `smooth_function` as a tape whose head is f_j."""
    return Tape.of(smooth_function(structure, order), trace(structure).x.numel())


@functools.lru_cache(maxsize=256)
@symbolic
def linear_tape(structure: Structure, order: int, method: str) -> tuple[Tape, dict[str, Row]]:
    """Return `linear_function` as a tape."""
    function, rows = linear_function(structure, order, method)
    return Tape.of(function), rows


def weights(model: Model) -> NDArray[np.float64]:
    """Return the state weights (n,) of the optimal linearization, 1 where the model says nothing."""
    return np.array([model.state_weights.get(name, 1.0) for name in model.states])


def scales(model: Model) -> NDArray[np.float64]:
    """Return the scale of every surface (q,): the model's, or chosen so that |g/scale| <= j/3 over its range."""
    surfaces = model.trace.surfaces
    if model.sign_scale > 0.0 or not surfaces:
        return np.full(len(surfaces), model.sign_scale or 1.0)
    if model.trace.parts is not None:
        known = model.operating_range
        return np.array([3.0 / model.sign_order * s.size if s.size else 1.0 for s in surfaces]) * [
            known[s.name] / s.size if s.size and s.name in known else 1.0 for s in surfaces
        ]
    return 3.0 / model.sign_order * _largest(model, model.trace, model.p)


@symbolic
def _largest(model: Model, t: Trace, p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest |g| of every surface over the corners of the operating range."""
    g = ca.vertcat(*(s.g for s in t.surfaces))
    symbols = ca.vertcat(*(s.symbol for s in t.surfaces))
    needed = {str(s) for s in ca.symvar(g)} & {*t.states, *t.inputs}
    held = {name: abs(value) for name, value in model.plant.unrecorded(model.parameters).items()}
    limits = {**held, **model.operating_range}
    missing = sorted(needed - set(limits))
    if missing:
        surfaces = ", ".join(f"surface {s.name}" for s in t.surfaces)
        raise ModelError(
            f"{model.source}: operating_range: {', '.join(missing)} missing;"
            f" sign_scale 0.0 needs the largest |value| of each: {surfaces}"
        )
    names = sorted(needed)
    corners = np.array(np.meshgrid(*([[-1.0, 0.0, 1.0]] * len(names)))).reshape(len(names), -1)
    point = {name: corners[i] * limits[name] for i, name in enumerate(names)}
    columns = [point.get(name, 0.0) for name in (*t.states, *t.inputs)]
    function = ca.Function("g", [t.x, t.u, t.p, symbols], [ca.densify(g)])
    best = np.zeros(len(t.surfaces))
    for sign in (-1.0, 1.0):
        values = Tape.of(function).batch([*columns, *p, *([sign] * len(t.surfaces))])
        best = np.maximum(best, np.max(np.abs(values), axis=1))
    return np.where(best > 0, best, 1.0)


def surface_scales(model: Model) -> dict[str, float]:
    """Return the scale of every surface by its name."""
    return {s.name: float(v) for s, v in zip(model.trace.surfaces, scales(model), strict=True)}


__all__ = [
    "Row",
    "Trace",
    "exact_tape",
    "linear_function",
    "linear_tape",
    "scales",
    "smooth_tape",
    "surface_scales",
]
