"""Efforts that are recorded late or in another size, positions from another zero: put right, and what is told then.

A delay, a gain, a zero and a tilt of the base are faults of the record, or of the file, not of the arm. Once told, the
model's file has them (a zero, its URDF), and all else is said of efforts as they acted, at the positions where they
did.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.ahead import Ahead, Witness, ahead, compared
from signlin_ros.arms.data import ArmRun, resized, shifted, with_delays, with_gains
from signlin_ros.arms.gravity import settled_tilt
from signlin_ros.arms.keys import DELAY, GAIN, TILT, ZERO, Key, SearchResult, names_of
from signlin_ros.arms.search import MIN_COEFFICIENT_ERRORS
from signlin_ros.arms.zeros import settled_zeros
from signlin_ros.model.arm import ArmModel

if TYPE_CHECKING:
    from signlin_ros.arms.verbs import ArmDiagnosis

Array = NDArray[np.float64]
Runs = tuple[Sequence[ArmRun], Sequence[ArmRun]]
FAULTS = {
    ZERO: "positions are counted from the encoders' zeros",
    TILT: "gravity is turned",
    DELAY: "efforts are put in time",
    GAIN: "efforts are put in their sizes",
}
"""Laws that are faults of a record, in the order in which they are taken out, and what is done."""


@dataclass(frozen=True, eq=False)
class Fault:
    """A diagnosis that told faults of one kind, and the laws that are them."""

    diagnosis: ArmDiagnosis
    laws: tuple[SearchResult, ...]


def faults(diagnosis: ArmDiagnosis, law: str) -> tuple[SearchResult, ...]:
    """Return the faults of one kind that a diagnosis tells and that a model file can hold."""
    return tuple(f for f in diagnosis.found if f.key.law == law and _held(diagnosis, f))


def _held(diagnosis: ArmDiagnosis, fault: SearchResult) -> bool:
    """Tell whether a model file can hold a fault: of gains, those of one joint that beyond doubt show what acts.

    Both efforts of a motor that turns two joints are of its gain.
    """
    if fault.key.law != GAIN:
        return True
    at_motor = _at_motor(diagnosis)
    return shows(float(fault.values[0]), float(fault.errors[0])) and not at_motor[fault.key.at]


def shows(gain: float, error: float) -> bool:
    """Tell whether an effort whose gain is off by a part, with its standard error, shows what acts beyond doubt."""
    return abs(1.0 + gain) > MIN_COEFFICIENT_ERRORS * error


def _at_motor(diagnosis: ArmDiagnosis) -> Sequence[bool]:
    """Return which joints' efforts are those of motors that turn others, too (n,)."""
    model = diagnosis.comparison.study.model
    return model.arm_plant.at_motor


def delays(diagnosis: ArmDiagnosis) -> Array:
    """Return by how many seconds the joints' efforts are recorded later than the motion (n,)."""
    found = np.zeros(diagnosis.state.robot.n)
    for law in faults(diagnosis, DELAY):
        found[slice(None) if law.key.at < 0 else law.key.at] += law.values[0]
    return found


def shown(laws: Sequence[SearchResult], n: int) -> Array:
    """Return how many times what acts the efforts of n joints show, by the gains that were found (n,)."""
    found = np.ones(n)
    for law in (law for law in laws if law.key.law == GAIN):
        found[law.key.at] += law.values[0]
    return found


def put_right(diagnosis: ArmDiagnosis, law: str) -> tuple[ArmModel, Runs, Sequence[SearchResult]]:
    """Return model and records of a diagnosis without its faults of one kind, and these: the model's file says them."""
    study, laws = diagnosis.comparison.study, faults(diagnosis, law)
    known, unseen = study.runs
    if law == ZERO:
        model, settled = settled_zeros(study, diagnosis.state, laws)
        return model, study.runs, settled
    if law == TILT:
        model, tilt = settled_tilt(study, diagnosis.state, laws[0])
        return model, study.runs, [tilt]
    if law == DELAY:
        late = delays(diagnosis)
        runs = [shifted(r, late) for r in known], [shifted(r, late) for r in unseen]
        return with_delays(study.model, late), runs, laws
    gains = shown(laws, study.robot.n)
    return (
        with_gains(study.model, gains),
        ([resized(r, gains) for r in known], [resized(r, gains) for r in unseen]),
        laws,
    )


def not_again(diagnosis: ArmDiagnosis, law: str) -> frozenset[Key]:
    """Return the laws that efforts which were put right are not asked for again."""
    if law in (ZERO, TILT):
        return frozenset(fault.key for fault in faults(diagnosis, law))
    at_motor = _at_motor(diagnosis)
    every = range(-1 if law == DELAY else 0, len(at_motor))
    kept = {f.key for f in diagnosis.found if f.key.law == law and not _held(diagnosis, f)}
    return frozenset(Key(law, i) for i in every if not (law == GAIN and at_motor[i])) - kept


def unmade(diagnosis: ArmDiagnosis, right: ArmDiagnosis, law: str) -> frozenset[Key]:
    """Return the zeros of a diagnosis that are none: bodies are no nearer the URDF's at positions counted from them.

    They are found by the first term of a series; only counting in earnest tells. ``right`` is the diagnosis of that.
    """
    if law != ZERO:
        return frozenset()
    laws = faults(diagnosis, law)
    without = diagnosis.state.without(diagnosis.estimate, *(name for fault in laws for name in fault.names))
    return frozenset() if right.estimate.tension < without.tension else frozenset(fault.key for fault in laws)


def told_with(diagnosis: ArmDiagnosis, before: Sequence[Fault]) -> ArmDiagnosis:
    """Return a diagnosis of efforts that were put right, with the faults that they had, and figures as before.

    Figures of a joint whose gain was off are all in N·m (N) of what acts.
    """
    if not before:
        return diagnosis
    assert diagnosis.ahead is not None  # noqa: S101 - for the type checker
    whole, first = diagnosis.ahead[1], before[0].diagnosis
    laws = [law for fault in before for law in fault.laws]
    sizes = np.abs(shown(laws, diagnosis.state.robot.n))
    given = {row: getattr(first.comparison.table, row) / sizes for row in ("as_given", "rigid", "basic")}
    table = replace(diagnosis.comparison.table, **given)
    told = [(_resized(law, sizes), _foretold(fault, law, whole)) for fault in before for law in fault.laws]
    told += list(zip(diagnosis.found, diagnosis.witnesses, strict=False))
    order = [law.key for law in first.found]
    told.sort(key=lambda pair: order.index(pair[0].key) if pair[0].key in order else len(order))
    missing = diagnosis.witnesses[len(diagnosis.found) :]
    return replace(
        diagnosis,
        comparison=replace(diagnosis.comparison, table=table),
        ahead=(_without(before[0], [name for key, _ in first.state.terms for name in names_of(key)]), whole),
        found=tuple(law for law, _ in told),
        witnesses=(*(witness for _, witness in told), *missing),
    )


def _resized(law: SearchResult, sizes: Array) -> SearchResult:
    return replace(law, before=law.before / sizes, after=law.after / sizes)


def _foretold(fault: Fault, law: SearchResult, whole: Ahead) -> Witness | None:
    """Return what short forward simulations say of a fault: without it, and of all that was found at last."""
    return compared(_without(fault, law.names), whole, law.key.at)


def _without(fault: Fault, names: Sequence[str]) -> Ahead:
    """Return how well velocities are foretold from efforts as they were recorded, without some columns."""
    state = fault.diagnosis.state
    return ahead(state, state.without(fault.diagnosis.estimate, *names))


__all__ = ["FAULTS", "Fault", "delays", "faults", "not_again", "put_right", "shown", "shows", "told_with", "unmade"]
