"""Rows of the tables: what a model leaves of motion and force. Of the same files all verbs have the same first rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.output_error.score import of_windows
from signlin_ros.diagnosis.results import FirstRows, LadderRow, Scores

Array = NDArray[np.float64]


def force_left(evidence: Evidence, f: FittedModel, final: FittedModel) -> Array | None:
    """Return the mean squared force (blocks,) left of validation data: by the proposal as written, else at best; of one
    that delays its input, as the delayed input leaves it, if that is seen above the noise.
    """
    left = evidence.force_mse_as_written(f) if f is final and f.effects else evidence.force_mse(f)
    if left is None:
        left = evidence.force_mse_delayed(f)
        return left if left is not None and float(np.mean(left)) > evidence.visible_force_mse else None
    return left


def force_percent(evidence: Evidence, f: FittedModel, final: FittedModel) -> float | None:
    """Return that force in per cent of the effort (RMS)."""
    return evidence.percent_of_effort(force_left(evidence, f, final))


def shown_percent(evidence: Evidence, f: FittedModel, left: Array | None) -> float | None:
    """Return the force (blocks,) that a fit leaves in per cent of the effort; None of effects where the base leaves
    less than the noise.
    """
    base = evidence.force_mse(evidence.base) if f.effects else None
    if base is not None and float(np.mean(base)) < evidence.force_noise_mse:
        return None
    return evidence.percent_of_effort(left)


def row(evidence: Evidence, f: FittedModel, left: Array | None) -> LadderRow:
    """Return the row of a fit; ``left``: the mean squared force (blocks,) that it leaves of validation data."""
    dataset, noise = evidence.dataset, np.array(list(evidence.dataset.noise.values()))
    sides = ((dataset.training, f.training_squares), (dataset.validation, f.validation_squares))
    training, validation = (Scores(of_windows(problem, squares, noise)) for problem, squares in sides)
    force, floor = shown_percent(evidence, f, left), evidence.force_noise_percent
    return LadderRow(f.effects, training, validation, force, floor if evidence.equation_error else None)


def first_rows(evidence: Evidence) -> FirstRows:
    """Return the rows of the model as given and of its base refitted."""
    given, base = evidence.output_error.unfitted, evidence.base
    as_given = row(evidence, given, evidence.force_mse_as_written(given))
    return FirstRows(as_given, row(evidence, base, evidence.force_mse(base)), evidence.dataset.horizon)


__all__ = ["first_rows", "force_left", "force_percent", "row", "shown_percent"]
