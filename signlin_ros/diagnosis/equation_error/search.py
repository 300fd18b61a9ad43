"""The sets of laws that leave least of the missing force, and the choice of the least set that suffices."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from signlin_ros.diagnosis.blocks import MIN_DIVISOR
from signlin_ros.diagnosis.equation_error.laws import Ripple, Shape
from signlin_ros.diagnosis.equation_error.regression import Member, Regression, RegressionFit
from signlin_ros.diagnosis.equation_error.subsets import Subsets
from signlin_ros.diagnosis.equation_error.waves import Waves
from signlin_ros.fitting.inverses import squared_distance

REFINED_BEAMS = 2
"""The best so many times `Criteria.beam_width` of a step are refined."""
SHAPE_STEPS, MAX_SHAPE_MOVES, NO_GAIN = (0.25, 0.1, 0.04), 3, 1 - 1e-4
"""Relative steps that refine a shape, and how often in a row, unless one leaves more than this of the squared error."""
MAX_STEP_RATIO = 0.97
"""A step that leaves more than this of the squared error of the one before ends the search."""
MAX_HARMONICS = 8
"""Most harmonics of a wave beyond its first."""


@dataclass(eq=False)
class SubsetSearch:
    """A beam search, set by set: ``models``: the best fit of every set of laws so far, by their names; ``shapes``: the
    values of each law's nonlinear parameters that are tried; ``whole``: whether orders of waves are whole numbers.
    ``chosen``, once it has been run: the least sound set that suffices, the law that is worth most first.
    """

    regression: Regression
    whole: bool
    shapes: dict[str, list[Shape]]
    models: dict[frozenset[str], RegressionFit] = field(default_factory=dict)
    chosen: RegressionFit = field(init=False)

    def run(self) -> None:
        """Fit sets of laws, in `Criteria.max_effects` steps or until nothing is gained."""
        best = [self._keep(self.regression.fitted(()))]
        for count in range(1, self.regression.criteria.max_effects + 1):
            before = min(f.training_mse for f in self.models.values())
            best = self._step(best, count)
            if not best or (count > 1 and min(f.training_mse for f in best) > MAX_STEP_RATIO * before):
                break
        self._fit_smaller_sets()
        rippled = self._rippled(self._choice())
        if rippled is not None and len(rippled.members) < self.regression.criteria.max_effects:
            beside = self._subsets(rippled.members).beside(rippled.members, self._others(rippled), rippled.training_mse)
            self._fitted(list(beside))
        self._fit_smaller_sets()
        self.chosen = self._by_worth(self._choice())

    def _rippled(self, f: RegressionFit) -> RegressionFit | None:
        """Return a fit whose wave has as many harmonics as validation data ask for; None if it has no wave, or but
        one.
        """
        wave = next((m for m in f.members if self.regression.laws[m[0]].effect.periodic), None)
        name = next((n for n, law in self.regression.laws.items() if isinstance(law, Ripple)), None)
        if wave is None or name is None:
            return None
        rest, best, orders = [m for m in f.members if m is not wave], f, wave[1]
        for _ in range(MAX_HARMONICS):
            more = [
                N
                for N in self.waves.strongest(best.training_residual)
                if all(abs(N - other) > 1e-9 for _, other in orders)
            ]
            tried = [self.regression.fitted([*rest, (name, (*orders, (wave[1][0][0], N)))]) for N in more]
            found = min(tried, key=lambda g: g.training_mse, default=None)
            if found is None or not self.improves(found, best, 3, whole=True):
                break
            best, orders = found, found.members[-1][1]
        return self._keep(best) if best is not f else None

    @property
    def base(self) -> RegressionFit:
        """The base model's best fit."""
        return self.models[frozenset()]

    def _keep(self, f: RegressionFit) -> RegressionFit:
        self.models[f.names] = min(self.models.get(f.names, f), f, key=lambda g: g.training_mse)
        return self.models[f.names]

    def _step(self, best: Sequence[RegressionFit], count: int) -> list[RegressionFit]:
        """Fit the best sets of ``count`` laws, and return the best of these; ``best``: of those of one law less."""
        for f in best:
            self._scan(f)
        subsets = self._subsets(chain.from_iterable(f.members for f in best))
        found = subsets.best(count, min(f.training_mse for f in best))
        return self._fitted(found[: 4 * REFINED_BEAMS * self.regression.criteria.beam_width])

    def _fitted(self, sets: Sequence[tuple[Member, ...]]) -> list[RegressionFit]:
        """Fit some sets, the first of them with their shapes between the points of the grid; return the best."""
        beam, fits = self.regression.criteria.beam_width, [self.regression.fitted(m) for m in sets]
        refined = [self.refined(f) for f in fits[: REFINED_BEAMS * beam]]
        fits = [self._keep(f) for f in (*refined, *fits[REFINED_BEAMS * beam :])]
        return sorted(
            fits, key=lambda f: f.training_mse * (1 + self.regression.criteria.min_share_per_parameter * f.n_parameters)
        )[:beam]

    def _others(self, f: RegressionFit) -> list[str]:
        """Return the laws that may stand beside those of a fit."""
        taken = {self.regression.laws[n].family for n in f.names}
        return [n for n, law in self.regression.laws.items() if law.family not in taken]

    def _scan(self, f: RegressionFit) -> None:
        """Add the orders at which what a fit leaves repeats over the position to the shapes of periodic laws."""
        for name in self._others(f):
            for order in self.regression.laws[name].effect.periodic[:1]:
                for N in self.waves.strongest(f.training_residual):
                    self._add_shape(name, ((order, N),))

    def _add_shape(self, name: str, shape: Shape) -> None:
        if shape not in self.shapes[name]:
            self.shapes[name].append(shape)

    def _subsets(self, members: Iterable[Member]) -> Subsets:
        """Return the sets of all laws, with the shapes that are known and those of some members."""
        for name, shape in members:
            self._add_shape(name, shape)
        return Subsets(self.regression, self.shapes)

    @functools.cached_property
    def waves(self) -> Waves:
        """What tells at which orders a force repeats."""
        return Waves(
            self.regression.training, self.whole, self.regression.model.gear, self.regression.criteria.min_periods
        )

    @functools.cached_property
    def _stretch(self) -> tuple[float, float]:
        """Smallest and largest position of the records."""
        q = np.concatenate([p.q for p in self.regression.training.pieces])
        return float(q.min()), float(q.max())

    def refined(self, f: RegressionFit) -> RegressionFit:
        """Return a fit whose shapes lie between the points of the grid, by what is left of the fitted data."""
        for step in SHAPE_STEPS:
            for j, (name, shape) in enumerate(f.members):
                f = self._restructured(f, j)
                for n in self._movable(name, shape):
                    f = self._moved(f, j, n, step)
        return f

    def _restructured(self, f: RegressionFit, j: int) -> RegressionFit:
        """Return a fit with another value of a parameter that changes the equations, if that leaves less."""
        name, shape = f.members[j]
        for n in sorted(self.regression.laws[name].structural):
            others = {dict(s)[n]: None for s in self.shapes[name] if dict(s)[n] != dict(shape)[n]}
            f = min(
                [f, *(self.regression.fitted(_put(f.members, j, n, v)) for v in others)], key=lambda g: g.training_mse
            )
        return f

    def _movable(self, name: str, shape: Shape) -> list[str]:
        law = self.regression.laws[name]
        if isinstance(law, Ripple):
            return []
        held = {*law.effect.held, *law.parts.group[:1], *law.structural, *(law.effect.periodic if self.whole else ())}
        return [n for n, v in shape if v and n not in held]

    def _moved(self, f: RegressionFit, j: int, n: str, step: float) -> RegressionFit:
        """Return a fit with a parameter of a shape moved by relative steps, as long as that leaves less."""
        effect = self.regression.laws[f.members[j][0]].effect
        factors: tuple[float, ...] = (1 / (1 + step), 1 + step)
        least = -np.inf
        if n in effect.periodic:
            apart = 2 * np.pi / self.regression.training.travel / dict(f.members[j][1])[n] * step
            factors, least = (1 - apart, 1 + apart), self.waves.slowest
        for _ in range(MAX_SHAPE_MOVES):
            now, par = dict(f.members[j][1])[n], effect.pars()[n]
            values = {factor: float(f"{par.nearest(now * factor):.12g}") for factor in factors}
            tried = [(k, self.regression.fitted(_put(f.members, j, n, v))) for k, v in values.items() if v >= least]
            factor, best = min(tried, key=lambda one: one[1].training_mse, default=(1.0, f))
            if best.training_mse >= f.training_mse * NO_GAIN:
                break
            f, factors = best, (factor,)  # the other way lies where it came from
        return f

    # ------------------------------------------------------------------ the choice

    def without(self, f: RegressionFit, name: str) -> RegressionFit:
        """Return the best fit known without one of a fit's laws: the reference of what that is worth."""
        return self._known([m for m in f.members if m[0] != name])

    def _known(self, members: Sequence[Member]) -> RegressionFit:
        """Return the best fit known of some laws, whatever their shapes; with these, if there is none yet."""
        return self.models.get(frozenset(dict(members))) or self._keep(self.regression.fitted(members))

    def _simpler(self, f: RegressionFit, name: str) -> list[RegressionFit]:
        """Return the fits with a simpler law of the same family in a law's place."""
        law, rest = self.regression.laws[name], [m for m in f.members if m[0] != name]
        kin = [n for n, other in self.regression.laws.items() if other.family == law.family and n not in f.names]
        first = [(n, shape) for n in kin for shape in self.shapes[n][:1]]
        simple = [m for m in first if self.regression.laws[m[0]].free(m[1]) < law.free(dict(f.members)[name])]
        known = [m for m in simple if len(self.shapes[m[0]]) == 1 or frozenset(dict([*rest, m])) in self.models]
        return [self._known([*rest, m]) for m in known]

    def helpful(self) -> frozenset[str]:
        """Return the laws that take away some of the missing force of validation data, alone or beside others."""
        fits = list(self.models.values())
        return frozenset(n for f in fits for n in f.names if self.without(f, n).validation_mse > f.validation_mse)

    def sound(self, f: RegressionFit) -> bool:
        """Tell whether every law of a fit is needed on validation data, and its level known; nothing known is bent,
        and no law is there but to take away what another one makes.
        """
        return not (self.bends(f) or self.cancels(f)) and all(self.needed(f, n) for n, _ in f.members)

    def cancels(self, f: RegressionFit) -> bool:
        """Tell whether laws all but cancel: together they vary by little of what one of them does."""
        laws = [
            self.regression.validation.columns(self.regression.laws[n], z) @ f.theta[f.spans[n]] for n, z in f.members
        ]
        return len(laws) > 1 and bool(
            np.var(sum(laws)) < self.regression.criteria.max_force_mse_left * max(map(np.var, laws))
        )

    def bends(self, f: RegressionFit) -> bool:
        """Tell whether a fit moves a base parameter that carries force beyond tolerance, and further than the base."""
        c, regression = self.regression.criteria, self.regression
        known = slice(regression.n_base - 1)
        spread, theta, alone = (x[known] for x in (regression.prior_std, f.theta, self.base.theta))
        moved, before = (np.abs(np.log1p(np.maximum(x, -1 + 1e-12))) / spread for x in (theta, alone))
        carried = (
            np.abs(theta) * np.sqrt(np.mean(regression.validation.X[:, :-1] ** 2, axis=0))
            > c.min_bent_share * regression.validation.effort
        )
        return bool(f.members) and bool(
            np.any((moved > c.max_bent) & (moved > before + 1.0) & carried & (spread < 0.5))
        )

    def needed(self, f: RegressionFit, name: str) -> bool:
        """Tell whether a law's level is known, its parameters are possible, and it takes away a sure and visible part
        of the validation error: of what is left without it; of all that is missing, beside a simpler law of its family.
        """
        free = self.regression.laws[name].free(dict(f.members)[name])
        shown = self.regression.criteria.min_share_per_parameter * self.base.validation_mse
        if not self._significant(f, name) or not self.improves(f, self.without(f, name), free):
            return False
        simpler = self._simpler(f, name)
        return all(
            self.improves(f, g, free) and (g.validation_mse - f.validation_mse > shown or self._most(f, g))
            for g in simpler
        )

    def _significant(self, f: RegressionFit, name: str) -> bool:
        """Tell whether the level of a law is known, its parameters are possible, and the records show what it is."""
        law = self.regression.laws[name]
        values = law.parameters(dict(f.members)[name], f.theta[f.spans[name]])
        possible = law.effect.plausible(values) and law.effect.is_met(values, *self._stretch)
        possible = possible and law.effect.is_resolved(values, self.regression.training.pieces[0].step)
        return possible and self.t_ratio(f, name) >= self.regression.criteria.min_coefficient_t

    def improves(self, f: RegressionFit, reference: RegressionFit, free: int, whole: bool = False) -> bool:
        """Tell whether a fit takes away a sure and visible part of a simpler one's validation error, and of all that is
        missing where more than noise is left: a small part beside that has no name, but one more wave (``whole``), or
        what takes away most of what was left: beside a weight all friction is a small part.
        """
        c, gone = self.regression.criteria, reference.validation_mse - f.validation_mse
        clean = whole or f.validation_mse < self.regression.visible_mse or self._most(f, reference)
        large = gone > c.min_share_per_parameter * max(
            free * reference.validation_mse, 0.0 if clean else self.base.validation_mse
        )
        return large and self.regression.surely(f, reference) >= c.min_t

    def _most(self, f: RegressionFit, reference: RegressionFit) -> bool:
        """Tell whether a fit takes away most of what another one leaves of validation data."""
        return f.validation_mse < self.regression.criteria.max_force_mse_left * reference.validation_mse

    def t_ratio(self, f: RegressionFit, name: str) -> float:
        """Return by how many standard errors a law is from nothing: by what tells it from simpler ones, or by all."""
        law, span = self.regression.laws[name], f.spans[name]
        z = np.abs(f.theta[span]) / np.maximum(f.std[span], MIN_DIVISOR)
        if law.parts.turning:
            return float(np.min(np.hypot(z[::2], z[1::2])))
        if law.parts.group or law.effect.telling or z.size == 1:
            return float(z[-1] if law.parts.group else np.min(z))
        at = np.arange(span.start, span.stop)[np.isfinite(f.std[span])]
        return float(np.sqrt(squared_distance(f.theta[at], f.covariance[np.ix_(at, at)])))

    def _choice(self) -> RegressionFit:
        """Return the least sound set that suffices, of those that are fitted by now."""
        fits = list(self.models.values())
        return self.regression.least_that_suffices([f for f in fits if self.sound(f)] or [self.base])

    def _fit_smaller_sets(self) -> None:
        """Fit the sets that a law more led to, without one of their others."""
        for f in list(self.models.values()):
            for name, _ in f.members if len(f.members) > 1 else ():
                self.without(f, name)

    def _by_worth(self, f: RegressionFit) -> RegressionFit:
        """Return a fit with the law that is worth most first."""
        ordered = sorted(f.members, key=lambda m: -self.without(f, m[0]).validation_mse)
        return self.regression.fitted(ordered) if len(ordered) > 1 else f

    def beside(self, f: RegressionFit, name: str) -> tuple[RegressionFit, ...]:
        """Return the sets that have another law in the place of one of a fit's, each from all its shapes."""
        rest = self.without(f, name)
        others = [n for n in self.regression.laws if n not in f.names]
        found = {n: self.models[rest.names | {n}] for n in others if rest.names | {n} in self.models}
        new = [n for n in others if n not in found]
        for members in self._subsets(rest.members).beside(rest.members, new, rest.training_mse) if new else ():
            one = self.regression.fitted(members)
            (other,) = one.names - rest.names
            found[other] = min(found.get(other, one), one, key=lambda g: g.training_mse)
        return tuple(found.values())

    def ties(self, f: RegressionFit, others: Sequence[RegressionFit]) -> tuple[str, ...]:
        """Return the laws by which some sets differ from a fit, and which could as well stand in it."""
        pairs = [(n, g) for g in others for n in g.names - f.names]
        return tuple(sorted(n for n, g in pairs if self.regression.alike(f, g) and self._significant(g, n)))


def _put(members: Sequence[Member], j: int, n: str, value: float) -> tuple[Member, ...]:
    """Return members with another value of a parameter of one's shape."""
    name, shape = members[j]
    return (*members[:j], (name, tuple((k, value if k == n else v) for k, v in shape)), *members[j + 1 :])


__all__ = ["SubsetSearch"]
