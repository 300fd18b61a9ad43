"""Drives of several sizes, excitations that suit them, and what their motion is like without anything hidden."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

Array = NDArray[np.float64]

MOTOR, MASS = "dc_motor", "mass_spring_damper"
CHANNELS = {MOTOR: ("current", "speed", "position"), MASS: ("displacement", "velocity")}
INPUT = {MOTOR: "voltage", MASS: "force"}
EXCITATIONS = ("multisine", "steps", "slow", "sweep", "prbs")


@dataclass(frozen=True)
class Drive:
    """A plant with its true base parameters, the largest input, and the angular frequency of its motion, rad/s."""

    plant: str
    true: dict[str, float]
    amplitude: float
    omega: float

    @property
    def inertia(self) -> float:
        """Moving mass, kg or kg·m²."""
        return self.true["J" if self.plant == MOTOR else "m"]

    @property
    def spring(self) -> float:
        """Stiffness of the plant's own spring, N/m or N·m/rad."""
        return self.true.get("k", 0.0)


def spread(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number between two bounds, its logarithm uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _motor(rng: np.random.Generator) -> Drive:
    """A small motor (R_a 0.764 ohm, 0.0022 kg·m²), one of a few hundred watts, or one of a few watts."""
    kind = rng.choice(["small", "small", "large", "tiny"])
    vary = rng.uniform(0.7, 1.4, 4)
    R, L, K, J = {
        "small": (0.764, 0.0026, 0.0805, 0.0022),
        "large": (0.35, 0.0014, 0.45, 0.06),
        "tiny": (7.0, 0.004, 0.021, 7e-6),
    }[kind] * vary
    amplitude = {"small": 6.0, "large": 40.0, "tiny": 9.0}[kind] * rng.uniform(0.7, 1.2)
    B = float(rng.choice([0.0, 0.0, rng.uniform(0.05, 0.3)])) * K**2 / R
    true = {"R_a": R, "L_a": L, "K_t": K, "K_m": K, "B": B, "J": J}
    return Drive(MOTOR, true, amplitude, (K**2 / R + B) / J)


def _oscillator(rng: np.random.Generator) -> Drive:
    """A mass on a spring: bench, light, heavy, or rotary with swings about 1 rad."""
    kind = rng.choice(["bench", "bench", "light", "heavy", "rotary"])
    m, frequency, travel = {
        "bench": (1.0, 1.0, 0.2),
        "light": (0.15, 3.0, 0.01),
        "heavy": (40.0, 0.8, 0.05),
        "rotary": (0.05, 0.9, 1.2),
    }[kind] * rng.uniform([0.7, 0.7, 0.6], [1.4, 1.4, 1.6])
    omega, damping = 2 * np.pi * frequency, rng.uniform(0.04, 0.15)
    true = {"m": m, "c": 2 * damping * m * omega, "k": m * omega**2}
    return Drive(MASS, true, float(travel * true["k"] * rng.uniform(0.8, 1.3)), float(omega))


def _free(rng: np.random.Generator) -> Drive:
    """A carriage or an axis without a spring: its friction stops it within a second."""
    m = spread(rng, 0.1, 100.0)
    lag, speed = rng.uniform(0.2, 0.9), rng.uniform(0.05, 0.5)
    if rng.random() < 0.4:
        m, speed = m * 1e-3, rng.uniform(2.0, 20.0)  # rotary: rad/s
    c = m / lag
    return Drive(MASS, {"m": m, "c": c, "k": 0.0}, float(c * speed * rng.uniform(1.5, 3.0)), float(1 / lag))


def draw_drive(rng: np.random.Generator, plant: str, kind: str = "") -> Drive:
    """Draw a drive. ``kind`` of a mass: "oscillator", "free" or either."""
    if plant == MOTOR:
        return _motor(rng)
    free = rng.random() < 0.3 if not kind else kind == "free"
    return _free(rng) if free else _oscillator(rng)


def _multisine(rng: np.random.Generator, t: Array, low: float, high: float) -> Array:
    frequencies = np.exp(np.linspace(np.log(low), np.log(high), int(rng.integers(8, 24))))
    phases = rng.uniform(0, 2 * np.pi, len(frequencies))
    return np.asarray(np.sum(np.sin(2 * np.pi * frequencies[:, None] * t + phases[:, None]), axis=0))


def _held(rng: np.random.Generator, t: Array, shortest: float, longest: float, binary: bool) -> Array:
    u = np.empty_like(t)
    start = t[0]
    while start <= t[-1]:
        level = rng.choice([-1.0, 1.0]) if binary else rng.uniform(-1, 1)
        u[t >= start - 1e-9] = level
        start += rng.uniform(shortest, longest)
    return u


def excite(rng: np.random.Generator, kind: str, drive: Drive, t: Array) -> Array:
    """Return an input at the times t, s, its largest value the drive's amplitude."""
    f = float(np.clip(drive.omega / (2 * np.pi), 0.2, 6.0))
    if kind == "multisine":
        u = _multisine(rng, t, max(0.12, 0.15 * f), min(4.0 * f + 1.0, 12.0))
    elif kind == "steps":
        u = _held(rng, t, 0.3 + 0.1 / f, 0.8 + 0.5 / f, binary=False)
    elif kind == "prbs":
        u = _held(rng, t, 0.1 + 0.05 / f, 0.3 + 0.5 / f, binary=True) * (1.0 + 0.2 * np.sin(0.5 * t))
    elif kind == "sweep":
        low, high, T = 0.15 * f, 3.0 * f, t[-1] - t[0]
        ratio = np.log(high / low) / T
        u = np.sin(2 * np.pi * low * np.expm1(ratio * (t - t[0])) / ratio + rng.uniform(0, 2 * np.pi))
    else:
        slow = rng.uniform(0.12, 0.45, 2)
        phases = rng.uniform(0, 2 * np.pi, 2)
        u = np.sin(2 * np.pi * slow[0] * t + phases[0]) + 0.4 * np.sin(2 * np.pi * 1.7 * slow[1] * t + phases[1])
    return np.asarray(drive.amplitude * u / np.abs(u).max())


def linear(plant: str, true: dict[str, float], dt: float) -> tuple[Array, Array]:
    """Return x[k+1] = A x[k] + B (u[k], force[k]) of the plant with nothing hidden, held inputs, x its channels."""
    if plant == MOTOR:
        R, L, K_t, K_m, B, J = (true[n] for n in ("R_a", "L_a", "K_t", "K_m", "B", "J"))
        a = np.array([[-R / L, -K_m / L, 0], [K_t / J, -B / J, 0], [0, 1, 0]])
        b = np.array([[1 / L, 0], [0, 1 / J], [0, 0]])
    else:
        m, c, k = (true[n] for n in ("m", "c", "k"))
        a, b = np.array([[0, 1], [-k / m, -c / m]]), np.array([[0, 0], [1 / m, 1 / m]])
    n = len(a)
    whole = np.zeros((n + 2, n + 2))
    whole[:n] = np.hstack([a, b])
    step = expm(whole * dt)
    return step[:n, :n], step[:n, n:]


@dataclass(frozen=True)
class Scale:
    """How the drive moves with nothing hidden: root mean squares, and what the effects are drawn relative to.

    ``stroke``: median travel between two reversals. ``drive``: force of the drive.
    """

    drive: float
    speed: float
    position: float
    reach: float
    stroke: float
    input: float
    peak_input: float
    current: float


def scale(drive: Drive, u: Array, dt: float) -> Scale:
    """Simulate the linear plant from rest."""
    A, B = linear(drive.plant, drive.true, dt)
    x = np.zeros((len(u), len(A)))
    for k in range(len(u) - 1):
        x[k + 1] = A @ x[k] + B[:, 0] * u[k]
    motor = drive.plant == MOTOR
    q, v = (x[:, 2], x[:, 1]) if motor else (x[:, 0], x[:, 1])
    force = drive.true["K_t"] * x[:, 0] if motor else u
    turns = np.flatnonzero(v[1:] * v[:-1] < 0)
    travel = np.abs(np.diff(q[turns]))
    travel = travel[travel > 0.02 * np.ptp(q)]
    stroke = float(np.median(travel)) if len(travel) else float(np.ptp(q))
    rms = [float(np.sqrt(np.mean(a**2))) for a in (force, v, u)]
    current = float(np.sqrt(np.mean(x[:, 0] ** 2))) if motor else 0.0
    reach = float(np.abs(q).max())
    return Scale(rms[0], rms[1], float(q.std()), reach, stroke, rms[2], float(np.abs(u).max()), current)
