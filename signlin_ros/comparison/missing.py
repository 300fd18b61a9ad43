"""What the equations lack: the force, or the voltage, that would make the model follow the measurements: innovations of
an observer, smoothed backwards [Koopman, Biometrika 80 (1993) 117]. No derivative of a measurement is taken, and any
channels will do that make the states observable.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.linear import linear_base
from signlin_ros.comparison.equations import bare, mass
from signlin_ros.engine.compiling import compiled
from signlin_ros.errors import InputError
from signlin_ros.follow.observer import OBSERVER_TRUSTS, Observer, ObserverDesign

Array = NDArray[np.float64]

MIN_OVER_NOISE, MIN_EQUATION_SHARE = 3.0, 0.005
"""How many times the noise that is missing, and which share of what the equation holds, is clear."""
SMOOTHER_FREQUENCIES = 512
"""Frequencies at which the smoother is evaluated, up to Nyquist's."""


@dataclass(frozen=True, eq=False)
class Missing:
    """What one equation lacks: ``values`` (T,) for each stretch in ``unit``, positive where the state should speed up.

    ``name``: force, torque or an input; ``noise``: standard deviation where the model is right; ``resolution`` in s,
    within which it is blurred; ``typical``: RMS of what the equation holds.
    """

    name: str
    unit: str
    values: tuple[Array, ...]
    noise: float
    resolution: float
    typical: float

    @property
    def clear(self) -> bool:
        """Whether what is missing stands out of the noise at all."""
        return self.rms > max(MIN_OVER_NOISE * self.noise, MIN_EQUATION_SHARE * self.typical)

    @cached_property
    def rms(self) -> float:
        """Its root mean square over all stretches."""
        return float(np.sqrt(np.mean(np.concatenate(self.values) ** 2)))

    def to_json(self) -> dict[str, float | str | bool]:
        """Return it without its samples."""
        numbers = {"rms": self.rms, "noise": self.noise, "typical": self.typical, "resolution": self.resolution}
        return {"unit": self.unit, **numbers, "clear": self.clear}


@dataclass(frozen=True)
class _Equation:
    """An equation that may lack something: of which state, and by how much its rate grows for one unit of it."""

    name: str
    unit: str
    state: int
    per_unit: float


def missing(observer: Observer, units: Mapping[str, str]) -> tuple[Missing, ...]:
    """Return the missing term of each equation of the plant; ``units`` of the record. One that stands out keeps its
    freedom while the model is trusted more in the others. Where the motion is imposed, it is what the measured force
    lacks.
    """
    plant = observer.model.plant
    if plant.velocity not in observer.model.states:
        return _beside_motion(observer, units) if plant.effort in observer.channels else ()
    equations = _equations(observer, units.get(plant.effort, plant.force_unit))
    trusts, clear, found = dict.fromkeys(observer.disturbed, OBSERVER_TRUSTS[-1]), set[int](), list[Missing]()
    for trust in reversed(OBSERVER_TRUSTS):
        trusts |= {e.state: trust for e in equations if e.state not in clear}
        design = observer.design(trusts)
        found = [_missing(observer, e, design) for e in equations]
        clear |= {e.state for e, one in zip(equations, found, strict=True) if one.clear}
        if len(clear) == len(equations):
            break
    return tuple(found)


def _beside_motion(observer: Observer, units: Mapping[str, str]) -> tuple[Missing, ...]:
    """Return the computed minus the measured force; 0 where samples are missing."""
    name = observer.model.plant.effort
    j = observer.channels.index(name)
    pairs = zip(observer.trackers, observer.rough, strict=True)
    values = tuple(np.nan_to_num((tracker.y - tracker.outputs(x))[:, j]) for tracker, x in pairs)
    typical = float(np.sqrt(np.nanmean(np.concatenate([s.y[:, j] for s in observer.stretches]) ** 2)))
    unit = units.get(name, observer.model.units[name])
    return (Missing(name, unit, values, observer.noise[j].sigma, observer.step, typical),)


def _equations(observer: Observer, force_unit: str) -> list[_Equation]:
    model, plant = observer.model, observer.model.plant
    linear, found = linear_base(bare(model)), []
    for i in observer.disturbed:
        if model.states[i] == plant.velocity:
            found.append(_Equation("force" if force_unit == "N" else "torque", force_unit, i, 1.0 / mass(model)))
        elif linear and (per_unit := float(linear.B[linear.states.index(model.states[i]), 0])):
            found.append(_Equation(model.inputs[0], plant.input_unit, i, per_unit))
    return found


def _missing(observer: Observer, equation: _Equation, design: ObserverDesign) -> Missing:
    row = design.spread[equation.state] / equation.per_unit
    noise, gain, resolution = _response(observer, equation, design)
    back, weigh = np.ascontiguousarray(design.back), np.ascontiguousarray(design.weigh)
    left = (np.nan_to_num(np.ascontiguousarray(run.innovation)) for run in observer.runs(design))
    values = tuple(_backwards(back, weigh, e) @ row / gain for e in left)
    typical = float(observer.typical[equation.state] / abs(equation.per_unit))
    return Missing(equation.name, equation.unit, values, noise / gain, resolution, typical)


def _response(observer: Observer, equation: _Equation, d: ObserverDesign) -> tuple[float, float, float]:
    """Return the standard deviation that the measurement noise gives to what is missing, the share of a constant that
    is seen, and the resolution in s, from frequency responses: e = [I - C (zI - A (I - K C))^-1 A K] noise + C (zI - A
    (I - K C))^-1 disturbance, missing = spread (I/z - back)^-1 weigh e.
    """
    omega = np.pi * (np.arange(SMOOTHER_FREQUENCIES) + 0.5) / SMOOTHER_FREQUENCIES
    z = np.exp(1j * omega)[:, None, None]
    eye = np.eye(len(d.A))
    to_state = np.linalg.inv(z * eye - d.A @ (eye - d.K @ d.C))
    smoothing = np.linalg.solve(eye / z - d.back, np.broadcast_to(d.weigh, (SMOOTHER_FREQUENCIES, *d.weigh.shape)))
    out = (d.spread[equation.state] / equation.per_unit) @ smoothing
    from_noise = out - np.einsum("fj,fjk->fk", out, d.C @ to_state @ d.A @ d.K)
    spectra = [n.sigma**2 * (1 - n.rho**2) / np.abs(1 - n.rho / z[:, 0, 0]) ** 2 for n in observer.noise]
    noise = float(np.sqrt(np.mean(np.sum(np.abs(from_noise) ** 2 * np.stack(spectra, axis=1), axis=1))))
    held = d.step[:, equation.state] * equation.per_unit
    seen = np.abs(np.einsum("fj,fj->f", out, (d.C @ to_state) @ held))
    if not np.isfinite(seen).all():
        source = observer.stretches[0].source
        raise InputError(f"{source}: samples {observer.step:.3g} s apart are too few for the model's fastest motion")
    passed = omega[seen >= 0.5 * seen.max()].max()
    return noise, max(float(seen[0]), 1e-6), float(np.pi * observer.step / passed)


@compiled
def _backwards(back, weigh, e):  # type: ignore[no-untyped-def]
    """Return r_k (T, n), from the last sample on: r_(k-1) = weigh e_k + back r_k."""
    n, ny = weigh.shape
    out, r, new = np.zeros((e.shape[0], n)), np.zeros(n), np.zeros(n)
    for k in range(e.shape[0] - 1, -1, -1):
        out[k] = r
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += back[i, j] * r[j]
            for c in range(ny):
                total += weigh[i, c] * e[k, c]
            new[i] = total
        r[:] = new
    return out


__all__ = ["Missing", "missing"]
