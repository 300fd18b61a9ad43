"""What `signlin_ros.follow.loop` needs of a model: machine code of its equations with all their derivatives."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from signlin_ros.engine.compiling import caller
from signlin_ros.engine.native import native, translated
from signlin_ros.engine.symbolic import symbolic
from signlin_ros.engine.tape import Tape
from signlin_ros.errors import ModelError
from signlin_ros.follow.steps import DECLARED, carrier, corrected, pace, padded, runge_kutta, seen
from signlin_ros.mathops import Surface
from signlin_ros.recording.trace import Structure, Trace, trace

Array = NDArray[np.float64]
Pattern = NDArray[np.bool_]
KINKED = 3
"""Least number of substeps where a kink is crossed inside a step, which lowers the order."""
OFF, MIN_COUNTED_DAMPING = 1e-3, 0.005
"""Largest error of a resonance's frequency, as a part of its width, and the least damping ratio that counts."""
STEEP = 1e4
"""Where a model has several switching surfaces, all but the first are smoothed to tanh(STEEP g / scale)."""


class Places(NamedTuple):
    """Where the channels h (ny), dh/dx (ny, n) and dF/dx (n, n) begin."""

    h: int
    h_x: int
    J: int


@dataclass(frozen=True)
class Equations:
    """Machine code of a structure for given measured channels and given free parameters.

    ``code``: addresses of what `signlin_ros.follow.loop` calls: F and the surface alone; everything; the
    fastest rate; a step in which the surface is left alone, one in which it is stuck to; of the sensitivities a
    step, what is seen of them, and how an observer corrects them; everything but derivatives to parameters.
    ``brief``: the same for following without these, where everything ends with dF/dx. ``pattern``: where dF/dx may
    differ from 0. ``parameters``: names of everything in p: the model's own in the trace's order, then
    ``sensor_gain.<channel>``, ``sensor_offset.<channel>`` and ``sensor_delay.<channel>`` of every channel.
    ``free``: those with sensitivities. ``substeps``: least number between two samples. ``own``: index of the first
    state that is an effect's. ``delay @ p``: by how much the input is late in s. ``keep``: the tape of what is
    known without sensitivities, for points one by one. ``lasting``: indices of the states that may ring for long:
    the plant's and those of resonant effects.
    """

    code: tuple[int, ...]
    brief: tuple[int, ...]
    pattern: Pattern
    sizes: tuple[int, ...]
    substeps: int
    own: int
    parameters: tuple[str, ...]
    free: tuple[str, ...]
    delay: Array
    keep: Any
    lasting: tuple[int, ...]

    @functools.cached_property
    def _spread(self) -> int:
        """Address of a step of a covariance."""
        n = self.sizes[0]
        text = carrier("tape_spread", self.pattern, np.zeros((n, padded(n)), dtype=bool))
        return translated("\n".join([*DECLARED, text]), ("spread",))[0]

    def calls(self, with_s: bool, aware: bool = False) -> tuple[int, ...]:
        """Return the addresses that `signlin_ros.follow.loop.follow` takes; ``aware``: with a Kalman filter."""
        return (*(self.code if with_s and self.free else self.brief), self._spread if aware else 0)

    def flags(self, with_s: bool, substeps: int = 0) -> tuple[int, ...]:
        """Return the sizes that `signlin_ros.follow.loop.follow` takes; ``substeps``: no fewer than that."""
        n, m, ny, count, *rest = self.sizes
        places = self.places
        with_s = with_s and count > 0  # where nothing is free there is no machine code for sensitivities
        count = count if with_s else 0
        return (n, m, ny, count, *rest, int(with_s), max(substeps, self.substeps), self.own, places.J, padded(count))

    def ringing(self, p: Array, scale: Array) -> float:
        """Return the largest product of a step and the fastest rate of what rings in which RK4 keeps every resonance.

        A step of h makes one of frequency w ring too slowly by (h w)^4 / 120, which is small only beside its width: the
        model at rest decides. Infinite where nothing rings. ``scale`` (n): sizes of the states.
        """
        n, m, *_ = self.sizes
        result = np.zeros(self.places.J + n * n)
        caller(self.brief[1])(np.concatenate([np.zeros(n + m), p, [0.0]]), result)
        lasting = np.array(self.lasting)
        J = result[self.places.J :].reshape(n, n)[lasting[:, None], lasting]
        return _ringing(J.tobytes(), scale[lasting].tobytes())

    @property
    def places(self) -> Places:
        """Where in everything what is known without sensitivities begins."""
        n, _, ny, *_ = self.sizes
        return _places(n, ny)


@functools.lru_cache(maxsize=4096)
def _ringing(jacobian: bytes, scale: bytes) -> float:
    """Return `Equations.ringing` of a model with J (k, k) at rest and states of these sizes (k): a fit's steps change
    much that does not act there, and all its observers ask for the same.
    """
    own = np.frombuffer(scale)
    J = np.frombuffer(jacobian).reshape(own.size, own.size)
    if not np.isfinite(J).all():
        return np.inf
    rates = np.linalg.eigvals(J)
    rates = rates[rates.imag > 0.0]
    if not rates.size:
        return np.inf
    size = np.abs(rates)
    fastest = np.sqrt(np.max((np.abs(J @ J) * own / own[:, None]).sum(axis=1)))
    damping = np.maximum(-rates.real / size, MIN_COUNTED_DAMPING)
    return float(fastest * np.min((240.0 * OFF * damping) ** 0.25 / size))


def _places(n: int, ny: int) -> Places:
    """Return where the results of a model of n states with ny channels begin."""
    h = 2 * n + 3
    return Places(h, h + ny, h + ny + ny * n + n)


def sensor_names(channels: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the sensors' parameters, in the order in which p holds them."""
    return tuple(f"sensor_{what}.{c}" for what in ("gain", "offset", "delay") for c in channels)


def _inline(t: Trace) -> tuple[list[ca.SX], list[ca.SX], Surface | None]:
    """Return the substitutes of every surface's symbol but that of the one switch that is located."""
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
@symbolic
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
    h = gains * ca.vertcat(*(_channel(t, c) for c in channels)) + offsets
    # A kink's sign is constant on either side, so derivatives are taken before it is put in.
    rate = ca.mtimes(ca.jacobian(g, t.x), t.f)
    n, count = t.x.numel(), len(free)
    none = padded(count) - count
    F_s, rate_x = ca.jacobian(t.f, s), ca.jacobian(rate, t.x)
    J, P, rate_p = ca.jacobian(t.f, t.x), ca.jacobian(t.f, wanted), ca.jacobian(rate, wanted)
    h_x, h_p = ca.jacobian(h, t.x), ca.jacobian(h, wanted)
    blocks = [
        t.f,
        g,
        rate,
        F_s,
        ca.jacobian(rate, s),
        h,
        _row_major(h_x),
        _row_major(rate_x),
        _row_major(J),
    ]
    more = [
        _row_major(ca.horzcat(P, ca.SX(n, none))),
        _row_major(ca.horzcat(rate_p, ca.SX(1, none))),
        _row_major(ca.jacobian(g, t.x)),
        _row_major(ca.horzcat(h_p, ca.SX(len(channels), none))),
    ]

    def tape(blocks: list[ca.SX], head: int | None = None) -> Tape:
        flat = _substituted(ca.densify(ca.vertcat(*blocks)), symbols, values)
        return Tape.of(ca.Function("follow", [t.x, t.u, p, s], [ca.densify(ca.cse(flat))]), head)

    known = tape(blocks, 2 * n + 3)
    full = tape(blocks + more) if free else known
    moved = _pattern(J, F_s, rate_x), _pattern(P, F_s, rate_p)
    places = _places(n, len(channels))
    zeros = set(range(places.h, full.n_out)) - _rewritten(places.J, *moved)
    body, head = native(known, zeros)
    whole = native(full, zeros)[0] if free else body
    lasting = _lasting(structure, t)
    steps = _steps(moved, (_there(h_x), _there(h_p)), lasting, known, located is not None)
    delay = _delay(t, p)
    i_delay = next((i for i, name in enumerate(free) if delay[names.index(name)] != 0.0), -1)
    coordinate = -1
    if located is not None:
        coordinate = next((i for i, e in enumerate(ca.vertsplit(t.x)) if ca.is_equal(e, g)), -1)
    sizes = (n, t.u.numel(), len(channels), len(free), i_delay, int(located is not None), coordinate)
    own = next((i for i, name in enumerate(t.states) if "." in name), n)
    kinked = any(bool(ca.which_depends(v.g, t.x, 1, False)[0]) for v in t.surfaces if v is not located)
    code, brief = (head, whole, *steps, body), (head, body, *steps[:3], 0, 0, 0, body)
    least = KINKED if kinked else 1
    return Equations(code, brief, moved[0], sizes, least, own, names, free, delay, known, lasting)


def _lasting(structure: Structure, t: Trace) -> tuple[int, ...]:
    """Return the indices of the states that may ring for long."""
    resonant = {slot.key for slot in structure.slots if slot.effect.resonant}
    return tuple(i for i, name in enumerate(t.states) if name.rpartition(".")[0] in {"", *resonant})


def _there(matrix: ca.SX) -> Pattern:
    """Return where a matrix may differ from 0."""
    return np.array(ca.DM(matrix.sparsity(), 1).full(), dtype=bool)


def _pattern(matrix: ca.SX, F_s: ca.SX, rate: ca.SX) -> Pattern:
    """Return where a derivative of F may differ from 0, and where it may if the surface is stuck to."""
    return np.asarray(_there(matrix) | (_there(F_s) & _there(rate)))


def _rewritten(at: int, J: Pattern, P: Pattern) -> set[int]:
    """Return which results change where the surface is stuck to: those of dF/dx, from ``at`` on, and of dF/dp."""
    return set((at + np.flatnonzero(np.concatenate([J.ravel(), _wide(P).ravel()]))).tolist())


def _wide(pattern: Pattern) -> Pattern:
    """Return a pattern with columns of zeros up to the `padded` width."""
    return np.pad(pattern, ((0, 0), (0, padded(pattern.shape[1]) - pattern.shape[1])))


def _steps(
    moved: tuple[Pattern, Pattern], shown: tuple[Pattern, Pattern], lasting: tuple[int, ...], tape: Tape, switched: bool
) -> tuple[int, ...]:
    """Return the addresses of the fastest rate, of a free and a stuck step, and for sensitivities those of a step, of
    what is seen and of a correction (0: none). Where F and h depend on x and p: ``moved`` and ``shown``.
    """
    (J, P), (H, S) = moved, shown
    (n, count), ny = P.shape, H.shape[0]
    parts, declared = {"pace": pace("tape_pace", J, lasting)}, set[str]()
    for name, stuck in (("free", False), ("stuck", True)) if switched else (("free", False),):
        parts[name], calls = runge_kutta(f"tape_{name}", tape, n, stuck)
        declared |= calls
    if count:
        width = padded(count)
        parts["carry"] = carrier("tape_carry", J, _wide(P))
        places = _places(n, ny)
        parts["seen"] = seen("tape_seen", H, _wide(S), (places.h_x, places.J + n * n + n * width + width + n))
    lines = [*DECLARED, *sorted(declared - set(DECLARED)), *parts.values()]
    found = dict(zip(parts, translated("\n".join(lines), tuple(parts)), strict=True))
    addresses = (found.get(name, 0) for name in ("pace", "free", "stuck", "carry", "seen"))
    return (*addresses, _correction(n, ny, padded(count)) if count else 0)


@functools.cache
def _correction(n: int, ny: int, width: int) -> int:
    """Return the address of an observer's correction of sensitivities."""
    return translated("\n".join([*DECLARED, corrected("tape_corrected", n, ny, width)]), ("corrected",))[0]


def neutral_sensors(count: int) -> Array:
    """Return the parameters of ``count`` perfect sensors."""
    return np.concatenate([np.ones(count), np.zeros(2 * count)])


def _channel(t: Trace, name: str) -> ca.SX:
    """Return a measured channel as an expression: a state or an output."""
    if name in t.states:
        return t.x[t.states.index(name)]
    if name in t.outputs:
        return t.y[t.outputs.index(name)]
    if name in t.inputs:
        return t.u[t.inputs.index(name)]
    known = ", ".join(dict.fromkeys((*t.states, *t.outputs)))
    raise ModelError(f"channel {name!r} is neither a state nor an output; known: {known}")


def _delay(t: Trace, p: ca.SX) -> Array:
    """Return the delay of the input as weights of the parameters; raise `ModelError` if it is no sum of them."""
    slope = ca.densify(ca.jacobian(t.delay, p))
    if not slope.is_constant():
        raise ModelError("the delay of the input is not a sum of parameters")
    return np.asarray(ca.evalf(slope)).ravel()


__all__ = ["Equations", "equations", "neutral_sensors", "sensor_names"]
