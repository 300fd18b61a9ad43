"""`diagnose`, `add` and `refine`: the chapters of docs/decisions/0006 in their order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count

from signlin_ros.diagnosis.agreement import Agreed, agree
from signlin_ros.diagnosis.case import case
from signlin_ros.diagnosis.criteria import DEFAULT, Criteria
from signlin_ros.diagnosis.first_rows import Records, Seen, force_witness, motion_witness
from signlin_ros.diagnosis.force.witness import Testimony
from signlin_ros.diagnosis.judgement import judge
from signlin_ros.diagnosis.measures import with_laws
from signlin_ros.diagnosis.motion import Fitted, Motion
from signlin_ros.diagnosis.results import Diagnosis
from signlin_ros.diagnosis.told import told
from signlin_ros.diagnosis.witnesses import Witnesses
from signlin_ros.effects import EFFECTS, find_effect
from signlin_ros.errors import InputError, SignlinError
from signlin_ros.model import Model
from signlin_ros.threads import one_thread

Progress = Callable[[str, float], None]
MOST = 6
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
    criteria: Criteria = DEFAULT,
) -> Diagnosis:
    """Name the physical effects that a model lacks, or say that none fits, none is missing, or what cannot be told.

    data, validation: records in the model's terms (`signlin_ros.records.read_for_model`); without validation the last
    third of every record is held out. ``jobs``: threads; ``progress``: told of what is done, and how much of all;
    ``cancelled``: asked whether to stop, which raises `CancelledError`; ``seen``: told, from any thread, of every model
    that was fitted, and of what the force witness found. Raises `RecordError` for records that cannot be used.
    """
    prepared = case(model, data, validation)
    tell = _stages(progress)
    motion = motion_witness(prepared, jobs, tell, cancelled, criteria, seen)
    force = force_witness(prepared, motion, tell, criteria, seen)
    tell("motion with what the force shows" if force and force.effects else "motion")
    agreed = agree(Witnesses(motion, force, criteria), criteria.most)
    return told(judge(prepared, agreed, criteria))


def refine(
    model: Model,
    data: Records,
    validation: Records | None = None,
    *,
    jobs: int | None = None,
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
    seen: Seen | None = None,
    criteria: Criteria = DEFAULT,
) -> Diagnosis:
    """Name up to `MOST` effects together; the last of the notes says why it stopped. See `diagnose`."""
    found = diagnose(
        model,
        data,
        validation,
        jobs=jobs,
        progress=progress,
        cancelled=cancelled,
        seen=seen,
        criteria=replace(criteria, most=MOST),
    )
    added = len(found.ladder[-1].effects)
    end = "nothing else that is listed lowers the error on unseen data beyond doubt"
    end = f"{MOST} effects are the most" if added >= MOST else end
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
    over: Sequence[str] = (),
    jobs: int | None = None,
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
    seen: Seen | None = None,
    criteria: Criteria = DEFAULT,
) -> Diagnosis:
    """Add an effect and fit it, whatever it is worth: the ranking has it, the ladder before and after.

    Arguments as in `diagnose`; ``over``: coordinates of a `learned_force`. Raises `ModelError` for an unknown effect,
    `InputError` where it cannot be added.
    """
    find_effect(effect, "effect")
    prepared = case(model, data, validation)
    _check_addable(prepared.model, effect)
    tell = _stages(progress)
    motion = motion_witness(prepared, jobs, tell, cancelled, criteria, seen)
    force = force_witness(prepared, motion, tell, criteria, seen)
    tell(f"motion with {effect.replace('_', ' ')}")
    final = _asked(motion, force, effect)
    agreed = Agreed(Witnesses(motion, force, criteria, [final]), final)  # asked for
    return told(judge(prepared, agreed, criteria), asked=effect)


def _stages(progress: Progress | None) -> Callable[[str], None]:
    """Return what tells of stages: how many there are shows on the way, so each is a fifth of what is left."""
    shares = (1.0 - 0.8**n for n in count())
    return (lambda what: progress(what, next(shares))) if progress else (lambda what: None)


def _check_addable(model: Model, effect: str) -> None:
    """Raise `InputError` where an effect cannot be added to a model."""
    if any(use.type == effect for use in model.effects.values()) and not EFFECTS[effect].periodic:
        raise InputError(f"effect {effect!r} cannot be added: the model has it already")
    try:
        model.with_effect(effect, "asked").states  # noqa: B018  tracing tells
    except SignlinError as error:
        why = f"it does not apply to {model.plant.name}"
        raise InputError(f"effect {effect!r} cannot be added: {why}") from error


def _asked(motion: Motion, force: Testimony | None, effect: str) -> Fitted:
    """Return the fit with an effect, started from what the force witness found of it."""
    fit = force.search.models.get(frozenset({effect})) if force else None
    start = with_laws(force, fit) if force and fit else None
    return motion.fitted([effect], start)


__all__ = ["add", "diagnose", "refine"]
