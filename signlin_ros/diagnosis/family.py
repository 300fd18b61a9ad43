"""Which law of a family a confirmed model should have: the simpler one, or a richer one that both estimates ask for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from signlin_ros.diagnosis.criteria import HALF
from signlin_ros.diagnosis.equation_error.estimate import LATE_SENSOR, EquationErrorResult
from signlin_ros.diagnosis.equation_error.regression import RegressionFit
from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.effects import kin_of
from signlin_ros.errors import InputError
from signlin_ros.model import Model


@dataclass(frozen=True, eq=False)
class FamilyChoice:
    """A choice among laws of one family by both estimates: ``evidence``; ``force``: its equation-error estimate."""

    evidence: Evidence
    force: EquationErrorResult

    @property
    def imposed(self) -> bool:
        """Whether the motion is imposed: both estimates speak of one force then, the motion's of all its band."""
        dataset = self.evidence.dataset
        return dataset.plant.motion_is_imposed()

    def simulated(self, fit: RegressionFit) -> FittedModel | None:
        """Return a set of the equation-error estimate fitted by simulation, after the sensor that is late by itself if
        that is surely better; None where that cannot be.
        """
        names, laws = [n for n, _ in fit.members], partial(self.force.with_laws, fit)
        plain, late = self._fitted(names, laws), self.force.late_beside(fit, self.evidence.dataset.training.channels)
        if not late:
            return plain
        other = self._fitted([LATE_SENSOR, *names], lambda: laws().with_effect(LATE_SENSOR, None, **late))
        if plain is None or other is None:
            return other or plain
        refused = self.evidence.output_error.refusal(plain, other) or self.evidence.force_rises(plain, other)
        return plain if refused else other

    def _fitted(self, names: Sequence[str], start: Callable[[], Model], least: float = np.inf) -> FittedModel | None:
        """Return a fit; None where that cannot be, or -2 log likelihood does not soon come below the ``least``."""
        motion = self.evidence.output_error
        try:
            model = start()
            if least < np.inf and motion.objective_nearby(*motion.candidate_at(names, model)) >= least:
                return None
            proposal = motion.fitted(names, model)
        except InputError:
            return None
        self.evidence.cache.keep(proposal)
        return proposal

    # ------------------------------------------------------------ what the force cannot tell apart

    def of_ties(self, proposal: FittedModel) -> FittedModel:
        """Return a model with another law in the place of one that the forces cannot tell from it, if the motion surely
        asks for it: while a machine turns one way a load is like friction, when it has stopped it is not.
        """
        if proposal.residual_is_noise or self.imposed:
            return proposal
        force, options = self.force, list[FittedModel]()
        for name in [n for n in proposal.effects if n in force.laws]:
            kin, tied = kin_of(name), force.ties.get(name, ())
            for fit in force.replacements.get(name, ()):
                new = next(iter(fit.names - force.fit.names), "")
                alike = new in tied or fit.validation_mse < self.evidence.visible_force_mse
                if alike and new not in kin and (other := self.simulated(fit)):
                    options.append(other)
        return next(iter(self.evidence.output_error.as_good_as_best(proposal, options)), proposal)

    # ------------------------------------------------------------ a richer law of the same family

    def in_family(self, proposal: FittedModel) -> FittedModel:
        """Return a model with a richer law in place of one if motion surely asks for it, and force where it is seen."""
        evidence, laws = self.evidence, self.force.laws
        for name in (name for name in proposal.effects if name in laws):
            names = [n for n in kin_of(name) if n in laws and n in evidence.laws and n not in proposal.effects]
            options, least, fit = [], np.inf, proposal.fit
            if names and proposal.residual_is_noise and not self.imposed:
                least = (
                    evidence.output_error.objective_nearby(fit.candidate, fit.theta)
                    - evidence.criteria.min_validation_t**2
                )
            for richer in self.worth_it(proposal, name, names):
                effects = tuple(n if n != name else richer for n in proposal.effects)
                other = self._fitted(effects, partial(self._started, proposal, name, richer), least)
                options += [other] if other else []
            if self.imposed:
                options = self.of_one_force(proposal, options)
            else:
                options = evidence.output_error.as_good_as_best(proposal, options)
                if evidence.force_shows(proposal):
                    options = [other for other in options if self._shows(proposal, other)]
            proposal = options[0] if options else proposal
        return proposal

    def worth_it(self, proposal: FittedModel, name: str, richer: Sequence[str]) -> list[str]:
        """Return the laws in place of ``name`` that take visible force away, or the best; all where none is seen."""
        if self.imposed or not self.evidence.force_shows(proposal):
            return list(richer)
        models, names = self.force.sets, self.evidence.effects_in_force(proposal)
        errors = {n: models[names - {name} | {n}].validation_mse for n in richer if names - {name} | {n} in models}
        if names not in models or not errors:
            return list(richer)
        most = models[names].validation_mse - self._shown
        best = min(errors, key=lambda n: errors[n])
        return [n for n in richer if n == best or errors.get(n, 0.0) < most]

    def _shows(self, before: FittedModel, after: FittedModel) -> bool:
        """Tell whether a richer law surely takes away force, and a visible part of all that is missing."""
        change = self.evidence.force_change(before, after)
        return self.evidence.force_falls(before, after) and change is not None and change.fall > self._shown

    @property
    def _shown(self) -> float:
        """A visible part of all the squared force that is missing."""
        return self.evidence.criteria.min_share_per_parameter * self.force.base.validation_mse

    def _started(self, proposal: FittedModel, name: str, other: str) -> Model:
        """Return a fitted model with another law in place of one, as the equation-error estimate fitted it alone."""
        model = proposal.model.without_effect(*proposal.model.keys_of(name))
        return model.with_effect(other, None, **self.force.values(self.evidence.laws[other], other))

    # ------------------------------------------------------------ where the motion is imposed

    def in_all_band(self, proposal: FittedModel) -> FittedModel:
        """Return the best other set that leaves less of an imposed motion's force in all its band, if there is one."""
        force = self.force
        if not self.imposed:
            return proposal
        fits = [
            f for names, f in force.sets.items() if f.validation_mse < force.fit.validation_mse and names in force.sound
        ]
        best = sorted(fits, key=lambda f: f.validation_mse)[: self.evidence.criteria.beam_width]
        options = self.of_one_force(proposal, [other for other in map(self.simulated, best) if other])
        return options[0] if options else proposal

    def of_one_force(self, proposal: FittedModel, options: Sequence[FittedModel]) -> list[FittedModel]:
        """Return the options to stand in a model's place where the motion is imposed: they take away a visible part of
        the force in all its band, beyond doubt or half of what is left, and do not leave more in the low-pass.
        """
        evidence, c, motion = self.evidence, self.evidence.criteria, self.evidence.output_error
        most = proposal.validation_rmse**2 - c.min_share_per_parameter * motion.base.validation_rmse**2
        options = [
            other
            for other in options
            if not evidence.force_rises(proposal, other) and np.any(other.validation_rmse**2 < most)
        ]
        gains = [(other, motion.improvement(proposal, other)) for other in options if not other.insignificant(c)]
        halved = [other for other, g in gains if g.mse_reduction >= HALF and g.t_ratio >= c.min_validation_t]
        return motion.as_good_as_best(proposal, options) or sorted(halved, key=lambda other: other.log_mse)


__all__ = ["FamilyChoice"]
