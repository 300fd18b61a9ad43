"""The model with the fewest effects: each must be missed where it is left out, and one may be all that there is."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from itertools import combinations

from signlin_ros.diagnosis.measures import is_shown_to_leave_noise, near_any_noise
from signlin_ros.diagnosis.motion import Fitted
from signlin_ros.diagnosis.motion.trials import completed, free_key, tryable
from signlin_ros.diagnosis.witnesses import Witnesses
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import SignlinError


@dataclass(frozen=True, eq=False)
class Fewest:
    """Both witnesses of how many effects there are."""

    witnesses: Witnesses

    def as_good_as(self, final: Fitted) -> Fitted:
        """Return the model with the fewest effects that is as good: each of several must be missed where it is left
        out, and one effect takes the place of two that it is about the same as. What no force shows does not stand in
        the place of what takes force away.
        """
        if len(final.effects) < 2:
            return final
        w, motion = self.witnesses, self.witnesses.motion
        options = [*self._as_one(final), *(f for f in w.tried if len(f.effects) < len(final.effects))]
        for name in final.effects:
            with contextlib.suppress(SignlinError):
                options.append(motion.fitted([n for n in final.effects if n != name], final.model))
            motion.check()
        w.keep(*options)
        shown = w.left(final) is not None
        good = [f for f in options if not motion.refused(w.base, f) and motion.as_good(final, f)]
        good = [f for f in good if motion.refused(f, final) and not w.raises(final, f)]
        good = [f for f in good if not shown or w.left(f) is not None]
        return min(good, key=lambda f: (len(f.effects), f.size, f.level), default=final)

    def alone(self, final: Fitted) -> Fitted | None:
        """Return the effect that by itself leaves nothing but noise, where what both witnesses arrived at leaves more,
        or is several: of all that there are, it is the one that explains the motion. That it takes more force away
        than another is not asked.
        """
        w, motion, done = self.witnesses, self.witnesses.motion, self._complete(final)
        if done and len(final.effects) < 2:
            return None
        names = [n for n in (self._as_little(final) if done else EFFECTS) if n not in motion.searched.get((), ())]
        names = [n for n in names if tryable(motion.problem, n)]
        w.keep(*(motion.extensions(w.base, names) if names else []))
        whole = [f for f in w.tried if len(f.effects) == 1 and self._complete(f)]
        whole = [f for f in whole if not motion.refused(w.base, f) and not w.raises(w.base, f)]
        whole = [f for f in whole if not done or motion.as_good(final, f)]
        best = min(whole, key=lambda f: f.level, default=None)
        return min(
            (f for f in whole if best and motion.as_good(best, f)), key=lambda f: (f.size, f.level), default=None
        )

    def _complete(self, f: Fitted) -> bool:
        """Tell whether a model leaves but noise, near the sensors' or at its own, with no base parameter far off."""
        w, c = self.witnesses, self.witnesses.criteria
        return near_any_noise(w.motion, f, c) and is_shown_to_leave_noise(f, c) and not f.far(c)

    def _as_little(self, final: Fitted) -> list[str]:
        """Return the laws that by themselves leave as little of the force as a model with several effects."""
        force = self.witnesses.force
        models = force.search.models if force else {}
        together = models.get(frozenset(final.effects))
        if together is None:
            return []
        most = (1 + self.witnesses.criteria.alike) ** 2 * together.error
        return [n for names, f in models.items() if len(names) == 1 and f.error <= most for n in names]

    def _as_one(self, final: Fitted) -> list[Fitted]:
        """Return models with one effect in place of two that it is about the same as, from their values and from its
        own starts.
        """
        motion, found = self.witnesses.motion, list[Fitted]()
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
