"""What every rig has: a machine that moves under a controller, sensors, and a logger that writes a table.

A machine is ``law(t, y, u, p, rate, dry)``: it writes the rates (n,) of the states y (n,) without dry friction, and
into ``dry`` (n,) the largest rate that dry friction takes from a state which is a velocity (0: none). A controller is
``control(r, y, z, memory, c)``: it returns u from the reference r, the states, three standard normal numbers z of this
tick and a memory (8,) of its own. p and c are tuples of floats. SI units.

A machine and a controller are compiled by themselves, and what marches, once for all of them, calls them by address.

Method: the midpoint rule with steps of some 20 µs. Dry friction is implicit: it stops a velocity that it can stop
within the step, and opposes one that it cannot [Moreau 1988, doi:10.1007/978-3-7091-2624-0_1].
"""

# mypy: disable-error-code="no-any-return"
from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numba import float64, int64, njit, types
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
RPM = 30 / np.pi
"""Revolutions per minute in a rad/s."""
STEP = 2e-5
"""Of the integration unless a machine says otherwise, s."""


@dataclass(frozen=True)
class Run:
    """What happened: states (K, n) and inputs (K,) at the ticks (K,) of the controller, s."""

    t: Array
    y: Array
    u: Array
    tick: float

    def at(self, period: float, jitter: float = 0.0, rng: np.random.Generator | None = None) -> NDArray[np.int64]:
        """Return the ticks at which a logger of some period reads; ``jitter``: standard deviation of its delay, s."""
        rows = np.arange(0, len(self.t), round(period / self.tick))
        if rng is None or not jitter:
            return rows
        late = np.round(np.abs(rng.normal(0.0, jitter, len(rows))) / self.tick).astype(int)
        return np.minimum(np.maximum.accumulate(rows + late), len(self.t) - 1)


_ROW = float64[::1]
_LAW = types.FunctionType(types.void(float64, _ROW, float64, _ROW, _ROW, _ROW))
_CONTROL = types.FunctionType(float64(float64, _ROW, _ROW, _ROW, _ROW))


_FROM_COMPILED = {"no_cpython_wrapper": True}
"""Options of what Python itself never calls: to write what it would call takes a fifth of the compilation."""


@functools.cache
def _law(law: Any, count: int) -> Any:
    """Return a machine of so many numbers p as what marches calls it, with an array of them."""
    law = njit(**_FROM_COMPILED, no_cfunc_wrapper=True)(law.py_func)

    @njit(_LAW.signature, error_model="numpy", **_FROM_COMPILED)
    def called(t: float, y: Array, u: float, p: Array, rate: Array, dry: Array) -> None:
        law(t, y, u, to_fixed_tuple(p, count), rate, dry)

    return called


@functools.cache
def _controller(control: Any, count: int) -> Any:
    """Return a controller of so many numbers c in the same way."""
    control = njit(**_FROM_COMPILED, no_cfunc_wrapper=True)(control.py_func)

    @njit(_CONTROL.signature, error_model="numpy", **_FROM_COMPILED)
    def called(r: float, y: Array, z: Array, memory: Array, c: Array) -> float:
        return control(r, y, z, memory, to_fixed_tuple(c, count))

    return called


@njit
def _stopped(v: float, most: float) -> float:
    return 0.0 if abs(v) <= most else v - most * np.sign(v)


@njit
def _step(law: Any, t: float, y: Array, u: float, p: Any, h: float, rate: Array, dry: Array, half: Array) -> None:
    dry[:] = 0.0
    law(t, y, u, p, rate, dry)
    for i in range(y.size):
        half[i] = _stopped(y[i] + 0.5 * h * rate[i], 0.5 * h * dry[i])
    dry[:] = 0.0
    law(t + 0.5 * h, half, u, p, rate, dry)
    for i in range(y.size):
        y[i] = _stopped(y[i] + h * rate[i], h * dry[i])


def _marched(
    law: Any, control: Any, y: Array, r: Array, z: Array, p: Any, c: Any, tick: float, parts: int
) -> tuple[Array, Array]:
    states, inputs = np.empty((r.size, y.size)), np.empty(r.size)
    rate, dry, half, memory = np.zeros(y.size), np.zeros(y.size), np.zeros(y.size), np.zeros(8)
    h = tick / parts
    for k in range(r.size):
        u = control(r[k], y, z[k], memory, c)
        states[k], inputs[k] = y, u
        for j in range(parts):
            _step(law, (k * parts + j) * h, y, u, p, h, rate, dry, half)
    return states, inputs


@functools.cache
def _march() -> Any:
    """Return `_marched`, compiled when it is first asked for."""
    return njit((_LAW, _CONTROL, _ROW, _ROW, float64[:, ::1], _ROW, _ROW, float64, int64))(_marched)


@njit
def given(r: float, y: Array, z: Array, memory: Array, c: Any) -> float:
    """Drive in the open loop: the reference is the input."""
    return r


@njit
def speed_loop(r: float, y: Array, z: Array, memory: Array, c: Any) -> float:
    """Hold a speed by a PI controller: c is (index of the speed, K_p, K_i, tick, limit, noise of the speed)."""
    index, K_p, K_i, tick, limit, noise = c
    e = r - y[int(index)] - noise * z[0]
    u = K_p * e + memory[0]
    if abs(u) < limit:
        memory[0] += K_i * tick * e
    return min(max(u, -limit), limit)


@njit
def position_loop(r: float, y: Array, z: Array, memory: Array, c: Any) -> float:
    """Hold a position by a P-PI cascade: c is (position, speed, K_v, K_p, K_i, tick, limit, encoder's step).

    The speed is the filtered difference of the encoder's counts.
    """
    position, _, K_v, K_p, K_i, tick, limit, count = c
    q = np.floor(y[int(position)] / count) * count
    if memory[3] == 0.0:
        memory[1], memory[3] = q, 1.0
    memory[2] += 0.3 * ((q - memory[1]) / tick - memory[2])
    memory[1] = q
    e = K_v * (r - q) - memory[2]
    u = K_p * e + memory[0]
    if abs(u) < limit:
        memory[0] += K_i * tick * e
    return min(max(u, -limit), limit)


@njit
def falling(v: float, mu: float, excess: float, v_s: float) -> float:
    """Return the level of dry friction that falls from breakaway to sliding (Stribeck's curve)."""
    return mu + excess * np.exp(-((v / v_s) ** 2))


def simulate(
    law: Any,
    start: Any,
    reference: Array,
    tick: float,
    p: tuple[float, ...],
    rng: np.random.Generator,
    control: Any = given,
    c: tuple[float, ...] = (0.0,),
    step: float = STEP,
) -> Run:
    """Return how a machine moves from a start while its controller follows a reference (K,), one value each tick."""
    noise = rng.standard_normal((len(reference), 3))
    parts = max(1, round(tick / step))
    numbers = (np.array(values, dtype=float) for values in (p, c))
    moved = _law(law, len(p)), _controller(control, len(c)), np.array(start, dtype=float)
    y, u = _march()(*moved, np.array(reference, dtype=float), noise, *numbers, tick, parts)
    return Run(np.arange(len(reference)) * tick, y, u, tick)


# References


def times(seconds: float, tick: float) -> Array:
    """Return the ticks of some seconds."""
    return np.arange(round(seconds / tick)) * tick


def steps(rng: np.random.Generator, t: Array, low: float, high: float, shortest: float, longest: float) -> Array:
    """Return levels drawn between two bounds, each held for a time drawn between two others."""
    count = int(t[-1] / shortest) + 2
    ends = np.cumsum(rng.uniform(shortest, longest, count))
    return rng.uniform(low, high, count + 1)[np.searchsorted(ends, t, side="right")]


def staircase(t: Array, levels: list[float]) -> Array:
    """Return levels of equal length, one after the other."""
    return np.asarray(levels)[np.minimum((t / (t[-1] + 1e-9) * len(levels)).astype(int), len(levels) - 1)]


def multisine(rng: np.random.Generator, t: Array, top: float, low: float, high: float, tones: int = 8) -> Array:
    """Return tones between two frequencies (Hz) with phases drawn; the largest value is ``top``."""
    f, phase = np.geomspace(low, high, tones), rng.uniform(0, 2 * np.pi, tones)
    out = np.sin(2 * np.pi * np.outer(t, f) + phase) @ (1 / np.sqrt(f / low))
    return top * out / np.abs(out).max()


def moves(rng: np.random.Generator, t: Array, low: float, high: float, speed: float, acceleration: float) -> Array:
    """Return positions: trapezoids of speed between points drawn, with short rests."""
    out, at, now = np.empty_like(t), float(low + high) / 2, 0.0
    while now <= t[-1]:
        to = rng.uniform(low, high)
        ramp, way = speed / acceleration, abs(to - at)
        peak = speed if way > speed * ramp else np.sqrt(way * acceleration)
        ramp, total = peak / acceleration, way / peak + peak / acceleration if peak > 0 else 0.0
        s = np.clip(t - now, 0.0, total)
        up, down = np.minimum(s, ramp), np.clip(s - (total - ramp), 0.0, ramp)
        gone = 0.5 * acceleration * up**2 + peak * np.clip(s - ramp, 0.0, total - 2 * ramp)
        gone = gone + peak * down - 0.5 * acceleration * down**2
        out[t >= now] = (at + np.sign(to - at) * gone)[t >= now]
        at, now = to, now + total + rng.uniform(0.1, 0.5)
    return out


# Sensors


def noisy(rng: np.random.Generator, x: Array, sigma: float) -> Array:
    return x + rng.normal(0.0, sigma, len(x))


def rounded(x: Array, step: float) -> Array:
    """Return what a converter shows."""
    return np.round(x / step) * step


def counted(x: Array, step: float) -> Array:
    """Return what an encoder shows."""
    return np.floor(x / step) * step


def filtered(x: Array, cutoff: float, tick: float) -> Array:
    """Return a signal behind a low-pass of first order, Hz."""
    a = 1.0 - np.exp(-2 * np.pi * cutoff * tick)
    return lfilter([a], [1.0, a - 1.0], x, zi=[(1.0 - a) * x[0]])[0]


def late(x: Array, ticks: int) -> Array:
    """Return a signal some ticks later."""
    return np.concatenate([np.full(ticks, x[0]), x[: len(x) - ticks]]) if ticks else x


def rate_of(x: Array, tick: float, over: int = 1) -> Array:
    """Return the difference of an encoder's counts over some ticks."""
    return (x - late(x, over)) / (over * tick)


# Files


def write_table(
    path: Path, columns: Mapping[str, Array], digits: int | Mapping[str, int] = 5, separator: str = ","
) -> None:
    """Write a table with a header, numbers of some digits after the point."""
    text = []
    for name, values in columns.items():
        places = digits if isinstance(digits, int) else digits.get(name, 5)
        text.append([f"{v:.{places}f}" for v in values])
    rows = [separator.join(columns), *map(separator.join, zip(*text, strict=True))]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def write_model(folder: Path, body: str) -> None:
    """Write ``model.yaml`` from what stands below ``ros__parameters``."""
    lines = [f"    {line}" for line in body.strip("\n").splitlines()]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.yaml").write_text("\n".join(["/**:", "  ros__parameters:", *lines, ""]), encoding="utf-8")


# The list of machines


@dataclass(frozen=True)
class Truth:
    """What a machine hides, and what an answer is worth.

    hidden: in words. right: sets of names, joined by ``+``, each a right answer; ``adequate`` if nothing is missing,
    ``unexplained`` if nothing listed explains it, ``refused`` if `check` is to stop the record. part: names that are
    partly right. also: names that are there as well and may be told: every controller holds its command for a tick, so
    that it acts half of it late, and a channel's filter makes it late. values: by ``effect.parameter`` the true value
    and its relative tolerance.
    """

    hidden: str
    right: tuple[str, ...]
    part: tuple[str, ...] = ()
    also: tuple[str, ...] = ("input_delay", "sensor_delay")
    values: Mapping[str, tuple[float, float]] | None = None


@dataclass(frozen=True)
class Machine:
    """A machine: ``make(folder, rng)`` writes ``model.yaml``, and the records ``training`` and ``validation``."""

    name: str
    seed: int
    truth: Truth
    make: Callable[[Path, np.random.Generator], None]

    def write(self, folder: Path) -> tuple[Path, Path, Path]:
        """Write the folder anew; return model, training and validation data."""
        folder.mkdir(parents=True, exist_ok=True)
        self.make(folder, np.random.default_rng(self.seed))
        first, second = (next(folder.glob(f"{name}.*")) for name in ("training", "validation"))
        return folder / "model.yaml", first, second


MACHINES: dict[str, Machine] = {}


def machine(seed: int, truth: Truth) -> Callable[[Any], Any]:
    """Enter a function into the list of machines, under its name."""

    def enter(make: Any) -> Any:
        MACHINES[make.__name__] = Machine(make.__name__, seed, truth, make)
        return make

    return enter
