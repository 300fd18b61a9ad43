"""`diagnose`, `add` and `refine`: data, both estimates, selection, verdict and report follow each other here.

| step | function | what it returns |
|---|---|---|
| data | `dataset_of` | `Dataset`: training and validation data, prepared once for both estimates |
| output error | `estimator_of`, in `evidence_of` | fits by simulation with an observer; that of the base model first |
| equation error | `estimate_equation_error`, in `evidence_of` | sets of laws, regressed on the force that is missing |
| input hold | `with_hold`, in `evidence_of` | the data and the base model again, if inputs do not act as if held |
| base held | `Evidence.grounded` | the same with base parameters held, where the forces contradict the fitted ones |
| selection | `select_model` | `Selection`: the effects that both estimates support; its steps stand in its module |
| base set free | `with_base_unheld` | both with no parameter held, if what is selected leaves more than noise |
| noise of inputs | `with_inputs_as_recorded` | `Evidence` and `Selection`, if noise of inputs acts and hid a law |
| verdict | `verdict_of` | `Verdict`: `reason_of` says which test on validation data fails, if one does |
| rivals | `discriminated` | the `Selection` between rivals of a planned experiment, where some are given |
| tolerance | `with_wider_tolerance` | both with base parameters known less well, if nothing is explained else |
| pruning | `without_untold`, `without_rounding`, `without_idle` | the `Verdict` on less: what is not decided on, is
  an offset within a sensor's step, or tells nothing goes |
| report | `summary_of` | `Diagnosis`: values, tables and sentences |

Short names that recur in this package: ``motion`` is the `OutputErrorEstimator`, ``force`` the `EquationErrorResult`,
``base`` the fit of the model as given, ``f`` a `FittedModel` (in `equation_error` a `RegressionFit`), ``g`` an
`Improvement`, ``c`` the `Criteria` (a `Candidate` where its parameters ``theta`` stand beside it), ``known`` and
``unseen`` training and validation data, ``left`` what a model leaves of the force. An effect that acts as a force along
the measured motion is a *law*: a regressor of the equation error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA, Criteria
from signlin_ros.diagnosis.dataset import Records, dataset_of
from signlin_ros.diagnosis.discrimination import PlannedRival, discriminated, refitted
from signlin_ros.diagnosis.evidence import evidence_of
from signlin_ros.diagnosis.least_absolute import by_absolute_error
from signlin_ros.diagnosis.output_error import FitCache
from signlin_ros.diagnosis.output_error.trials import trials
from signlin_ros.diagnosis.progress import Progress, Report
from signlin_ros.diagnosis.pruning import without_idle, without_rounding, without_untold
from signlin_ros.diagnosis.recorded_inputs import with_inputs_as_recorded
from signlin_ros.diagnosis.results import Diagnosis, listed
from signlin_ros.diagnosis.selection import Selection, select_model
from signlin_ros.diagnosis.summary import summary_of
from signlin_ros.diagnosis.unheld_base import with_base_unheld
from signlin_ros.diagnosis.verdict import verdict_of
from signlin_ros.diagnosis.wider_tolerance import with_wider_tolerance
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.model import Model
from signlin_ros.threads import one_thread

MAX_REFINE_EFFECTS = 6
"""Most effects that `refine` adds."""


@one_thread
def diagnose(
    model: Model,
    data: Records,
    validation: Records | None = None,
    *,
    jobs: int | None = None,
    progress: Progress | Report | None = None,
    criteria: Criteria = DEFAULT_CRITERIA,
    rivals: Sequence[PlannedRival] = (),
) -> Diagnosis:
    """Name the physical effects that a model lacks, or say that none fits, none is missing, or what cannot be told.

    data, validation: records in the model's terms (`signlin_ros.records.read_for_model`). ``jobs``: threads;
    ``progress``: who watches, may stop it and is shown every fit; a function is told of each stage, and how much of all
    is done. ``rivals``: those of a planned experiment, each is refitted from its own values and must lose before
    another law is confirmed. Raises `RecordError` for unusable records, `CancelledError` where it was stopped.
    """
    dataset, cache, watched = dataset_of(model, data, validation), FitCache(), Progress.of(progress)
    evidence = evidence_of(dataset, criteria, cache, watched, jobs)
    watched.say(
        phrases.MOTION_WITH_FORCE if evidence.equation_error and evidence.equation_error.effects else phrases.MOTION
    )
    evidence = evidence.grounded()
    selection = select_model(evidence)
    evidence, selection = with_base_unheld(evidence, selection) or (evidence, selection)
    evidence, selection = with_inputs_as_recorded(evidence, selection) or (evidence, selection)
    if rivals:
        watched.say(phrases.PLANNED_RIVALS)
        selection = discriminated(evidence, selection, refitted(evidence, rivals))
    verdict = verdict_of(evidence, selection)
    wider = with_wider_tolerance(evidence, verdict, lambda known_less: dataset_of(known_less, data, validation))
    evidence, verdict = wider or (evidence, verdict)
    verdict = without_rounding(evidence, without_untold(evidence, verdict))
    return summary_of(evidence, without_idle(evidence, verdict))


def refine(
    model: Model,
    data: Records,
    validation: Records | None = None,
    *,
    criteria: Criteria = DEFAULT_CRITERIA,
    **options: Any,
) -> Diagnosis:
    """Name up to `MAX_REFINE_EFFECTS` effects together; the last of the notes says why it stopped. See `diagnose`."""
    found = diagnose(model, data, validation, criteria=replace(criteria, max_effects=MAX_REFINE_EFFECTS), **options)
    if model.plant.closed_loop:
        found = by_absolute_error(found, model, dataset_of(model, data, validation).training.parts)
    added = len(found.ladder[-1].effects)
    note = phrases.stopped(added, MAX_REFINE_EFFECTS, found.verdict != "unexplained")
    return replace(found, notes=(*found.notes, note))


@one_thread
def add(
    effect: str,
    model: Model,
    data: Records,
    validation: Records | None = None,
    *,
    jobs: int | None = None,
    progress: Progress | Report | None = None,
    criteria: Criteria = DEFAULT_CRITERIA,
) -> Diagnosis:
    """Add an effect and fit it, whatever it is worth; as `diagnose`. Raises `InputError` where it cannot be added."""
    dataset, cache, watched = dataset_of(model, data, validation), FitCache(), Progress.of(progress)
    trials(dataset.training, [effect])  # raises what is told above, before anything is fitted
    evidence = evidence_of(dataset, criteria, cache, watched, jobs)
    watched.say(f"{phrases.MOTION} with {listed([effect])}")
    evidence = evidence.grounded()
    alone, force = evidence.laws.get(effect), evidence.equation_error
    final = evidence.output_error.fitted([effect], force.with_laws(alone) if force and alone else None)
    evidence.cache.keep(final)
    return summary_of(evidence, verdict_of(evidence, Selection(evidence.with_better_values(final), asked=effect)))


__all__ = ["add", "diagnose", "refine"]
