"""What is missing, one law after the other: sure on the rows of the fit, and worth it on rows that no fit saw.

Every law is first told by the fall of the weighted squares that it promises beside all that is fitted already, inertial
parameters with their priors included; the best are fitted in earnest. A law stands if its coefficient is many standard
errors from nothing on the rows of the fit, or on all (of blocks, corrected for the number of laws tried), if unseen
rows lose a visible part of their squares, and if those rows say the same, by themselves or in what the fit foretells
for them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from signlin_ros.arms.drift import with_changes
from signlin_ros.arms.fit import IN_RECORD, CoefficientEstimate, FitDesign, blocks, fit, rigid
from signlin_ros.arms.heldout import (
    MIN_VALIDATION_ERRORS,
    again,
    agree,
    foretells,
    foretold_both_ways,
    ratio_above_crawl,
    ratio_on_all,
)
from signlin_ros.arms.keys import BODIES_IMITATE, DELAY, GAIN, SEEN_ELSEWHERE, TILT, ZERO, Key, SearchResult, names_of
from signlin_ros.arms.laws import (
    BASIC,
    EXTRA,
    JointLaw,
    KeptEffect,
    Loads,
    column,
    compliance,
    delay,
    gain,
    kept_column,
    motor_inertia,
    payload,
    shapes,
    tilt,
    zero,
)
from signlin_ros.arms.loaded import payload_in_record, with_payloads
from signlin_ros.arms.piece import RegressionRows
from signlin_ros.arms.shape import shaped
from signlin_ros.arms.warmth import Friction, sources_of, with_sizes
from signlin_ros.effects import find_effect
from signlin_ros.robots import Robot
from signlin_ros.robots.inertia import TEN, about_centre, moved

Array = NDArray[np.float64]
DOUBT = 1e-4
"""Probability of a law that is not there, over all that are tried."""
MIN_COEFFICIENT_ERRORS = 4.0
"""Standard errors that a coefficient needs, at least."""
MIN_VALIDATION_SHARE = 0.05
"""Part of the squares of a joint's unseen rows that a law must take away."""
TIE = 0.75
"""Part of the best law's worth from which on another one is as good."""
MAX_LAWS_FITTED = 8
"""Laws that are fitted in earnest in a round."""
MIN_NEW_SHARE = 1e-4
"""Part of a column that must be new beside what is fitted already."""
GIVEN = 0.3
"""Relative error of a motor's inertia that the file gives."""
OF_SPEED = "viscous_friction"
"""What laws of the whole speed take the place of; they are told by rows above the crawl."""
MAX_LAWS_ADDED = 12
"""Laws that are added, at most."""


@dataclass(eq=False)
class State:
    """Where a search stands: the rows, the laws in the model so far, and what they were found by.

    ``barred``: joints of which nothing is told; ``behind``: joints whose effort is measured behind the gear, so that
    the motor's inertia is not in it; ``known``: laws that are not searched for; ``lumped`` (10 n,): the
    inertia of a payload that was found, as that of a point, which its columns leave out; ``spread``: standard deviation
    of a record's size of friction around one, 0 where friction is the same in all; ``change``: the same of its change
    within a record; ``lightest``: the record that carries least, where payloads differ; ``asked``: the friction for
    laws in the place of which is searched, and for no others.
    """

    robot: Robot
    rows: RegressionRows
    new: RegressionRows
    tolerance: float
    basic: tuple[tuple[int, JointLaw], ...]
    inertias: Array
    payload_at: tuple[int, Array, Array] | None
    barred: frozenset[int] = frozenset()
    behind: frozenset[int] = frozenset()
    kept: tuple[KeptEffect, ...] = ()
    carried: Array | float = 0.0
    tilts: bool = True
    known: frozenset[Key] = frozenset()
    lumped: Array | float = 0.0
    spread: float = 0.0
    change: float = 0.0
    lightest: int | None = None
    asked: str = ""
    terms: list[tuple[Key, JointLaw | None]] = field(default_factory=list)
    found: list[SearchResult] = field(default_factory=list)

    def loads(self, estimate: CoefficientEstimate | None) -> Loads:
        """Return the loads of the rigid body as it is estimated, else as it is given."""
        if estimate is None:
            return Loads(self.robot, self.robot.pi + self.carried)
        return Loads(self.robot, self.body(estimate), self.friction(estimate), self._own_payloads(estimate))

    def _own_payloads(self, estimate: CoefficientEstimate) -> dict[str, Array]:
        """Return what the payloads of records add to the inertial parameters (10 n,), where they differ."""
        place = self.payload_at
        if self.lightest is None or place is None:
            return {}
        return {name: payload_in_record(estimate, k, place) for k, name in enumerate(sources_of(*self.both))}

    def friction(self, estimate: CoefficientEstimate) -> list[tuple[int, JointLaw, float, float]]:
        """Return the laws of friction that were fitted: place, law, shape and coefficient of each."""
        found = [(i, law, 0.0, f"{i}.{law.effect}.{law.linear}") for i, law in self.basic]
        found += [(key.at, law, key.shape, names_of(key)[0]) for key, law in self.terms if law is not None]
        known = set(estimate.design.names)
        return [(i, law, shape, estimate[name]) for i, law, shape, name in found if name in known]

    def without(self, estimate: CoefficientEstimate, *names: str, weights: Array | None = None) -> CoefficientEstimate:
        """Return the fit without some columns of an estimate; sizes of friction are those of the laws that stay.

        ``weights`` (n,) of the joints are worked out where they are not given.
        """
        sizes = [name for name in estimate.design.names if IN_RECORD in name]
        less = fit(estimate.design.without(*names, *sizes), self.rows, self.new, weights)
        if sizes:
            design = self._with_own(less.design, self.friction(less), self.loads(estimate))
            less = fit(design, self.rows, self.new, weights)
        return less

    def body(self, estimate: CoefficientEstimate) -> Array:
        """Return the inertial parameters (10 n,), a payload that was found on them."""
        return np.asarray(estimate.pi + self._found(estimate))

    def _found(self, estimate: CoefficientEstimate) -> Array:
        """Return mass and first moment of a payload that was found (10 n,), in its joint's frame."""
        found = np.zeros(TEN * self.robot.n)
        if "payload.m" in estimate.design.names and self.payload_at is not None:
            joint, R, t = self.payload_at
            own = np.zeros(TEN)
            own[:4] = [estimate[name] for name in names_of(Key("payload", -1))]
            found[TEN * joint : TEN * (joint + 1)] = moved(own, R, t)
        return found

    def point(self, estimate: CoefficientEstimate) -> Array:
        """Return what a payload that was found, as a point, adds to the inertia beside its mass and moment (10 n,)."""
        added = np.zeros(TEN * self.robot.n)
        if "payload.m" in estimate.design.names and self.payload_at is not None:
            part = slice(TEN * self.payload_at[0], TEN * (self.payload_at[0] + 1))
            whole = (self._found(estimate) + self.carried)[part]
            m, h = float(whole[0]), whole[1:4]
            if m > 0.0:
                added[part] = about_centre(m, h / m, np.zeros((3, 3))) - whole
        return added

    def design(self, loads: Loads) -> FitDesign:
        """Return the design of all that is in the model so far."""
        found = rigid(self.robot, self.tolerance, self.rows, self.new, self.carried + self.lumped)
        for i, law in self.basic:
            known, unseen = (column(law, 0.0, r, i, loads) for r in self.both)
            found = found.plus((f"{i}.{law.effect}.{law.linear}",), known, unseen)
        for i, given in ((i, given) for i, given in enumerate(self.inertias) if i not in self.behind):
            known, unseen = (motor_inertia(r, i) for r in self.both)
            sd = GIVEN * given if given > 0.0 else np.inf
            found = found.plus((f"{i}.motor_inertia",), known, unseen, float(given), sd)
        for key, term in self.terms:
            known, unseen = self.columns(key, term, loads)
            found = found.plus(names_of(key), known, unseen)
        if self.kept:
            known, unseen = (kept_column(self.kept, r, loads) for r in self.both)
            found = found.plus(("kept",), known, unseen, 1.0, 0.0)
        return self._with_own(found, loads.friction, loads)

    @property
    def own(self) -> bool:
        """Whether records have coefficients of their own."""
        return self.lightest is not None or self.sized

    @property
    def sized(self) -> bool:
        """Whether the friction of a record has a size of its own, or one that changes."""
        return self.spread > 0.0 or self.change > 0.0

    def _with_own(self, design: FitDesign, friction: Friction, loads: Loads) -> FitDesign:
        """Return a design with what each record has of its own: a payload, sizes of friction."""
        if self.lightest is not None and self.payload_at is not None:
            design = with_payloads(design, self.both, self.payload_at, self.lightest)
        if self.change:
            design = with_changes(design, self.both, friction, loads, self.change)
        return with_sizes(design, self.both, friction, loads, self.spread) if self.spread else design

    @property
    def both(self) -> tuple[RegressionRows, RegressionRows]:
        """The rows of the fit, and the unseen ones."""
        return self.rows, self.new

    def columns(self, key: Key, law: JointLaw | None, loads: Loads) -> tuple[Array, Array]:
        """Return the columns of a law on both kinds of rows."""
        if law is not None:
            return column(law, key.shape, self.rows, key.at, loads), column(law, key.shape, self.new, key.at, loads)
        if key.law == "payload" and self.payload_at is not None:
            return payload(self.rows, *self.payload_at), payload(self.new, *self.payload_at)
        if key.law == TILT:
            return tilt(self.rows, loads), tilt(self.new, loads)
        if key.law == "compliant_load":
            return compliance(self.rows, key.at, loads), compliance(self.new, key.at, loads)
        if key.law == DELAY:
            return delay(self.rows, key.at, loads), delay(self.new, key.at, loads)
        if key.law == ZERO:
            given = np.asarray(self.robot.pi + self.carried)
            return zero(self.rows, key.at, given), zero(self.new, key.at, given)
        drives = self._drives(loads)
        return gain(self.rows, key.at, drives[0]), gain(self.new, key.at, drives[1])

    def _drives(self, loads: Loads) -> list[list[Array]]:
        """Return the model's rigid-body effort as regressor of a joint's gain; its friction scales along."""
        return [[loads.of(p)[:, : self.robot.n] @ p.motors[: self.robot.n] for p in r.pieces] for r in self.both]

    def candidates(self, estimate: CoefficientEstimate) -> Iterator[tuple[Key, JointLaw | None]]:
        """Yield every law that may be missing; of an effort behind the gear, what acts outside it and the gain."""
        taken = {*(key for key, _ in self.terms), *self.known}
        for i in range(self.robot.n):
            if i in self.barred:
                continue
            behind = i in self.behind
            for law in (law for law in EXTRA if not behind or find_effect(law.effect, "effects").external):
                key = Key(law.effect, i)
                kin = any(k.at == i and w is not None and w.base and w.base == law.base for k, w in self.terms)
                if kin or any(key.same(other) for other in taken) or law.base != (self.asked or law.base):
                    continue
                yield from ((replace(key, shape=shape), law) for shape in shapes(law, self.rows, i))
            of_record = (GAIN,) if behind else (GAIN, "compliant_load", DELAY, ZERO)
            yield from ((Key(name, i), None) for name in of_record if Key(name, i) not in taken and not self.asked)
        if self.asked:
            return
        of_all = {"payload": self.payload_at is not None, TILT: self.tilts, DELAY: self.tilts}
        yield from ((Key(name, -1), None) for name, may in of_all.items() if may and Key(name, -1) not in taken)


@dataclass(frozen=True, eq=False)
class Promise:
    """A law with what it promises: the fall of the squares, and its columns."""

    fall: float
    key: Key
    law: JointLaw | None
    known: Array
    unseen: Array


def search(state: State, progress: Callable[[str], None] = lambda _: None) -> CoefficientEstimate:
    """Add laws to a state until none stands; return the last estimate."""
    estimate = settled(state)
    for _ in range(MAX_LAWS_ADDED):
        found = _best(state, estimate)
        if found is None:
            break
        result, law = found
        key = result.key if law is None else shaped(state, estimate, result.key, law)
        state.found.append(replace(result, key=key))
        state.terms.append((key, law))
        progress(f"{names_of(key)[0]}: validation errors fall")
        estimate = settled(state, estimate)
    return _beside(state, estimate)


def _beside(state: State, estimate: CoefficientEstimate) -> CoefficientEstimate:
    """Take out laws of joints that were found before others were, and that are not there beside them, or would drive
    their joint; return the estimate.

    The one that is least there goes first.   [Efroymson, in: Mathematical Methods for Digital Computers, Wiley, 1960]
    """
    while laws := [(found.key, law) for found in state.found for key, law in state.terms if key == found.key]:
        own = dict(zip(estimate.design.names, (estimate.theta / estimate.errors()).tolist(), strict=True))
        ratios = {}
        for key, law in laws:
            ratio = own[names_of(key)[0]]
            ratios[key] = ratio if _of_one_sign(key, law) else abs(ratio)
        for key in (key for key, ratio in ratios.items() if 0.0 <= ratio < MIN_COEFFICIENT_ERRORS):
            ratios[key] = ratio_on_all(estimate, names_of(key))
        least = min((key for key in ratios if key.at >= 0), key=lambda key: ratios[key], default=None)
        if least is None or ratios[least] >= MIN_COEFFICIENT_ERRORS:
            break
        state.terms = [(key, law) for key, law in state.terms if key != least]
        state.found = [law for law in state.found if law.key != least]
        estimate = settled(state, estimate)
    return estimate


def settled(state: State, estimate: CoefficientEstimate | None = None) -> CoefficientEstimate:
    """Return the fit of all that is in the model, the loads of its friction being its own."""
    for _ in range(2):
        estimate = fit(state.design(state.loads(estimate)), state.rows, state.new)
        state.lumped = state.point(estimate)
        if not state.sized and not any(law is None or law.loaded for _, law in state.terms):
            break
    return estimate  # type: ignore[return-value]


def _best(state: State, estimate: CoefficientEstimate) -> tuple[SearchResult, JointLaw | None] | None:
    """Return the law that unseen rows gain most from, of those that stand."""
    fixed = fit(estimate.design, state.rows, state.new, estimate.weights)
    promises, tried = _promises(state, fixed)
    standing = [(p, found) for p in promises if (found := stands(state, fixed, p, tried)) is not None]
    if not standing:
        return None
    standing.sort(key=lambda pair: -pair[1][0].worth)
    (promise, (first, law)), others = standing[0], standing[1:]
    for own, (rival, its_law) in list(others):
        if _beaten(state, fixed, promise, own):
            others = [pair for pair in others if pair[0] is not own]
            promise, first, law = own, rival, its_law
    rivals = tuple(other.key for _, (other, _) in others if other.worth > TIE * first.worth)
    return replace(first, rivals=rivals), law


def _beaten(state: State, estimate: CoefficientEstimate, first: Promise, other: Promise) -> bool:
    """Tell whether all rows know a law no more beside another one, which they know beside it.

    [Davidson and MacKinnon, Econometrica 49(3), 1981]
    """
    own, its = names_of(first.key), names_of(other.key)
    if first.key.at < 0 or other.key.at == first.key.at:
        return False
    design = estimate.design.plus(own, first.known, first.unseen).plus(its, other.known, other.unseen)
    beside = fit(design, state.rows, state.new, estimate.weights)
    return ratio_on_all(beside, own) < MIN_COEFFICIENT_ERRORS <= ratio_on_all(beside, its)


def _promises(state: State, estimate: CoefficientEstimate) -> tuple[list[Promise], int]:
    """Return the laws that promise most, the best shape of each, and how many were tried."""
    w = estimate.weights[state.rows.joint]
    X, r, inner = estimate.design.known * w[:, None], estimate.residual * w, estimate.inverse()
    errors = estimate.errors()
    loads, tried = state.loads(estimate), 0
    best: dict[tuple[str, int], Promise] = {}
    for key, law in state.candidates(estimate):
        known, unseen = state.columns(key, law, loads)
        tried += 1
        C = known * w[:, None]
        if not np.isfinite(C).all() or not np.abs(C).max(initial=0.0):
            continue
        P = X.T @ C
        S = C.T @ C - P.T @ inner @ P
        if key.law not in BODIES_IMITATE and (np.diag(S) < MIN_NEW_SHARE * _varying(C, state.rows)).any():
            continue
        d = C.T @ r
        coefficients = np.linalg.lstsq(S, d, rcond=1e-8)[0]
        fall = float(d @ coefficients)
        if _of_one_sign(key, law) and coefficients[0] <= 0.0:
            continue  # takes no place of one that may stand
        if not possible(estimate.design, estimate.theta - inner @ (P @ coefficients), errors, key):
            continue
        if (key.law, key.at) not in best or fall > best[key.law, key.at].fall:
            best[key.law, key.at] = Promise(fall, key, law, known, unseen)
    return sorted(best.values(), key=lambda p: -p.fall)[:MAX_LAWS_FITTED], tried


def _varying(C: Array, rows: RegressionRows) -> Array:
    """Return the sums of squares (c,) of columns (N, c) about their mean in each joint, which its offset has."""
    counts = np.maximum(rows.counts, 1)[:, None]
    means = np.stack([np.bincount(rows.joint, column, rows.n) for column in C.T], axis=1) / counts
    return np.asarray(np.sum(C**2, axis=0) - np.sum(counts * means**2, axis=0))


def stands(
    state: State, estimate: CoefficientEstimate, promise: Promise, tried: int
) -> tuple[SearchResult, JointLaw | None] | None:
    """Return a law if it is sure, and worth it on unseen rows; None else."""
    names, count = names_of(promise.key), promise.known.shape[1]
    design = estimate.design.plus(names, promise.known, promise.unseen)
    trial = fit(design, state.rows, state.new, estimate.weights)
    values, errors = trial.theta[-count:], trial.errors()[-count:]
    law, key = promise.law, promise.key
    if _of_one_sign(key, law) and values[0] <= 0.0:
        return None
    before, after = estimate.matched_rms, trial.matched_rms
    elsewhere = key.law in SEEN_ELSEWHERE
    fall = foretold_both_ways(estimate, trial) if elsewhere else _fall(before, after)
    with np.errstate(invalid="ignore", divide="ignore"):
        worth = -0.5 * float(np.nansum(np.log(1.0 - fall)))
    needed = needed_errors(tried)
    sure = float(np.abs(values / np.maximum(errors, 1e-300)).max()) >= needed
    if not sure and (law is not None or elsewhere):
        sure = ratio_on_all(trial, names) >= needed
    if key.law in BODIES_IMITATE:
        if not (sure and _relieved(estimate, trial, count) and worth > -0.01 * state.robot.n):
            return None
        worth = max(worth, drop(estimate, trial) / max(len(state.rows), 1))
    else:
        visible = np.nanmax(fall) if key.at < 0 or elsewhere else fall[key.at]
        if not (sure and visible > MIN_VALIDATION_SHARE and worth > 0.0 and _held(estimate, trial, promise, needed)):
            return None
        of_speed = law is not None and law.base == OF_SPEED
        if of_speed and ratio_above_crawl(trial, names, key.at) < MIN_COEFFICIENT_ERRORS:
            return None
        if key.law == DELAY and not _in_earnest(state, estimate, key, float(values[0])):
            return None
    return SearchResult(key, names, values, errors, before, after, worth), law


def _in_earnest(state: State, estimate: CoefficientEstimate, key: Key, delay: float) -> bool:
    """Tell whether efforts that are put in time by a delay (s) are explained visibly better.

    The law is the first term of a series, and of the rigid body alone; where something else is missing, bodies and
    friction contradict each other on the delay.
    """
    delays = np.zeros(state.robot.n)
    delays[slice(None) if key.at < 0 else key.at] = delay
    rows, new = (r.with_efforts(delays) for r in state.both)
    shifted = fit(replace(estimate.design, worked={}, before=None), rows, new, estimate.weights)
    fall = _fall(estimate.matched_rms, shifted.matched_rms)
    visible = np.nanmax(fall) if key.at < 0 else fall[key.at]
    return bool(visible > MIN_VALIDATION_SHARE) and float(np.nansum(np.log(1.0 - fall))) < 0.0


def _of_one_sign(key: Key, law: JointLaw | None) -> bool:
    """Tell whether the (first) coefficient of a law is above nothing."""
    return law.positive if law is not None else key.law in ("compliant_load", "payload")


def possible(design: FitDesign, theta: Array, errors: Array, key: Key) -> bool:
    """Tell whether coefficients (k,) leave a joint friction that takes energy: none is below nothing beyond doubt."""
    at = [design.at(f"{key.at}.{name}") for name in _TAKES_ENERGY if f"{key.at}.{name}" in design.names]
    return bool((theta[at] >= -MIN_VALIDATION_ERRORS * errors[at]).all())


def admissible(trial: CoefficientEstimate, key: Key) -> bool:
    """Tell whether a law and the friction beside it are what a model file takes: none of them drives its joint."""
    names = (*names_of(key), *(f"{key.at}.{name}" for name in _TAKES_ENERGY))
    return all(trial[name] >= 0.0 for name in names if name in trial.design.names)


_TAKES_ENERGY = ("viscous_friction.b", "coulomb_friction.mu")
"""Basic friction of a joint that is written beside other laws, and cannot be below nothing."""


def needed_errors(tried: int) -> float:
    """Return the standard errors that a coefficient needs where so many laws are tried."""
    return max(MIN_COEFFICIENT_ERRORS, float(norm.isf(DOUBT / max(tried, 1) / 2)))


def _held(estimate: CoefficientEstimate, trial: CoefficientEstimate, promise: Promise, needed: float) -> bool:
    """Tell whether unseen rows say the same of a law: by themselves; of friction, in what the fit foretells; or, of
    what bodies imitate in one motion, together with the rows of the fit, which they agree with.
    """
    names, key = names_of(promise.key), promise.key
    if again(trial, names):
        return True
    if key.law in SEEN_ELSEWHERE:
        return agree(trial, names) and ratio_on_all(trial, names) >= needed
    return promise.law is not None and foretells(estimate, trial, names, key.at)


def _fall(before: Array, after: Array) -> Array:
    """Return by what part the squares (n,) fall from one RMS to another."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(1.0 - (after / before) ** 2)


def drop(estimate: CoefficientEstimate, trial: CoefficientEstimate) -> float:
    """Return by how much twice the objective falls, in units of what chance would make of it."""
    w = estimate.weights[estimate.rows.joint]
    r = (trial.residual * w)[:, None]
    over = float(np.sum(blocks(r, estimate.rows.block) ** 2) / max(np.sum(r**2), 1e-300))
    return 2.0 * (estimate.objective - trial.objective) / max(over, 1.0)


def _relieved(estimate: CoefficientEstimate, trial: CoefficientEstimate, count: int) -> bool:
    """Tell whether a law is what the inertial parameters were bent for: the squares and the distances from their
    priors together fall beyond doubt.
    """
    return drop(estimate, trial) > float(chi2.isf(DOUBT, count)) and trial.tension < estimate.tension


__all__ = [
    "BASIC",
    "Key",
    "Promise",
    "SearchResult",
    "State",
    "drop",
    "names_of",
    "needed_errors",
    "search",
    "settled",
    "stands",
]
