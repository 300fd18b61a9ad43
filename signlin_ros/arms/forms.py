"""The form of a viscous friction that grows ever more slowly: cubic, or a power of speed.

Near standstill a power of speed looks like dry friction that sets in gradually, so it is judged above the crawl only,
last, and against the cubic law: of the two one is told if it is there beside the other, and the other is not there
beside it, on the rows of the fit and on unseen rows alike.   [Davidson and MacKinnon, Econometrica 49(3), 1981]
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from signlin_ros.arms.fit import CoefficientEstimate, FitDesign, fit
from signlin_ros.arms.heldout import MIN_VALIDATION_ERRORS, above_crawl
from signlin_ros.arms.keys import Key, SearchResult, names_of
from signlin_ros.arms.laws import ASKED, EXTRA, JointLaw, shapes
from signlin_ros.arms.search import MIN_VALIDATION_SHARE, State, admissible, needed_errors, settled

POWER_LAW = ASKED[0]
CUBIC = "cubic_viscous_friction"


def better_forms(
    state: State, estimate: CoefficientEstimate, progress: Callable[[str], None] = lambda _: None
) -> CoefficientEstimate:
    """Add a power of speed to each joint that it is visibly better for, in the place of a cubic law that stands there;
    return the estimate.
    """
    for i in (i for i in range(state.robot.n) if i not in state.barred):
        rivals = [key for key, law in state.terms if law is not None and law.base == POWER_LAW.base and key.at == i]
        if any(key.law != CUBIC or estimate[names_of(key)[0]] > 0.0 for key in rivals):
            continue
        found = _power_law(state, estimate, i)
        if found is not None:
            progress(f"{names_of(found[0])[0]}: validation errors fall")
            estimate = found[1]
            state.terms = _with(state, found[0])
            state.found = [r for r in state.found if r.key not in rivals] + [_told(state, estimate, found[0])]
    return estimate


def _with(state: State, new: Key) -> list[tuple[Key, JointLaw | None]]:
    """Return the terms of a state with a power of speed in the place of its kin."""
    kept = [(k, law) for k, law in state.terms if law is None or (k.at, law.base) != (new.at, POWER_LAW.base)]
    return [*kept, (new, POWER_LAW)]


def _power_law(state: State, estimate: CoefficientEstimate, i: int) -> tuple[Key, CoefficientEstimate] | None:
    """Return the power of speed of a joint that is better than none and than a cubic law, None if none is."""
    tried = []
    for shape in shapes(POWER_LAW, state.rows, i):
        new = Key(POWER_LAW.effect, i, shape)
        trial = _fixed(replace(state, terms=_with(state, new)), estimate)
        if admissible(trial, new):
            tried.append((new, trial))
    if not tried:
        return None
    new, _ = min(tried, key=lambda pair: pair[1].objective)
    trial = settled(replace(state, terms=_with(state, new)), estimate)
    visible = 1.0 - (trial.matched_rms[i] / estimate.matched_rms[i]) ** 2 > MIN_VALIDATION_SHARE
    return (new, trial) if visible and _stands(state, estimate, new) else None


def _fixed(state: State, estimate: CoefficientEstimate) -> CoefficientEstimate:
    """Return the fit of a state with loads and weights of an estimate."""
    return fit(state.design(state.loads(estimate)), state.rows, state.new, estimate.weights)


def _stands(state: State, estimate: CoefficientEstimate, new: Key) -> bool:
    """Tell whether a power of speed is sure above the crawl, there beside a cubic law, and that not beside it."""
    cubic = Key(CUBIC, new.at)
    power, other = names_of(new)[0], names_of(cubic)[0]
    own = replace(state, terms=_with(state, new))
    design = own.design(state.loads(estimate))
    law = next(law for law in EXTRA if law.effect == CUBIC)
    beside = design.plus((other,), *state.columns(cubic, law, state.loads(estimate)))
    tried = len(list(state.candidates(estimate)))
    needed = (needed_errors(tried), MIN_VALIDATION_ERRORS)
    alone, both = _ratios(state, design, estimate, new.at), _ratios(state, beside, estimate, new.at)
    sure = all(ratio[power] >= least for ratio, least in zip(alone, needed, strict=True))
    return sure and all(ratio[power] >= MIN_VALIDATION_ERRORS > abs(ratio[other]) for ratio in both)


def _ratios(state: State, design: FitDesign, estimate: CoefficientEstimate, i: int) -> Iterator[dict[str, float]]:
    """Yield coefficients over their standard errors by name, of rows of the fit and of unseen ones above the crawl."""
    above, rows, others = above_crawl(design, state.both, i)
    for own, first, second in ((above, rows, others), (above.swapped(), others, rows)):
        fitted = fit(own, first, second, estimate.weights)
        ratios = fitted.theta / np.maximum(fitted.errors(), 1e-300)
        yield dict(zip(own.names, ratios.tolist(), strict=True))


def _told(state: State, estimate: CoefficientEstimate, new: Key) -> SearchResult:
    """Return what is told of a power of speed beside all other laws."""
    at = estimate.design.at(names_of(new)[0])
    without = state.without(estimate, *names_of(new), weights=estimate.weights)
    one, rms = slice(at, at + 1), (without.matched_rms, estimate.matched_rms)
    worth = float(np.nansum(np.log(rms[0]) - np.log(rms[1])))
    return SearchResult(new, names_of(new), estimate.theta[one], estimate.errors()[one], *rms, worth)


__all__ = ["better_forms"]
