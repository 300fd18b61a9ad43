"""`diagnose`, `add` and `refine`: the chapters of docs/decisions/0006 in their order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count
from typing import Any

from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA, Criteria
from signlin_ros.diagnosis.dataset import Records, dataset_of
from signlin_ros.diagnosis.discrimination import PlannedRival, discriminated, refitted
from signlin_ros.diagnosis.evidence import Seen, Tell, evidence_of
from signlin_ros.diagnosis.output_error.trials import trials
from signlin_ros.diagnosis.parts import without_idle
from signlin_ros.diagnosis.results import Diagnosis, listed
from signlin_ros.diagnosis.selection import select_model
from signlin_ros.diagnosis.summary import summary_of
from signlin_ros.diagnosis.verdict import Verdict, verdict_of
from signlin_ros.model import Model
from signlin_ros.threads import one_thread

Progress = Callable[[str, float], None]
MAX_REFINE_EFFECTS = 6
"""Most effects that `refine` adds."""


@one_thread
def diagnose(
    model: Model,
    data: Records,
    validation: Records | None = None,
    *,
    jobs: int | None = None,
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
    seen: Seen | None = None,
    criteria: Criteria = DEFAULT_CRITERIA,
    rivals: Sequence[PlannedRival] = (),
) -> Diagnosis:
    """Name the physical effects that a model lacks, or say that none fits, none is missing, or what cannot be told.

    data, validation: records in the model's terms (`signlin_ros.records.read_for_model`). ``jobs``: threads;
    ``progress``: told of what is done, and how much of all; ``cancelled``: asked whether to stop, which raises
    `CancelledError`; ``seen``: told, from any thread, of every fit; ``rivals``: those of a planned experiment, each is
    refitted from its own values and must lose before another law is confirmed. Raises `RecordError` for unusable
    records.
    """
    prepared, tell = dataset_of(model, data, validation), _stages(progress)
    both = evidence_of(prepared, criteria, tell, jobs, cancelled, seen)
    tell("motion with what the force shows" if both.force and both.force.effects else "motion")
    both = both.grounded()
    selected = select_model(both)
    if rivals:
        tell("rivals of the plan")
        both.rivals = refitted(both, rivals)
        selected = discriminated(both, *selected)
    return summary_of(without_idle(verdict_of(both, *selected)))


def refine(
    model: Model,
    data: Records,
    validation: Records | None = None,
    *,
    criteria: Criteria = DEFAULT_CRITERIA,
    **options: Any,
) -> Diagnosis:
    """Name up to `MAX_REFINE_EFFECTS` effects together; the last of the notes says why it stopped. See `diagnose`."""
    found = diagnose(model, data, validation, criteria=replace(criteria, most=MAX_REFINE_EFFECTS), **options)
    added = len(found.ladder[-1].effects)
    end = "nothing else that is listed lowers the error on validation data beyond doubt"
    end = f"{MAX_REFINE_EFFECTS} effects are the most" if added >= MAX_REFINE_EFFECTS else end
    end = "the records are not explained, see the verdict" if found.verdict == "unexplained" else end
    note = f"stopped after {added} effect{'' if added == 1 else 's'}: {end}"
    return replace(found, notes=(*found.notes, note))


@one_thread
def add(
    effect: str,
    model: Model,
    data: Records,
    validation: Records | None = None,
    *,
    jobs: int | None = None,
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
    seen: Seen | None = None,
    criteria: Criteria = DEFAULT_CRITERIA,
) -> Diagnosis:
    """Add an effect and fit it, whatever it is worth; as `diagnose`. Raises `InputError` where it cannot be added."""
    prepared, tell = dataset_of(model, data, validation), _stages(progress)
    trials(prepared.problem, [effect])  # raises what is told above, before anything is fitted
    both = evidence_of(prepared, criteria, tell, jobs, cancelled, seen)
    tell(f"motion with {listed([effect])}")
    both = both.grounded()
    alone, force = both.laws.get(effect), both.force
    final = both.motion.fitted([effect], force.with_laws(alone) if force and alone else None)
    both.keep(final)
    return summary_of(Verdict(both, both.valued(final), asked=effect))


def _stages(progress: Progress | None) -> Tell:
    """Return what tells of stages: how many there are shows on the way, so each is a fifth of what is left."""
    shares = (1.0 - 0.8**n for n in count())
    return (lambda what: progress(what, next(shares))) if progress else (lambda what: None)


__all__ = ["add", "diagnose", "refine"]
