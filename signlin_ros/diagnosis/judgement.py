"""The verdict that follows from what both witnesses stand for: adequate, missing or unexplained."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.scores import unfollowed
from signlin_ros.diagnosis.agreement import Agreed
from signlin_ros.diagnosis.case import Case
from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.cycles import seldom
from signlin_ros.diagnosis.force.flexible import changing, structured
from signlin_ros.diagnosis.force.regression import Fit, mean_certainty
from signlin_ros.diagnosis.measures import (
    acting,
    comparable,
    leaves_much,
    leaves_noise,
    near_any_noise,
    near_noise,
    noise_percent,
    written_left,
)
from signlin_ros.diagnosis.motion import Fitted
from signlin_ros.diagnosis.motion.score import Gain, elsewhere, gain, of_windows
from signlin_ros.effects import find_effect
from signlin_ros.errors import SignlinError
from signlin_ros.fitting.prepare import reversed_signal

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Judgement:
    """What follows from an agreement: the `verdict`, and every number that it rests on.

    ``final``: the model to stand for; ``steps``: from the base model to it, one effect after the other.
    """

    case: Case
    agreed: Agreed
    criteria: Criteria
    final: Fitted
    steps: tuple[Fitted, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The effects that the model lacks."""
        return self.final.effects

    @cached_property
    def reversed(self) -> str:
        """The signal with whose sign reversed the model as given follows much better, if there is one."""
        return reversed_signal(self.agreed.motion.problem, self.agreed.base.fit)

    @cached_property
    def far(self) -> dict[str, float]:
        """Base parameters that end far from nominal, and by how many tolerances."""
        return self.final.far(self.criteria)

    @cached_property
    def same_at_nominal(self) -> bool:
        """Whether the proposal is confirmed with the parameters that are far held at nominal too: beside what the base
        model leaves with these held, and beside what it leaves at its best.
        """
        free = self.agreed.motion
        try:
            held = free.holding(self.far)
            found = held.fitted(self.names)
        except SignlinError:
            return False
        return not held.refused(held.base, found) and not free.refused(self.agreed.base, found)

    @cached_property
    def percent(self) -> float | None:
        """Force that is left, in per cent of the effort."""
        return self.agreed.percent(self.final)

    @cached_property
    def noise_percent(self) -> float:
        """What the sensors' noise leaves of a force, in per cent of the effort."""
        return np.inf if self.agreed.force is None else noise_percent(self.agreed.force)

    @property
    def sees(self) -> bool:
        """Whether the force witness can tell what is in the force that is left."""
        return self.agreed.witnesses.sees(self.final)

    @cached_property
    def structure(self) -> tuple[bool, float]:
        """Whether a flexible curve takes a visible part away from the force that is left, and what it would leave."""
        force = self.agreed.force
        if force is None or self.percent is None:
            return False, np.inf
        r, search = force.search.r, force.search
        if acting(force, self.final) == set(force.effects):
            return force.structure, force.flexible
        if not self.names:
            return structured(r, search.base, search.base)
        left, unseen = (s.missing(self.final.model) for s in (r.known, r.unseen))
        return structured(r, Fit((("final", ()),), np.zeros(0), left, lambda: unseen), search.base)

    @cached_property
    def changing(self) -> str:
        """Which force changes slowly along the records, if that is most of what is left; empty if none does."""
        force = self.agreed.force
        if force is None or self.percent is None or self.final.white:
            return ""
        fit = force.search.models.get(acting(force, self.final))
        r = force.search.r
        return changing(r, fit.unseen if fit else r.unseen.missing(self.final.model))

    @cached_property
    def worse(self) -> str:
        """The channel whose printed error rises from the base model to the proposal beyond its standard error, or the
        missing force, if one does.
        """
        motion, base = self.agreed.motion, self.agreed.base
        if self.final is base:
            return ""
        pairs = zip(motion.problem.channels, base.unseen_squares.T, self.final.unseen_squares.T, strict=True)
        rows = [*pairs, ("the missing force", self.left(base), self.left(self.final))]
        return next((n for n, a, b in rows if a is not None and b is not None and self._rises(a, b)), "")

    def _rises(self, before: Array, after: Array) -> bool:
        """Tell whether mean squares (blocks,) rise so that it shows, and beyond their standard error."""
        rise = after - before
        error = float(np.nanstd(rise) / np.sqrt(max(int(np.count_nonzero(np.isfinite(rise))), 1)))
        shows = np.nanmean(after) > (1.0 + self.criteria.alike) ** 2 * np.nanmean(before)
        return bool(shows and np.nanmean(rise) > self.criteria.worse * error)

    @cached_property
    def beside_given(self) -> Gain:
        """What the proposal explains of unseen data beyond the model as given."""
        return gain(self.agreed.motion.given.unseen_squares, self.final.unseen_squares, self.agreed.motion.unseen.noise)

    @cached_property
    def no_better(self) -> bool:
        """Whether unseen data do not surely show the proposal to be better than the model as given, as its row shows,
        in force or in motion: what is gained beside a base that was refitted, and does not carry over, is nothing
        gained.
        """
        motion, force, least = self.agreed.motion, self.agreed.force, self.criteria.least
        if self.beside_given.certainty > least:
            return False
        given, final = motion.given, self.final
        if force is None or not (comparable(force, given) and comparable(force, final)):
            return True
        return mean_certainty(written_left(force, given), written_left(force, final)) <= least

    @property
    def remembers(self) -> tuple[str, ...]:
        """The effects of the proposal that have a state of their own."""
        return tuple(n for n in self.names if find_effect(n, "effects").states)

    @cached_property
    def lost(self) -> list[str]:
        """The channels that the model follows neither where it was fitted nor on unseen data."""
        motion, final = self.agreed.motion, self.final
        sides = ((motion.problem, final.known_squares), (motion.unseen, final.unseen_squares))
        known, unseen = (unfollowed(of_windows(p, squares, p.noise)) for p, squares in sides)
        return [name for name in known if name in unseen]

    @cached_property
    def elsewhere(self) -> bool:
        """Whether the model follows unseen data far worse than those that it was fitted to."""
        motion, final = self.agreed.motion, self.final
        here, there = motion.problem.noise, motion.unseen.noise
        return elsewhere(final.known_squares, final.unseen_squares, here, there, self.criteria.near)

    @cached_property
    def unexplained(self) -> str:
        """Why the records are not explained; empty if they are."""
        if self.reversed:
            return "reversed"
        if self.agreed.conflict:
            return "conflict"
        if not self.names and self.lost:
            return "lost"
        if self.names and self.worse:
            return "worse"
        if self.names and self.no_better:
            return "given"
        if self.remembers and seldom(self.case.model, (*self.case.known, *self.case.unseen)):
            return "once"
        if self.names and self.far and not self.same_at_nominal:
            return "far"
        if self.sees:
            large = not self.names and (self.percent or 0.0) > 100.0 * self.criteria.large
            near = near_noise(self.final, self.criteria)
            if large and self.elsewhere:
                return "elsewhere"
            noise = self.final.clean or (near and self.final.white)
            more = (self.little or near or self.changing) and not self.final.white
            return "structure" if ((large or self.structure[0]) and not noise) or more else ""
        noise = leaves_noise(self.final, self.criteria)
        near = near_any_noise(self.agreed.motion, self.final, self.criteria)
        if self.names and not near and (noise or self.percent is None):
            return "elsewhere" if self.elsewhere else "structure" if self.little_motion else ""
        return "" if noise or self.within_noise else "structure"

    @property
    def within_noise(self) -> bool:
        """Whether all that is shown is within the sensors' noise: the force, and the motion over the horizon. What is
        slower than that, as what noise in the input makes, is in neither. Effects that leave structure all the same
        imitate another.
        """
        if self.names:
            return False
        return self.percent is not None and self.percent <= self.noise_percent and near_noise(self.final, self.criteria)

    @property
    def little(self) -> bool:
        """Whether a proposal leaves the larger part of the force that is missing."""
        force, before, after = self.agreed.force, self.left(self.agreed.base), self.left(self.final)
        if not self.names or force is None or before is None or after is None:
            return False
        return leaves_much(force, before, after, self.criteria)

    @property
    def little_motion(self) -> bool:
        """Whether a proposal leaves the larger part of what the motion lacks, of unseen data or of those that it was
        fitted to.
        """
        motion, base = self.agreed.motion, self.agreed.base
        known = gain(base.known_squares, self.final.known_squares, motion.problem.noise)
        return min(motion.gain(base, self.final).share, known.share) < 1.0 - self.criteria.part

    @property
    def verdict(self) -> str:
        """One of adequate, missing and unexplained."""
        if self.unexplained:
            return "unexplained"
        return "missing" if self.names else "adequate"

    @property
    def horizon(self) -> float:
        """Seconds over which the motion is predicted."""
        motion = self.agreed.motion
        return float(max(motion.problem.base.update_period, 2 * motion.problem.scale.step))

    def without(self, effect: str) -> Fitted:
        """Return the best fit without one effect of the proposal: what removing it costs."""
        return _part(self.agreed, [n for n in self.names if n != effect])

    def left(self, f: Fitted) -> Array | None:
        """Return the mean squared force (blocks,) that a model leaves of unseen data."""
        return self.agreed.left(f)


def judge(case: Case, agreed: Agreed, criteria: Criteria) -> Judgement:
    """Return what follows from an agreement."""
    final, motion = agreed.final, agreed.motion
    steps = [agreed.base]
    for k in range(1, len(final.effects)):
        part = _part(agreed, final.effects[:k])
        if part.effects and not motion.gain(steps[-1], part).worsens(criteria.worse, criteria.alike):
            steps.append(part)
    if final.effects:
        steps.append(final)
    return Judgement(case, agreed, criteria, final, tuple(steps))


def _part(agreed: Agreed, names: Sequence[str]) -> Fitted:
    """Return the best fit of some of the effects that are stood for; the base where it diverges without the others."""
    try:
        return agreed.motion.fitted(names, agreed.final.model) if names else agreed.base
    except SignlinError:
        return agreed.base


__all__ = ["Judgement", "judge"]
