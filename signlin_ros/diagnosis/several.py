"""Several plain effects at once, found where the effort was measured: all sets of two and three by least squares.

What adds one effect after the other must gain by the first alone. A constant load, a spring and dry friction together
may each be worth little while the others are missing, and a rich law that imitates all three then comes first. The
inverse model is linear in their parameters [Gautier, Janot and Vandanjon, IEEE Trans. Control Systems Technology 21
(2013) 428], so that all sets are told apart in a moment; the best are then fitted as everything else is.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.data import Stretch
from signlin_ros.diagnosis.fit import Filter, base_coordinates, candidate
from signlin_ros.diagnosis.inverse import Efforts
from signlin_ros.diagnosis.problem import Problem
from signlin_ros.diagnosis.rank import PRICE, Ranked, Trial, descend, extends, ranked
from signlin_ros.effects import EFFECTS
from signlin_ros.effects.base import Effect
from signlin_ros.model import Model
from signlin_ros.noise import Noise

Array = NDArray[np.float64]

LARGEST = 3
"""Most effects of a set."""
FINISHED = 6
"""How many sets are fitted out."""
SMALL = 1e-3
"""By what share a base parameter is changed to see what the effort owes to it."""
LINEAR = 1e-6
"""What twice a parameter may differ from twice what it does, as a share of that."""
FEWEST = 50
"""Samples, after decimation, by which sets are told apart."""


@dataclass(frozen=True)
class _Shape:
    """An effect whose parameters are given but for those that its force is linear in: ``names``, and what a unit of
    each does to the effort (K, names).
    """

    trial: Trial
    start: dict[str, float]
    names: tuple[str, ...]
    columns: Array

    @property
    def least(self) -> Array:
        """The least allowed values (names,) of the linear parameters."""
        pars = EFFECTS[self.trial.effect].pars()
        return np.array([pars[n].low for n in self.names])

    def values(self, found: Array) -> dict[str, float] | None:
        """Return all parameters for the linear ones (names,); None if these are not allowed."""
        pars = EFFECTS[self.trial.effect].pars()
        if any(not pars[n].low <= v <= pars[n].high for n, v in zip(self.names, found, strict=True)):
            return None
        return {**self.start, **dict(zip(self.names, map(float, found), strict=True))}


Parts = list[tuple[Trial, dict[str, float]]]


def best_sets(problem: Problem, trials: Sequence[Trial], count: int = FINISHED) -> list[Parts]:
    """Return the sets of two and three plain effects that explain the measured effort best, with their parameters; none
    where effort or motion were not measured.

    Plain is an effect of a force without own states; of a form that starts give several of, each is tried.
    """
    found = _efforts(problem)
    if found is None:
        return []
    efforts, kept = found
    shapes = list(_shapes(problem.base, trials, efforts, kept))
    if not shapes:
        return []
    computed = efforts.computed(problem.base, True)
    target, known = (efforts.measured - computed)[kept], _known(problem, efforts, kept, computed)
    best: dict[tuple[str, ...], tuple[float, Parts]] = {}
    for one, cost, parts in _solved(shapes, target, known):
        if one not in best or cost < best[one][0]:
            best[one] = cost, parts
    return [parts for _, parts in sorted(best.values(), key=lambda item: item[0])[:count]]


def at_once(problem: Problem, parts: Parts, filter: Filter) -> Ranked | None:
    """Return a set of effects fitted out from given parameters; None if it diverges."""
    model = problem.base
    for trial, values in parts:
        pars = EFFECTS[trial.effect].pars()
        model = model.with_effect(
            trial.effect, key=trial.added[0], **{n: pars[n].nearest(v) for n, v in values.items()}
        )
    c = candidate(problem, model, tuple(trial.added[0] for trial, _ in parts))
    fits = descend(problem, c, None, problem.levels[1:], 10, filter)
    return ranked(problem, tuple(trial.effect for trial, _ in parts), (), fits)


def _efforts(problem: Problem) -> tuple[Efforts, NDArray[np.bool_]] | None:
    """Return the efforts of a problem, and where (K,) they tell anything of friction; None where they are not known."""
    if problem.scale.imposed:
        return None
    stretches = [Stretch(s.t, s.u, s.y, s.source, i, 0, early=s.early) for i, s in enumerate(problem.segments)]
    efforts = Efforts.of(problem.base, stretches, problem.channels, [Noise(float(s)) for s in problem.noise])
    if efforts is None:
        return None
    kept = efforts.moving(problem.base)
    return (efforts, kept) if kept.sum() >= FEWEST else None


def _plain(trial: Trial) -> bool:
    """Tell whether an effect is a force without a memory that starts from a few shapes."""
    effect = EFFECTS[trial.effect]
    own = not (effect.states or effect.periodic or effect.rugged)
    return bool(trial.added) and own and effect.force is not Effect.force


def _shapes(base: Model, trials: Sequence[Trial], efforts: Efforts, kept: NDArray[np.bool_]) -> Iterator[_Shape]:
    """Yield plain effects with each of their shapes."""
    nothing = efforts.computed(base, True)[kept]
    for trial in filter(_plain, trials):
        pars, seen = EFFECTS[trial.effect].pars(), set()

        def done(values: dict[str, float], trial: Trial = trial) -> Array:
            model = base.with_effect(trial.effect, key=trial.added[0], **values)
            return efforts.computed(model, True)[kept] - nothing

        for start in trial.starts:
            unit = {n: v or 1.0 for n, v in start.items()}
            zero = {n: pars[n].low <= 0 <= pars[n].high and not pars[n].positive for n in start}
            linear = [n for n in start if zero[n] and _linear(done, {**start, n: unit[n]}, n)]
            shape = tuple(v for n, v in start.items() if n not in linear)
            if not linear or shape in seen:
                continue
            seen.add(shape)
            off = {**start, **dict.fromkeys(linear, 0.0)}
            columns = np.column_stack([done({**off, n: unit[n]}) / unit[n] for n in linear])
            if (np.linalg.norm(columns, axis=0) > 0).all():
                yield _Shape(trial, off, tuple(linear), columns)


def _linear(done: Callable[[dict[str, float]], Array], at: dict[str, float], name: str) -> bool:
    """Tell whether what an effect does is linear in one of its parameters, between zero and where it is."""
    zero, one, two = (done({**at, name: factor * at[name]}) for factor in (0.0, 0.5, 1.0))
    return bool(np.linalg.norm(two - 2.0 * one + zero) <= LINEAR * np.linalg.norm(two - zero))


def _known(problem: Problem, efforts: Efforts, kept: NDArray[np.bool_], computed: Array) -> Array:
    """Return what a standard deviation of the prior of each base parameter does to the effort (K, parameters)."""
    base, columns = problem.base, [np.zeros((int(kept.sum()), 0))]
    for c in base_coordinates(problem, base):
        value = c.value(c.prior)
        changed = efforts.computed(base.with_parameters({c.name: value * (1.0 + SMALL)}), True)
        columns.append((changed - computed)[kept, None] / (SMALL * value) * c.slope(c.prior) * c.spread)
    return np.hstack(columns)


def _solved(shapes: Sequence[_Shape], target: Array, known: Array) -> Iterator[tuple[tuple[str, ...], float, Parts]]:
    """Yield every set of two and three effects that has allowed parameters: names, cost and parts.

    Squares are in units of those that all effects together leave; base parameters count their priors. A parameter that
    would be less than it may be is nothing, as one of two directions is whose damping the base model has already.
    """
    everything = np.hstack([known, *(s.columns for s in shapes)])
    left = target - everything @ np.linalg.lstsq(everything, target, rcond=None)[0]
    noise = max(float(left @ left) / max(target.size - everything.shape[1], 1), 1e-300)
    gram, right = everything.T @ everything / noise, everything.T @ target / noise
    gram[np.diag_indices(known.shape[1])] += 1.0
    size_of = np.sqrt(np.diag(gram))
    gram, right = gram / np.outer(size_of, size_of), right / size_of
    own, price = np.arange(known.shape[1]), float(np.log(target.size))
    ends = own.size + np.cumsum([0, *(s.columns.shape[1] for s in shapes)])
    least = np.concatenate([np.full(own.size, -np.inf), *(s.least for s in shapes)])
    for size in range(2, LARGEST + 1):
        for chosen in itertools.combinations(range(len(shapes)), size):
            names = tuple(shapes[i].trial.effect for i in chosen)
            if _overlapping(names):
                continue
            at = np.concatenate([own, *(np.arange(ends[i], ends[i + 1]) for i in chosen)])
            found, there = _bounded(gram[np.ix_(at, at)], right[at], least[at] * size_of[at])
            cuts = own.size + np.cumsum([0, *(shapes[i].columns.shape[1] for i in chosen)])
            if not np.logical_or.reduceat(there, cuts[:-1]).all():
                continue
            split = np.split((found / size_of[at])[own.size :], cuts[1:-1] - own.size)
            parts = [(shapes[i].trial, shapes[i].values(p)) for i, p in zip(chosen, split, strict=True)]
            if any(values is None for _, values in parts):
                continue
            cost = -float(found @ right[at]) + price * (np.count_nonzero(there) - own.size) + PRICE * size
            yield names, cost, [(trial, values) for trial, values in parts if values is not None]


def _bounded(gram: Array, right: Array, least: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the least squares from normal equations without what would be below its least (k,), and what is there."""
    there = np.ones(right.size, dtype=bool)
    while True:
        found = np.zeros(right.size)
        found[there] = np.linalg.lstsq(gram[np.ix_(there, there)], right[there], rcond=None)[0]
        below = there & (found < least)
        if not below.any():
            return found, there
        there &= ~below


def _overlapping(names: tuple[str, ...]) -> bool:
    """Tell whether an effect is there twice, or one that another one contains."""
    return len(set(names)) < len(names) or any(set(extends(n)) & set(names) for n in names)


__all__ = ["LARGEST", "at_once", "best_sets"]
