"""Simulation under held inputs: `exact` (set-valued), `smooth` (f_j) and `piecewise` (A_k held for a period).

``exact`` locates every crossing of a switching surface inside the step, then sticks or slips by the set-valued law:
a stuck shaft stands exactly still. Between crossings it is an adaptive method of order 5.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from signlin_ros.compiled import exact_tape, linear_tape, scales, smooth_tape, weights
from signlin_ros.engine.exact import exact_plan, run_exact
from signlin_ros.engine.native import native
from signlin_ros.engine.parts import CHATTER, DIVERGED, OK, TOO_STIFF
from signlin_ros.engine.piecewise import run_piecewise
from signlin_ros.engine.smooth import flow_many, run_smooth, smooth_plan
from signlin_ros.engine.symbolic import symbolic
from signlin_ros.errors import InputError, SimulationError, choices, suggest
from signlin_ros.lazy import drawn_by, frame
from signlin_ros.model import Model
from signlin_ros.recording.trace import Structure, trace

Array = NDArray[np.float64]
KINDS = ("exact", "smooth", "piecewise")
_EVENT_NAMES = ("crossed", "stuck", "slips")
_WHY = {
    DIVERGED: "it diverges",
    TOO_STIFF: "it needs too many steps (too stiff)",
    CHATTER: "it crosses switching surfaces without end in no time",
}
HALVED = 0.5 - 1.0 / np.sqrt(12.0)
"""Part of a step after a sample, and before the next, in which a stepwise input has their values, its mean in between:
over the step its mean and its first moment are then those of a straight line."""


@dataclass(frozen=True)
class Trajectory:
    """A simulated run: t (T,), u (T, m), x (T, n), y (T, outputs) with their names.

    ``events`` are (time, surface, what) with what one of "crossed", "stuck", "slips"; `exact` only.
    """

    t: Array
    u: Array
    x: Array
    y: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    events: tuple[tuple[float, str, str], ...] = ()

    def __getitem__(self, name: str) -> Array:
        """Return a state, output or input (T,) by its name."""
        for names, values in ((self.states, self.x), (self.outputs, self.y), (self.inputs, self.u)):
            if name in names:
                return np.asarray(values[:, names.index(name)])
        raise KeyError(name)

    def to_frame(self) -> Any:
        """Return inputs, states and outputs (T,) by name as a pandas DataFrame over t in s."""
        names = dict.fromkeys((*self.inputs, *self.states, *self.outputs))
        return frame({"t": self.t, **{name: self[name] for name in names}}, index="t")

    plot = drawn_by("signlin_ros.plotting", "trajectory_figure")


def simulate(
    model: Model,
    t: ArrayLike,
    u: ArrayLike,
    x0: ArrayLike | None = None,
    kind: str = "exact",
    rtol: float = 1e-6,
    acts: ArrayLike | None = None,
) -> Trajectory:
    """Simulate a model under inputs that are held from each time to the next, or as its ``input_hold`` says; where that
    is ``auto`` no record is asked, and they are held.

    Parameters
    ----------
    model : Model
        The model; its input delay shifts the inputs, before its first sample an input has that sample's value.
    t : array_like (T,)
        Increasing times in s.
    u : array_like (T, m)
        Inputs in the model's order and units.
    x0 : array_like (n,), optional
        State at t[0]; by default the model's ``initial_state``.
    kind : str
        ``exact`` (set-valued: what sticks stands still), ``smooth`` (f_j) or ``piecewise`` (A_k held for a period).
    rtol : float
        Relative tolerance of the integrator.
    acts : array_like (T,), optional
        From when each row of ``u`` acts, where inputs have a clock of their own.

    Returns
    -------
    Trajectory
        Times, inputs, states (T, n), outputs, and events of sticking and slipping.

    Raises
    ------
    InputError
        Bad arguments.
    SimulationError
        The run diverges; the message says when.
    """
    times, inputs, start = _checked(model, t, u, x0)
    if kind not in KINDS:
        raise InputError(f"kind {kind!r}; known: {choices(KINDS)}{suggest(kind, KINDS)}")
    if not 1e-14 <= rtol <= 0.1:
        raise InputError(f"rtol is {rtol!r}; allowed: [1e-14, 0.1]")
    X = np.empty((times.size, start.size))
    extra = model.outputs != model.states
    Y = np.empty((times.size, len(model.outputs) if extra else 0))
    breaks = _acting(times, acts) + model.delay
    breaks[1:] -= model.early * np.diff(times)
    breaks[0] = times[0]
    run = {"exact": _run_exact, "smooth": _run_smooth, "piecewise": _run_piecewise}[kind]
    rows, breaks = interpolated(inputs, breaks) if model.interpolates else (inputs, breaks)
    status, when, events = run(model, times, breaks, rows, start, rtol, X, Y)
    if status != OK:
        raise SimulationError(f"{model.source}: the {kind} simulation stops at t = {when:.6g} s: {_WHY[status]}")
    y = Y if extra else X
    return Trajectory(times, inputs, X, y, model.states, model.inputs, model.outputs, events)


def interpolated(u: Array, t: Array) -> tuple[Array, Array]:
    """Return rows of inputs (2 T - 1, m), and from when each acts (2 T - 1,), that stand for straight lines between u
    (T, m) at t (T,): see `HALVED`.
    """
    rows, acts, steps = np.empty((2 * t.size - 1, u.shape[1])), np.empty(2 * t.size - 1), np.diff(t)
    rows[::2], rows[1::2] = u, 0.5 * (u[1:] + u[:-1])
    acts[0], acts[1::2], acts[2::2] = t[0], t[:-1] + HALVED * steps, t[1:] - HALVED * steps
    return rows, acts


def _acting(times: Array, acts: ArrayLike | None) -> Array:
    """Return from when each row of the inputs acts (T,)."""
    if acts is None:
        return times
    found = np.asarray(acts, dtype=float)
    if found.shape != times.shape or not np.isfinite(found).all() or (np.diff(found) < 0).any():
        raise InputError(f"acts (T,) must be times that do not decrease, one for each of {times.size} rows")
    return found


def _checked(model: Model, t: ArrayLike, u: ArrayLike, x0: ArrayLike | None) -> tuple[Array, Array, Array]:
    times = np.ascontiguousarray(np.atleast_1d(np.asarray(t, dtype=float)))
    m, n = len(model.inputs), len(model.states)
    inputs = (
        np.ascontiguousarray(np.asarray(u, dtype=float).reshape(times.size, -1)) if np.size(u) else np.zeros((0, 0))
    )
    start = np.array(model.x0 if x0 is None else x0, dtype=float).reshape(-1)
    if inputs.shape != (times.size, m) or start.size != n or times.size < 1:
        raise InputError(f"t (T,), u (T, {m}), x0 ({n},) are needed; found {times.shape}, {np.shape(u)}, {start.shape}")
    if not (np.isfinite(times).all() and np.isfinite(inputs).all() and np.isfinite(start).all()):
        raise InputError("times, inputs and the initial state must be finite numbers")
    if (np.diff(times) <= 0).any():
        raise InputError(f"times must increase; they do not at sample {int(np.argmax(np.diff(times) <= 0)) + 1}")
    return times, inputs, start


@functools.lru_cache(maxsize=256)
@symbolic
def _exact_plan(structure: Structure) -> tuple[np.void, NDArray[np.int64]]:
    """Return the arguments of the exact kernel: a plan, and which surface is a coordinate and which a switch."""
    t = trace(structure)
    x = ca.vertsplit(t.x)
    coordinate = [next((i for i, e in enumerate(x) if ca.is_equal(e, s.g)), -1) for s in t.surfaces]
    switches = [i for i, s in enumerate(t.surfaces) if s.kind == "switch"]
    switch_of = [switches.index(i) if i in switches else -1 for i in range(len(t.surfaces))]
    links = np.array([coordinate, switch_of], dtype=np.int64).reshape(2, -1)
    sizes = (t.x.numel(), t.u.numel(), t.p.numel(), len(t.surfaces), len(switches), t.y.numel())
    return exact_plan(native(exact_tape(structure)), *sizes), links


def exact_plan_of(model: Model) -> tuple[np.void, NDArray[np.int64]]:
    """Return the arguments of other kernels: a plan, and the links of its surfaces."""
    return _exact_plan(model.structure)


@functools.lru_cache(maxsize=256)
@symbolic
def _smooth_plan(structure: Structure, order: int) -> np.void:
    t = trace(structure)
    sizes = (t.x.numel(), t.u.numel(), t.p.numel() + len(t.surfaces), t.y.numel())
    return smooth_plan(native(smooth_tape(structure, order)), *sizes)


@functools.lru_cache(maxsize=256)
@symbolic
def _piecewise_plan(structure: Structure, order: int, method: str) -> np.void:
    t, n = trace(structure), trace(structure).x.numel()
    sizes = (n, t.u.numel(), t.p.numel() + len(t.surfaces) + n, t.y.numel())
    tape, rows = linear_tape(structure, order, method)
    rest = tape.n_out - rows["c"].stop
    return smooth_plan(native(smooth_tape(structure, order)), *sizes, native(tape)[0], rest)


def _run_exact(
    model: Model, times: Array, breaks: Array, inputs: Array, x0: Array, rtol: float, X: Array, Y: Array
) -> tuple[int, float, tuple[tuple[float, str, str], ...]]:
    plan, links = _exact_plan(model.structure)
    events = np.zeros((10_000 if plan["q"] else 0, 3))
    t, u = _not_written_to(times, inputs)
    status, when, count = run_exact(plan, links, t, breaks, u, x0, model.p, rtol, X, Y, events)
    names = [s.name for s in model.trace.surfaces]
    found = tuple((float(e[0]), names[int(e[1])], _EVENT_NAMES[int(e[2])]) for e in events[:count])
    return status, when, found


def _not_written_to(times: Array, inputs: Array) -> tuple[Array, Array]:
    """Return views that may not be written to, as arrays of a record: for others Numba compiles every kernel again."""
    t, u = times.view(), inputs.view()
    t.flags.writeable = u.flags.writeable = False
    return t, u


def _smooth_constants(model: Model) -> Array:
    return np.concatenate([model.p, scales(model)])


def _run_smooth(
    model: Model, times: Array, breaks: Array, inputs: Array, x0: Array, rtol: float, X: Array, Y: Array
) -> tuple[int, float, tuple[()]]:
    plan = _smooth_plan(model.structure, model.sign_order)
    t, u = _not_written_to(times, inputs)
    status, when = run_smooth(plan, t, breaks, u, x0, _smooth_constants(model), rtol, X, Y)
    return status, when, ()


def _run_piecewise(
    model: Model, times: Array, breaks: Array, inputs: Array, x0: Array, rtol: float, X: Array, Y: Array
) -> tuple[int, float, tuple[()]]:
    plan = _piecewise_plan(model.structure, model.sign_order, model.linearization)
    period = model.update_period
    count = int(np.floor((times[-1] - times[0]) / period + 1e-9)) + 1
    updates = _snapped(times[0] + period * np.arange(count), times)
    half = period / 2 if model.operating_point == "midpoint" else 0.0
    constants = np.concatenate([_smooth_constants(model), weights(model)])
    t, u = _not_written_to(times, inputs)
    status, when = run_piecewise(plan, t, breaks, u, x0, constants, updates, half, X, Y)
    return status, when, ()


def _snapped(updates: Array, times: Array) -> Array:
    """Move each update that coincides with a sample, but for rounding, onto that sample."""
    near = times[np.clip(np.searchsorted(times, updates), 0, times.size - 1)]
    before = times[np.clip(np.searchsorted(times, updates) - 1, 0, times.size - 1)]
    closest = np.where(np.abs(near - updates) < np.abs(before - updates), near, before)
    return np.where(np.abs(closest - updates) < 1e-9 * np.maximum(1.0, np.abs(updates)), closest, updates)


class SmoothFlow:
    """Where f_j arrives from a state after a fixed time with the input held: the midpoint predictor."""

    def __init__(self, model: Model, span: float, rtol: float = 1e-9) -> None:
        self._plan = _smooth_plan(model.structure, model.sign_order)
        self._constants, self._span, self._rtol = _smooth_constants(model), span, rtol

    def __call__(self, x: Array, u: Array) -> Array:
        """Return the state (n,) reached from x (n,) under u (m,)."""
        return np.asarray(self.many(x[None, :], u[None, :])[0])

    def many(self, x: Array, u: Array) -> Array:
        """Return the states (T, n) reached from x (T, n) under u (T, m); NaN where the run diverges."""
        points = x.copy()
        flow_many(self._plan, points, np.ascontiguousarray(u), self._constants, self._span, self._rtol)
        return np.asarray(points)


class Stepper:
    """A simulation that is continued step by step, e.g. by a plant-simulator node.

    ``kind`` is "exact" or "smooth"; an input delay is kept between steps. ``x`` (n,) is the present state.
    """

    def __init__(self, model: Model, x0: ArrayLike | None = None, kind: str = "exact", rtol: float = 1e-6) -> None:
        if kind not in ("exact", "smooth"):
            raise InputError(f"kind {kind!r}; known: exact, smooth")
        self.model, self.kind, self.rtol = model, kind, rtol
        self.x = np.array(model.x0 if x0 is None else x0, dtype=float)
        self._run = _run_exact if kind == "exact" else _run_smooth
        self._t = 0.0
        self._history: list[tuple[float, Array]] = []
        self._y = np.empty(0)

    @property
    def y(self) -> Array:
        """The present outputs (outputs,): the states, or what the plant says."""
        return np.asarray(self._y if self._y.size else self.x)

    def advance(self, dt: float, u: ArrayLike) -> Array:
        """Advance ``dt`` seconds with the input u (m,) held from now on; returns the new state (n,)."""
        value = np.array(u, dtype=float).reshape(len(self.model.inputs))  # a copy: it may be kept for a delay
        if not (dt > 0.0 and np.isfinite(dt) and np.isfinite(value).all()):
            raise InputError(f"dt must be positive and u finite; found dt = {dt}, u = {value.tolist()}")
        self._history.append((self._t + self.model.delay, value))
        while len(self._history) > 1 and self._history[1][0] <= self._t:
            self._history.pop(0)
        breaks = np.array([max(when, self._t) for when, _ in self._history]) - self._t
        inputs = np.array([v for _, v in self._history])
        breaks[0] = 0.0
        X = np.empty((2, self.x.size))
        Y = np.empty((2, len(self.model.outputs) if self.model.outputs != self.model.states else 0))
        arguments = (self.model, np.array([0.0, dt]), breaks, inputs, self.x, self.rtol, X, Y)
        status, when, _ = self._run(*arguments)
        if status != OK:
            raise SimulationError(f"{self.model.source}: the simulation stops {when:.3g} s into a step: {_WHY[status]}")
        self._t += dt
        self.x, self._y = X[1], Y[1]
        return np.asarray(self.x)
