"""Base parameters of which nobody said how well they are known, taken as known less well where that explains more."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from signlin_ros.diagnosis.blocks import BlockChange
from signlin_ros.diagnosis.dataset import Dataset
from signlin_ros.diagnosis.evidence import Evidence, equation_error_of, evidence_of
from signlin_ros.diagnosis.output_error import FitCache
from signlin_ros.diagnosis.selection import select_model
from signlin_ros.diagnosis.verdict import Verdict, verdict_of
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.model import Model
from signlin_ros.model.options import DEFAULT_TOLERANCE

WIDER = 0.5
"""Relative tolerance of base parameters then: of a friction that was fitted together with what is missing."""
MAX_SHARE_LEFT = 0.5
"""Largest share of the squared force that may be left then."""


def with_wider_tolerance(
    evidence: Evidence, verdict: Verdict, prepare: Callable[[Model], Dataset]
) -> tuple[Evidence, Verdict] | None:
    """Return both estimates and the verdict with base parameters known to within `WIDER`; None where the model says how
    well they are known, where the records are explained, where the base fitted by itself is not at its nominal values,
    where rivals of a plan are held against each other, or where that leaves not surely less of the force.

    A nominal value that was fitted to a record holds a part of what is missing: dry friction makes a viscous friction
    that is fitted without it twice as large. So nominal values are taken to be where the base fits by itself. Whether
    it is worth another selection, the equation error tells first.
    """
    model, criteria, progress = evidence.dataset.model, evidence.criteria, evidence.output_error.progress
    before = evidence.force_mse(verdict.final)
    if model.tolerance != DEFAULT_TOLERANCE or verdict.label != "unexplained" or before is None:
        return None
    if evidence.base.far_from_nominal(criteria) or verdict.selection.rivals:
        return None
    dataset = replace(prepare(model.with_options(tolerance=WIDER)), given=evidence.dataset.given)
    force = equation_error_of(dataset, criteria, progress)
    if force is None or not force.effects:
        return None
    seen = force.validation.mse_by_block(force.fit.validation_residual)
    if not BlockChange(before, seen).falls_to(MAX_SHARE_LEFT, criteria.min_t):
        return None
    progress.say(phrases.WIDER_TOLERANCE)
    other = evidence_of(dataset, criteria, FitCache(), progress, evidence.output_error.jobs)
    selection = select_model(other)
    after = other.force_mse(selection.chosen)
    if after is None or not BlockChange(before, after).falls_to(MAX_SHARE_LEFT, criteria.min_t):
        return None
    note = phrases.wider_tolerance(DEFAULT_TOLERANCE, WIDER)
    training = replace(other.dataset.training, notes=(*other.dataset.training.notes, note))
    other = replace(other, dataset=replace(other.dataset, training=training))
    return other, verdict_of(other, selection)


__all__ = ["with_wider_tolerance"]
