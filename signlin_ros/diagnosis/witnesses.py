"""Both witnesses of a record together: what they measure of a model on unseen data, and what was fitted so far."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.force.regression import TINY, mean_certainty, scaling
from signlin_ros.diagnosis.force.witness import Testimony
from signlin_ros.diagnosis.measures import (
    acting,
    comparable,
    leaves_much,
    near_noise,
    noise_percent,
    not_seen,
    percent,
    with_laws,
    written_left,
)
from signlin_ros.diagnosis.motion import Fitted, Motion

Array = NDArray[np.float64]


@dataclass(eq=False)
class Witnesses:
    """``force``: None where forces do not tell; ``tried``: all models that were fitted out."""

    motion: Motion
    force: Testimony | None
    criteria: Criteria
    tried: list[Fitted] = field(default_factory=list)
    _left: dict[int, Array] = field(default_factory=dict, repr=False)

    @property
    def base(self) -> Fitted:
        """The best fit of the model as given."""
        return self.motion.base

    @property
    def hidden(self) -> set[str]:
        """The effects that the force witness cannot see."""
        return not_seen(self.force)

    def keep(self, *found: Fitted) -> None:
        """Keep what was fitted out."""
        self.tried += [f for f in found if f not in self.tried]

    def left(self, f: Fitted) -> Array | None:
        """Return the mean squared force (blocks,) that a set of effects leaves of unseen data; None where forces do not
        tell: with the values that the motion gave or those that the force gave, whichever leave less. So that what is
        held against a set is the best of it.
        """
        force = self.force
        if force is None or not comparable(force, f):
            return None
        if id(f) not in self._left:
            left, own = written_left(force, f), force.search.models.get(acting(force, f))
            better = own is not None and own.error < float(np.mean(left))
            self._left[id(f)] = force.search.r.unseen.by_block(own.unseen) if own and better else left
        return self._left[id(f)]

    def percent(self, f: Fitted) -> float | None:
        """Return that force in per cent of the effort (RMS), None where forces do not tell."""
        left = self.left(f)
        return None if left is None or self.force is None else percent(self.force, left)

    def sees(self, f: Fitted) -> bool:
        """Tell whether the force witness can tell what is in the force that a model leaves."""
        left = self.percent(f)
        return left is not None and self.force is not None and left > self.criteria.sees * noise_percent(self.force)

    def explains(self, f: Fitted) -> bool:
        """Tell whether a model takes away most of a missing force that is seen."""
        before, after = self.left(self.base), self.left(f)
        if before is None or after is None or self.force is None or not self.sees(f):
            return False
        return not leaves_much(self.force, before, after, self.criteria)

    def falls(self, before: Fitted, after: Fitted) -> bool:
        """Tell whether a model leaves surely less force than another one, if forces tell."""
        a, b = self.left(before), self.left(after)
        return a is None or b is None or mean_certainty(a, b) >= self.criteria.certainty

    def raises(self, before: Fitted, after: Fitted) -> bool:
        """Tell whether a model leaves more force than another one, beyond doubt, and so that it shows: more than the
        sensors' noise.
        """
        a, b = self.left(before), self.left(after)
        if a is None or b is None or self.force is None:
            return False
        alike = (1 + self.criteria.alike) ** 2 * float(np.mean(a))
        shows = float(np.mean(b)) > max(alike, self.force.search.r.unseen.noise)
        return shows and mean_certainty(a, b) < -self.criteria.tie

    def written(self, f: Fitted) -> Fitted:
        """Return the best model with some effects: with the values that the motion gave, or with those that the force
        gave, where these leave less force beyond doubt, and less of both together. What is near the noise of the motion
        has the right values.
        """
        motion, force, best = self.motion, self.force, self.motion.best(f)
        if force is None or near_noise(best, self.criteria) or not (f.effects and comparable(force, f)):
            return best
        f = min(f, best, key=self._both)
        fit = force.search.models.get(frozenset(f.effects))
        if fit is None:
            return f
        model = with_laws(force, fit)
        untold = set(f.model.plant.pars()) - {*force.search.r.names, *scaling(force.search.r.current)}
        model = model.with_parameters({n: v for n, v in f.model.parameters.items() if n in untold})
        stated = motion.stated([n for n, _ in fit.members], model)
        less = stated is not None and mean_certainty(written_left(force, f), written_left(force, stated))
        return min(f, stated, key=self._both) if stated and less >= self.criteria.certainty else f

    def _both(self, f: Fitted) -> float:
        """Return the sum of the logarithms of what a model leaves of the force and of every channel of the motion."""
        assert self.force is not None  # noqa: S101  asked before
        return f.level + float(np.log(np.mean(written_left(self.force, f)) + TINY))


__all__ = ["Witnesses"]
