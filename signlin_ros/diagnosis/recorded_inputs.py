"""Noise of an input that acts on the plant, as that of a controller does: then inputs are known as they were recorded.

Observers allow for noise that inputs show (`signlin_ros.fitting.problem`), since most is a meter's; beside that, what a
small law leaves may pass for noise. So where a model leaves noise for that reason alone, one law more is sought with
inputs as recorded: if it leaves but the sensors' noise, which inputs known badly do not allow, they are known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from signlin_ros.diagnosis.dataset import Dataset
from signlin_ros.diagnosis.evidence import Evidence, equation_error_of
from signlin_ros.diagnosis.output_error import FitCache, estimator_of
from signlin_ros.diagnosis.preference import simplest
from signlin_ros.diagnosis.selection import Selection
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.errors import InputError, SimulationError


def with_inputs_as_recorded(evidence: Evidence, selection: Selection) -> tuple[Evidence, Selection] | None:
    """Return both estimates with inputs as recorded, and what leaves but the sensors' noise then: the selected model
    with one law more, or one of several laws as it is. None where inputs show no noise, the selection leaves more than
    noise, or is one law that leaves but noise so, too, or where no law more does.
    """
    chosen, motion = selection.chosen, evidence.output_error
    allows = evidence.dataset.training.allows_for_input_noise
    if not allows or selection.conflict or not chosen.white or len(chosen.effects) >= evidence.criteria.max_effects:
        return None
    dataset = _as_recorded(evidence.dataset)
    try:
        exact = estimator_of(
            dataset.training, dataset.validation, motion.criteria, FitCache(), motion.progress, motion.jobs
        )
        same = exact.fitted(chosen.effects, chosen.model)
    except (InputError, SimulationError):
        return None
    recorded = Evidence(dataset, exact, None)
    if recorded.explains_to_noise(same):  # what each of several laws is worth is told best there
        return (_with_force(recorded), Selection(same)) if len(chosen.effects) > 1 else None
    options = [f for f in exact.extensions(same, sorted(exact.candidates)) if recorded.explains_to_noise(f)]
    options = [f for f in options if not exact.refusal(same, f) and not exact.refusal(exact.base, f)]
    found = simplest(recorded, options)
    if found is None:
        return None
    exact.cache.keep(same, *options)
    return _with_force(recorded), Selection(found)


def _as_recorded(dataset: Dataset) -> Dataset:
    """Return the same data with inputs that are known, and a note on them: their noise acts on the plant."""
    noisy = np.array(dataset.training.base.inputs)[dataset.training.input_noise > 0.0].tolist()
    training, validation = (one.with_inputs_as_recorded() for one in (dataset.training, dataset.validation))
    training = replace(training, notes=(*training.notes, phrases.inputs_as_recorded(noisy)))
    return replace(dataset, training=training, validation=validation)


def _with_force(evidence: Evidence) -> Evidence:
    """Return the same with the equation-error estimate."""
    dataset, motion = evidence.dataset, evidence.output_error
    force = equation_error_of(dataset.knowing(motion.own_values), motion.criteria, motion.progress)
    return replace(evidence, equation_error=force)


__all__ = ["with_inputs_as_recorded"]
