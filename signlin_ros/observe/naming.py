"""What a machine has changed in: hypotheses with one number each, judged by the filter's likelihood on data since then.

A quick first word while a diagnosis, which compares the whole catalogue on held-out data, is not asked for yet.
``python -m signlin_ros.observe.naming`` answers a pickled `Question` from its standard input as JSON.
"""

from __future__ import annotations

import json
import pickle
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from signlin_ros.errors import SignlinError
from signlin_ros.model import Model
from signlin_ros.observe.observer import KalmanObserver

Array = NDArray[np.float64]

WILDEST = 400.0
"""A squared innovation counts so much at most."""
SETTLING = 0.5
"""Seconds after the change that are not judged: the filter finds its state anew."""
TRIES = 14
"""Values of its number that a hypothesis is tried at."""
GAIN = 30.0
"""Logarithm of the likelihood ratio that a hypothesis must gain to be told, and that tells two apart."""
KEPT = 0.5
"""Share of its gain that a hypothesis must not have had before the change already."""
SHARES = (0.3, 0.6)
"""Of the inertia behind a play that has opened."""


@dataclass(frozen=True)
class Named:
    """A hypothesis: the effect's name, the number found with its unit, and the gain in the log-likelihood."""

    name: str
    value: float
    unit: str
    gain: float

    @property
    def sentence(self) -> str:
        """What has changed, in words: ``coulomb_friction, 1.49 times as much``."""
        if not np.isfinite(self.value):
            return self.name
        return f"{self.name}, {self.value:.3g} {self.unit or 'times as much'}"


@dataclass(frozen=True)
class _Hypothesis:
    """A number between ``low`` and ``high`` that makes another model and another input of it.

    ``parameter``: which one it is, by its ROS name; empty where it is a factor.
    """

    name: str
    parameter: str
    low: float
    high: float
    made: Callable[[float], tuple[Model, float]]

    def unit(self, value: float) -> str:
        """Return the unit of the number; empty for a factor."""
        return self.made(value)[0].par_declarations()[self.parameter].unit if self.parameter else ""


@dataclass(frozen=True)
class Stretch:
    """What was seen for a while: times t (T,), shown values (T,) by name, inputs u (T, m)."""

    t: Array
    measured: Mapping[str, Array]
    u: Array


def name_change(model: Model, before: Stretch, since: Stretch, trust: float, noise: Mapping[str, float]) -> list[Named]:
    """Return what could have changed, the likeliest first; nothing where the model is as good as it was.

    ``trust``, ``noise``: of the guard before the change. What a hypothesis gains on the data before it is a fault that
    the model had all along.
    """
    then, now = (_Scored(s.t, s.measured, s.u, trust, noise) for s in (before, since))
    found = []
    for hypothesis in _hypotheses(model, since.u):
        named = _best(hypothesis, now, now(model, 1.0))
        if named.gain > GAIN:
            old = then(*hypothesis.made(named.value)) - then(model, 1.0)
            net = named.gain - max(old, 0.0) * since.t.size / max(before.t.size, 1)
            if net > max(GAIN, KEPT * named.gain):
                found.append(replace(named, gain=net))
    found.sort(key=lambda h: -h.gain)
    names = [named.name for named in found]
    return [n for k, n in enumerate(found) if n.gain > found[0].gain - GAIN and n.name not in names[:k]]


@dataclass(frozen=True)
class Question:
    """What `name_change` is asked, and whether a sensor has shifted: that leaves a model that is right again."""

    model: Model
    before: Stretch
    since: Stretch
    trust: float
    noise: Mapping[str, float]
    shifted: bool

    def answer(self) -> list[Named]:
        """Return what may have changed, the likeliest first; empty where nothing has."""
        found = name_change(self.model, self.before, self.since, self.trust, self.noise)
        return found or ([Named("sensor_offset", float("nan"), "", 0.0)] if self.shifted else [])


class _Scored:
    """The log-likelihood of data under a model and a gain of its input."""

    def __init__(
        self, t: Array, measured: Mapping[str, Array], u: Array, trust: float, noise: Mapping[str, float]
    ) -> None:
        self.t, self.measured, self.u, self.trust, self.noise = t, measured, u, trust, noise

    def __call__(self, model: Model, gain: float) -> float:
        try:
            observer = KalmanObserver(model, self.measured, self.noise, (self.trust,))
            _, innovations = observer.record(self.t, self.measured, gain * self.u)
        except SignlinError:
            return -np.inf
        late = innovations.t >= self.t[0] + SETTLING
        z, variance = innovations.sizes[late], innovations.variance[late]
        return -0.5 * float(np.sum(np.log(variance + 1e-300) + np.minimum(z**2, WILDEST)))


def _best(hypothesis: _Hypothesis, score: _Scored, before: float) -> Named:
    def cost(value: float) -> float:
        try:
            return -score(*hypothesis.made(value))
        except SignlinError:
            return float("inf")

    grid = np.linspace(hypothesis.low, hypothesis.high, TRIES // 2)
    costs = [cost(float(value)) for value in grid]
    k = int(np.argmin(costs))
    bounds = (float(grid[max(k - 1, 0)]), float(grid[min(k + 1, grid.size - 1)]))
    found = minimize_scalar(cost, bounds=bounds, method="bounded", options={"maxiter": TRIES // 2})
    value, least = (float(found.x), float(found.fun)) if found.fun < costs[k] else (float(grid[k]), costs[k])
    return Named(hypothesis.name, value, hypothesis.unit(value), -least - before)


def _hypotheses(model: Model, u: Array) -> Iterator[_Hypothesis]:
    yield _Hypothesis("input_gain", "", 0.5, 1.6, lambda g: (model, g))
    if model.delay == 0.0:
        late = lambda T: (model.with_effect("input_delay", T=T), 1.0)  # noqa: E731
        yield _Hypothesis("input_delay", "effects.input_delay.T", 0.0, 0.05, late)
    for key, use in model.effects.items():
        if any(s.kind == "switch" for s in model.trace.surfaces) and "mu" in use.parameters:
            yield _scaled(model, key)
    size = _usual_force(model, u)
    load = "constant_load" if "constant_load" not in model.effects else "constant_load_since"
    added = lambda F: (model.with_effect("constant_load", key=load, F0=F), 1.0)  # noqa: E731
    yield _Hypothesis("constant_load", f"effects.{load}.F0", -size, size, added)
    yield from _plays(model)


def _scaled(model: Model, key: str) -> _Hypothesis:
    name, value = f"{key}.mu", model.value(f"{key}.mu")
    return _Hypothesis(key, "", 0.3, 3.0, lambda s: (model.with_parameters({name: s * value}), 1.0))


def _usual_force(model: Model, u: Array) -> float:
    """Return about how large the force of the input is, at rest."""
    size = float(np.sqrt(np.mean(u[:, 0] ** 2)))
    if "K_t" in model.parameters:
        return size * model.parameters["K_t"] / model.parameters["R_a"]
    return size


def _plays(model: Model) -> Iterator[_Hypothesis]:
    """Part of the inertia comes loose, within a play that opens."""
    inertia = next((name for name in ("J", "m") if name in model.parameters), None)
    if inertia is None or model.plant.position not in model.states or "backlash" in model.effects:
        return
    whole = model.parameters[inertia]
    for share in SHARES:
        loose, k = share * whole, share * whole * 150.0**2

        def made(gap: float, loose: float = loose, k: float = k) -> tuple[Model, float]:
            rest = model.with_parameters({inertia: whole - loose})
            return rest.with_effect("backlash", gap=gap, k=k, c=0.1 * (k * loose) ** 0.5, J=loose), 1.0

        yield _Hypothesis("backlash", "effects.backlash.gap", 0.002, 0.06, made)


def main() -> None:
    """Answer a pickled question from the standard input."""
    question = pickle.load(sys.stdin.buffer)
    told = [{**asdict(named), "sentence": named.sentence} for named in question.answer()]
    for entry in told:
        entry["value"] = entry["value"] if np.isfinite(entry["value"]) else None
    sys.stdout.write(json.dumps(told))


__all__ = ["Named", "Question", "Stretch", "main", "name_change"]


if __name__ == "__main__":
    main()
