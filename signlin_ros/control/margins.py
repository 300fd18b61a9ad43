"""Whether a sampled loop holds: stable and well damped, whenever within its delays the input acts.

A regulator that remembers inputs which have not acted yet takes them off its feedback. Where the input acts sooner
than it believes, that memory is wrong: the same gains may be stable at the delay that they were made for and unstable
at a shorter one. So a loop is judged at every delay from the shortest to the longest.

Sources: Åström and Wittenmark, Computer-Controlled Systems, 1997, sec. 2.3 (sampling with a delay); Åström and
Hägglund, Advanced PID Control, 2006, sec. 4.6: a largest sensitivity of 2 keeps a gain margin of 2 and a phase margin
of 29°.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control.law import K_I, K_PAST, K_Q, K_V
from signlin_ros.control.lqr import held, sampled
from signlin_ros.errors import InputError

Array = NDArray[np.float64]
MAX_SENSITIVITY = 2.0
"""Largest |1/(1 + L)| of a loop that is called well damped."""
JUDGED_DELAYS = 9
"""Delays, evenly from the shortest to the longest, at which a loop is judged."""
SENSITIVITY_FREQUENCIES = 150
"""Frequencies up to half of the sampling rate at which the sensitivity is looked at."""
LOWEST_FREQUENCY = 1e-3
"""The lowest of them, in rad per sample."""
ANYWHERE = 1e-6
"""Distance from 1 within which a pole is no motion, but where something stands: what hysteresis remembers, or a spring
that is held at speed 0."""
BANDWIDTH_STEPS, BANDWIDTH_HALVINGS = 25, 8
"""Bandwidths that are tried from above, and halvings of the bracket of the largest that holds."""
MIN_BANDWIDTH = 1e-2
"""The lowest bandwidth that is tried, as a multiple of 1 / (period + delay)."""


@dataclass(frozen=True)
class LinearDrive:
    """x' = A x + B u of a drive: A (n, n), B (n, 1); slots of position and speed among x, -1 where there is none."""

    A: Array
    B: Array
    position: int
    velocity: int


@dataclass(frozen=True)
class Margins:
    """The worst of a loop over its delays: spectral radius, largest sensitivity, and the delay in s of the latter."""

    radius: float
    sensitivity: float
    delay: float

    @property
    def stable(self) -> bool:
        """Whether all poles are within the unit circle."""
        return self.radius < 1.0

    @property
    def hold(self) -> bool:
        """Whether the loop is stable and well damped."""
        return self.stable and self.sensitivity <= MAX_SENSITIVITY

    @property
    def fault(self) -> str:
        """What is wrong with the loop; empty where it holds."""
        if self.hold:
            return ""
        if not self.stable:
            return f"the closed loop is unstable (spectral radius {self.radius:.3g})"
        found = f"largest sensitivity {self.sensitivity:.3g}, allowed: {MAX_SENSITIVITY:g}"
        return f"the closed loop is badly damped ({found})"


def rigid_drive(kV: float, kA: float, kP: float) -> LinearDrive:
    """Return the drive u = kV v + kA a + kP q as x' = A x + B u with x = [q, v]."""
    return LinearDrive(np.array([[0.0, 1.0], [-kP / kA, -kV / kA]]), np.array([[0.0], [1.0 / kA]]), 0, 1)


@dataclass(frozen=True)
class SampledDrive:
    """A drive as it is sampled with one delay in s: F, G with the inputs that are still to act, and responses at
    `frequencies` (2, W): from the input to position and speed.
    """

    drive: LinearDrive
    delay: float
    F: Array
    G: Array
    response: NDArray[np.complex128]


def sampled_drives(drives: Sequence[LinearDrive], period: float, delays: tuple[float, float]) -> list[SampledDrive]:
    """Return drives as they are sampled with all delays in s from low to high."""
    some = np.linspace(*delays, JUDGED_DELAYS if delays[1] > delays[0] else 1)
    return [_sampled(drive, period, float(delay)) for drive in drives for delay in some]


def frequencies() -> NDArray[np.complex128]:
    """Return points z (W,) of the unit circle, up to half of the sampling rate."""
    return np.asarray(np.exp(1j * np.geomspace(LOWEST_FREQUENCY, math.pi, SENSITIVITY_FREQUENCIES)))


def _sampled(drive: LinearDrive, period: float, delay: float) -> SampledDrive:
    F, G = sampled(drive.A, drive.B, period, delay) if delay > 0.0 else held(drive.A, drive.B, period)
    z, size = frequencies(), F.shape[0]
    moved = np.linalg.solve(z[:, None, None] * np.eye(size) - F, np.broadcast_to(G + 0j, (z.size, size, 1)))[..., 0]
    shown = [moved[:, i] if i >= 0 else np.zeros(z.size) for i in (drive.position, drive.velocity)]
    return SampledDrive(drive, delay, F, G, np.array(shown, dtype=complex))


def loop_margins(drives: Sequence[SampledDrive], rows: Array, period: float, position: bool) -> Margins:
    """Return the margins of the worst of some drives under gains (G, 3 + N)."""
    worst = Margins(0.0, 0.0, 0.0)
    for row in np.atleast_2d(rows):
        regulator = _regulator(row, period, position)
        for one in drives:
            radius = _radius(one, row, period, position)
            open_loop = np.sum(regulator * one.response, axis=0)
            sensitivity = float(np.max(1.0 / np.abs(1.0 + open_loop))) if radius < 1.0 else math.inf
            if sensitivity >= worst.sensitivity:
                worst = Margins(worst.radius, sensitivity, one.delay)
            worst = Margins(max(worst.radius, radius), worst.sensitivity, worst.delay)
    return worst


def _regulator(row: Array, period: float, position: bool) -> NDArray[np.complex128]:
    """Return the response (2, W) of a law from the errors of position and speed to its input."""
    z, past = frequencies(), row[K_PAST:]
    remembered = 1.0 + sum((gain * z ** (j - past.size) for j, gain in enumerate(past)), np.zeros(z.size))
    summed = row[K_I] * period / (z - 1.0)
    errors = [row[K_Q] + summed, row[K_V] + 0.0 * z] if position else [0.0 * z, row[K_V] + summed]
    return np.asarray(np.array(errors) / remembered)


def closed_loop(one: SampledDrive, row: Array, period: float, position: bool) -> Array:
    """Return the transition (N, N) over one period of a drive in a loop, by gains (3 + N).

    Its states are those of the sampled drive with the inputs that are still to act, the integral action, and the
    feedback of the past periods that the law remembers, oldest first.
    """
    size, past, drive = one.F.shape[0], row[K_PAST:], one.drive
    total = size + 1 + past.size
    feedback = np.zeros(total)
    feedback[drive.velocity] -= row[K_V]
    if position:
        feedback[drive.position] -= row[K_Q]
    feedback[size], feedback[size + 1 :] = 1.0, -past
    M = np.zeros((total, total))
    M[:size, :size] = one.F
    M[:size] += np.outer(one.G[:, 0], feedback)
    M[size, drive.position if position else drive.velocity] = -row[K_I] * period
    M[size, size] = 1.0
    if past.size:
        M[size + 1 : -1, size + 2 :] = np.eye(past.size - 1)
        M[-1] = feedback
    return M


def _radius(one: SampledDrive, row: Array, period: float, position: bool) -> float:
    """Return the spectral radius of a loop."""
    M = closed_loop(one, row, period, position)
    seen = _seen(M, one.drive, position)
    poles = np.linalg.eigvals(M[np.ix_(seen, seen)])
    return float(np.max(np.abs(poles[np.abs(poles - 1.0) > ANYWHERE]), initial=0.0))


def _seen(M: Array, drive: LinearDrive, position: bool) -> list[int]:
    """Return the states that the loop goes through: a position that nothing goes by is none of a speed loop."""
    q = drive.position
    unseen = not position and q >= 0 and not np.delete(M[:, q], q).any()
    return [i for i in range(M.shape[0]) if not (unseen and i == q)]


def largest_bandwidth(margins: Callable[[float], Margins], period: float, delay: float, high: float) -> float:
    """Return the largest bandwidth below ``high``, in rad/s, with which a loop holds, to three digits; 0: none does.

    ``margins`` gives the margins at a bandwidth. Where a slow loop does not hold a faster one may: a load that would
    fall. So it is looked for from above.
    """
    steps = np.geomspace(high, MIN_BANDWIDTH / (period + delay), BANDWIDTH_STEPS)
    held = next((k for k, bandwidth in enumerate(steps) if margins(float(bandwidth)).hold), None)
    if held is None:
        return 0.0
    low, high = float(steps[held]), float(steps[max(held - 1, 0)])
    for _ in range(BANDWIDTH_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if margins(middle).hold else (low, middle)
    unit = float(10.0 ** (math.floor(math.log10(low)) - 2))
    return float(f"{math.floor(low / unit) * unit:.3g}")


def refusal(name: str, bandwidth: float, found: Margins, largest: float, period: float, longest: float) -> InputError:
    """Return the error for a bandwidth that does not hold: what is wrong, and the largest that is not."""
    when = f"inputs every {period:g} s that act up to {longest:g} s after their sample"
    way = f"the largest that holds is {largest:.3g} rad/s" if largest else "none holds: shorten period and delay"
    return InputError(f"bandwidth: found {bandwidth:.3g} rad/s, design {name}; with {when} {found.fault}; {way}")


__all__ = [
    "LinearDrive",
    "Margins",
    "SampledDrive",
    "closed_loop",
    "largest_bandwidth",
    "loop_margins",
    "refusal",
    "rigid_drive",
    "sampled_drives",
]
