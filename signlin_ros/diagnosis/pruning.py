"""What each effect of a selection is worth: those that validation data cannot decide on, that lower no error, or whose
size is not known, are left out.
"""

from __future__ import annotations

from dataclasses import replace

from signlin_ros.diagnosis.criteria import HALF
from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.rows import force_percent
from signlin_ros.diagnosis.selection import Selection
from signlin_ros.diagnosis.validation import freed
from signlin_ros.diagnosis.verdict import Verdict, verdict_of
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.diagnosis.wording.reasons import REASONS
from signlin_ros.errors import joined

SENSOR_OFFSET = "sensor_offset"
REMAINDER_REASONS = ("structure", "elsewhere")
"""Why records are not explained, where more is left than the proposal takes away."""


def without_untold(evidence: Evidence, verdict: Verdict) -> Verdict:
    """Return the verdict on the base model where validation data cannot decide on the selected one and the base is
    adequate.
    """
    if not verdict.reason or not REASONS[verdict.reason].untold:
        return verdict
    alone = verdict_of(evidence, Selection(evidence.base, untold=verdict.reason))
    return alone if alone.label == "adequate" else verdict


def without_rounding(evidence: Evidence, verdict: Verdict) -> Verdict:
    """Return the verdict without an offset of a sensor that is within the step in which it shows: that is no effect but
    what rounding leaves open, one that rounds down reads half a step too little. What else is named, and whether
    anything is, was judged beside it.
    """
    if SENSOR_OFFSET not in verdict.names or verdict.reason or verdict.selection.asked:
        return verdict
    problem, values = evidence.dataset.training, verdict.final.fit.parameters()
    steps = dict(zip(problem.channels, problem.quanta.tolist(), strict=True))
    offsets = {c: values[f"{SENSOR_OFFSET}.{c}"] for c in steps if f"{SENSOR_OFFSET}.{c}" in values}
    if not offsets or any(abs(x) >= steps[c] for c, x in offsets.items()):
        return verdict
    rest, (channel, offset) = verdict.without[SENSOR_OFFSET], next(iter(offsets.items()))
    unit = problem.unit_of(channel)
    dropped = {**verdict.selection.dropped, SENSOR_OFFSET: phrases.rounded(channel, offset, steps[channel], unit)}
    other = verdict_of(evidence, replace(verdict.selection, chosen=rest, dropped=dropped))
    evidence.cache.keep(*([rest] if rest.effects else []))
    return replace(other, reason="", lost=(), worse="", label="missing" if rest.effects else "adequate")


def without_idle(evidence: Evidence, verdict: Verdict) -> Verdict:
    """Return the verdict without the effects that lower no error: the weakest goes first, each with its reason."""
    dropped = dict[str, str]()
    while not (verdict.selection.conflict or verdict.reversed) and (found := _weakest(evidence, verdict)):
        name, why = found
        dropped[name] = why
        rest = verdict.without[name]
        evidence.cache.keep(*([rest] if rest.effects else []))
        verdict = verdict_of(evidence, replace(verdict.selection, chosen=rest, dropped=dict(dropped)))
    return verdict


def _weakest(evidence: Evidence, verdict: Verdict) -> tuple[str, str] | None:
    """Return the weakest effect to leave out, and the reason; None where all are needed."""
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
    """Return the t ratio that an effect must have. Its standard error includes the uncertainty of the base model's
    scale, so a smaller ratio does where it takes away most of the error that is left without it.
    """
    most = evidence.output_error.improvement(verdict.without[name], verdict.final).mse_reduction > HALF
    return evidence.criteria.min_validation_t if most else evidence.criteria.min_coefficient_t


def _takes_nothing(evidence: Evidence, verdict: Verdict, without: FittedModel, left: bool) -> bool:
    """Tell whether an effect lowers neither a channel's error nor the force residual by as much as a table shows; one
    without which what is left is no noise, and with which it is the sensors', takes something away.

    ``left``: more than noise is left; then it must show beside that, and freeing a base parameter does not count.
    """
    final, base, c = verdict.final, verdict.base, evidence.criteria
    if evidence.explains_to_noise(final) and evidence.near_noise(final) and not without.white:
        return False
    gone = without.validation_rmse**2 - final.validation_rmse**2
    shown = gone > c.visible_change**2 * base.validation_rmse**2
    if left:
        shown &= final.validation_rmse < (1.0 - c.visible_change) * without.validation_rmse
    before, after = force_percent(evidence, without, final), verdict.percent
    most = force_percent(evidence, base, final) or 0.0
    force = before is not None and after is not None and before**2 - after**2 > (c.visible_change * most) ** 2
    return not (bool(shown.any()) or force) and (left or not freed(without, final))


__all__ = ["without_idle", "without_rounding", "without_untold"]
