"""Phrases of a diagnosis: numbers and names in, text out. What decides which of them is said stands at the caller."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from signlin_ros.diagnosis.results import listed
from signlin_ros.errors import joined

# -------------------------------------------------------------------- progress

BASE_MODEL = "base model"
FORCE_RESIDUAL = "missing force"
INPUT_HOLD = "how the input acts"
MANY_MINIMA = "effects with many local minima"
MOTION = "motion"
MOTION_WITH_FORCE = "motion with what the force shows"
PLANNED_RIVALS = "rivals of the plan"
WIDER_TOLERANCE = "base parameters known less well"


def extending(count: int, effects: Sequence[str]) -> str:
    """Return the stage in which so many effects are tried beside others."""
    return f"{count} effects on top of {', '.join(effects) or 'the base model'}"


def finishing(count: int) -> str:
    """Return the stage in which so many fits go on to the end."""
    return f"fitting {count} of them to the end"


# -------------------------------------------------------------------- a change of the validation error


def channel_rises(name: str) -> str:
    """Return that the error of a channel rises."""
    return f"the error of {name} rises"


def change(t: float, asked: float, most: str = "") -> str:
    """Return by how many standard errors the validation error changes, and by how many it must fall."""
    if round(t, 1) < 0:
        return f"the error on validation data rises by {-t:.1f} standard errors"
    size = f"{most}{max(np.floor(10 * t), 0.0) / 10:.1f} standard errors"  # 3.48 are not the 3.5 that are asked
    return f"the error on validation data falls by {size}, {asked:g} are asked"


def no_noise(channel: str, goes_with_motion: bool) -> str:
    """Return a sentence on a residual that has structure."""
    why = "follows from the motion" if goes_with_motion else "goes on from sample to sample, as where an input is off"
    return f" What is left of {channel} is no noise: it {why}."


def too_little(what: str, why: str) -> str:
    """Return what would explain the records, and why they do not tell."""
    return f"Too little was recorded to tell what is missing: {what}, but {why}"


def not_told(name: str, why: str) -> str:
    """Return which effect would explain the records, and why they do not tell it from something else."""
    return f"What is missing cannot be told: {listed([name])} would leave nothing but noise, but {why}"


UNTESTED = (
    "Too little was recorded to tell whether something is missing: samples are too few to test that what is left is "
    "noise"
)

# -------------------------------------------------------------------- one parameter, one effect

AT_BOUND = "at its bound"
NOT_EXCITED = "not excited: the record says nothing beyond the tolerance"
TAKES_NOTHING = "beside the others it lowers no error visibly"


def off_nominal(tolerances: float, ratio: float | None) -> str:
    """Return how far a value is from nominal: in tolerances, and as so many times the nominal value."""
    times = "" if ratio is None else f" ({ratio:.3g} times it)"
    return f"{abs(tolerances):.1f} tolerances from its nominal value{times}"


def freed(name: str, tolerances: float) -> str:
    """Return that a base parameter ends far from nominal without an effect, which is another way to see the same."""
    return f", but without it {name} {ends_off(tolerances)}: either may be off"


def wider_tolerance(stated: float, taken: float) -> str:
    """Return a note on base parameters of which the model does not say how well they are known."""
    return (
        f"the model does not say how well its parameters are known: taken as known to {100 * stated:g} % they hide what"
        f" is missing, so they are taken as known to {100 * taken:g} % (`tolerance` in the model file says otherwise)"
    )


def ends_off(tolerances: float) -> str:
    """Return that a parameter ends so many tolerances from nominal."""
    return f"ends {off_nominal(tolerances, None)}"


def bent(names: str) -> str:
    """Return that an effect lowers the error only with base parameters far from nominal."""
    return f"it lowers the error only with {names} that far from nominal"


def own_record(source: str) -> str:
    """Return that a value is one record's own."""
    return f"of {source}"


def not_real(key: str) -> str:
    """Return that an effect's values are those of something that its equation imitates."""
    return f"the values of {key} are not physically plausible"


def unknown(key: str) -> str:
    """Return that no coefficient of an effect is known."""
    return f"the records do not identify {key}"


def at_bound(name: str) -> str:
    """Return that a parameter ended at its bound."""
    return f"{name} is {AT_BOUND}"


def vague(name: str) -> str:
    """Return that a parameter's standard error is more than half of it."""
    return f"the standard error of {name} is more than half of its value"


def insignificant(name: str, t: float) -> str:
    """Return that a coefficient over its standard error, its t ratio, is too small to tell it from zero."""
    return f"{name} is insignificant (t ratio {t:.1f})"


def insignificant_beside_rest(name: str, t: float) -> str:
    """Return the same of an effect beside which more than noise is left."""
    return f"{insignificant(name, t)}, and more than noise is left"


# -------------------------------------------------------------------- what records do not hold


def beyond_limit(key: str) -> str:
    """Return that a limit was passed throughout."""
    return f"all records lie beyond {key}"


def unresolved(key: str) -> str:
    """Return that an effect acts within less time than samples show: a delay far below one, a force that relaxes."""
    return f"{key} acts within less time than the samples can show"


def rounded(channel: str, offset: float, step: float, unit: str) -> str:
    """Return that an offset is how a sensor rounds."""
    return f"the {channel} reads {offset:.3g} {unit} off, less than the {step:.3g} {unit} in which it is shown"


def undriven(key: str) -> str:
    """Return that what a load does is not what the motion of the axis makes of it."""
    return f"the axis hardly moves the load of {listed([key])}: a vibration from outside looks the same"


def few_waves(key: str, periods: float) -> str:
    """Return that the records hold too few periods of a wave."""
    return f"the records hold {periods:.1f} periods of {key}"


def phase_unknown(key: str, place: str) -> str:
    """Return that records of which nobody measured the position do not tell a wave over it."""
    return f"{place} was not measured: where in a period of {key} each record begins is not known"


def wave_too_fast(key: str) -> str:
    """Return that a wave passes faster than samples can tell."""
    return f"a period of {key} passes in less than two samples"


def zero_beyond_travel(place: str, distance: float, travel: float, unit: str) -> str:
    """Return that a force would have its zero beyond where any record went."""
    told = f"{place} was not measured: its zero would be {distance:.3g} {unit} from where a record starts"
    return f"{told}, which goes {travel:.3g}"


def diverges(source: str, effect: str) -> str:
    """Return that a model diverges with an effect."""
    return f"{source}: with {effect} the model diverges on these records"


# -------------------------------------------------------------------- rows of the ranking

LED_NOWHERE = "not fitted: no step of the search led to it"
TOO_LITTLE_AT_FIRST = "not fitted to the end: after the first steps it takes too little of the error away"


def not_fitted(effects: Sequence[str]) -> str:
    """Return that an effect was not fitted, since others leave but noise."""
    what, verb = listed(effects) or "the model as it is", "leave" if len(effects) > 1 else "leaves"
    return f"not fitted: {what} {verb} nothing but noise"


def not_applicable(plant: str) -> str:
    """Return that an effect does not exist for a plant."""
    return f"does not apply to {plant}"


def by_force(left: float, before: float, of_effort: str, whole: float) -> str:
    """Return the force residual with a law and without it, in per cent of the effort, as a phrase."""
    told = f"{left:.3g} %" if left <= whole else "more than all"
    beside = f"the model without it leaves {before:.3g} %"
    return f"judged by the missing force alone it would leave {told} {of_effort} on validation data, {beside}"


def may_act_beyond(low: float, high: float, unit: str) -> str:
    """Return between which positions the records are."""
    return f"; the records move from {low:.3g} to {high:.3g} {unit}: it may act beyond"


def as_good(effect: str, richer: bool) -> str:
    """Return that an effect explains the records as well as one that is named."""
    return f"as good on validation data as {listed([effect])}{', which is the simpler law' * richer}"


def experiment(to_decide: bool, effect: str, what: str) -> str:
    """Return which experiment would decide on an effect, or show it."""
    return f"{'to decide on' if to_decide else 'to see'} {listed([effect])}: {what}"


# -------------------------------------------------------------------- why the estimates differ


def _leaves(effects: Collection[str]) -> str:
    return "leaves" if len(effects) == 1 else "leave"


def more_force_than_base(effects: Sequence[str]) -> str:
    """Return that effects follow the motion, and leave more force than the model as it is."""
    return f"{listed(effects)} would follow the motion, but {_leaves(effects)} more force than the model as it is"


def more_force(effects: Sequence[str]) -> str:
    """Return the same beside another model, whose effects take the place of ``{}``."""
    return f"{listed(effects)} would follow the motion better than {{}}, but {_leaves(effects)} more force"


def motion_refuses(
    laws: Sequence[str],
    left: float | None,
    before: float | None,
    of_effort: str,
    others: Sequence[str],
    changed: Mapping[str, tuple[float, float]],
) -> str:
    """Return that simulation refuses the laws of the force, which leave so many per cent of the effort, and which of
    them are of another size in the validation data than in the training data.
    """
    place = "" if before is None else f" in place of {before:.3g} %"
    told = f"by the force {listed(laws)} would leave {left:.3g} % {of_effort}{place}, but the motion"
    other = f"; {listed(others)} would follow it better" if others else ""
    pairs = changed.items()
    sizes = [f"{listed([n])} is {a:.3g} in the training and {b:.3g} in the validation data" for n, (a, b) in pairs]
    warmer = f"; {joined(sizes)}, as after warming up" if sizes else ""
    return f"{told} that they make is not the one that was measured{other}{warmer}"


# -------------------------------------------------------------------- notes

HOLDS = {
    "centred": "as if sampled from what goes on in between",
    "linear": "as if interpolated between its samples",
    "backward": "as if logged beside the state that it led to",
}


def input_acts(hold: str | float, figures: str, effects: Sequence[str]) -> str:
    """Return how the input was found to act, and what that is worth for the base, or with some effects."""
    what = f"with {listed(effects)}" if effects else "of the refitted model"
    return f"the input acts {HOLDS[str(hold)]} (input_hold: {hold}): {figures} {what}, on the data fitted to"


def inputs_as_recorded(inputs: Sequence[str]) -> str:
    """Return that inputs are taken without an error of their own, and why rows differ from those of another verb."""
    acts = f"the {joined(list(inputs))} is taken to act as recorded, the noise or the steps in it too"
    return f"{acts}: `signlin compare`, whose observer allows for an error of it, has other numbers in its first rows"


def repeats(force: str, often: str) -> str:
    """Return that forces repeat along the way, which one most, and how often."""
    return f"forces that repeat along the way, first of all {force} that repeats {often}"


def changes_along(force: str) -> str:
    """Return that the size of a force is a curve over the position."""
    return f"a {force} that changes along the way"


def error_changes(channel: str, horizon: float, before: float, after: float, unit: str) -> str:
    """Return two RMS errors of a channel over the horizon in s."""
    return f"error of {channel} over {horizon:.3g} s {before:.3g} -> {after:.3g} {unit}"


def stopped(added: int, most: int, explained: bool) -> str:
    """Return why `refine` stopped after so many effects."""
    end = "nothing else that is listed lowers the error on validation data beyond doubt"
    end = f"{most} effects are the most" if added >= most else end
    end = end if explained else "the records are not explained, see the verdict"
    return f"stopped after {added} effect{'' if added == 1 else 's'}: {end}"
