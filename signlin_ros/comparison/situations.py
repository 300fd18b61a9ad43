"""Situations in which a model may fail: by speed, position, load, branch of a loop, time, and so on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.scene import Scene, Split, time_to

Array = NDArray[np.float64]

JUMP_OVER_STEP, OF_ALL, LEAST_JUMPS, MAX_JUMP_SHARE = 10, 0.05, 3, 0.02
"""A jump of the input: times its usual step and part of its range at least; how many, and which part of the samples."""
QUANTILES = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 0.98)
NEAR_EVENT_TIMES = (0.005, 0.01, 0.02, 0.03, 0.05, 0.1, 0.2)
"""Time in s within which a sample counts as near an event."""
PATTERN_HARMONICS, PATTERN_SAMPLES, HARMONICS_AT_ONCE = 1500, 3000, 32
"""Harmonics over the way at which a pattern is looked for, in so many samples, and how many of them at once."""
SLOW_PASSAGES = 0.1
"""Patterns are looked for down to what this slowest part of the samples resolves."""
PATTERN_CLEAR, PATTERN_SHARE = 12, 0.04
"""A pattern over position must explain so many times what the median one does, and this share of what is missing."""

Splits = Iterator[Split | None]


def rounded(value: float) -> float:
    """Return a value rounded to what one says aloud: two digits."""
    return float(f"{value:.2g}")


def _limits(scene: Scene, name: str, kind: str, signed: bool = False) -> Splits:
    """Below and above limits of the size of a quantity, and of itself where it is ``signed``, if the model has it."""
    own = scene.column(name)
    if own is None:
        return
    for shown, values in [*([(name, own)] if signed else []), (f"|{name}|", np.abs(own))]:
        for limit in dict.fromkeys(rounded(float(q)) for q in np.quantile(values, QUANTILES)):
            yield scene.split(f"{shown} < {limit:g} {scene.unit(name)}", kind, values < limit)
            yield scene.split(f"{shown} > {limit:g} {scene.unit(name)}", kind, values > limit)


def _signs(scene: Scene, name: str, kind: str, least: float) -> Splits:
    """Positive and negative, by more than ``least``, if the model has such a quantity."""
    values = scene.column(name)
    if values is not None:
        yield scene.split(f"{name} > 0 {scene.unit(name)}", kind, values > least)
        yield scene.split(f"{name} < 0 {scene.unit(name)}", kind, values < -least)


def _driver(scene: Scene) -> str:
    """Return the name of the input that drives, empty where the motion is imposed."""
    name = scene.model.inputs[0]
    return "" if name == scene.model.plant.velocity else name


def _near(scene: Scene, events: NDArray[np.int64], what: str, kind: str) -> Splits:
    away = time_to(scene, events)
    for reach in NEAR_EVENT_TIMES:
        if reach >= 0.5 * scene.resolution:
            yield scene.split(f"within {1e3 * reach:g} ms {what}", kind, away <= reach)


def _input_steps(scene: Scene) -> Splits:
    """After a jump of the input, where it does jump: rarely, and by much more than it usually moves."""
    steps = np.abs(np.diff(scene.u[:, 0], prepend=scene.u[0, 0]))
    jumps = np.flatnonzero(steps > max(JUMP_OVER_STEP * float(np.median(steps)), OF_ALL * float(np.ptp(scene.u[:, 0]))))
    if LEAST_JUMPS <= jumps.size < MAX_JUMP_SHARE * steps.size:
        yield from _near(scene, jumps, f"of a step of {scene.model.inputs[0]}", "input step")


def _branch(scene: Scene) -> Splits:
    q, v = scene.column(scene.model.plant.position), scene.velocity
    held = scene.model.parameters.get("k", 0.0) > 0 or scene.model.plant.motion_is_imposed()
    if q is not None and held:
        name, other = scene.model.plant.position, scene.model.plant.velocity
        yield scene.split(f"loading ({name} and {other} of the same sign)", "branch", q * v > 0)
        yield scene.split(f"unloading ({name} and {other} of opposite sign)", "branch", q * v < 0)


def _power(scene: Scene) -> Splits:
    current = scene.column("current")
    effort = scene.u[:, 0] if current is None else current
    if scene.model.plant.velocity in scene.model.states:
        yield scene.split("driving (effort along the motion)", "power", effort * scene.velocity > 0)
        yield scene.split("braking (effort against the motion)", "power", effort * scene.velocity < 0)


def _time(scene: Scene) -> Splits:
    length = float(scene.t.max())
    for limit in dict.fromkeys(rounded(part * length) for part in (0.01, 0.02, 0.05, 0.1, 0.2)):
        yield scene.split(f"first {limit:g} s", "start", scene.t < limit)
    for limit in dict.fromkeys(rounded(part * length) for part in (0.33, 0.5, 0.67)):
        yield scene.split(f"after {limit:g} s", "drift", scene.t > limit)


def _pattern(scene: Scene) -> Splits:
    """Position within a period, where what is missing swings with the position."""
    name = scene.model.plant.position
    q = scene.column(name)
    found = None if q is None else _period(scene, q)
    if q is None or found is None:
        return
    harmonic, phase = found
    period, distance, unit = 2 * np.pi / harmonic, np.pi / harmonic, scene.unit(name)
    centre = (-phase / harmonic) % distance
    near = np.abs((q - centre + distance / 2) % distance - distance / 2) < 0.5 * (distance / 2)
    place = f"{distance / 4:.2g} {unit} of {centre:.2g} + {distance:.3g} n"
    text = f"{name} within {place} (a pattern of period {period:.3g} {unit})"
    split = scene.split(text, "position in its period", near)
    yield replace(split, period=float(period)) if split else None


def _period(scene: Scene, q: Array) -> tuple[float, float] | None:
    """Return N and phi of the pattern cos(N q + phi) that explains most, if one does; fast passages weigh less."""
    every = max(1, q.size // PATTERN_SAMPLES)
    q, v, value = q[::every], scene.velocity[::every], scene.value[::every]
    span, speed = float(np.ptp(q)), float(np.quantile(np.abs(v), SLOW_PASSAGES))
    highest = np.pi / max(scene.resolution * max(speed, 1e-12), 1e-9 * max(span, 1e-12))
    lowest = 4 * np.pi / span if span > 0 else np.inf
    if highest <= lowest:
        return None
    count = int(min(PATTERN_HARMONICS, 2 * span * (highest - lowest) / np.pi + 2))
    harmonics = np.linspace(lowest, min(highest, lowest + PATTERN_HARMONICS * np.pi / (2 * span)), count)
    value = value - value.mean()
    amplitude, weight = _amplitudes(harmonics, q, v * scene.resolution, value)
    explained = 2 * np.abs(amplitude) ** 2 / weight / np.sum(value**2)
    best = int(np.argmax(explained))
    clear = explained[best] > max(PATTERN_SHARE, PATTERN_CLEAR * float(np.median(explained)))
    return (float(harmonics[best]), float(np.angle(amplitude[best]))) if clear else None


def _amplitudes(harmonics: Array, q: Array, turned: Array, value: Array) -> tuple[NDArray[np.complex128], Array]:
    """Return the sums (K,) of w exp(-i N q) times a value (T,) for evenly spaced harmonics N (K,), and those of w^2.

    The weights w fall with the phase N ``turned`` (T,) within a sample. The waves of a block of harmonics are those of
    the first block, turned on: exp costs most of all.
    """
    found = np.zeros(harmonics.size, dtype=complex), np.zeros(harmonics.size)
    apart = np.exp(-1j * (harmonics[:HARMONICS_AT_ONCE, None] - harmonics[0]) * q)
    for at in range(0, harmonics.size, HARMONICS_AT_ONCE):
        block = slice(at, at + HARMONICS_AT_ONCE)
        weight = 1.0 / (1.0 + (harmonics[block, None] * turned) ** 2)
        found[0][block] = (weight * apart[: len(weight)]) @ (np.exp(-1j * harmonics[at] * q) * value)
        found[1][block] = np.sum(weight**2, axis=1)
    return found


SPLIT_FAMILIES: tuple[Callable[[Scene], Splits], ...] = (
    lambda scene: _signs(scene, scene.model.plant.velocity, "direction", scene.slow),
    lambda scene: _limits(scene, scene.model.plant.velocity, "speed"),
    lambda scene: _near(scene, scene.turns, f"of a reversal of {scene.model.plant.velocity}", "reversal"),
    lambda scene: _limits(scene, scene.model.plant.position, "position", signed=True),
    _pattern,
    lambda scene: _limits(scene, "current", "load"),
    lambda scene: _limits(scene, _driver(scene), "input"),
    lambda scene: _signs(scene, _driver(scene), "input sign", 0.0),
    *(_input_steps, _branch, _power, _time),
)
"""Each gives at most one region: its best split."""


__all__ = ["SPLIT_FAMILIES", "rounded"]
