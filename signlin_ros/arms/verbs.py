"""`compare`, `diagnose`, `add` and `refine` of an arm."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.ahead import WINDOW, Ahead, Witness, ahead, witnesses
from signlin_ros.arms.coupling import (
    Ratio,
    at_joints,
    coupled_model,
    find_coupling,
    find_coupling_of_efforts,
    settled_ratios,
)
from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.detectable import detectable
from signlin_ros.arms.distance import BodyDistance, body_distance
from signlin_ros.arms.drift import Drift, drift
from signlin_ros.arms.faults import FAULTS, Fault, faults, not_again, put_right, shows, told_with, unmade
from signlin_ros.arms.fit import CoefficientEstimate, blocks, fit
from signlin_ros.arms.forms import better_forms
from signlin_ros.arms.heavier import Heaviness, heaviness
from signlin_ros.arms.heldout import MIN_VALIDATION_ERRORS
from signlin_ros.arms.keys import GAIN, SEEN_ELSEWHERE, Key, SearchResult, names_of
from signlin_ros.arms.laws import BY_EFFECT, JointLaw, shapes
from signlin_ros.arms.loaded import Loaded, loaded
from signlin_ros.arms.notes import paying
from signlin_ros.arms.proposal import Proposal, proposal
from signlin_ros.arms.relief import Relief, relief
from signlin_ros.arms.reversals import band_of_reversals, of_reversals
from signlin_ros.arms.rivals import rivals_left
from signlin_ros.arms.search import MIN_COEFFICIENT_ERRORS, MIN_VALIDATION_SHARE, State, search, settled
from signlin_ros.arms.settling import settling
from signlin_ros.arms.shape import shaped
from signlin_ros.arms.study import LINK_SIDE, Study, study
from signlin_ros.arms.warmth import Warmth, sources_of, warmth
from signlin_ros.arms.ways import asked, in_effort_time, lateness
from signlin_ros.effects import find_effect
from signlin_ros.errors import ModelError, choices, suggest
from signlin_ros.model.arm import ArmModel
from signlin_ros.plants.arm import parted
from signlin_ros.threads import one_thread

Array = NDArray[np.float64]
Progress = Callable[[str], None]
SETTLING_ROUNDS = 3
"""Times that joints are looked at for friction that sets in over a distance."""
ROTOR, FRICTIONLESS = 2.0, 0.1
"""Standard errors above nothing that a motor's inertia needs to be seen in an effort; part of all efforts that friction
of motors with gears is at least."""


@dataclass(frozen=True, eq=False)
class JointTable:
    """RMS of what is left of unseen rows (n,): URDF as given, rigid body refitted, basic friction, model."""

    as_given: Array
    rigid: Array
    basic: Array
    model: Array


@dataclass(frozen=True, eq=False)
class ArmComparison:
    """How good a model of an arm is; ``basic`` fitted to the rows of the fit, ``all_data`` to unseen ones, too.

    ``matched``: RMS (n,) of what is left of unseen rows where friction differs between records, and is as it was there.
    ``bodies``: how far those that the rows ask for are from the URDF's, beside all laws of the model.
    """

    study: Study
    table: JointTable
    basic: CoefficientEstimate
    all_data: CoefficientEstimate
    bodies: BodyDistance
    matched: Array | None = None


@dataclass(frozen=True, eq=False)
class MissingLaw:
    """An effect of everybody's that the file leaves out of a joint: unseen RMS (n,) without it and with it."""

    joint: int
    effect: str
    value: float
    error: float
    before: Array
    after: Array


@dataclass(frozen=True, eq=False)
class ArmDiagnosis:
    """What is missing: laws, couplings, effects that the file leaves out, and the model that is proposed.

    ``ratios``: of couplings that were found; ``detectable``: the smallest coefficients of laws that these records would
    show. ``ahead``: velocities foretold over short windows by basic friction and by what is proposed; ``witnesses``:
    what those say of ``found`` and ``missing``; ``relief``: what efforts behind the gears show beside bodies that
    exist, which is in the model that is proposed; ``heaviness``: how many times as heavy as in the URDF bodies are.
    """

    comparison: ArmComparison
    state: State
    estimate: CoefficientEstimate
    found: tuple[SearchResult, ...]
    missing: tuple[MissingLaw, ...]
    ratios: tuple[Ratio, ...]
    proposal: Proposal
    payload: dict[str, tuple[float, float, str]] = field(default_factory=dict)
    only_payload: bool = False
    detectable: dict[Key, float] = field(default_factory=dict)
    ahead: tuple[Ahead, Ahead] | None = None
    witnesses: tuple[Witness | None, ...] = ()
    relief: Relief | None = None
    heaviness: Heaviness | None = None

    @property
    def couplings(self) -> tuple[tuple[str, str], ...]:
        """The pairs of joints of couplings that were found, by name."""
        names, pairs = self.comparison.study.names, dict.fromkeys(ratio.pair for ratio in self.ratios)
        return tuple((names[a], names[b]) for a, b in pairs)


def _quiet(_: str) -> None:
    pass


@one_thread
def compare(
    model: ArmModel,
    known: Sequence[ArmRun],
    unseen: Sequence[ArmRun],
    band: float | None = None,
    progress: Progress = _quiet,
) -> ArmComparison:
    """Return how good a model is on unseen rows, beside the rigid body and basic friction fitted to the others."""
    found = _in_effort_time(study(model, known, unseen, band))
    progress(f"band {found.band:g} Hz, {len(found.rows)} rows to fit, {len(found.new)} unseen")
    return _compared(found)


def _in_effort_time(found: Study) -> Study:
    """Return a study of efforts that are put in time with positions, as far as velocities were later than these."""
    known, unseen = found.runs
    most = asked(known)
    if not most:
        return found
    state = found.state()
    delay = lateness(state.design(state.loads(None)), found.rows, most)
    return study(found.model, in_effort_time(known, delay), in_effort_time(unseen, delay), found.band)


def _compared(found: Study) -> ArmComparison:
    state = found.state()
    basic, rigid = settled(state), found.rigid().rms
    if _behind_gears(found, basic, rigid):
        basic = settled(found.state())
    elif not found.link_side:
        found = _in_which_friction_is_known(found, basic)
        if len(sources_of(found.rows, found.new)) > 1:
            found = _beside_payloads(found)
        state, rigid = found.state(), found.rigid().rms
        basic = settled(state)
    as_given = found.as_given(found.new)
    own = found.new.by_joint(found.left(found.model, found.new))
    table = JointTable(as_given, rigid, basic.rms, own)
    whole = found.of_all()
    all_data = settled(whole.state())  # the best numbers of basic friction, not a test
    found.loaded = whole.loaded = _loaded(whole, all_data)
    laws = in_file(found)
    found.warmth, found.drift = _in_time(whole, laws)
    state = found.state()
    beside = settled(state) if state.own else basic
    bodies = body_distance(settled(replace(state, terms=laws)) if laws else beside)
    return ArmComparison(found, table, basic, all_data, bodies, beside.matched_rms if state.own else None)


def _in_which_friction_is_known(found: Study, estimate: CoefficientEstimate) -> Study:
    """Return a study of rows in which friction has set in after a reversal, as far as that takes a distance.

    Rows of one joint in which it has not hide those of another.
    """
    lengths = np.zeros(found.robot.n) if found.settling is None else found.settling
    for _ in range(SETTLING_ROUNDS):
        longer = np.maximum(lengths, settling(found.state(), estimate))
        if (longer == lengths).all():
            break
        lengths, found = longer, found.with_settling(longer)
        estimate = settled(found.state())
    return found


def _beside_payloads(found: Study) -> Study:
    """Return a study of rows in which friction has set in, what one record alone carries beside it: that hides it."""
    whole = found.of_all()
    found.loaded = _loaded(whole, settled(whole.state()))
    if found.loaded is None:
        return found
    return replace(_in_which_friction_is_known(found, settled(found.state())), loaded=None)


def _loaded(whole: Study, all_data: CoefficientEstimate) -> Loaded | None:
    """Return by how much payloads differ between the records of all rows; None of one, and of efforts behind gears."""
    if len(sources_of(whole.rows)) < 2 or whole.link_side:
        return None
    return loaded(all_data, whole.payload_place, MIN_COEFFICIENT_ERRORS, MIN_VALIDATION_SHARE)


def _in_time(whole: Study, laws: Sequence[tuple[Key, JointLaw | None]]) -> tuple[Warmth | None, Drift | None]:
    """Return by how much friction differs between the records of all rows beside some laws, None of one record, and by
    how much it changes within them, None of efforts behind gears.
    """
    several, geared = len(sources_of(whole.rows)) > 1, not whole.link_side
    if not several and not geared:
        return None, None
    state = replace(whole.state(), terms=list(laws), spread=0.0, change=0.0)
    estimate = settled(state)
    friction, loads = state.friction(estimate), state.loads(estimate)
    own = warmth(estimate, friction, loads) if several else None
    return own, drift(estimate, friction, loads) if geared else None


def _behind_gears(found: Study, basic: CoefficientEstimate, rigid: Array) -> bool:
    """Note efforts in which neither the motors' inertias nor much friction is seen: they are of the link's side.

    That is a fact of the robot, so most joints must say so; a slow robot's motors are not seen either, its friction is.
    """
    if found.link_side:
        return False
    errors = dict(zip(basic.design.names, basic.errors().tolist(), strict=True))
    told = [i for i in range(found.robot.n) if i not in found.barred]
    unseen = [i for i in told if basic[f"{i}.motor_inertia"] < ROTOR * errors[f"{i}.motor_inertia"]]
    efforts = found.new.by_joint(found.new.y)[told]
    share = float(np.sqrt(np.sum(np.maximum(rigid**2 - basic.rms**2, 0.0)[told]) / np.sum(efforts**2)))
    if not told or len(unseen) <= len(told) / 2 or share > FRICTIONLESS:
        return False
    seen = (
        f"in the efforts of {len(unseen)} of {len(told)} joints no motor's inertia is seen, and friction is {share:.0%}"
    )
    advice = "say side: link, or give the motors' inertias if they are not"
    found.notes.append(f"{seen} of all: they look measured on the link's side ({advice})")
    found.link_side.update(dict.fromkeys(told, LINK_SIDE))
    return True


@one_thread
def diagnose(
    model: ArmModel,
    known: Sequence[ArmRun],
    unseen: Sequence[ArmRun],
    band: float | None = None,
    progress: Progress = _quiet,
) -> ArmDiagnosis:
    """Return the laws that a model of an arm lacks: couplings first, then those of joints and of the robot.

    Where efforts are recorded late or in another size, that is told, and all else of efforts that are put right.
    """
    comparison = compare(model, known, unseen, band, progress)
    if model.arm.payload is not None and model.arm.payload.free:
        from signlin_ros.arms.carrying import carried

        return carried(comparison)
    found = _put_right(comparison, progress)
    told, before, coupled = found if band is not None else _with_reversals(found, model, known, unseen, progress)
    progress(f"windows of {WINDOW:g} s")
    seen = detectable(told.state, told.estimate), heaviness(told.state, told.estimate)
    told = replace(_witnessed(told), detectable=seen[0], heaviness=seen[1])
    told = told_with(told, before)
    return replace(told, ratios=(*coupled, *told.ratios))


_Told = tuple[ArmDiagnosis, list[Fault], list[Ratio]]
"""A diagnosis without witnesses, the faults that were put right before it, and couplings whose efforts were."""


def _put_right(comparison: ArmComparison, progress: Progress, known_faults: frozenset[Key] = frozenset()) -> _Told:
    """Return a diagnosis of efforts at the joints, and of records without faults that a model's file can hold.

    known_faults : laws that are not asked for.
    """
    comparison, coupled = _at_joints(comparison, progress)
    told, before = _searched(comparison, progress, known_faults), list[Fault]()
    while law := next((law for law in FAULTS if faults(told, law)), None):
        progress(FAULTS[law])
        right, runs, laws = put_right(told, law)
        again, own = known_faults | not_again(told, law), compare(right, *runs, comparison.study.band, progress)
        put = _searched(own, progress, again)
        if wrong := unmade(told, put, law):
            known_faults |= wrong
            told = _searched(comparison, progress, known_faults)
            continue
        before.append(Fault(told, tuple(laws)))
        told, comparison, known_faults = put, own, again
    return told, before, coupled


def _with_reversals(
    told: _Told, model: ArmModel, known: Sequence[ArmRun], unseen: Sequence[ArmRun], progress: Progress
) -> _Told:
    """Return a diagnosis in a wider band than that of the motion, where a law of reversals shows in it.

    Beyond the motion, efforts hold what a controller makes of the sensors' noise, which looks like a delay, a gain or
    an elastic gear: these are what the band of the motion tells.   [Ljung 13.4]
    """
    study = told[0].comparison.study
    band = band_of_reversals(study, told[0].state, progress)
    if band is None:
        return told
    wide = _put_right(compare(model, known, unseen, band, progress), progress, _untold(told))
    if not any(map(of_reversals, wide[0].found)):
        return told
    said = f"band: {band:g} Hz, and not that of the motion, {study.band:g} Hz, in which reversals hardly show"
    wide[0].comparison.study.notes.append(said)
    return wide


def _untold(told: _Told) -> frozenset[Key]:
    """Return the faults of records, and the elastic gears, that a diagnosis does not tell."""
    found, before, _ = told
    every = {Key(law, i) for law in (*FAULTS, *SEEN_ELSEWHERE) for i in range(-1, found.state.robot.n)}
    return frozenset(every - {law.key for laws in (found.found, *(fault.laws for fault in before)) for law in laws})


def _at_joints(comparison: ArmComparison, progress: Progress) -> tuple[ArmComparison, list[Ratio]]:
    """Return a comparison of efforts at the joints where the record's are those of motors that turn several of them,
    and how much such motors turn which joints; the model's file has their couplings.
    """
    ratios: list[Ratio] = []
    while not (study := comparison.study).link_side:
        progress("motors of neighbouring joints")
        found = find_coupling_of_efforts(study.state(), comparison.basic, study.model.arm_plant.at_motor)
        if found is None:
            break
        ratios += found.ratios
        comparison = _with_efforts_of(comparison, found.motors, progress)
    at_motor = comparison.study.model.arm_plant.at_motor
    motors, settled_ones = settled_ratios(comparison.study.state(), comparison.basic, ratios, at_motor)
    if settled_ones != ratios:
        comparison = _with_efforts_of(comparison, motors, progress)
    return comparison, settled_ones


def _with_efforts_of(comparison: ArmComparison, motors: Array, progress: Progress) -> ArmComparison:
    """Return a comparison of efforts at the joints, those of the records being of motors (n, n)."""
    study = comparison.study
    known, unseen = (at_joints(runs, study.model.arm_plant.motors, motors) for runs in study.runs)
    return compare(coupled_model(study.model, motors), known, unseen, study.band, progress)


def _searched(comparison: ArmComparison, progress: Progress, known: frozenset[Key] = frozenset()) -> ArmDiagnosis:
    """Return the laws that a model lacks, ``known`` ones apart, and the model that has them."""
    found, ratios = comparison.study, list[Ratio]()
    state, estimate = found.state(), comparison.basic
    while not found.link_side:
        progress("couplings of neighbouring joints")
        coupling = find_coupling(state, estimate)
        if coupling is None:
            break
        ratios += coupling.ratios
        found = found.with_motors(coupling.motors)
        state = found.state()
        estimate = settled(state)
    motors, settled_ones = settled_ratios(state, estimate, ratios)
    if settled_ones != ratios:
        found, ratios = found.with_motors(motors), settled_ones
        state = found.state()
        estimate = settled(state)
    state.known = known
    state.terms = in_file(found)
    estimate = _borne_out(state, estimate)
    missing = _left_out(found, state, estimate)
    estimate = search(state, progress)
    estimate = better_forms(state, estimate, progress)
    state.found = rivals_left(state, estimate)
    return _told(replace(comparison, study=found), state, estimate, missing, ratios)


def _witnessed(told: ArmDiagnosis) -> ArmDiagnosis:
    """Return a diagnosis with what short forward simulations of unseen motion say of each law."""
    state, estimate = told.state, told.estimate
    laws = [(f.key.at, f.names) for f in told.found]
    laws += [(m.joint, (f"{m.joint}.{m.effect}.{LINEAR_PARAMETERS[m.effect]}",)) for m in told.missing]
    whole = ahead(state, estimate)
    before = ahead(state, state.without(estimate, *(name for key, _ in state.terms for name in names_of(key))))
    return replace(told, ahead=(before, whole), witnesses=tuple(witnesses(state, estimate, whole, laws)))


@one_thread
def add(
    effect: str,
    model: ArmModel,
    known: Sequence[ArmRun],
    unseen: Sequence[ArmRun],
    band: float | None = None,
    progress: Progress = _quiet,
) -> ArmDiagnosis:
    """Return a model with one more effect of a joint, fitted beside all the rest."""
    joint, _, name = effect.rpartition(".")
    if joint not in model.robot.names:
        raise ModelError(f"{effect}: no joint {joint!r}; allowed: JOINT.EFFECT with {choices(model.robot.names)}")
    laws = BY_EFFECT
    if name not in laws:
        known_ = (*laws, "viscous_friction", "coulomb_friction", "constant_load")
        if name not in known_:
            raise ModelError(f"{effect}: cannot be fitted to an arm; allowed: {choices(known_)}{suggest(name, known_)}")
    comparison = compare(model, known, unseen, band, progress)
    found, state = comparison.study, comparison.study.state()
    before = comparison.basic
    if name in laws:
        place, law = found.names.index(joint), laws[name]
        kept = [(k, own) for k, own in in_file(found) if own is None or not _replaced(k, own, place, law)]
        tried = []
        for shape in shapes(law, found.rows, place):
            state.terms = [*kept, (Key(name, place, shape), law)]
            fitted = fit(state.design(state.loads(before)), state.rows, state.new, before.weights)
            if fitted[f"{place}.viscous_friction.b"] >= 0.0 or law.base != "viscous_friction":
                tried.append((fitted, list(state.terms)))
        if not tried:
            raise ModelError(f"{effect}: with it viscous friction of {joint} would be negative; it does not fit")
        _, terms = min(tried, key=lambda pair: pair[0].objective)
        state.terms = kept
        beside = fit(state.design(state.loads(before)), state.rows, state.new, before.weights)
        state.terms = [*kept, (shaped(state, beside, terms[-1][0], law), law)]
        estimate = settled(state, before)
        at = estimate.design.at(f"{place}.{name}")
        one = slice(at, at + 1)
        state.found = [
            SearchResult(
                state.terms[-1][0],
                names_of(state.terms[-1][0]),
                estimate.theta[one],
                estimate.errors()[one],
                before.rms,
                estimate.rms,
                0.0,
            )
        ]
    else:
        estimate = before
    return _witnessed(_told(comparison, state, estimate, (), [], asked_more=False))


def in_file(found: Study) -> list[tuple[Key, JointLaw | None]]:
    """Return the laws that the file has in its joints beside basic friction."""
    kept = list[tuple[Key, JointLaw | None]]()
    for key, use in found.model.effects.items():
        law, at = BY_EFFECT.get(use.type), found.model.arm_plant.place_of(key)
        told = at not in found.barred and (at not in found.link_side or find_effect(use.type, "effects").external)
        if law is not None and told:
            shape = float(use.parameters[law.shape]) if law.shape else 0.0
            kept.append((Key(use.type, at, shape), law))
    return kept


def _replaced(key: Key, own: JointLaw, place: int, new: JointLaw) -> bool:
    """Tell whether a new law of a place takes the place of another one."""
    return key.at == place and (own is new or bool(own.base and own.base == new.base))


def _borne_out(state: State, estimate: CoefficientEstimate) -> CoefficientEstimate:
    """Take out laws of the file that would drive their joints in these records; return the fit of those that stay."""
    if not state.terms and not state.own:
        return estimate
    while against := _driving(state, estimate := settled(state, estimate)):
        state.terms = [(key, law) for key, law in state.terms if key not in against]
    return estimate


def _driving(state: State, estimate: CoefficientEstimate) -> list[Key]:
    """Return the laws of one sign that have the other one in a fit."""
    one_sign = [key for key, law in state.terms if law is not None and law.positive]
    return [key for key in one_sign if estimate[names_of(key)[0]] < 0.0]


def _told(
    comparison: ArmComparison,
    state: State,
    estimate: CoefficientEstimate,
    missing: Sequence[MissingLaw],
    ratios: Sequence[Ratio],
    asked_more: bool = True,
) -> ArmDiagnosis:
    """Return what is told, and the model that is proposed; ``asked_more``: with what relieves bodies, if need be."""
    found, (written, as_written) = comparison.study, _to_write(state, estimate)
    new = proposal(found, written, as_written)
    own = found.new.by_joint(found.left(new.model, found.new))
    payload = {}
    if "payload.m" in estimate.design.names:
        errors = estimate.errors()
        for name, unit in (("m", "kg"), ("mx", "kg·m"), ("my", "kg·m"), ("mz", "kg·m")):
            at = estimate.design.at(f"payload.{name}")
            payload[name] = (float(estimate.theta[at]), float(errors[at]), unit)
    differs, changes = _in_time(found.of_all(), written.terms)
    again = replace(found, warmth=differs, drift=changes)
    table = replace(comparison.table, model=own)
    matched = estimate.matched_rms if state.own else None
    compared = replace(comparison, study=again, table=table, bodies=body_distance(estimate), matched=matched)
    laws = tuple(_as_settled(law, estimate) for law in state.found)
    told = ArmDiagnosis(compared, state, estimate, laws, tuple(missing), tuple(ratios), new, payload)
    beside = relief(again, written, own) if asked_more and paying(told) else None
    if beside is None:
        return told
    compared = replace(compared, table=replace(table, model=beside.rms), bodies=body_distance(beside.estimate))
    return replace(told, comparison=compared, proposal=beside.proposal, relief=beside)


def _to_write(state: State, estimate: CoefficientEstimate) -> tuple[State, CoefficientEstimate]:
    """Return what a model file can hold of a state, and the fit of that.

    An effort that does not show what acts says nothing of bodies: its gain is fitted, and not written.
    """
    kept = [(key, law) for key, law in state.terms if key.law not in SEEN_ELSEWHERE or _mute(estimate, key)]
    written = replace(state, terms=kept)
    return written, settled(written, estimate) if len(kept) < len(state.terms) else estimate


def _mute(estimate: CoefficientEstimate, key: Key) -> bool:
    """Tell whether a law is the gain of an effort that does not show what acts."""
    at = estimate.design.at(names_of(key)[0])
    return key.law == GAIN and not shows(float(estimate.theta[at]), float(estimate.errors()[at]))


def _as_settled(law: SearchResult, estimate: CoefficientEstimate) -> SearchResult:
    """Return a law with its coefficients beside all laws that were found after it."""
    at = [estimate.design.at(name) for name in law.names]
    return replace(law, values=estimate.theta[at], errors=estimate.errors()[at])


def _left_out(found: Study, state: State, estimate: CoefficientEstimate) -> list[MissingLaw]:
    """Return basic friction that the file leaves out of a joint whose effects it lists, where it is sure."""
    missing, errors = [], estimate.errors()
    fixed = fit(estimate.design, state.rows, state.new, estimate.weights)
    again = fit(estimate.design.swapped(), state.new, state.rows, estimate.weights)
    unseen_errors = again.errors()
    alone = set(parted(found.model.arm_plant.motors))
    for i, name in enumerate(found.names):
        own = {use.type for key, use in found.model.effects.items() if key.partition(".")[0] == name}
        if not own or i in found.barred or i in found.link_side or i in alone:
            continue
        for effect, linear in LINEAR_PARAMETERS.items():
            if own & _CONTAIN[effect]:
                continue
            column = f"{i}.{effect}.{linear}"
            at = estimate.design.at(column)
            value, error = float(fixed.theta[at]), float(errors[at])
            without = state.without(fixed, column, weights=estimate.weights)
            fall = 1.0 - (fixed.matched_rms[i] / without.matched_rms[i]) ** 2
            sure = (
                value >= MIN_COEFFICIENT_ERRORS * error and again.theta[at] >= MIN_VALIDATION_ERRORS * unseen_errors[at]
            )
            if sure and fall > MIN_VALIDATION_SHARE:
                missing.append(MissingLaw(i, effect, value, error, without.matched_rms, fixed.matched_rms))
    return missing


LINEAR_PARAMETERS = {"coulomb_friction": "mu", "viscous_friction": "b"}
"""Basic friction that a file may leave out, and its parameters."""
_CONTAIN = {
    "coulomb_friction": {"coulomb_friction", "stribeck_friction", "load_dependent_stribeck"},
    "viscous_friction": {"viscous_friction", "cubic_viscous_friction", "asymmetric_viscous_friction"},
}
"""Effects that have an effect in them."""


__all__ = [
    "ArmComparison",
    "ArmDiagnosis",
    "JointTable",
    "MissingLaw",
    "add",
    "blocks",
    "compare",
    "diagnose",
    "in_file",
]
