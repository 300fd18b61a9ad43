"""Where a search for a periodic force starts: peaks of the spectrum of the missing force over position, at the orders N
of -A sin(N q + phi). What an observer corrects, and what it leaves, tells of the force; it is binned over position.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, fftconvolve

from signlin_ros.comparison.equations import inertia
from signlin_ros.fitting.candidate import candidate
from signlin_ros.fitting.fit import fit
from signlin_ros.fitting.following import follow_records
from signlin_ros.fitting.gains import ObserverGains, linear_base
from signlin_ros.fitting.problem import MAX_WAVE_STEP, Problem, looks
from signlin_ros.follow.data import travelled
from signlin_ros.follow.tracking import filled
from signlin_ros.model import Model

Array = NDArray[np.float64]

MIN_ORDER_TRAVEL, MIN_ORDER_DISTANCE = 4.0, 6.0
"""Least order, and least distance of two of them, times the way: two thirds of a wave, and about a line's width."""
MAX_SPECTRUM_ORDERS, MIN_STEPS_PER_PERIOD = 4, 6.0
"""Most orders that are taken from one spectrum; steps of an encoder that a period must have, else it is its own."""
MIN_FAST_STEP, TRACE, MIN_TRACE_GAIN = 0.8, 5.0, 30.0
"""Smallest N v dt of a fast one, and least order times the way; for how many time constants of the observer it leaves a
trace, and what that must take from the squares, in means of these: noise takes less at any of a thousand orders."""


def _missing_force(problem: Problem, model: Model) -> tuple[Array, Array, Array]:
    """Return position, velocity and the force that the model lacks, each (T,), where the motion is imposed."""
    plant, rows = model.plant, []
    at, output = model.states.index(plant.position), problem.channels.index(plant.effort)
    for tracker, run in looks(model, problem.segments, problem.channels, problem.force_observers[0]):
        lacks = tracker.outputs(run.state)[:, output] - filled(tracker.t, tracker.y[:, output])
        rows.append((run.state[:, at], tracker.u[:, model.inputs.index(plant.velocity)], lacks))
    q, v, force = map(np.concatenate, zip(*rows, strict=True))
    return q, v, force


def _matched(problem: Problem, model: Model, highest: float, count: int) -> list[tuple[float, float, float]]:
    """Return (N, A / inertia, phi) of fast periodic forces: those that turn by about a radian and more in a sample.

    An observer is too slow for them, but it leaves a trace of each: what it leaves is filtered backwards with its own
    response to a force that acts between two samples (a matched filter), and the amplitudes are those whose response
    fits best. Positions are of a high and of a lower gain: the ones are noisier, the others off by what is missing.
    """
    lines = whole_orders(problem, highest)
    c, (high, lower) = candidate(problem, model, ()), problem.force_observers[:2]
    base = fit(problem, c, lower, None, 4)
    runs = [follow_records(problem, c, c.start() if base is None else base.theta, one, False) for one in (high, lower)]
    seen, starts = response(problem, model, high), []
    for run in runs:
        if runs[0] is None or run is None:
            break
        left = [np.nan_to_num(e / problem.noise) for e in runs[0][0]]
        places = [halfway(model, s.t, X) for X, s in zip(run[2], problem.segments, strict=True)]
        whole = [fftconvolve(e[1:], seen[::-1], axes=0).sum(axis=1)[len(seen) - 1 :][: len(e) - 1] for e in left]
        q, rest = np.concatenate(places), np.concatenate([e[1:].ravel() for e in left])
        slowest = MIN_FAST_STEP / MAX_WAVE_STEP * highest
        for order in _orders(q, np.gradient(q), np.concatenate(whole), highest, count, lines, slowest):
            waves = [np.exp(1j * order * one)[:, None] for one in places]
            trace = np.concatenate([fftconvolve(w, seen, axes=0)[: len(w)].ravel() for w in waves])
            basis = np.column_stack([trace.imag, trace.real])
            sine, cosine = np.linalg.lstsq(basis, rest, rcond=None)[0]
            if np.sum((basis @ (sine, cosine)) ** 2) > MIN_TRACE_GAIN * np.mean(rest**2):
                starts.append((order, float(np.hypot(sine, cosine)), float(np.arctan2(-cosine, -sine))))
    return starts


def halfway(model: Model, t: Array, X: Array) -> Array:
    """Return the position (T - 1,) between every two samples of states (T, n)."""
    plant, names = model.plant, model.states
    known = plant.position in names
    q = X[:, names.index(plant.position)] if known else travelled(t, X[:, names.index(plant.velocity)])
    return np.asarray((q[1:] + q[:-1]) / 2)


def response(problem: Problem, model: Model, gains: ObserverGains) -> Array:
    """Return the innovations (M, ny), over the noise, of an observer of the bare plant after a unit of acceleration."""
    states, A, C = linear_base(model, problem.channels)
    push, dt = (np.array(states) == model.plant.velocity)[:, None].astype(float), problem.scale.step
    free, x, *_ = cont2discrete((A, push, C, np.zeros((len(C), 1))), dt)
    onward = free @ (np.eye(len(states)) - gains.rows(states)[-1] @ C)
    while x.shape[1] <= TRACE * gains.tau / dt:  # twice as many powers each time
        x, onward = np.hstack([x, onward @ x]), onward @ onward
    return np.asarray((C @ x).T / problem.noise)


def _corrections(problem: Problem, model: Model, gains: ObserverGains) -> tuple[Array, Array, Array]:
    """Return position, velocity and the acceleration by which an observer corrects the base model, each (T,).

    What it corrects at a sample was missing since the one before: positions are those in between.
    """
    c, plant = candidate(problem, model, ()), model.plant
    found = follow_records(problem, c, c.start(), gains, False)
    if found is None:
        return np.zeros(2), np.zeros(2), np.zeros(2)
    at = model.states.index(plant.velocity)
    row = gains.rows(model.states)[-1, at] / problem.scale.step
    q = [halfway(model, s.t, X) for X, s in zip(found[2], problem.segments, strict=True)]
    v = np.concatenate([X[1:, at] for X in found[2]])
    return np.concatenate(q), v, np.concatenate([np.nan_to_num(e[1:]) @ row for e in found[0]])


def periodic_starts(problem: Problem, model: Model) -> list[tuple[float, float, float]]:
    """Return the most promising (N, A, phi) of a force -A sin(N q + phi)."""
    highest = min(problem.max_wave_order, finest(problem))
    lines = whole_orders(problem, highest)
    if model.plant.motion_is_imposed():
        q, v, force = _missing_force(problem, model)
        return [_start(q, force, order, 1.0) for order in _orders(q, v, force, highest, MAX_SPECTRUM_ORDERS, lines)]
    mass, starts = inertia(model), list[tuple[float, float, float]]()
    for gains in problem.force_observers[:2]:
        q, v, a = _corrections(problem, model, gains)
        for order in _orders(q, v, a, highest, MAX_SPECTRUM_ORDERS - 1, lines):
            N, A, phase = _start(q, a, order, mass)
            starts += [(N, A, phase), (N, A, phase + np.pi / 2)]  # the observer is late; the sign of A is free
    return starts + [
        (N, A * mass, phase) for N, A, phase in _matched(problem, model, highest, MAX_SPECTRUM_ORDERS // 2)
    ]


def finest(problem: Problem) -> float:
    """Return the largest order that the steps in which a position is shown can tell; inf where none is measured so."""
    place = problem.base.plant.position
    step = float(problem.quanta[problem.channels.index(place)]) if place in problem.channels else 0.0
    return 2 * np.pi / (MIN_STEPS_PER_PERIOD * step) if step > 0.0 else np.inf


def whole_orders(problem: Problem, highest: float) -> Array:
    """Return the whole orders (k,) up to ``highest``, of the joint or of the motor before its gear; none on a slide."""
    gear = problem.base.gear
    return np.union1d(np.arange(1.0, highest), gear * np.arange(1.0, highest / gear)) if problem.turns else np.zeros(0)


def _orders(q: Array, v: Array, a: Array, highest: float, count: int, lines: Array, lowest: float = 0.2) -> list[float]:
    """Return the orders from ``lowest`` to ``highest`` of the highest peaks of a (T,) over q (T,), or of ``lines``."""
    span = float(np.ptp(q))
    if not span > 0:
        return []
    features = np.column_stack([np.ones_like(v), v, np.sign(v), v * np.abs(v)])
    a = a - features @ np.linalg.lstsq(features, a, rcond=None)[0]
    a = np.clip(a, *np.quantile(a, [0.005, 0.995]))
    bins = int(min(2**18, max(256, 4 * span * highest / (2 * np.pi))))
    place = np.minimum(((q - q.min()) / span * bins).astype(int), bins - 1)
    size = 2 ** int(np.ceil(np.log2(4 * bins)))
    spectrum = np.fft.rfft(np.bincount(place, weights=a, minlength=bins), size)
    orders = 2 * np.pi * np.arange(spectrum.size) * bins / (span * size)
    power = np.abs(spectrum) ** 2
    if lines.size:
        orders, power = lines, np.interp(lines, orders, power)
    power = np.where((orders > MIN_ORDER_TRAVEL / span) & (orders > lowest) & (orders <= highest), power, 0.0)
    found: list[float] = []
    while len(found) < count and power.max() > 0:
        found.append(float(orders[int(np.argmax(power))]))
        power[np.abs(orders - found[-1]) < MIN_ORDER_DISTANCE / span] = 0.0
    return found


def _start(q: Array, a: Array, order: float, mass: float) -> tuple[float, float, float]:
    waves = np.column_stack([np.sin(order * q), np.cos(order * q)])
    s, c = np.linalg.lstsq(waves, a, rcond=None)[0]
    return order, float(mass * np.hypot(s, c)), float(np.arctan2(-c, -s))


__all__ = ["finest", "halfway", "periodic_starts", "response"]
