"""What each effect of a proposal is worth by itself: what takes nothing away, or is not known, is no part of it."""

from __future__ import annotations

from dataclasses import replace

from signlin_ros.diagnosis.evidence import HALF
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.verdict import Verdict, freed
from signlin_ros.errors import joined

REMAINDER_REASONS = ("structure", "elsewhere")
"""Why records are not explained, where more is left than the proposal takes away."""


def without_idle(j: Verdict) -> Verdict:
    """Return a judgement of the effects that tell: the weakest of the others is left out, and so on, each with why."""
    dropped = dict[str, str]()
    while not (j.asked or j.conflict or j.reversed) and (found := _weakest(j)):
        name, why = found
        dropped[name] = why
        rest = j.without(name)
        j.evidence.keep(*([rest] if rest.effects else []))
        j = replace(j, final=rest, dropped=dict(dropped))
    return j


def _weakest(j: Verdict) -> tuple[str, str] | None:
    """Return the effect that tells least, and why it does not tell; None where all do."""
    found = dict[str, tuple[float, str]]()
    more = j.unexplained in REMAINDER_REASONS or not (j.unexplained or j.final.white)
    least = min(j.names, key=lambda n: j.motion.gain(j.without(n), j.final).share) if len(j.names) > 1 else ""
    for name in j.names:
        size = j.final.certainty(name)
        if len(j.names) > 1 and _takes_nothing(j, j.without(name), bool(j.unexplained)):
            found[name] = size, "beside the others it takes away less than shows of what is missing"
        elif more and name == least and (bent := _bent(j, name)):
            found[name] = size, f"only with {bent} that far from nominal it would take something away"
        elif more and size < _asked(j, name):
            told = f"{size:.1f} of its own standard errors from nothing, and more than noise is left"
            found[name] = size, f"{name} is {told}"
    name = min(found, key=lambda n: found[n][0], default="")
    return (name, found[name][1]) if name else None


def _bent(j: Verdict, name: str) -> str:
    """Return the base parameters that end far from nominal with an effect, and not without it."""
    return joined(sorted(j.far.keys() - j.without(name).far(j.criteria).keys()) or [""])


def _asked(j: Verdict, name: str) -> float:
    """Return by how many of its own standard errors an effect is to differ from nothing: these hold what is not known
    of the base model's scale too, so that fewer do for one that takes most of what is left without it away.
    """
    most = j.motion.gain(j.without(name), j.final).share > HALF
    return j.criteria.least if most else j.criteria.coefficient


def _takes_nothing(j: Verdict, without: FittedModel, left: bool) -> bool:
    """Tell whether an effect takes away no more of what the base model leaves than a table shows, of no channel and of
    no force; ``left``: more than noise is left, so that it must show beside that, and a base parameter that it frees is
    no reason for it.
    """
    final, base, c = j.final, j.base, j.criteria
    gone = without.errors**2 - final.errors**2
    shown = gone > c.alike**2 * base.errors**2
    if left:
        shown &= final.errors < (1.0 - c.alike) * without.errors
    before, after, most = j.percent_of(without), j.percent, j.percent_of(base) or 0.0
    force = before is not None and after is not None and before**2 - after**2 > (c.alike * most) ** 2
    return not (bool(shown.any()) or force) and (left or not freed(without, final))


__all__ = ["without_idle"]
