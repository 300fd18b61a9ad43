"""Every law of the catalogue by itself, fitted by simulation, before more than one of them is named.

A search that adds law to law may miss the single law that suffices. So each is fitted from all its starts; those that
gain too little after a few steps are given up.
"""

from __future__ import annotations

import contextlib

from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import InputError

MIN_GAIN_SHARE, MIN_FAMILY_SHARE = 0.5, 1.0
"""Share of what a proposal gains that a law must gain by itself, and that one of its family in its place must, to be
fitted to the end.
"""


def explains_to_noise(evidence: Evidence, f: FittedModel) -> bool:
    """Tell whether a model's residual is noise over windows too, with no base parameter far from nominal."""
    return evidence.near_any_noise(f) and f.residual_is_noise and not f.far_from_nominal(evidence.criteria)


def unidentified(evidence: Evidence) -> dict[str, str]:
    """Return the single laws that leave only noise, and why the records do not identify them all the same."""
    fits = [f for f in evidence.single_effect_fits if explains_to_noise(evidence, f)]
    return {f.effects[0]: why for f in fits if (why := evidence.output_error.not_identifiable(f))}


def needs_no_search(evidence: Evidence, f: FittedModel) -> bool:
    """Tell whether a model has one law at most and leaves only noise: then no other law is fitted."""
    return len(f.effects) < 2 and explains_to_noise(evidence, f)


def fit_every_law(evidence: Evidence, now: FittedModel) -> list[FittedModel]:
    """Return the fits of single laws that come near a proposal ``now``, or the best where there is none."""
    names = [n for n in EFFECTS if n in evidence.output_error.candidates - evidence.cache.from_all_starts]
    evidence.cache.keep(*_extended(evidence, evidence.base, names, now, MIN_GAIN_SHARE))
    return evidence.single_effect_fits


def fit_families(evidence: Evidence, final: FittedModel) -> list[FittedModel]:
    """Return fits of a proposal with another law of the same family in the place of one."""
    found = list[FittedModel]()
    for name in final.effects if len(final.effects) > 1 else ():
        family = EFFECTS[name].family
        kin = [n for n, effect in EFFECTS.items() if family and effect.family == family and n not in final.effects]
        kin = [n for n in kin if n in evidence.output_error.candidates]
        with contextlib.suppress(InputError):  # without it the motion diverges
            rest = evidence.output_error.fitted([n for n in final.effects if n != name], final.model)
            found += _extended(evidence, rest, kin, final, MIN_FAMILY_SHARE)
    evidence.cache.keep(*found)
    return found


def _extended(
    evidence: Evidence, of: FittedModel, names: list[str], rival: FittedModel, share: float
) -> list[FittedModel]:
    return evidence.output_error.extensions(of, names, rival if rival.effects else None, share) if names else []


__all__ = ["explains_to_noise", "fit_every_law", "fit_families", "needs_no_search", "unidentified"]
