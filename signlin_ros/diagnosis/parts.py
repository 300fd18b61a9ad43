"""What each part of a selection is worth: what validation data do not tell of, takes nothing away, or is not known, is
no part of it.
"""

from __future__ import annotations

from dataclasses import replace

from signlin_ros.diagnosis.evidence import HALF, Evidence
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.selection import Selection
from signlin_ros.diagnosis.validation import force_percent, freed
from signlin_ros.diagnosis.verdict import Verdict, verdict_of
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.diagnosis.wording.reasons import REASONS
from signlin_ros.errors import joined

REMAINDER_REASONS = ("structure", "elsewhere")
"""Why records are not explained, where more is left than the proposal takes away."""


def without_untold(evidence: Evidence, verdict: Verdict) -> Verdict:
    """Return the verdict on the base model where validation data do not tell of the selected one, and nothing is
    missing without it.
    """
    if not verdict.reason or not REASONS[verdict.reason].untold:
        return verdict
    alone = verdict_of(evidence, Selection(evidence.base, untold=verdict.reason))
    return alone if alone.label == "adequate" else verdict


def without_idle(evidence: Evidence, verdict: Verdict) -> Verdict:
    """Return the verdict on the effects that tell: the weakest of the others is left out, and so on, each with why."""
    dropped = dict[str, str]()
    while not (verdict.selection.conflict or verdict.reversed) and (found := _weakest(evidence, verdict)):
        name, why = found
        dropped[name] = why
        rest = verdict.without[name]
        evidence.cache.keep(*([rest] if rest.effects else []))
        verdict = verdict_of(evidence, replace(verdict.selection, chosen=rest, dropped=dict(dropped)))
    return verdict


def _weakest(evidence: Evidence, verdict: Verdict) -> tuple[str, str] | None:
    """Return the effect that tells least, and why it does not tell; None where all do."""
    found = dict[str, tuple[float, str]]()
    more = verdict.reason in REMAINDER_REASONS or not (verdict.reason or verdict.final.white)
    least = (
        min(
            verdict.names,
            key=lambda n: evidence.output_error.improvement(verdict.without[n], verdict.final).mse_reduction,
        )
        if len(verdict.names) > 1
        else ""
    )
    for name in verdict.names:
        size = verdict.final.t_ratio(name)
        if len(verdict.names) > 1 and _takes_nothing(evidence, verdict, verdict.without[name], bool(verdict.reason)):
            found[name] = size, phrases.TAKES_NOTHING
        elif more and name == least and (bent := _bent(evidence, verdict, name)):
            found[name] = size, phrases.bent(bent)
        elif more and size < _asked(evidence, verdict, name):
            found[name] = size, phrases.insignificant_beside_rest(name, size)
    name = min(found, key=lambda n: found[n][0], default="")
    return (name, found[name][1]) if name else None


def _bent(evidence: Evidence, verdict: Verdict, name: str) -> str:
    """Return the base parameters that end far from nominal with an effect, and not without it."""
    return joined(sorted(verdict.far.keys() - verdict.without[name].far_from_nominal(evidence.criteria).keys()) or [""])


def _asked(evidence: Evidence, verdict: Verdict, name: str) -> float:
    """Return by how many of its own standard errors an effect is to differ from nothing: these hold what is not known
    of the base model's scale too, so that fewer do for one that takes most of what is left without it away.
    """
    most = evidence.output_error.improvement(verdict.without[name], verdict.final).mse_reduction > HALF
    return evidence.criteria.min_validation_t if most else evidence.criteria.min_coefficient_t


def _takes_nothing(evidence: Evidence, verdict: Verdict, without: FittedModel, left: bool) -> bool:
    """Tell whether an effect takes away no more of what the base model leaves than a table shows, of no channel and of
    no force; ``left``: more than noise is left, so that it must show beside that, and a base parameter that it frees is
    no reason for it.
    """
    final, base, c = verdict.final, verdict.base, evidence.criteria
    gone = without.validation_rmse**2 - final.validation_rmse**2
    shown = gone > c.visible_change**2 * base.validation_rmse**2
    if left:
        shown &= final.validation_rmse < (1.0 - c.visible_change) * without.validation_rmse
    before, after = force_percent(evidence, without, final), verdict.percent
    most = force_percent(evidence, base, final) or 0.0
    force = before is not None and after is not None and before**2 - after**2 > (c.visible_change * most) ** 2
    return not (bool(shown.any()) or force) and (left or not freed(without, final))


__all__ = ["without_idle", "without_untold"]
