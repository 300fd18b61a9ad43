"""How much of a hidden effect is in a record, whatever the base parameters and the simpler laws can imitate.

The noise-free motion is predicted by the linear plant over windows of about half a period of its motion. The
prediction's error, in units of the noise, is reduced by the best change of the base parameters (least squares, in
logarithms, with the prior that the record's `tolerance` declares) and by free multiples of simpler force laws. What
remains of the sum of squares is the evidence for the effect; 10 to 20 is what any criterion asks for one more effect in
3,200 samples. Each window starts from the true state, so this is more than an estimator can have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.hidden.drives import MOTOR, Drive, linear

Array = NDArray[np.float64]

SIBLINGS = {
    "coulomb_friction": ("v",),
    "stribeck_friction": ("s", "v"),
    "asymmetric_viscous_friction": ("v", "1"),
    "cubic_viscous_friction": ("v", "s"),
    "quadratic_drag": ("s", "v"),
    "load_dependent_friction": ("s", "v"),
    "load_dependent_stribeck": ("s", "v"),
    "gravity_load": ("1", "q"),
    "cogging_torque": ("1", "q"),
    "torque_ripple": ("1", "q"),
    "cubic_stiffness": ("q",),
    "asymmetric_stiffness": ("q", "q3"),
    "hard_stop": ("q",),
    "dahl_presliding": ("s", "v"),
    "play_friction": ("s", "v", "q"),
    "lugre_friction": ("s", "v"),
    "pinching_hysteresis": ("q", "v", "s"),
    "maxwell_element": ("q", "v"),
    "bouc_wen_hysteresis": ("q", "v", "s"),
    "compliant_load": ("a",),
    "backlash": ("a",),
    "input_deadzone": ("s", "v"),
    "torque_constant_saturation": ("v",),
    "sensor_offset": ("1",),
    "sensor_gain": ("v",),
}
"""Simpler laws, by their shape, which must not be able to imitate an effect."""
COMMON = ("s", "v", "v2", "q", "q3", "1")


@dataclass(frozen=True)
class Motion:
    """A record without its noise: ``shown`` (T, channels) is what the sensors show, ``s`` dry friction's direction."""

    u: Array
    shown: Array
    v: Array
    q: Array
    s: Array
    dt: float

    def shape(self, name: str) -> Array:
        """Return a force law's dependence on the motion."""
        if name.startswith(("sin", "cos")):
            return np.asarray(getattr(np, name[:3])(float(name[3:]) * self.q))
        if name.startswith("zone"):
            gap = float(name[4:])
            return np.asarray(self.q - np.clip(self.q, -gap, gap))
        shapes = {"s": self.s, "v": self.v, "v2": np.abs(self.v) * self.v, "q": self.q, "q3": self.q**3}
        if name == "a":
            return np.gradient(self.v, self.dt)
        return shapes.get(name, np.ones_like(self.q))


def shapes_of(effect: str, values: dict[str, float]) -> tuple[str, ...]:
    """Return the shapes whose multiples contain an effect, or come close to it."""
    own = {
        "coulomb_friction": ("s",),
        "stribeck_friction": ("s", "v"),
        "load_dependent_friction": ("s", "v"),
        "viscous_friction": ("v",),
        "quadratic_drag": ("v2",),
        "constant_load": ("1",),
        "linear_stiffness": ("q",),
        "cubic_stiffness": ("q3",),
        "gravity_load": ("sin1", "cos1"),
        "compliant_load": ("a",),
        "torque_constant_saturation": ("v",),
    }
    if effect == "cogging_torque":
        return f"sin{values['N']!r}", f"cos{values['N']!r}"
    if effect == "hard_stop":
        return (f"zone{values['gap']!r}",)
    return own.get(effect, ())


def _predict(drive: Drive, true: dict[str, float], motion: Motion, forces: Array, window: int, at: Array) -> Array:
    """Return the error of prediction over windows, (T', channels, 1 + forces); ``at``: start states (windows, n, .)."""
    A, B = linear(drive.plant, true, motion.dt)
    count = len(motion.u) // window
    u = motion.u[: count * window].reshape(count, window)
    f = forces[: count * window].reshape(count, window, -1)
    x = at
    out = np.empty((count, window, *at.shape[1:]))
    for j in range(window):
        out[:, j] = x
        x = np.einsum("ij,wjr->wir", A, x)
        x[:, :, 0] += B[:, 0] * u[:, j, None]
        x[:, :, 1:] += B[:, 1][None, :, None] * f[:, j, None, :]
    return out.reshape(count * window, *at.shape[1:])


def _columns(drive: Drive, motion: Motion, shapes: tuple[str, ...], window: int) -> tuple[Array, Array, Array]:
    """Return the errors (T', n), their derivatives by the logarithms of the base parameters, and by the shapes."""
    forces = np.array([motion.shape(s) for s in shapes]).T.reshape(len(motion.u), len(shapes))
    count = len(motion.u) // window
    start = motion.shown[: count * window : window]
    both = np.zeros((*start.shape, 1 + len(shapes)))
    both[:, :, 0] = start
    base = _predict(drive, drive.true, motion, forces, window, both)
    error = motion.shown[: count * window] - base[:, :, 0]
    alone, none = both[:, :, :1], np.zeros((len(motion.u), 0))
    names = [n for n, value in drive.true.items() if value != 0.0]
    by_base = []
    for name in names:
        moved = {**drive.true, name: drive.true[name] * 1.001}
        by_base.append((_predict(drive, moved, motion, none, window, alone)[:, :, 0] - base[:, :, 0]) / 0.001)
    return error, np.stack(by_base, axis=-1), base[:, :, 1:]


def evidence(drive: Drive, motion: Motion, sigma: Array, tolerance: float, shapes: tuple[str, ...] = ()) -> float:
    """Return the evidence; ``sigma`` (channels,): the noise, infinite where a channel is not measured."""
    half = np.pi / drive.omega if drive.plant != MOTOR else 0.5
    window = max(4, round(min(max(half, 0.3), 1.0) / motion.dt))
    error, by_base, by_shape = _columns(drive, motion, shapes, window)
    floor = np.maximum(sigma, 0.002 * motion.shown.std(axis=0))
    y = (error / floor).ravel()
    S = (by_base / floor[:, None]).reshape(len(y), -1)
    R = (by_shape / floor[:, None]).reshape(len(y), -1)
    R = R / np.maximum(np.linalg.norm(R, axis=0), 1e-300)
    prior = np.hstack([np.eye(S.shape[1]) / tolerance, np.zeros((S.shape[1], R.shape[1]))])
    whole = np.vstack([np.hstack([S, R]), prior])
    target = np.concatenate([y, np.zeros(S.shape[1])])
    solution = np.linalg.lstsq(whole, target, rcond=1e-10)[0]
    return float(np.sum((target - whole @ solution) ** 2))
