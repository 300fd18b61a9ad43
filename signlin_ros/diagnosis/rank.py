"""All effects compete: starts, fits of singles, then of what can be added to the best of them."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.fit import Candidate, Filter, Fit, candidate, fit
from signlin_ros.diagnosis.problem import Problem
from signlin_ros.diagnosis.scan import periodic_starts
from signlin_ros.effects import EFFECTS, load_entry_points
from signlin_ros.effects.base import Effect
from signlin_ros.errors import ModelError
from signlin_ros.model import Model

Array = NDArray[np.float64]

PRICE = 10.0
"""What an effect must gain in -2 log likelihood on top of ln n for each of its parameters."""
SERIOUS = 0.25
"""Share of the best candidate's gain at the middle gain that makes another one worth a thorough fit."""


@dataclass(frozen=True)
class Trial:
    """An effect that may be missing: its name, the key or the sensors that it adds, and what it is added to."""

    effect: str
    added: tuple[str, ...] = ()
    sensors: dict[str, float] = field(default_factory=dict)
    starts: tuple[dict[str, float], ...] = ()


@dataclass(frozen=True)
class Ranked:
    """A set of effects, fitted: the fit at the lowest gain and its evidence (-2 log likelihood, priced)."""

    effects: tuple[str, ...]
    sensors: tuple[str, ...]
    fit: Fit
    evidence: float

    @property
    def label(self) -> str:
        """The last effect added."""
        return self.effects[-1] if self.effects else ""


def applicable(problem: Problem) -> tuple[list[Trial], list[str]]:
    """Return what can be tried on the base model, and the effects that do not apply to its plant."""
    load_entry_points()
    trials, outside = [], []
    for name, effect in EFFECTS.items():
        if any(use.type == name for use in problem.base.effects.values()) and name != "cogging_torque":
            continue
        found = _sensor_trials(problem, name) if name.startswith("sensor_") else _effect_trials(problem, name, effect)
        trials += found
        if not found:
            outside.append(name)
    return trials, outside


def _effect_trials(problem: Problem, name: str, effect: type[Effect]) -> list[Trial]:
    plant = problem.base.plant
    if (effect.plants and plant.name not in effect.plants) or name in plant.built_in:
        return []
    starts = _starts(problem, effect)
    if not starts:
        return []
    try:
        model = problem.base.with_effect(name, key=_key(problem.base, name), **starts[0])
        _ = model.trace
    except ModelError:
        return []
    return [Trial(name, (_key(problem.base, name),), {}, tuple(starts))]


def _key(model: Model, name: str) -> str:
    key, number = name, 2
    while key in model.effects:
        key, number = f"{name}_{number}", number + 1
    return key


def _starts(problem: Problem, effect: type[Effect]) -> list[dict[str, float]]:
    """Return complete sets of parameters to start from."""
    starts = effect.starts(problem.scale)
    if effect.periodic:
        order, amplitude, phase = effect.periodic
        names = {"N": order, "A": amplitude, "phi": phase}
        scanned = periodic_starts(problem, problem.base)
        starts = [{**one, **{names[k]: v for k, v in found.items()}} for one in starts for found in scanned]
    pars = effect.pars()
    spring = problem.base._has_spring
    complete = []
    for one in starts:
        values = {n: v for n, v in one.items() if not (pars[n].free_standing and spring)}
        for n, v in effect.held.items():
            if v is not None:
                values[n] = v
        complete.append({n: float(np.clip(v, pars[n].low, pars[n].high)) for n, v in values.items()})
    return complete


def _sensor_trials(problem: Problem, name: str) -> list[Trial]:
    start = {"sensor_gain": 1.0, "sensor_delay": 1.5 * problem.scale.step}.get(name, 0.0)
    shown = [c for c in problem.channels if c in problem.base.states or name != "sensor_delay"]
    return [Trial(name, (), {f"{name}.{c}": start}, ({},)) for c in shown]


def extended(problem: Problem, before: Ranked | None, trial: Trial, start: dict[str, float]) -> Candidate:
    """Return the candidate that adds a trial, at one of its starts, to what was fitted before."""
    model = before.fit.candidate.model if before else problem.base
    sensors = {n: before.fit.parameters()[n] for n in before.sensors} if before else {}
    added = tuple(e for e in before.fit.candidate.label if e in model.effects) if before else ()
    if before:
        values = {n: v for n, v in before.fit.parameters().items() if not n.startswith("sensor_")}
        model = model.with_parameters(_inside(model, values))
    for key in trial.added:
        model = model.with_effect(trial.effect, key=key, **start)
    c = candidate(problem, model, added + trial.added, {**sensors, **trial.sensors})
    return _from_nominal(problem, c)


def _inside(model: Model, values: dict[str, float]) -> dict[str, float]:
    """Return the values, moved by rounding into the declared bounds."""
    declared = {n.split(".", 1)[1]: p for n, p in model.par_declarations().items()}
    return {
        n: float(
            np.clip(
                v, np.nextafter(declared[n].low, 1e300) if declared[n].positive else declared[n].low, declared[n].high
            )
        )
        for n, v in values.items()
    }


def _from_nominal(problem: Problem, c: Candidate) -> Candidate:
    """Return the candidate with the base parameters at nominal: the base-only fit has run off to imitate effects."""
    values = dict(c.values)
    for name, value in problem.base.parameters.items():
        if name in values:
            values[name] = value
    for key, use in problem.base.effects.items():
        for name, value in use.parameters.items():
            if f"{key}.{name}" in values:
                values[f"{key}.{name}"] = value
    return replace(c, values=values)


def evidence(problem: Problem, f: Fit, effects: int) -> float:
    """Return -2 log likelihood + prior + p ln n + a price for every effect; p counts what is not a base parameter."""
    base = sum(1 for c in f.candidate.coordinates if np.isfinite(c.spread) and c.name in _base_names(problem))
    free = len(f.candidate.coordinates) - base
    return f.cost + free * float(np.log(f.count.sum())) + PRICE * effects


def _base_names(problem: Problem) -> set[str]:
    known = {f"{key}.{n}" for key, use in problem.base.effects.items() for n in use.parameters}
    return set(problem.base.parameters) | known


def assess(problem: Problem, filter: Filter | None) -> Ranked | None:
    """Fit the base model and return it with its evidence; None if it diverges."""
    c, theta = candidate(problem, problem.base, ()), None
    found: Fit | None = None
    for gains in problem.levels:
        found = fit(problem, c, gains, theta, 10, filter if gains is problem.levels[-1] else None)
        if found is None:
            return None
        theta = found.theta
    return Ranked((), (), found, evidence(problem, found, 0)) if found else None


def _climb(problem: Problem, trial: Trial) -> list[Fit]:
    """Search at high gain from all starts of a trial, and follow the best to the middle gain; best first."""
    high, middle, _ = problem.levels
    candidates = [extended(problem, None, trial, start) for start in trial.starts]
    first = [f for f in (fit(problem, c, high, None, 4) for c in candidates) if f]
    first.sort(key=_cost)
    second = [f for f in (fit(problem, g.candidate, middle, g.theta, 6) for g in first[:3]) if f]
    return sorted(second, key=_cost)


def _cost(f: Fit) -> float:
    return f.cost


def _descend(problem: Problem, trial: Trial, climbed: list[Fit], serious: bool, filter: Filter | None) -> Ranked | None:
    """Fit a trial at the low gain, thoroughly if it is a ``serious`` candidate."""
    low, best = problem.levels[-1], None
    for g in climbed[: 2 if serious else 1]:
        if best is not None and g.cost > climbed[0].cost + 50.0:
            break
        found = fit(problem, g.candidate, low, g.theta, 12 if serious else 2, filter)
        if found and (best is None or found.cost < best.cost):
            best = found
    if best is None:
        return None
    return Ranked((trial.effect,), tuple(trial.sensors), best, evidence(problem, best, 1))


def residual_filter(residuals: Sequence[Array]) -> Filter:
    """Return the prewhitening for residuals (T, ny): rho of an AR(1) process from the variances of 1st, 2nd and 4th
    differences, which a slow error of the model does not touch.
    """
    rho = [_rho([r[:, c] for r in residuals]) for c in range(residuals[0].shape[1])]
    return Filter(np.array([r if r > 0.15 else 0.0 for r in rho]))


def _ratios(rho: Array) -> Array:
    """Return var(D^k e) / (its value for white noise) for k = 1, 2, 4 and an AR(1) process of variance 1."""
    return np.array(
        [
            1 - rho,
            (6 - 8 * rho + 2 * rho**2) / 6,
            (70 - 112 * rho + 56 * rho**2 - 16 * rho**3 + 2 * rho**4) / 70,
        ]
    )


def _differences(parts: Sequence[Array]) -> Array:
    result = []
    for order, white in ((1, 2.0), (2, 6.0), (4, 70.0)):
        values = np.concatenate([np.diff(p, order) for p in parts])
        result.append(np.nanmean(values**2) / white)
    return np.array(result)


def _rho(parts: Sequence[Array]) -> float:
    """Return rho of an AR(1) process from differences of order 2 and 4 alone."""
    found = _differences(parts)
    grid = np.linspace(0.0, 0.97, 195)
    table = _ratios(grid)
    wanted = found[2] / max(found[1], 1e-300)
    return float(grid[int(np.argmin(np.abs(table[2] / table[1] - wanted)))])


def noise_floor(residuals: Sequence[Array], filter: Filter) -> Array:
    """Return the standard deviation (ny) of the noise in residuals whose slow part is the model's error."""
    result = []
    for c, rho in enumerate(filter.rho):
        found = _differences([r[:, c] for r in residuals])
        result.append(np.sqrt(found[2] / _ratios(np.array([rho]))[2, 0]))
    return np.array(result)


def compete(problem: Problem, base: Ranked, trials: Sequence[Trial], run: Executor) -> list[Ranked]:
    """Return every trial alone on the base model, fitted, best evidence first.

    Only those that explain a fair part of what the best explains at the middle gain are fitted thoroughly at the low.
    """
    climbed = list(run.map(functools.partial(_climb, problem), trials))
    middle = fit(problem, base.fit.candidate, problem.levels[1], None, 10)
    reference = middle.cost if middle else np.inf
    gains = [reference - c[0].cost if c else -np.inf for c in climbed]
    limit = min(SERIOUS * max(gains, default=0.0), 1e9)
    serious = [g > limit or max(gains) < 1000.0 for g in gains]
    work = [(t, c, s) for t, c, s in zip(trials, climbed, serious, strict=True) if c]
    found = run.map(lambda w: _descend(problem, *w, None), work)
    return sorted((r for r in found if r is not None), key=lambda r: r.evidence)


__all__ = ["Ranked", "Trial", "applicable", "assess", "compete", "noise_floor", "residual_filter"]
