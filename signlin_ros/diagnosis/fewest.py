"""The model with the fewest effects: each must be missed where it is left out, and one may be all that there is."""

from __future__ import annotations

import contextlib
from itertools import combinations, product

from signlin_ros.diagnosis.motion import Fitted, Motion
from signlin_ros.diagnosis.motion.trials import completed, free_key, tryable
from signlin_ros.diagnosis.witnesses import Witnesses
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import SignlinError


def as_good_as(w: Witnesses, final: Fitted) -> Fitted:
    """Return the model with the fewest effects that is as good; what no force shows displaces nothing that one does."""
    if len(final.effects) < 2:
        return final
    motion = w.motion
    options = [*_as_one(motion, final), *(f for f in w.tried if len(f.effects) < len(final.effects))]
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


def alone(w: Witnesses, final: Fitted) -> Fitted | None:
    """Return the effect that by itself leaves nothing but noise, where what both witnesses arrived at leaves more."""
    if _complete(w, final):
        return None
    motion, base = w.motion, w.base
    names = [n for n in EFFECTS if n not in motion.searched.get((), ()) and tryable(motion.problem, n)]
    w.keep(*(motion.extensions(base, names) if names else []))
    whole = [f for f in w.single if _complete(w, f)]
    whole = [f for f in whole if not motion.refused(base, f) and not w.raises(base, f)]
    best = min(whole, key=lambda f: f.level, default=None)
    as_good = [f for f in whole if best and motion.as_good(best, f)]
    return min(as_good, key=lambda f: (f.size, f.level), default=None)


def _complete(w: Witnesses, f: Fitted) -> bool:
    """Tell whether a model leaves but noise, near the sensors' or at its own, with no base parameter far off."""
    return w.near_any_noise(f) and f.clean and not f.far(w.criteria)


def _as_one(motion: Motion, final: Fitted) -> list[Fitted]:
    """Return models with one effect in place of two that it is about the same as, from their values and its starts."""
    found, uses = list[Fitted](), {use.type: use.parameters for use in final.model.effects.values()}
    for pair, (name, effect) in product(combinations(final.effects, 2), EFFECTS.items()):
        others = {n: uses.get(n, {}) for n in pair}
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


__all__ = ["alone", "as_good_as"]
