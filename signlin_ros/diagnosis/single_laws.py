"""Every law of the catalogue by itself, fitted by simulation, before more than one of them is named; and other laws in
the place of those of a proposal.

A search that adds law to law may miss the single law that suffices. So each is fitted from all its starts; those that
gain too little after a few steps are given up.
"""

from __future__ import annotations

import contextlib

from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.preference import sufficient_law
from signlin_ros.effects import EFFECTS, SensorEffect, kin_of
from signlin_ros.errors import InputError

MIN_GAIN_SHARE, MIN_FAMILY_SHARE = 0.5, 1.0
"""Share of what a proposal gains that a law must gain by itself, and that one of its family in its place must, to be
fitted to the end.
"""


def search_single_laws(evidence: Evidence, proposal: FittedModel) -> FittedModel | None:
    """Fit every law by itself, and return the one that leaves only noise; None where none does, or where a proposal
    leaves no more.
    """
    if evidence.explains_to_noise(proposal):
        return None
    fit_every_law(evidence, proposal)
    return sufficient_law(evidence, proposal)


def fit_alternatives(evidence: Evidence, proposal: FittedModel) -> list[FittedModel]:
    """Return fits of other laws in the place of a proposal that leaves more than noise, or has several laws: every law
    by itself, others of the same family, and what leaves noise with the base parameters free.
    """
    if evidence.needs_no_search(proposal):
        return []
    options = fit_every_law(evidence, proposal)
    options += [] if evidence.explains_to_noise(proposal) else fit_families(evidence, proposal)
    return options + fit_released(evidence, proposal)


def fit_every_law(evidence: Evidence, proposal: FittedModel) -> list[FittedModel]:
    """Return the fits of single laws that come near a proposal, or the best where there is none."""
    names = [name for name in EFFECTS if name in evidence.output_error.candidates - evidence.cache.from_all_starts]
    evidence.cache.keep(*_extended(evidence, evidence.base, names, proposal, MIN_GAIN_SHARE))
    return evidence.single_effect_fits


def fit_families(evidence: Evidence, proposal: FittedModel) -> list[FittedModel]:
    """Return fits of a proposal with another law of the same family in the place of one: the known ones, and others
    that come near the best.
    """
    options, known = list[FittedModel](), {frozenset(f.effects): f for f in evidence.cache.best.values()}
    for name in proposal.effects if len(proposal.effects) > 1 else ():
        kept = [n for n in proposal.effects if n != name]
        kin = [n for n in kin_of(name) if n in evidence.output_error.candidates and n not in proposal.effects]
        others = {n: known.get(frozenset((*kept, n))) for n in kin}
        options += [f for f in others.values() if f]
        names = [n for n, f in others.items() if f is None]
        with contextlib.suppress(InputError):  # without it the motion diverges
            rest = evidence.output_error.fitted(kept, proposal.model)
            options += _extended(evidence, rest, names, proposal, MIN_FAMILY_SHARE)
    evidence.cache.keep(*options)
    return options


def fit_sensor_errors(evidence: Evidence, proposal: FittedModel) -> None:
    """Fit an error of the force sensor in the place of each law of a proposal, for ties, where the motion is imposed:
    the force is an output then, and its sensor's zero moves it as a load does.
    """
    names = [n for n in EFFECTS if issubclass(EFFECTS[n], SensorEffect) and n in evidence.output_error.candidates]
    for effect in proposal.effects if evidence.dataset.plant.motion_is_imposed() else ():
        rest = [n for n in proposal.effects if n != effect]
        for name in (n for n in names if n not in rest):
            with contextlib.suppress(InputError):  # without the law what is left of others diverges
                evidence.cache.keep(evidence.output_error.fitted([*rest, name], proposal.model))


def fit_ties(evidence: Evidence, proposal: FittedModel) -> None:
    """Fit the laws by simulation that forces do not tell from one of a proposal, each in its place, from what the force
    shows of it: below their cut-off forces may look alike that the motion tells apart.
    """
    force = evidence.equation_error
    if force is None or set(force.effects) != set(proposal.effects):
        return
    for effect, ties in force.ties.items():
        for found in force.replacements[effect]:
            names = tuple(n for n in ties if n in found.names and n in evidence.output_error.candidates)
            with contextlib.suppress(InputError):  # the motion that it makes diverges
                for name in names:
                    rest = [n for n in proposal.effects if n != effect]
                    evidence.cache.keep(evidence.output_error.fitted([*rest, name], force.with_laws(found)))
                    evidence.output_error.progress.check()


def fit_released(evidence: Evidence, proposal: FittedModel) -> list[FittedModel]:
    """Return the best single effect, and a proposal, with base parameters free that were held at what forces tell of
    them, where that leaves noise: forces were read beside the law that they found first.
    """
    if evidence.unheld is None:
        return []
    best = min(evidence.single_effect_fits, key=lambda f: f.log_mse, default=proposal)
    fits = [evidence.unheld.fitted(f.effects, f.model) for f in (best, proposal) if f.effects]
    options = [f for f in fits if evidence.explains_to_noise(f)]
    evidence.cache.best.update({f.kind: f for f in options})
    evidence.cache.keep(*options)
    return options


def _extended(
    evidence: Evidence, of: FittedModel, names: list[str], rival: FittedModel, share: float
) -> list[FittedModel]:
    return evidence.output_error.extensions(of, names, rival if rival.effects else None, share) if names else []


__all__ = [
    "fit_alternatives",
    "fit_every_law",
    "fit_families",
    "fit_released",
    "fit_sensor_errors",
    "fit_ties",
    "search_single_laws",
]
