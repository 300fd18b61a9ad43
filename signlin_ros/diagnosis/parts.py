"""What each part of a selection is worth: what validation data do not tell of, takes nothing away, or is not known, is
no part of it.
"""

from __future__ import annotations

from dataclasses import replace

from signlin_ros.diagnosis.evidence import HALF, Evidence
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.selection import Selection
from signlin_ros.diagnosis.validation import force_percent, freed
from signlin_ros.diagnosis.verdict import REASONS, Verdict, verdict_of
from signlin_ros.errors import joined

REMAINDER_REASONS = ("structure", "elsewhere")
"""Why records are not explained, where more is left than the proposal takes away."""


def without_untold(w: Evidence, v: Verdict) -> Verdict:
    """Return the verdict on the base model where validation data do not tell of the selected one, and nothing is
    missing without it.
    """
    if not v.reason or not REASONS[v.reason].untold:
        return v
    alone = verdict_of(w, Selection(w.base, untold=v.reason))
    return alone if alone.label == "adequate" else v


def without_idle(w: Evidence, v: Verdict) -> Verdict:
    """Return the verdict on the effects that tell: the weakest of the others is left out, and so on, each with why."""
    dropped = dict[str, str]()
    while not (v.selection.conflict or v.reversed) and (found := _weakest(w, v)):
        name, why = found
        dropped[name] = why
        rest = v.without[name]
        w.cache.keep(*([rest] if rest.effects else []))
        v = verdict_of(w, replace(v.selection, chosen=rest, dropped=dict(dropped)))
    return v


def _weakest(w: Evidence, v: Verdict) -> tuple[str, str] | None:
    """Return the effect that tells least, and why it does not tell; None where all do."""
    found = dict[str, tuple[float, str]]()
    more = v.reason in REMAINDER_REASONS or not (v.reason or v.final.white)
    least = min(v.names, key=lambda n: w.motion.gain(v.without[n], v.final).share) if len(v.names) > 1 else ""
    for name in v.names:
        size = v.final.certainty(name)
        if len(v.names) > 1 and _takes_nothing(w, v, v.without[name], bool(v.reason)):
            found[name] = size, "beside the others it takes away less than shows of what is missing"
        elif more and name == least and (bent := _bent(w, v, name)):
            found[name] = size, f"only with {bent} that far from nominal it would take something away"
        elif more and size < _asked(w, v, name):
            told = f"{size:.1f} of its own standard errors from nothing, and more than noise is left"
            found[name] = size, f"{name} is {told}"
    name = min(found, key=lambda n: found[n][0], default="")
    return (name, found[name][1]) if name else None


def _bent(w: Evidence, v: Verdict, name: str) -> str:
    """Return the base parameters that end far from nominal with an effect, and not without it."""
    return joined(sorted(v.far.keys() - v.without[name].far(w.criteria).keys()) or [""])


def _asked(w: Evidence, v: Verdict, name: str) -> float:
    """Return by how many of its own standard errors an effect is to differ from nothing: these hold what is not known
    of the base model's scale too, so that fewer do for one that takes most of what is left without it away.
    """
    most = w.motion.gain(v.without[name], v.final).share > HALF
    return w.criteria.least if most else w.criteria.coefficient


def _takes_nothing(w: Evidence, v: Verdict, without: FittedModel, left: bool) -> bool:
    """Tell whether an effect takes away no more of what the base model leaves than a table shows, of no channel and of
    no force; ``left``: more than noise is left, so that it must show beside that, and a base parameter that it frees is
    no reason for it.
    """
    final, base, c = v.final, v.base, w.criteria
    gone = without.errors**2 - final.errors**2
    shown = gone > c.alike**2 * base.errors**2
    if left:
        shown &= final.errors < (1.0 - c.alike) * without.errors
    before, after = force_percent(w, without, final), v.percent
    most = force_percent(w, base, final) or 0.0
    force = before is not None and after is not None and before**2 - after**2 > (c.alike * most) ** 2
    return not (bool(shown.any()) or force) and (left or not freed(without, final))


__all__ = ["without_idle", "without_untold"]
