"""Two witnesses, one rule of agreement: which effects both of them can stand for.

Every model that either of them proposes is measured in the same two ways on unseen data: the force that it leaves, in
per cent of the effort, and the motion over the horizon. The force witness goes first where forces are seen; the motion
witness confirms by simulation, tells richer laws of a family from simpler ones, and adds what no force shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.family import Choice
from signlin_ros.diagnosis.fewest import Fewest
from signlin_ros.diagnosis.force.witness import Testimony
from signlin_ros.diagnosis.measures import (
    HALF,
    acting,
    comparable,
    force_falls,
    force_left,
    force_raises,
    heard,
    is_shown_to_leave_noise,
    leaves_much,
    not_seen,
    of_effort,
    percent,
    sees,
    written,
    written_left,
)
from signlin_ros.diagnosis.motion import Fitted, Motion
from signlin_ros.diagnosis.motion.search import search
from signlin_ros.diagnosis.motion.trials import tryable
from signlin_ros.effects import EFFECTS, find_effect
from signlin_ros.errors import joined

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Agreed:
    """What both witnesses can stand for: ``final`` beside ``base``, and why they differ, if they do.

    ``tried``: all models that were fitted out. ``conflict``: in words, empty where they agree. ``proposed`` (force) and
    ``found`` (motion): what each says by itself.
    """

    motion: Motion
    force: Testimony | None
    base: Fitted
    final: Fitted
    conflict: str = ""
    tried: tuple[Fitted, ...] = ()
    proposed: tuple[str, ...] = ()
    found: tuple[str, ...] = ()
    _left: dict[int, Array] = field(default_factory=dict, repr=False)

    def left(self, f: Fitted) -> Array | None:
        """Return the mean squared force (blocks,) that a model leaves of unseen data; None where forces do not tell: of
        the effects that are stood for as they are written, of others at their best.
        """
        if f is self.final and f.effects and self.force is not None and comparable(self.force, f):
            return self._written
        return force_left(self.force, f, self._left)

    @cached_property
    def _written(self) -> Array:
        assert self.force is not None  # noqa: S101  asked before
        return written_left(self.force, self.final)

    def percent(self, f: Fitted) -> float | None:
        """Return the force left of unseen data in per cent of the effort (RMS), None where forces do not tell."""
        left = self.left(f)
        return None if left is None or self.force is None else percent(self.force, left)


def agree(motion: Motion, force: Testimony | None, criteria: Criteria, depth: int) -> Agreed:
    """Return what both witnesses can stand for.

    What the force witness proposes is fitted by simulation. Where that leaves noise, both agree. Else the motion
    witness looks for what no force shows, beside it and instead of it; what it adds must not leave more force. If
    the force witness proposes nothing, or nothing that the motion confirms, the motion witness searches by itself; if
    little force is left, and seen, and none of its laws is in it, among what no force shows. Of what is as good, the
    fewest effects are stood for; and before more than noise is left, the one that leaves but noise by itself.
    """
    left: dict[int, Array] = {}
    tried: list[Fitted] = []
    motion.heard = heard(force)
    final, conflict, found = _stood_for(motion, force, criteria, depth, tried, left)
    fewest = Fewest(motion, force, criteria, tried, left)
    final = fewest.as_good_as(final)
    whole = fewest.alone(final)
    final, conflict = (whole, "") if whole else (final, conflict)
    proposed, final = force.effects if force else (), written(motion, force, final, criteria)
    final = motion.base if final.effects and final.unreal else final
    return Agreed(motion, force, motion.base, final, conflict, tuple(tried), proposed, found, left)


def _stood_for(
    motion: Motion,
    force: Testimony | None,
    criteria: Criteria,
    depth: int,
    tried: list[Fitted],
    left: dict[int, Array],
) -> tuple[Fitted, str, tuple[str, ...]]:
    """Return the model to stand for, why the witnesses differ, and what the motion witness found by itself."""
    base, hidden = motion.base, sorted(not_seen(force))
    first = _confirmed(motion, force, criteria, tried, left) if force and force.effects else None
    if first is not None and first.white:
        return first, "", ()
    if first is None and tried:
        together = _together(motion, tried[0], hidden, tried, depth)
        if together is not None:
            return *_chosen(motion, force, [together], base, criteria, left), together.effects
    if first is None or not _explained(force, base, first, criteria, left):
        path = search(motion, depth, names=_searched(motion, force, criteria, left))
        tried += [f for step in path for f in step]
        found, options = path[-1][0], [first] if first else []
        return *_chosen(motion, force, options, found, criteria, left), found.effects
    found = _best_of(motion, base, hidden, tried, rival=first) or base
    beside = _best_of(motion, first, hidden, tried, depth)
    return *_chosen(motion, force, [f for f in (first, beside) if f], found, criteria, left), found.effects


def _searched(motion: Motion, force: Testimony | None, criteria: Criteria, left: dict[int, Array]) -> list[str] | None:
    """Return the effects among which the motion witness searches, None for all of them.

    Where the force witness sees what the model leaves: those that it cannot see, waves, of which its band holds but
    the slower ones, and the laws that take away a visible part of it; none of these if it finds no law in a force that
    is as little as any real machine lacks.
    """
    base = motion.base
    if force is None or not sees(force, base, criteria, left):
        return None
    share = force_left(force, base, left)
    small = share is not None and percent(force, share) < 100.0 * criteria.large
    waves = {n for n, effect in EFFECTS.items() if effect.periodic}  # what passes its band is not all that there are
    names = not_seen(force) | (set() if small and not force.effects else force.search.helpful | waves)
    return [n for n in sorted(names) if tryable(motion.problem, n)]


def _together(motion: Motion, refused: Fitted, hidden: Sequence[str], tried: list[Fitted], depth: int) -> Fitted | None:
    """Return what the force shows, which the motion refuses by itself, with an effect beside it that no force shows,
    where both are needed: what the input lacks spoils the motion, not the force.
    """
    both = _best_of(motion, refused, hidden, tried, depth)
    if both is None or motion.refused(motion.base, both):
        return None
    alone = motion.fitted([n for n in both.effects if n not in refused.effects], both.model)
    tried.append(alone)
    return None if motion.refused(alone, both) else both


def _explained(
    force: Testimony | None, base: Fitted, first: Fitted, criteria: Criteria, left: dict[int, Array]
) -> bool:
    """Tell whether a model takes away most of a missing force that is seen."""
    before, after = force_left(force, base, left), force_left(force, first, left)
    if before is None or after is None or force is None or not sees(force, first, criteria, left):
        return False
    return not leaves_much(force, before, after, criteria)


def _best_of(
    motion: Motion,
    of: Fitted,
    names: Sequence[str],
    tried: list[Fitted],
    depth: int | None = None,
    rival: Fitted | None = None,
) -> Fitted | None:
    """Return the simplest of the best steps beyond a model with one more of some effects; None where there is none.

    ``rival``: a model that it would have to hold its own against.
    """
    if depth is not None and len(of.effects) >= depth:
        return None
    options = motion.extensions(of, [n for n in names if tryable(motion.problem, n)], rival)
    tried += options
    return next(iter(motion.alike(of, options)), None)


def _chosen(
    motion: Motion,
    force: Testimony | None,
    first: Sequence[Fitted],
    second: Fitted,
    criteria: Criteria,
    left: dict[int, Array],
) -> tuple[Fitted, str]:
    """Return the model to stand for, of what force (``first``) and motion (``second``) arrived at, and why not both."""
    base = motion.base
    if not first:
        if force is not None and force.effects and _overruled(force, second, left):
            return base, _both(force, base, second, left)
        if second.effects and force_raises(force, base, second, criteria, left):
            return base, f"{_words(second)} would follow the motion, but leaves more force than the model as it is"
        if force is not None and _bent(force, second):
            return base, f"{_words(second)} would follow the motion, but by the force only with base parameters bent"
        return second, ""
    now = first[0]
    for other in (*first[1:], second):
        if set(other.effects) != set(now.effects) and _beyond(motion, force, now, other, criteria, left):
            now = other
    g = motion.gain(now, second)
    if now is not second and g.certainty >= criteria.certainty and g.share >= HALF and second.effects:
        return now, f"{_words(second)} would follow the motion better than {_words(now)}, but leaves more force"
    return now, ""


def _overruled(force: Testimony, second: Fitted, left: dict[int, Array]) -> bool:
    """Tell whether a model that leaves more than noise would stand in the place of laws that take away most of the
    missing force, and does not take that away itself.
    """
    before = force.search.base.error
    own = force_left(force, second, left)
    explains = own is not None and float(np.mean(own)) < HALF * before
    return not second.white and force.fit.error < HALF * before and not explains


def _bent(force: Testimony, second: Fitted) -> bool:
    """Tell whether what the motion found takes away force only with a base parameter moved beyond its tolerance."""
    fit = force.search.models.get(acting(force, second))
    return fit is not None and force.search.bends(fit)


def _both(force: Testimony, base: Fitted, second: Fitted, left: dict[int, Array]) -> str:
    """Return what both witnesses say where the motion refuses what the force shows, beside the row of the base."""
    after, shown, laws = (
        percent(force, np.array([force.fit.error])),
        force_left(force, base, left),
        _listed(force.effects),
    )
    before = "" if shown is None else f" in place of {percent(force, shown):.3g} %"
    told = f"by the force {laws} would leave {after:.3g} % {of_effort(force)}{before}, but the motion"
    other = f"; {_words(second)} would follow it better" if second.effects else ""
    return f"{told} that they make is not the one that was measured{other}"


def _beyond(
    motion: Motion, force: Testimony | None, now: Fitted, other: Fitted, criteria: Criteria, left: dict[int, Array]
) -> bool:
    """Tell whether another model is to be stood for instead: it leaves noise where this one does not, and no more of
    unseen data, or surely less of the motion, and not more of the force; what the force witness can see, it must see.
    """
    if is_shown_to_leave_noise(other, criteria) and not now.white and other.level <= now.level:
        return not force_raises(force, now, other, criteria, left)
    g = motion.gain(now, other)
    if g.worsens(criteria.worse, criteria.alike) or force_raises(force, now, other, criteria, left):
        return False
    surely = g.certainty >= criteria.certainty and g.share >= criteria.share
    if not surely or not sees(force, now, criteria, left):
        return surely
    added = set(other.effects) - set(now.effects)
    if any(find_effect(name, "effects").floating for name in added):
        return False  # a load that floats follows any motion; only what leaves noise is one
    return added <= not_seen(force) or force_falls(force, now, other, criteria, left)


def _confirmed(
    motion: Motion, force: Testimony, criteria: Criteria, tried: list[Fitted], left: dict[int, Array]
) -> Fitted | None:
    """Return the model that the force witness proposes, fitted by simulation; None where the motion refuses it."""
    choice = Choice(motion, force, criteria, tried, left)
    found = choice.simulated(force.fit)
    if found is None:
        return None
    stated = written(motion, force, found, criteria) if found.vague(criteria) else found
    known = stated is not found and motion.gain(motion.base, stated).certainty >= criteria.certainty
    found = stated if known else found  # the force knows these values
    g = motion.gain(motion.base, found)
    falls = 0.0 if _explained(force, motion.base, found, criteria, left) else criteria.least
    if g.certainty < falls or g.worsens(criteria.worse, criteria.alike):
        return None
    if not known and found.vague(criteria):
        plain = motion.plainer(found)
        tried += plain
        sound = motion.alike(motion.base, plain)
        if not sound:
            return None
        found = sound[0]
    return choice.among(found)


def _words(f: Fitted) -> str:
    return _listed(f.effects)


def _listed(names: Sequence[str]) -> str:
    return joined([n.replace("_", " ") for n in names])


__all__ = ["Agreed", "agree"]
