"""Two witnesses, one rule of agreement: which effects both of them can stand for.

Every model that either of them proposes is measured in the same two ways on unseen data: the force that it leaves, in
per cent of the effort, and the motion over the horizon. The force witness goes first where forces are seen; the motion
witness confirms by simulation, tells richer laws of a family from simpler ones, and adds what no force shows.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.family import Choice
from signlin_ros.diagnosis.fewest import alone, as_good_as
from signlin_ros.diagnosis.force.witness import Testimony
from signlin_ros.diagnosis.measures import (
    HALF,
    comparable,
    heard,
    is_shown_to_leave_noise,
    of_effort,
    percent,
    written_left,
)
from signlin_ros.diagnosis.motion import Fitted, Motion
from signlin_ros.diagnosis.motion.trials import tryable
from signlin_ros.diagnosis.witnesses import Witnesses
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import joined

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Agreed:
    """What both ``witnesses`` can stand for, ``final``, and why they differ, if they do.

    ``conflict``: in words, empty where they agree.
    """

    witnesses: Witnesses
    final: Fitted
    conflict: str = ""

    @property
    def motion(self) -> Motion:
        """The motion witness."""
        return self.witnesses.motion

    @property
    def force(self) -> Testimony | None:
        """The force witness; None where forces do not tell."""
        return self.witnesses.force

    @property
    def base(self) -> Fitted:
        """The best fit of the model as given."""
        return self.witnesses.base

    @property
    def tried(self) -> Sequence[Fitted]:
        """All models that were fitted out."""
        return self.witnesses.tried

    def left(self, f: Fitted) -> Array | None:
        """Return the mean squared force (blocks,) that a model leaves of unseen data; None where forces do not tell: of
        the effects that are stood for as they are written, of others at their best.
        """
        if f is self.final and f.effects and self.force is not None and comparable(self.force, f):
            return self._written
        return self.witnesses.left(f)

    @cached_property
    def _written(self) -> Array:
        assert self.force is not None  # noqa: S101  asked before
        return written_left(self.force, self.final)

    def percent(self, f: Fitted) -> float | None:
        """Return the force left of unseen data in per cent of the effort (RMS), None where forces do not tell."""
        left = self.left(f)
        return None if left is None or self.force is None else percent(self.force, left)


def agree(w: Witnesses, depth: int) -> Agreed:
    """Return what both witnesses can stand for.

    What the force witness proposes is fitted by simulation. Where that leaves noise, both agree. Else the motion
    witness looks for what no force shows, beside it and instead of it; what it adds must not leave more force. If
    the force witness proposes nothing, or nothing that the motion confirms, the motion witness searches by itself; if
    little force is left, and seen, and none of its laws is in it, among what no force shows. Of what is as good, the
    fewest effects are stood for; and before more than noise is left, the one that leaves but noise by itself.
    """
    w.motion.heard = heard(w.force)
    final, conflict = _stood_for(w, depth)
    final = as_good_as(w, final)
    whole = alone(w, final)
    final, conflict = (w.written(whole), "") if whole else (w.written(final), conflict)
    return Agreed(w, w.base if final.effects and final.unreal else final, conflict)


def _stood_for(w: Witnesses, depth: int) -> tuple[Fitted, str]:
    """Return the model to stand for, and why the witnesses differ."""
    base, force = w.base, w.force
    first = _confirmed(w, force) if force and force.effects else None
    if first is not None and first.white:
        return first, ""
    if first is None and w.tried:
        together = _together(w, w.tried[0], depth)
        if together is not None:
            return _chosen(w, [together], base)
    if first is None or not w.explains(first):
        path = w.motion.search(depth, _searched(w))
        w.keep(*(f for step in path for f in step))
        return _chosen(w, [first] if first else [], path[-1][0])
    found = _best_of(w, base, w.hidden, rival=first) or base
    beside = _best_of(w, first, w.hidden, depth)
    return _chosen(w, [f for f in (first, beside) if f], found)


def _searched(w: Witnesses) -> list[str] | None:
    """Return the effects among which the motion witness searches, None for all of them.

    Where the force witness sees what the model leaves: those that it cannot see, waves, of which its band holds but
    the slower ones, and the laws that take away a visible part of it; none of these if it finds no law in a force that
    is as little as any real machine lacks.
    """
    force, share = w.force, w.percent(w.base)
    if force is None or not w.sees(w.base):
        return None
    small = share is not None and share < 100.0 * w.criteria.large
    waves = {n for n, effect in EFFECTS.items() if effect.periodic}  # what passes its band is not all that there are
    names = w.hidden | (set() if small and not force.effects else force.search.helpful | waves)
    return [n for n in sorted(names) if tryable(w.motion.problem, n)]


def _together(w: Witnesses, refused: Fitted, depth: int) -> Fitted | None:
    """Return what the force shows, which the motion refuses by itself, with an effect beside it that no force shows,
    where both are needed: what the input lacks spoils the motion, not the force.
    """
    motion, both = w.motion, _best_of(w, refused, w.hidden, depth)
    if both is None or motion.refused(w.base, both):
        return None
    alone = motion.fitted([n for n in both.effects if n not in refused.effects], both.model)
    w.keep(alone)
    return None if motion.refused(alone, both) else both


def _best_of(
    w: Witnesses, of: Fitted, names: Iterable[str], depth: int | None = None, rival: Fitted | None = None
) -> Fitted | None:
    """Return the simplest of the best steps beyond a model with one more of some effects; None where there is none.

    ``rival``: a model that it would have to hold its own against.
    """
    if depth is not None and len(of.effects) >= depth:
        return None
    options = w.motion.extensions(of, [n for n in sorted(names) if tryable(w.motion.problem, n)], rival)
    w.keep(*options)
    return next(iter(w.motion.alike(of, options)), None)


def _chosen(w: Witnesses, first: Sequence[Fitted], second: Fitted) -> tuple[Fitted, str]:
    """Return the model to stand for, of what force (``first``) and motion (``second``) arrived at, and why not both."""
    base, force = w.base, w.force
    if not first:
        if force is not None and force.effects and _overruled(w, force, second):
            return base, _both(w, force, second)
        if second.effects and w.raises(base, second):
            return base, f"{_words(second)} would follow the motion, but leaves more force than the model as it is"
        return second, ""
    now = first[0]
    for other in (*first[1:], second):
        if set(other.effects) != set(now.effects) and _beyond(w, now, other):
            now = other
    g = w.motion.gain(now, second)
    if now is not second and g.certainty >= w.criteria.certainty and g.share >= HALF and second.effects:
        return now, f"{_words(second)} would follow the motion better than {_words(now)}, but leaves more force"
    return now, ""


def _overruled(w: Witnesses, force: Testimony, second: Fitted) -> bool:
    """Tell whether a model that leaves more than noise would stand in the place of laws that take away most of the
    missing force, and does not take that away itself.
    """
    before, own = force.search.base.error, w.left(second)
    explains = own is not None and float(np.mean(own)) < HALF * before
    return not second.white and force.fit.error < HALF * before and not explains


def _both(w: Witnesses, force: Testimony, second: Fitted) -> str:
    """Return what both witnesses say where the motion refuses what the force shows, beside the row of the base."""
    after, shown = percent(force, np.array([force.fit.error])), w.percent(w.base)
    before = "" if shown is None else f" in place of {shown:.3g} %"
    told = f"by the force {_listed(force.effects)} would leave {after:.3g} % {of_effort(force)}{before}, but the motion"
    other = f"; {_words(second)} would follow it better" if second.effects else ""
    return f"{told} that they make is not the one that was measured{other}"


def _beyond(w: Witnesses, now: Fitted, other: Fitted) -> bool:
    """Tell whether another model is to be stood for instead: it leaves noise where this one does not, and no more of
    unseen data, or surely less of the motion, and not more of the force; what the force witness can see, it must see.
    """
    if is_shown_to_leave_noise(other, w.criteria) and not now.white and other.level <= now.level:
        return not w.raises(now, other)
    c, g = w.criteria, w.motion.gain(now, other)
    if g.worsens(c.worse, c.alike) or w.raises(now, other):
        return False
    if g.certainty < c.certainty or not w.sees(now):
        return g.certainty >= c.certainty
    return set(other.effects) - set(now.effects) <= w.hidden or w.falls(now, other)


def _confirmed(w: Witnesses, force: Testimony) -> Fitted | None:
    """Return the model that the force witness proposes, fitted by simulation, or with the values of the force, where
    it alone knows them and the motion is surely better for it; None where the motion refuses it.
    """
    c, motion, choice = w.criteria, w.motion, Choice(w, force)
    found = choice.simulated(force.fit)
    if found is None:
        return None
    stated = w.written(found) if found.vague(c) else found
    known = stated is not found and motion.gain(w.base, stated).certainty >= c.certainty
    found = stated if known else found
    g = motion.gain(w.base, found)
    if g.certainty < (0.0 if w.explains(found) else c.least) or g.worsens(c.worse, c.alike):
        return None
    if not known and found.vague(c):
        plain = motion.plainer(found)
        w.keep(*plain)
        sound = motion.alike(w.base, plain)
        if not sound:
            return None
        found = sound[0]
    return choice.among(found)


def _words(f: Fitted) -> str:
    return _listed(f.effects)


def _listed(names: Sequence[str]) -> str:
    return joined([n.replace("_", " ") for n in names])


__all__ = ["Agreed", "agree"]
