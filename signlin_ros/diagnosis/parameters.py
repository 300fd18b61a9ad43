"""Fitted parameters, with units and standard errors that allow for what correlation is left."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.findings import Findings
from signlin_ros.diagnosis.fit import Fit
from signlin_ros.diagnosis.judge import correlations
from signlin_ros.diagnosis.problem import Problem, added_keys
from signlin_ros.diagnosis.results import Estimate
from signlin_ros.model import Model
from signlin_ros.trace import resolve_unit

Array = NDArray[np.float64]

FAR = (0.2, 3.0)
"""A known effect's parameter moved far: by more than this share of it, and so many standard errors."""


def estimates(f: Fit, names: Sequence[str], findings: Findings) -> dict[str, Estimate]:
    """Return parameters with standard errors that allow for what correlation is left in the residual."""
    c, problem = f.candidate, findings.problem
    covariance = _covariance(f)
    units = {n.split(".", 1)[1]: p.unit for n, p in c.model.par_declarations().items()}
    fitted = {k.name: (i, k) for i, k in enumerate(c.coordinates)}
    p = dict(zip(c.equations.parameters, c.p(f.theta), strict=True))
    result = {}
    for name in names:
        if name in units:
            unit = resolve_unit(units[name], c.model.plant, problem.rotary)
        else:
            unit = _sensor_unit(problem, name)
        if name not in fitted:
            result[name] = Estimate(float(p[name] if name in p else c.model.value(name)), None, unit, "held")
            continue
        i, k = fitted[name]
        own = float(np.sqrt(max(covariance[i, i], 0.0)))
        std = own * abs(k.slope(float(f.theta[i])))
        told = f.hessian[i, i] > 0.0
        notes = [_note(k, float(f.theta[i]), own) if told else "values nearby fit as well"]
        if told and "." in name:
            notes.insert(0, _moved(float(p[name]), std, given(problem.base, name)))
        result[name] = Estimate(float(p[name]), std if told else None, unit, "; ".join(n for n in notes if n))
    return result


def added_parameters(f: Findings, r: Any, effect: str) -> dict[str, Estimate]:
    """Return the parameters of an effect that was added, in a fit, by their names without its key."""
    model = r.fit.candidate.model
    keys = added_keys(f.problem, model, effect)
    names = [f"{key}.{n}" for key in keys for n in model.effects[key].parameters]
    names += [s for s in r.sensors if s.partition(".")[0] == effect]
    found = estimates(r.fit, names, f)
    return {n if n.startswith("sensor_") else n.partition(".")[2]: p for n, p in found.items()}


def _covariance(f: Fit) -> Array:
    """Return the covariance of the coordinates: of the data, widened for their correlation, and of the priors."""
    prior = np.diag([1.0 / k.spread**2 for k in f.candidate.coordinates])
    return np.asarray(np.linalg.pinv((f.hessian - prior) / _inflation(f) ** 2 + prior, hermitian=True))


def _note(k: Any, theta: float, std: float) -> str:
    if theta <= k.low + 1e-9 * abs(k.low) or theta >= k.high - 1e-9 * abs(k.high):
        return "at its bound"
    if np.isfinite(k.spread) and k.spread < 1.0 and abs(theta - k.prior) > 3 * k.spread:
        return f"{abs(theta - k.prior) / k.spread:.1f} standard deviations from its nominal value"
    if np.isfinite(k.spread) and k.spread < 1.0 and std > 0.95 * k.spread:
        return "not excited: the record says nothing beyond the tolerance"
    return ""


def given(base: Model, name: str) -> float | None:
    """Return a parameter as the base model has it, None where it has none of this name."""
    key, _, inner = name.rpartition(".")
    if not key:
        return base.parameters.get(inner)
    return base.effects[key].parameters.get(inner) if key in base.effects else None


def _moved(value: float, std: float, was: float | None) -> str:
    """Return what a known effect's parameter was, where it is no longer nearly that."""
    far = was is not None and abs(value - was) > max(FAR[0] * abs(was), FAR[1] * std)
    return f"was {was:g}" if far else ""


def _sensor_unit(problem: Problem, name: str) -> str:
    kind, _, channel = name.partition(".")
    return {"sensor_gain": "-", "sensor_delay": "s"}.get(kind, problem.units.get(channel, ""))


def _inflation(f: Fit) -> float:
    """Return by how much correlated residuals widen standard errors: sqrt(1 + 2 sum of correlations), at least 1."""
    worst = 1.0
    for c in range(f.innovations[0].shape[1]):
        r, _, _ = correlations([f.filter.apply(e)[:, c] for e in f.innovations], 50)
        positive = r[: int(np.argmax(r < 0.02)) or r.size] if (r < 0.02).any() else r
        worst = max(worst, 1.0 + 2.0 * float(np.sum(np.maximum(positive, 0.0))) if r[0] > 0.05 else 1.0)
    return float(np.sqrt(worst))


__all__ = ["added_parameters", "estimates", "given"]
