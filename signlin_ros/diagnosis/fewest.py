"""The model with the fewest effects: each must be missed where it is left out, and one may be all that there is."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.force.witness import Testimony
from signlin_ros.diagnosis.measures import force_left, force_raises, is_shown_to_leave_noise, near_any_noise
from signlin_ros.diagnosis.motion import Fitted, Motion
from signlin_ros.diagnosis.motion.trials import completed, free_key, tryable
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import SignlinError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Fewest:
    """Both witnesses of how many effects there are. ``tried``: keeps what is fitted; ``left``: the forces left, by
    model.
    """

    motion: Motion
    force: Testimony | None
    criteria: Criteria
    tried: list[Fitted]
    left: dict[int, Array]

    def as_good_as(self, final: Fitted) -> Fitted:
        """Return the model with the fewest effects that is as good: each of several must be missed where it is left
        out, and one effect takes the place of two that it is about the same as. What no force shows does not stand in
        the place of what takes force away.
        """
        if len(final.effects) < 2:
            return final
        options = [*self._as_one(final), *(f for f in self.tried if len(f.effects) < len(final.effects))]
        for name in final.effects:
            with contextlib.suppress(SignlinError):
                options.append(self.motion.fitted([n for n in final.effects if n != name], final.model))
            self.motion.check()
        self._keep(options)
        good = [f for f in options if not self.motion.refused(self.motion.base, f) and self.motion.as_good(final, f)]
        good = [f for f in good if self.motion.refused(f, final) and not self._raises(final, f)]
        shown = force_left(self.force, final, self.left) is not None
        good = [f for f in good if not shown or force_left(self.force, f, self.left) is not None]
        return min(good, key=lambda f: (len(f.effects), f.size, f.level), default=final)

    def alone(self, final: Fitted) -> Fitted | None:
        """Return the effect that by itself leaves nothing but noise, where what both witnesses arrived at leaves more,
        or is several: of all that there are, it is the one that explains the motion. That it takes more force away
        than another is not asked.
        """
        motion, done = self.motion, self._complete(final)
        if done and len(final.effects) < 2:
            return None
        names = [n for n in (self._as_little(final) if done else EFFECTS) if n not in motion.searched.get((), ())]
        names = [n for n in names if tryable(motion.problem, n)]
        self._keep(motion.extensions(motion.base, names) if names else [])
        whole = [f for f in self.tried if len(f.effects) == 1 and self._complete(f)]
        whole = [f for f in whole if not motion.refused(motion.base, f) and not self._raises(motion.base, f)]
        whole = [f for f in whole if not done or motion.as_good(final, f)]
        best = min(whole, key=lambda f: f.level, default=None)
        return min(
            (f for f in whole if best and motion.as_good(best, f)), key=lambda f: (f.size, f.level), default=None
        )

    def _keep(self, found: list[Fitted]) -> None:
        self.tried.extend(f for f in found if f not in self.tried)

    def _raises(self, before: Fitted, after: Fitted) -> bool:
        return force_raises(self.force, before, after, self.criteria, self.left)

    def _complete(self, f: Fitted) -> bool:
        """Tell whether a model leaves but noise, near the sensors' or at its own, with no base parameter far off."""
        near = near_any_noise(self.motion, f, self.criteria)
        return near and is_shown_to_leave_noise(f, self.criteria) and not f.far(self.criteria)

    def _as_little(self, final: Fitted) -> list[str]:
        """Return the laws that by themselves leave as little of the force as a model with several effects."""
        models = self.force.search.models if self.force else {}
        together = models.get(frozenset(final.effects))
        if together is None:
            return []
        most = (1 + self.criteria.alike) ** 2 * together.error
        return [n for names, f in models.items() if len(names) == 1 and f.error <= most for n in names]

    def _as_one(self, final: Fitted) -> list[Fitted]:
        """Return models with one effect in place of two that it is about the same as, from their values and from its
        own starts.
        """
        motion, found = self.motion, list[Fitted]()
        for pair in combinations(final.effects, 2):
            uses = {use.type: use.parameters for use in final.model.effects.values()}
            others = {name: uses.get(name, {}) for name in pair}
            for name, effect in EFFECTS.items():
                values = effect.instead(others) if all(others.values()) and name not in final.effects else {}
                if not values:
                    continue
                model, kept = final.model, tuple(n for n in final.effects if n not in pair)
                for key in [k for k, use in model.effects.items() if use.type in pair]:
                    model = model.without_effect(key)
                with contextlib.suppress(SignlinError):
                    model = model.with_effect(name, free_key(model, name), **completed(motion.problem, effect, values))
                    found.append(motion.fitted((*kept, name), model))
                with contextlib.suppress(SignlinError):
                    found += motion.extensions(motion.fitted(kept, final.model), [name])
                motion.check()
        return [f for f in found if len(f.effects) < len(final.effects)]


__all__ = ["Fewest"]
