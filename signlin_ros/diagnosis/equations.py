"""What `signlin_ros.diagnosis.follow` needs of a model: machine code of its equations with all their derivatives."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import ModelError
from signlin_ros.mathops import Surface
from signlin_ros.native import native
from signlin_ros.tape import Tape
from signlin_ros.trace import Structure, Trace, trace

Array = NDArray[np.float64]
KINKED = 3
"""Least number of substeps where a kink is crossed inside a step, which lowers the order."""
STEEP = 1e4
"""Where a model has several switching surfaces, all but the first are smoothed to tanh(STEEP g / scale)."""


@dataclass(frozen=True)
class Equations:
    """Machine code of a structure for given measured channels and given free parameters.

    ``parameters``: names of everything in p: the model's own in the trace's order, then ``sensor_gain.<channel>``,
    ``sensor_offset.<channel>`` and ``sensor_delay.<channel>`` of every channel. ``free``: those with sensitivities.
    ``substeps``: least number between two samples. ``own``: index of the first state that is an effect's.
    ``delay @ p``: by how much the input is late in s. ``keep``: the tape, for points one by one.
    """

    head: int
    whole: int
    sizes: tuple[int, ...]
    substeps: int
    own: int
    parameters: tuple[str, ...]
    free: tuple[str, ...]
    delay: Array
    keep: Any

    @property
    def delaying(self) -> frozenset[str]:
        """Names of the parameters by which the input is late."""
        return frozenset(n for n, part in zip(self.parameters, self.delay, strict=True) if part)

    def flags(self, with_s: bool, substeps: int = 0) -> tuple[int, ...]:
        """Return the sizes that `signlin_ros.diagnosis.follow.follow` takes; ``substeps``: no fewer than that."""
        return (*self.sizes, int(with_s), max(substeps, self.substeps), self.own)


def sensor_names(channels: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the sensors' parameters, in the order in which p holds them."""
    return tuple(f"sensor_{what}.{c}" for what in ("gain", "offset", "delay") for c in channels)


def _inline(t: Trace) -> tuple[list[ca.SX], list[ca.SX], Surface | None]:
    """Return what replaces every surface's symbol but that of the one switch that is located."""
    located: Surface | None = None
    symbols: list[ca.SX] = []
    values: list[ca.SX] = []
    for surface in t.surfaces:
        if surface.kind == "switch" and located is None:
            located = surface
            continue
        symbols.append(surface.symbol)
        steep = surface.kind == "switch"
        values.append(ca.tanh(STEEP * surface.g) if steep else ca.if_else(surface.g >= 0, 1.0, -1.0))
    return symbols, values, located


def _substituted(expression: ca.SX, symbols: list[ca.SX], values: list[ca.SX]) -> ca.SX:
    for _ in range(4):  # a surface may lie inside another one's expression
        expression = ca.substitute([expression], symbols, values)[0] if symbols else expression
    return expression


def _row_major(matrix: ca.SX) -> ca.SX:
    return ca.reshape(ca.densify(matrix).T, -1, 1)


@functools.lru_cache(maxsize=1024)
def equations(structure: Structure, channels: tuple[str, ...], free: tuple[str, ...]) -> Equations:
    """Return the equations of a structure that shows ``channels`` (states or outputs), with respect to ``free``."""
    t = trace(structure)
    gains, offsets, lags = (ca.SX.sym(what, len(channels)) for what in ("gain", "offset", "lag"))
    names = (*t.parameters, *sensor_names(channels))
    p = ca.vertcat(t.p, gains, offsets, lags)
    wanted = ca.vertcat(*(p[names.index(name)] for name in free)) if free else ca.SX(0, 1)
    symbols, values, located = _inline(t)
    s = located.symbol if located else ca.SX.sym("s")
    g = located.g if located else ca.SX(1)
    shown = ca.vertcat(*(_channel(t, c) for c in channels))
    h = gains * shown + offsets
    # A kink's sign is constant on either side, so derivatives are taken before it is put in.
    rate = ca.mtimes(ca.jacobian(g, t.x), t.f)
    blocks = [
        t.f,
        g,
        rate,
        ca.densify(ca.jacobian(t.f, s)),
        ca.jacobian(rate, s),
        h,
        _row_major(ca.jacobian(t.f, t.x)),
        _row_major(ca.jacobian(t.f, wanted)),
        _row_major(ca.jacobian(rate, t.x)),
        _row_major(ca.jacobian(rate, wanted)),
        _row_major(ca.jacobian(g, t.x)),
        _row_major(ca.jacobian(h, t.x)),
        _row_major(ca.jacobian(h, wanted)),
    ]
    flat = _substituted(ca.densify(ca.vertcat(*blocks)), symbols, values)
    function = ca.Function("follow", [t.x, t.u, p, s], [ca.densify(ca.cse(flat))])
    n = t.x.numel()
    tape = Tape.of(function, 2 * n + 3)
    whole, head = native(tape)
    delay = _delay(t, p)
    i_delay = next((i for i, name in enumerate(free) if delay[names.index(name)] != 0.0), -1)
    coordinate = -1
    if located is not None:
        coordinate = next((i for i, e in enumerate(ca.vertsplit(t.x)) if ca.is_equal(e, g)), -1)
    sizes = (n, t.u.numel(), len(channels), len(free), i_delay, int(located is not None), coordinate)
    own = next((i for i, name in enumerate(t.states) if "." in name), n)
    kinked = any(bool(ca.which_depends(v.g, t.x, 1, False)[0]) for v in t.surfaces if v is not located)
    return Equations(head, whole, sizes, KINKED if kinked else 1, own, names, free, delay, tape)


def neutral_sensors(count: int) -> Array:
    """Return the parameters of ``count`` perfect sensors."""
    return np.concatenate([np.ones(count), np.zeros(2 * count)])


def _channel(t: Trace, name: str) -> ca.SX:
    """Return a measured channel as an expression: a state or an output."""
    if name in t.states:
        return t.x[t.states.index(name)]
    outputs = [o for o in t.outputs if o not in t.states]
    if name in outputs:
        return t.y[outputs.index(name)]
    if name in t.inputs:
        return t.u[t.inputs.index(name)]
    raise ModelError(f"channel {name!r} is neither a state nor an output; known: {', '.join((*t.states, *outputs))}")


def _delay(t: Trace, p: ca.SX) -> Array:
    """Return the delay of the input as weights of the parameters; raise `ModelError` if it is no sum of them."""
    slope = ca.densify(ca.jacobian(t.delay, p))
    if not slope.is_constant():
        raise ModelError("the delay of the input is not a sum of parameters")
    return np.asarray(ca.evalf(slope)).ravel()


__all__ = ["Equations", "equations", "neutral_sensors", "sensor_names"]
