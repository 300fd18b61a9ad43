"""What a search found, and whether what a model leaves is more than noise."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.dependence import dependence, strongest
from signlin_ros.diagnosis.disturbance import Disturbance, disturbance
from signlin_ros.diagnosis.fit import Filter, Fit, evaluated, fit, follow_records
from signlin_ros.diagnosis.judge import Residue, any_structure, residues, whiteness
from signlin_ros.diagnosis.problem import TIMES, Gains, Problem, as_uncertain_throughout, driven_by_changes
from signlin_ros.diagnosis.rank import Ranked
from signlin_ros.diagnosis.signs import reversed_signal
from signlin_ros.diagnosis.varying import Varying, varying
from signlin_ros.noise import fourth_difference_share

Array = NDArray[np.float64]

ROUNDED = 0.6
"""A residual smaller than this share of the step in which a channel is shown is its rounding."""
DRAWS, MORE, SENSITIVE = 4, 32, 0.1
"""Draws of uncertain parameters where motion may be chaotic, and where only they may be to blame; and the share of what
is left that they must make."""
MATTERS = 0.05
"""Share of the noise, in squares, that what is left must make in a channel for that."""
AWAKE = 1.35
"""What an observer may leave, in multiples of the noise, where it follows a state that is moved at random: the noise,
by how much its gain follows that, and steps of an encoder."""
DEPENDENT = 0.02
"""Share of the squared residual that must follow from the motion of a model to be structure. What models that are right
leave reached 0.007 in 70 records, mostly below 0."""
AT_RANDOM = 0.2
"""Largest such share of what noise in the input leaves."""
WORSE = 5.0
"""Times what a model leaves where it was fitted, in multiples of the noise, that noise in the input may leave on other
data. A right model whose parameters are known less well than a fine encoder shows left 3.2 times as much."""
FOLLOWS = 4.0
"""Standard errors by which what noise in the input leaves may go with one of three dozen functions of the motion. With
such noise alone it was 2.9 at most in 36 records."""
LIKE = (0.25, 2.5)
"""Multiples of the noise which a record of the input shows that noise in it may seem to have (0.5 to 1.6 in a dozen
right models)."""
UNSEEN = 0.3
"""Noise of which no record shows anything, as a share of the root mean square of the input."""
WHITE = ((2.0, 4.0), (0.3, 11.0))
"""Sizes of noise in the force, as shares of what drives, and by how much a force that lasts may be more likely then in
-2 log likelihood (chances of 0.05 and 0.001): the larger it is, the less may contradict that it is white."""
ALONG, COUNTS = 6.0, (0.002, 0.02)
"""Standard errors that a wave of friction or inertia along the way must have, and its least size, as a share of the
driving force, to be told and to count as missing: the most certain of all that are tried had 4.5 in 57 right models,
and 7 to 23 where there was one."""
NEEDED = 30.0
"""A model is imperfect if a higher gain is more likely than the lowest one by this in -2 log likelihood."""


@dataclass(frozen=True)
class Step:
    """A model on the way from the base to the proposal: what it is, and its innovations on unseen data.

    ``unseen``: at the gain of its fit. ``gain``: fall of -2 log likelihood against the step
    before (singles: the base), ``certainty`` in standard errors, ``share``: of the squared innovations.
    """

    ranked: Ranked
    unseen: tuple[Array, ...]
    gain: float = 0.0
    certainty: float = 0.0
    share: float = 0.0


@dataclass(frozen=True)
class Beside:
    """What an effect takes away beside others, as a share of the squared errors that these leave (their geometric mean
    over channels).
    """

    others: tuple[str, ...]
    share: float


@dataclass(frozen=True)
class Findings:
    """Everything that a search found.

    ``steps``: base, then one more effect each. ``singles``: every effect alone, best first, with its innovations on
    unseen data. ``pairs``: what was tried on top of each single. ``left``: the residual of the proposal;
    ``held_out``: innovations of the base and of the proposal on unseen data, at the gain where this is judged;
    ``followed``: the same at the middle gain. ``beside``: what effects promised beside others, on the data that was
    fitted to. ``declined``: why effects that lower the error were refused. ``beyond_doubt``: whether the last step
    lowers the error on unseen data so; one that was asked for may not. ``floor``: the `noise` and
    `unseen_noise` of a longer proposal, where there is one.
    """

    problem: Problem
    unseen: Problem
    filter: Filter
    steps: tuple[Step, ...]
    singles: tuple[Step, ...]
    pairs: tuple[Ranked, ...]
    outside: tuple[str, ...]
    left: tuple[Residue, ...]
    held_out: tuple[tuple[Array, ...], tuple[Array, ...]]
    followed: tuple[tuple[Array, ...], tuple[Array, ...]]
    beside: Mapping[str, Sequence[Beside]]
    declined: Mapping[str, str]
    beyond_doubt: bool = True
    floor: tuple[Array, Array] | None = None

    @property
    def final(self) -> Step:
        """The proposed model."""
        return self.steps[-1]

    def first(self, count: int) -> Findings:
        """Return the same with so many steps, the base among them."""
        base, last = self.steps[0].ranked, self.steps[count - 1].ranked
        at, middle = judged(self.problem, last), self.problem.levels[1]
        return replace(
            self,
            steps=self.steps[:count],
            left=left_by(self.problem, at),
            held_out=(on_unseen(self.unseen, base, at.gains), on_unseen(self.unseen, last, at.gains)),
            followed=(self.followed[0], on_unseen(self.unseen, last, middle)),
            floor=(self.noise, self.unseen_noise),
        )

    @functools.cached_property
    def structured(self) -> bool:
        """Whether the residual of the proposed model shows structure that is no noise."""
        return structured(self.problem, self.final.ranked, self.filter)

    @functools.cached_property
    def driven_by_noise(self) -> bool:
        """Whether that structure is what noise in the input, or in the force, leaves."""
        found = self.at_random
        return found is not None and mere_noise(self.problem, found) and not self._worse_on_unseen

    @property
    def in_input(self) -> bool:
        """Whether that can be noise in the input."""
        return self.at_random is not None and in_input(self.problem, self.at_random)

    @property
    def noise_is_shown(self) -> bool:
        """Whether what moves the proposed model at random is as large as the noise that the input's record shows."""
        return self.at_random is not None and as_shown(self.problem, self.at_random)

    @functools.cached_property
    def at_random(self) -> Disturbance | None:
        """What moves the proposed model, if that goes with nothing that is known of the motion."""
        return moved_at_random(self.problem, self.final.ranked) if self.structured else None

    @functools.cached_property
    def varying(self) -> Varying | None:
        """What certainly varies with the position, in what the proposed model leaves."""
        found = varying(self.problem, self.final.ranked.fit)
        if found is None or found.certainty < ALONG or found.force < COUNTS[0] * self.problem.scale.force:
            return None
        return found

    @property
    def along(self) -> Varying | None:
        """That, if it is so large that it counts as missing."""
        large = self.varying is not None and self.varying.force > COUNTS[1] * self.problem.scale.force
        return self.varying if large else None

    @functools.cached_property
    def _worse_on_unseen(self) -> bool:
        """Whether more is left on unseen data than noise in the input would: that leaves much the same there."""
        seen, unseen = (np.concatenate(e) for e in (self.final.ranked.fit.innovations, self.final.unseen))
        before, after = (np.sqrt(np.nanmean(e**2, axis=0)) for e in (seen, unseen))
        return bool((after / self.unseen.noise > WORSE * before / self.problem.noise).any())

    @property
    def noise(self) -> Array:
        """Standard deviation (ny) of the noise on the data that was fitted to."""
        found = np.array([r.noise for r in self.left])
        return found if self.floor is None else np.minimum(found, self.floor[0])

    @functools.cached_property
    def unseen_noise(self) -> Array:
        """Standard deviation (ny) of the noise on unseen data: what the proposal leaves there but structure; where it
        leaves some, no more than the sensors' can be.
        """
        left = residues(self.held_out[1], self.unseen.white(self._judged.gains))
        left = [r.depending(s.dependent) for r, s in zip(left, self.left, strict=True)]
        found = np.array([r.noise if r.structure < 0.5 else n for r, n in zip(left, self.noise, strict=True)])
        found = found if self.floor is None else np.minimum(found, self.floor[1])
        if not self.unaccounted or not self.filter.rho.any():
            return found
        most, rho = _as_coloured(self.problem, self.filter, self._judged)
        return np.where(rho > 0.0, np.minimum(found, AWAKE * most), found)

    @functools.cached_property
    def uncertain(self) -> bool:
        """Whether the error on unseen data is what noise and the uncertainty of the parameters make there."""
        at = self._judged
        return _by_chance(self.unseen, at, at.gains, self.held_out[1], self.unseen_noise**2, MORE)

    @functools.cached_property
    def reversed(self) -> str:
        """The input or channel whose sign the model as given puts in doubt; empty if there is none."""
        return reversed_signal(self.problem, self.steps[0].ranked.fit)

    @functools.cached_property
    def _judged(self) -> Fit:
        return judged(self.problem, self.final.ranked)

    @property
    def unaccounted(self) -> bool:
        """Whether structure is left that is not what noise in the input leaves."""
        return self.structured and not self.driven_by_noise


def on_unseen(unseen: Problem, r: Ranked, gains: Gains) -> tuple[Array, ...]:
    """Return the innovations (T, ny) of a fitted model on the records of a problem at a gain; large if it diverges."""
    f = r.low if gains is r.low.gains else r.fit
    found = follow_records(unseen, f.candidate, f.theta, gains, False)
    if found is None:
        return tuple(np.full(s.y.shape, 1e3) * unseen.noise for s in unseen.segments)
    return tuple(found[0])


def at_stake(unseen: Problem, f: Fit) -> float:
    """Return by how much the uncertainty of fitted parameters is expected to raise -2 log likelihood on the records of
    a problem: the trace of the information there times the covariance from where they were fitted; 0 if it diverges.
    """
    there = evaluated(unseen, f.candidate, f.theta, f.gains, f.filter)
    if there is None:
        return 0.0
    prior = np.diag([1.0 / k.spread**2 for k in f.candidate.coordinates])
    return float(np.trace((there.hessian - prior) @ np.linalg.pinv(f.hessian, hermitian=True)))


def judged(problem: Problem, r: Ranked) -> Fit:
    """Return the fit by whose residual a model is judged: that at the lowest gain, where most shows of what is missing.

    Where the motion is so sensitive there that noise and the uncertainty of the parameters alone make what is left
    (chaos under cogging, contacts), it is the one of highest likelihood; and where gains are those of noise in the
    inputs, of which one fits it best.
    """
    low, c = r.low, r.fit.candidate
    if problem.driven:
        return r.fit
    if low is r.fit or low.cost - r.fit.cost <= NEEDED:
        return low
    reference = follow_records(problem, c, r.fit.theta, low.gains, False)
    if reference is None:
        return low
    floor = np.nanmean(np.concatenate(r.fit.innovations) ** 2, axis=0)
    return r.fit if _by_chance(problem, r.fit, low.gains, reference[0], floor, DRAWS) else low


def _by_chance(problem: Problem, f: Fit, gains: Gains, left: Sequence[Array], floor: Array, draws: int) -> bool:
    """Tell whether noise, of variance ``floor`` (ny), and the uncertainty of the parameters make what a model leaves
    beyond it at a gain, ``left`` (T, ny): some ``draws`` of both change that as much.
    """
    excess = np.nanmean(np.concatenate(left) ** 2, axis=0) - floor
    w, V = np.linalg.eigh(np.linalg.pinv(f.hessian, hermitian=True))
    root = V * np.sqrt(np.maximum(w, 0.0))
    spread = np.zeros_like(excess)
    draw = np.random.default_rng(0).standard_normal
    for _ in range(draws):
        theta = np.clip(f.theta + root @ draw(w.size), *f.candidate.bounds)
        noise = [draw(s.y.shape) * np.sqrt(floor) for s in problem.segments]
        noisy = tuple(replace(s, y=s.y + n) for s, n in zip(problem.segments, noise, strict=True))
        moved = follow_records(problem, f.candidate, theta, gains, False, noisy)
        if moved is None:
            return True
        change = [a - b - n for a, b, n in zip(moved[0], left, noise, strict=True)]
        spread += np.nanmean(np.concatenate(change) ** 2, axis=0) / draws
    matters = excess > MATTERS * floor
    return bool(matters.any() and (spread > SENSITIVE * excess)[matters].all())


def structured(problem: Problem, r: Ranked, filter: Filter) -> bool:
    """Tell whether the residual of a fitted model shows structure that is no noise of the filter's colour."""
    at = judged(problem, r)
    if at.cost - r.fit.cost > NEEDED or any_structure(at.innovations, problem.white(at.gains)):
        return True
    whitened = [filter.apply(e) for e in at.innovations]
    rounding = np.nanstd(np.concatenate(at.innovations), axis=0) < ROUNDED * problem.quanta
    white = [whiteness([e[:, c] for e in whitened], steps=bool(rounding[c])).white for c in range(rounding.size)]
    return not all(white) or bool((dependence(problem, at) > DEPENDENT).any())


def left_by(problem: Problem, f: Fit) -> tuple[Residue, ...]:
    """Return what a fit leaves in every channel, taken apart; what follows from its motion is structure."""
    shares = dependence(problem, f)
    found = residues(f.innovations, problem.white(f.gains))
    return tuple(r.depending(s if s > DEPENDENT else 0.0) for r, s in zip(found, shares.tolist(), strict=True))


def driven_by_noise(problem: Problem, r: Ranked) -> bool:
    """Tell whether what a model leaves is what noise in the input, or in the force, leaves."""
    found = moved_at_random(problem, r)
    return found is not None and mere_noise(problem, found)


def moved_at_random(problem: Problem, r: Ranked) -> Disturbance | None:
    """Return what moves a model at random, if that is what it leaves; where a force is missing, some function of the
    motion predicts at least a part of it.
    """
    c = r.fit.candidate
    if problem.scale.imposed or problem.driven or c.filtered:
        return None
    at = judged(problem, r)
    if bool((dependence(problem, at, of_input=False) > AT_RANDOM).any()):
        return None
    noise, rho = _as_coloured(problem, r.low.filter, at)
    found = fit(problem, c, _awake(problem, noise, rho), r.fit.theta, 10)
    if found is None or strongest(problem, found) > FOLLOWS:
        return None
    left = np.sqrt(np.nanmean(np.concatenate(found.innovations) ** 2, axis=0))
    gone = not any_structure(found.innovations, problem.noise) and bool((left < AWAKE * noise).all())
    return replace(disturbance(problem, found, noise, rho), gone=gone)


def in_input(problem: Problem, found: Disturbance) -> bool:
    """Tell whether what moves a model at random can be noise in the input: it is as large as the record of that shows,
    or no larger than that leaves room for, and not less likely than a force.
    """
    usual = float(np.sqrt(np.mean(np.concatenate([s.u[:, 0] for s in problem.segments]) ** 2)))
    most = max(TIMES[0] * float(problem.input_noise[0]), UNSEEN * usual)
    possible = found.input <= most and found.doubt <= NEEDED
    return as_shown(problem, found) or possible


def mere_noise(problem: Problem, found: Disturbance) -> bool:
    """Tell whether what moves a model at random is but noise, of the input or of a force that is another one at every
    sample. It is gone at the highest gain: an observer that is wide awake follows it, and only the noise of the sensors
    is left.
    """
    white = any(found.white <= share * problem.scale.force and found.lasting <= most for share, most in WHITE)
    return found.gone and (white or in_input(problem, found))


def as_shown(problem: Problem, found: Disturbance) -> bool:
    """Tell whether what moves a model at random is as large as the noise that the record of the input shows."""
    shown = float(problem.input_noise[0])
    return LIKE[0] * shown < found.input < LIKE[1] * shown


def sooner_or_later(problem: Problem, f: Fit) -> bool:
    """Tell whether what a model leaves is there where the inputs change, and not elsewhere: they act sooner or later
    than the record tells. A force that the model lacks lasts, and is better explained by as much noise throughout.
    """
    other = driven_by_changes(problem)
    if other is None or f.candidate.floating:
        return False

    def least(levels: Sequence[Gains]) -> float:
        found = (fit(problem, f.candidate, g, f.theta, 5) for g in levels)
        return min((one.cost for one in found if one), default=np.inf)

    return least(other.levels) < least(as_uncertain_throughout(problem)) - NEEDED


def _as_coloured(problem: Problem, filter: Filter, f: Fit) -> tuple[Array, Array]:
    """Return the standard deviation (ny) of the noise, of which fourth differences show a share where it has the colour
    of a filter, and its correlation (ny) from sample to sample.
    """
    rho = np.array([one.rho for one in residues(f.innovations, problem.noise)])
    rho = np.where(filter.rho > 0.0, rho, 0.0)
    return problem.noise / np.sqrt(fourth_difference_share(rho)), rho


def _awake(problem: Problem, noise: Array, rho: Array) -> Gains:
    """Return the highest gain in a noise (ny) of some colour: an observer must not take what lasts of it for motion."""
    high = problem.levels[0]
    if not rho.any():
        return high
    lasting = noise * np.sqrt((1.0 + rho) / (1.0 - rho))
    return problem.observer(high.tau, lasting)


__all__ = [
    "NEEDED",
    "Beside",
    "Findings",
    "Step",
    "at_stake",
    "driven_by_noise",
    "judged",
    "left_by",
    "on_unseen",
    "sooner_or_later",
    "structured",
]
