"""What amplifiers and sensors make of a signal, and what acts by chance or by the clock."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Values = dict[str, float]


def _play(u: Array, half: float) -> Array:
    out = np.zeros_like(u)
    w = 0.0
    for k, value in enumerate(u):
        w = min(max(w, value - half), value + half)
        out[k] = w
    return out


def _slew(u: Array, most: float) -> Array:
    out = np.zeros_like(u)
    w = 0.0
    for k, value in enumerate(u):
        w += min(max(value - w, -most), most)
        out[k] = w
    return out


def _bent(u: Array, u_max: float) -> Array:
    return 2 * u_max / np.pi * np.arctan(np.pi * u / (2 * u_max))


AMPLIFIERS: dict[str, Callable[[Array, Values], Array]] = {
    "input_deadzone": lambda u, v: u - np.clip(u, -v["d"], v["d"]),
    "input_saturation": lambda u, v: np.clip(u, -v["u_max"], v["u_max"]),
    "arctan_saturation": lambda u, v: _bent(u, v["u_max"]),
    "input_steps": lambda u, v: v["step"] * np.round(u / v["step"]),
    "input_play": lambda u, v: _play(u, v["half"]),
    "input_slew": lambda u, v: _slew(u, v["most"]),
    "input_square": lambda u, v: u * np.abs(u) / v["top"],
    "asymmetric_gain": lambda u, v: np.where(u < 0, v["gain"], 1.0) * u,
    "drifting_gain": lambda u, v: (1.0 + v["by"] * np.linspace(-1.0, 1.0, len(u))) * u,
}


def reaching(u: Array, values: dict[str, Values]) -> Array:
    """Return what reaches the drive of what was commanded, before any delay."""
    for name, v in values.items():
        u = AMPLIFIERS[name](u, v) if name in AMPLIFIERS else u
    return u


SENSORS: dict[str, Callable[[Array, float, Array], Array]] = {
    "sensor_gain": lambda x, v, _: v * x,
    "sensor_offset": lambda x, v, _: x + v,
    "sensor_clip": lambda x, v, _: np.clip(x, -v, v),
    "sensor_eccentricity": lambda x, v, _: x + v * np.sin(x / v / 2.0),
    "missed_counts": lambda x, v, counts: x + v * counts,
}


def shown(true: Array, channel: str, values: dict[str, Values], aux: Array) -> Array:
    """Return what a sensor shows of a motion (T,) at the samples; of its delay nothing is said here."""
    for name, error in SENSORS.items():
        v = values.get(name, {}).get(channel)
        true = true if v is None else error(true, v, aux)
    return true


def auxiliary(rng: np.random.Generator, law: str, t: Array) -> Array:
    """Return what a law takes from chance and time: a level, a phase, a switch."""
    T, dt = t[-1] - t[0], t[1] - t[0]
    if law == "drifting_coulomb":
        phase = rng.choice([-0.5, 0.5]) * np.pi
        return np.asarray(1.0 + 0.85 * np.sin(np.pi * rng.uniform(1.0, 1.8) * (t - t[0]) / T + phase))
    if law == "wandering_ripple":
        return np.asarray(np.cumsum(rng.normal(0, 2.5 * np.sqrt(dt), len(t))))
    if law == "step_load":
        return np.asarray(t > t[0] + rng.uniform(0.3, 0.7) * T, dtype=np.float64)
    if law == "random_load":
        return _wandering(rng, len(t), float(np.exp(-dt / rng.uniform(0.1, 1.0))))
    if law == "missed_counts":
        return np.asarray(np.cumsum(rng.poisson(4.0 * dt / T, len(t))), dtype=np.float64)
    first = t[0] + rng.uniform(0.5, 2.0)  # whatever the law: the records of a seed stay what they were
    return _bursts(rng, t, first) if law == "burst_load" else np.zeros_like(t)


def _wandering(rng: np.random.Generator, count: int, rho: float) -> Array:
    """Return noise (count,) of variance 1 with a correlation from sample to sample."""
    out = rng.normal(size=count)
    for k in range(1, count):
        out[k] = rho * out[k - 1] + np.sqrt(1.0 - rho * rho) * out[k]
    return out


def _bursts(rng: np.random.Generator, t: Array, at: float) -> Array:
    out = np.zeros_like(t)
    while at < t[-1]:
        length = rng.uniform(0.4, 1.5)
        out[(t >= at) & (t < at + length)] = 1.0
        at += length + rng.uniform(0.7, 3.0)
    return out
