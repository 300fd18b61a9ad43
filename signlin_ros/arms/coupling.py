"""Couplings that the model does not know: a motor that turns with the next joint too, its friction on both.

The efforts of a record are those of the joints, or those of the motors: then a joint's effort is that of its own motor
with that of the other one, T^T u of efforts u. Likelihoods of the efforts that are recorded, of unseen rows, tell one
coupling from another, and from none.   [Vuong, Econometrica 57(2), 1989]

How much a motor turns with the other joint is where the recorded efforts of a fit are likeliest, with a standard error.
A ratio that is not beyond doubt another one than 1 or -1 is that.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from signlin_ros.arms.data import ArmRun, of_motors
from signlin_ros.arms.fit import CoefficientEstimate, FitDesign, fit
from signlin_ros.arms.heldout import MIN_VALIDATION_ERRORS
from signlin_ros.arms.laws import BASIC, Loads, column, motor_inertia
from signlin_ros.arms.piece import RegressionRows
from signlin_ros.arms.search import MIN_COEFFICIENT_ERRORS, MIN_VALIDATION_SHARE, State, needed_errors
from signlin_ros.model.arm import ArmModel
from signlin_ros.model.arm_file import Coupling
from signlin_ros.robots import Robot

Array = NDArray[np.float64]
Rows = tuple[RegressionRows, RegressionRows]
WHOLE_RATIOS = (1.0, -1.0)
"""Turns of a motor, in those of its own joint, for one of the joint beside it, of which no other is told by chance."""
RATIO_STARTS = tuple(sign * size for size in (0.25, 0.35, 0.5, 0.71, 1.0, 1.4, 2.0, 2.8, 4.0) for sign in WHOLE_RATIOS)
"""Ratios from which the best is worked out."""
MIN_RATIO, MAX_RATIO = 0.1, 10.0
"""Sizes of ratios that are told."""
TRIED = 3
"""Pairs of a motor and a joint that are fitted in earnest, those that promise most."""
RATIO_REACH, RATIO_ACCURACY, RATIO_STEP = 2.0**0.5, 1e-3, 0.01
"""Factor within which a ratio is looked for about its start, relative error, half a step of a difference quotient."""
MAX_RATIO_ROUNDS = 8
"""Times that ratios are settled beside each other, at most."""
MOVED = 0.1
"""Standard errors by which ratios move once they are settled beside each other."""
COUPLED_EFFECTS = ("coupled.viscous_friction", "coupled.coulomb_friction")
"""Names of the friction of a motor that turns with another joint, too, as columns of a fit."""
SINGULAR = 1e-9
"""Determinant of motors that do not move the joints independently."""


@dataclass(frozen=True)
class Ratio:
    """Turns of a motor, counted in those of its own joint, for one turn of another joint; with its standard error."""

    motor: int
    joint: int
    value: float
    error: float

    @property
    def pair(self) -> tuple[int, int]:
        """The two joints in the order of the file."""
        return min(self.motor, self.joint), max(self.motor, self.joint)

    @property
    def whole(self) -> bool:
        """Whether it is 1 or -1."""
        return abs(self.value) == 1.0

    def named(self) -> Ratio:
        """Return the ratio that is told: 1 or -1 where it is no other beyond doubt."""
        near = min(WHOLE_RATIOS, key=lambda whole: abs(self.value - whole))
        return self if abs(self.value - near) > MIN_COEFFICIENT_ERRORS * self.error else replace(self, value=near)


@dataclass(frozen=True, eq=False)
class FoundCoupling:
    """Motors of a pair of joints that turn with the other one, too: how much, and the motors from the joints (n, n)."""

    ratios: tuple[Ratio, ...]
    motors: Array
    worth: float


def find_coupling(state: State, estimate: CoefficientEstimate) -> FoundCoupling | None:
    """Return the coupling that unseen rows gain most from, efforts being those of the joints; None if none stands.

    A coupling stands if its friction is sure beside all other, of unseen rows alone too, and both joints' unseen rows
    gain from it.
    """
    motors = state.rows.pieces[0].motors[: state.robot.n]
    fixed = fit(estimate.design, state.rows, state.new, estimate.weights)
    pairs = list(_pairs(state.robot, motors))
    needed = needed_errors(len(pairs) * len(RATIO_STARTS))
    best: FoundCoupling | None = None
    for start in _promising(state, fixed, motors, pairs):
        ratio = _settled(state, estimate.design, motors, start)
        if ratio is None:
            continue
        ratio = _named_by_unseen(state, estimate.design, motors, ratio)
        changed = _changed(motors, ratio)
        if abs(np.linalg.det(changed)) <= SINGULAR:
            continue
        known, unseen = (_friction(state, rows, ratio.motor, changed) for rows in state.both)
        trial = fit(fixed.design.plus(COUPLED_EFFECTS, known, unseen), state.rows, state.new, fixed.weights)
        if not _sure(trial, needed):
            continue
        other = fit(_with(state, fixed.design, ratio.motor, changed), state.rows, state.new, fixed.weights)
        with np.errstate(divide="ignore", invalid="ignore"):
            worth = float(np.nansum(np.log(fixed.rms) - np.log(other.rms)))
            fall = 1.0 - (other.rms / fixed.rms) ** 2
        if _both_gain(fall, ratio) and (best is None or worth > best.worth):
            best = FoundCoupling((ratio,), changed, worth)
    return best


def find_coupling_of_efforts(
    state: State, estimate: CoefficientEstimate, at_motor: tuple[bool, ...]
) -> FoundCoupling | None:
    """Return the coupling that unseen rows gain most from where efforts are those of the motors; None if none stands.

    It stands if unseen rows are likelier by it beyond doubt, if those of one of the two joints lose a visible part of
    their squares, and if no coupling of which efforts are those of the joints makes them likelier.
    """
    motors = state.rows.pieces[0].motors[: state.robot.n]
    new, mix = (state.new, state.rows), _mix(motors, at_motor)
    before = _both_ways(estimate.design, state.both, mix)
    pairs = [(j, i) for j, i in _pairs(state.robot, motors, at_motor) if not {i, j} & state.barred]
    needed = needed_errors(len(pairs) * len(RATIO_STARTS))
    best: FoundCoupling | None = None
    tried = [[ratio] for ratio in _promising(state, estimate, motors, pairs, at_motor)]
    while tried:
        settled = _together(state, estimate.design, motors, tried.pop(0), at_motor)
        if not settled:
            continue
        changed, at = _changed(motors, *settled), _of(settled, at_motor)
        if abs(np.linalg.det(changed)) <= SINGULAR:
            continue
        design, other = _with_all(state, estimate.design, settled, changed), _mix(changed, at)
        change = np.asarray(np.linalg.solve(mix, other))
        rows = state.rows.of_motors(change), state.new.of_motors(change)
        after = _both_ways(design, rows, other)
        worth, errors = _likelier(new, before, after)
        fall = 1.0 - _squares(new, after) / _squares(new, before)
        visible = max(fall[list(settled[0].pair)]) > MIN_VALIDATION_SHARE
        if errors >= needed and visible and (best is None or worth > best.worth):
            best = FoundCoupling(tuple(settled), changed, worth)
        elif worth > 0.0 and len(settled) == 1:  # one motor of a differential without the other is not beyond doubt
            here = replace(state, rows=rows[0], new=rows[1])
            back = [(settled[0].joint, settled[0].motor)]
            tried += [[*settled, also] for also in _promising(here, fit(design, *rows), changed, back, at)]
    if best is None:
        return None
    own = [(j, i) for j, i in pairs if (min(i, j), max(i, j)) == best.ratios[0].pair]
    for start in _promising(state, estimate, motors, own):
        ratio = _settled(state, estimate.design, motors, start)
        if ratio is None:
            continue
        design = _with(state, estimate.design, ratio.motor, _changed(motors, ratio.named()))
        if _likelier(new, before, _both_ways(design, state.both, mix))[0] >= best.worth:
            return None
    return best


def settled_ratios(
    state: State, estimate: CoefficientEstimate, ratios: Sequence[Ratio], at_motor: Sequence[bool] | None = None
) -> tuple[Array, list[Ratio]]:
    """Return the motors (n, n), and ratios that were found one after the other as they are beside all of them.

    ``at_motor``: whose efforts are their motors'; None where those of the ratios are the joints'.
    """
    motors = state.rows.pieces[0].motors[: state.robot.n].copy()
    found = list(ratios)
    for _ in range(MAX_RATIO_ROUNDS if len(found) > 1 else 0):
        moved = 0.0
        for k, before in enumerate(found):
            again = _settled(state, estimate.design, motors, before, at_motor)
            if again is None:
                continue
            found[k] = before if before.whole else again.named()
            moved = max(moved, abs(found[k].value - before.value) / max(found[k].error, 1e-300))
            motors[before.motor, before.joint] = found[k].value
        if moved < MOVED:
            break
    return motors, found


def coupled_model(model: ArmModel, motors: Array) -> ArmModel:
    """Return a model whose file has the couplings of motors (n, n), efforts of coupled joints being the motors'."""
    names, couplings = model.robot.names, dict(model.arm.couplings)
    ratios = {name: c.ratio(name) for c in couplings.values() for name in c.joints}
    for group in _groups(motors):
        own = tuple(names[i] for i in group)
        rows = motors[np.ix_(group, group)] * np.array([ratios.get(name, 1.0) for name in own])[:, None]
        for key in [key for key, c in couplings.items() if set(c.joints) & set(own)]:
            del couplings[key]
        couplings["_".join(own)] = Coupling(own, tuple(rows.ravel().tolist()), "motor")
    return model.with_arm(replace(model.arm, couplings=tuple(couplings.items())))


def at_joints(runs: Sequence[ArmRun], before: Array, motors: Array) -> list[ArmRun]:
    """Return runs whose efforts are those of the joints, by the motors (n, n) that they were not known to be of."""
    change = np.asarray(np.linalg.solve(before, motors))
    return [of_motors(run, change) for run in runs]


def _groups(motors: Array) -> list[list[int]]:
    """Return the joints that share motors (n, n), each group in the order of the file."""
    linked = (motors != 0.0) | (motors != 0.0).T
    for _ in range(len(motors)):
        linked = linked @ linked
    groups = {tuple(np.flatnonzero(row).tolist()): None for row in linked}
    return [list(group) for group in groups if len(group) > 1]


# ---------------------------------------------------------------- ratios


def _promising(
    state: State,
    estimate: CoefficientEstimate,
    motors: Array,
    pairs: Sequence[tuple[int, int]],
    at_motor: Sequence[bool] | None = None,
) -> list[Ratio]:
    """Return the ratios of pairs beside whose friction the rows of a fit are likeliest, best first.

    ``at_motor``: whose efforts are their motors', those of the pair as well: what a motor rubs is in its own effort,
    and what it exerts is not in that of the other joint. None: those of the pair are the joints'.
    """
    fixed = fit(estimate.design, state.rows, state.new, estimate.weights)
    before, best = fixed.known_rms, dict[tuple[int, int], tuple[float, Ratio]]()
    for j, i in pairs:
        for value in RATIO_STARTS:
            ratio = Ratio(j, i, value, 0.0)
            known = _friction(state, state.rows, j, _changed(motors, ratio))
            if at_motor is not None:
                own = [np.where((state.rows.joint == joint)[:, None], known, 0.0) for joint in (j, i)]
                known = np.concatenate([*own, _effort_of(state.rows, motors, at_motor, ratio)], axis=1)
            names = tuple(f"coupled.{k}" for k in range(known.shape[1]))
            design = fixed.design.plus(names, known, np.zeros((len(state.new), len(names))))
            trial = fit(design, state.rows, state.new, fixed.weights)
            left, fall = trial.known_rms, 1.0 - (trial.known_rms / before) ** 2
            size = float(np.nansum(state.rows.counts * np.log(left)))
            if max(fall[i], fall[j]) > MIN_VALIDATION_SHARE and ((j, i) not in best or size < best[j, i][0]):
                best[j, i] = (size, ratio)
    return [ratio for _, ratio in sorted(best.values(), key=lambda own: own[0])[:TRIED]]


def _together(
    state: State, design: FitDesign, motors: Array, starts: Sequence[Ratio], at_motor: Sequence[bool]
) -> list[Ratio]:
    """Return the ratios that are told near some starts, beside each other; none where one is none."""
    found = list(starts)
    for _ in range(MAX_RATIO_ROUNDS if len(found) > 1 else 1):
        before = list(found)
        for k, ratio in enumerate(found):
            others = [other for other in found if other is not ratio]
            beside = _with_all(state, design, others, _changed(motors, *found), unseen=False)
            own = _settled(state, beside, _changed(motors, *others), ratio, _of(others, at_motor))
            if own is None:
                return []
            found[k] = own
        if all(abs(now.value - then.value) < MOVED * now.error for now, then in zip(found, before, strict=True)):
            break
    return [ratio.named() for ratio in found]


def _with_all(
    state: State, design: FitDesign, ratios: Sequence[Ratio], motors: Array, unseen: bool = True
) -> FitDesign:
    """Return a design in which the motors of some ratios turn with another joint, too."""
    for ratio in ratios:
        design = _with(state, design, ratio.motor, motors, unseen)
    return design


def _settled(
    state: State, design: FitDesign, motors: Array, start: Ratio, at_motor: Sequence[bool] | None = None
) -> Ratio | None:
    """Return the ratio near a start with which the recorded efforts of the fit are likeliest; None where that is none.

    A ratio changes the speed that the motor's friction sees, the joint on which that acts, and, where efforts are the
    motors', the effort of the joint.
    """

    def unlikely(value: float) -> float:
        estimate, mix = _turning(state, design, motors, replace(start, value=value), at_motor)
        return -float(np.nansum(_log_likelihood(state.rows, _recorded(state.rows, estimate.residual, mix))))

    ends = sorted((start.value / RATIO_REACH, start.value * RATIO_REACH))
    best = minimize_scalar(
        unlikely, bounds=ends, method="bounded", options={"xatol": RATIO_ACCURACY * abs(start.value)}
    )
    ratio = replace(start, value=float(best.x))
    if not MIN_RATIO < abs(ratio.value) < MAX_RATIO:
        return None
    return replace(ratio, error=_error(state, design, motors, ratio, at_motor))


def _named_by_unseen(state: State, design: FitDesign, motors: Array, ratio: Ratio) -> Ratio:
    """Return the ratio that is told: another one than 1 or -1 where unseen rows are likelier by it beyond doubt, too.

    What a law of friction misses bends a ratio by more than its standard error says.
    """
    named, whole = ratio.named(), replace(ratio, value=min(WHOLE_RATIOS, key=lambda one: abs(ratio.value - one)))
    if named.whole:
        return named
    mix, new = np.eye(len(motors)), (state.new, state.rows)
    sides = (_with(state, design, ratio.motor, _changed(motors, one)) for one in (whole, named))
    before, after = (_both_ways(side, state.both, mix) for side in sides)
    return named if _likelier(new, before, after)[1] > MIN_COEFFICIENT_ERRORS else whole


def _turning(
    state: State, design: FitDesign, motors: Array, ratio: Ratio, at_motor: Sequence[bool] | None
) -> tuple[CoefficientEstimate, Array]:
    """Return the fit in which a motor turns a joint, too, and what makes the efforts of joints of recorded ones."""
    changed, before, mix = _changed(motors, ratio), np.eye(len(motors)), np.eye(len(motors))
    if at_motor is not None:
        before, mix = _mix(state.rows.pieces[0].motors[: len(motors)], at_motor), _mix(changed, _of([ratio], at_motor))
    own = _with(state, design, ratio.motor, changed, unseen=False)
    return fit(own, state.rows.of_motors(np.asarray(np.linalg.solve(before, mix))), state.new), mix


def _error(state: State, design: FitDesign, motors: Array, ratio: Ratio, at_motor: Sequence[bool] | None) -> float:
    """Return the standard error of a ratio beside all that is fitted, by what the fit's efforts change with it."""
    here, _ = _turning(state, design, motors, ratio, at_motor)
    ends = [replace(ratio, value=ratio.value + way * RATIO_STEP) for way in (1.0, -1.0)]
    sides = [_with(state, design, ratio.motor, _changed(motors, end), unseen=False) for end in ends]
    slope = ((sides[0].known - sides[1].known) @ here.theta / (2.0 * RATIO_STEP))[:, None]
    if at_motor is not None:
        slope = slope - _effort_of(state.rows, motors, at_motor, ratio)
    more = here.design.plus(("ratio",), np.asarray(slope), np.zeros((len(state.new), 1)))
    return float(fit(more, here.rows, here.new, here.weights).errors()[-1])


def _effort_of(rows: RegressionRows, motors: Array, at_motor: Sequence[bool], ratio: Ratio) -> Array:
    """Return the recorded effort of a motor in the rows (N, 1) of the joint that it would turn, too."""
    change = np.zeros(motors.shape)
    change[:, ratio.joint] = np.linalg.inv(_mix(rows.pieces[0].motors[: len(motors)], at_motor))[:, ratio.motor]
    return np.asarray(rows.of_motors(change).y[:, None])


def _mix(motors: Array, at_motor: Sequence[bool]) -> Array:
    """Return what makes the efforts of joints of those that are recorded: of motors (n, n), where they are motors'."""
    return np.asarray(np.where(np.array(at_motor)[:, None], motors, np.eye(len(motors))))


def _of(ratios: Sequence[Ratio], at_motor: Sequence[bool]) -> list[bool]:
    """Return whose efforts are their motors' where those of the joints of some ratios are."""
    return [own or any(i in ratio.pair for ratio in ratios) for i, own in enumerate(at_motor)]


def _changed(motors: Array, *ratios: Ratio) -> Array:
    changed = np.array(motors)
    for ratio in ratios:
        changed[ratio.motor, ratio.joint] = ratio.value
    return changed


# ---------------------------------------------------------------- fits


def _two_ways(
    design: FitDesign, both: tuple[RegressionRows, RegressionRows]
) -> Iterator[tuple[FitDesign, tuple[RegressionRows, RegressionRows]]]:
    """Yield a design with its rows, and with its two sides exchanged: of the two ways each row is unseen in one."""
    design = replace(design, before=None, worked={})
    yield design, both
    yield design.swapped(), (both[1], both[0])


def _both_ways(design: FitDesign, both: Rows, mix: Array) -> list[Array]:
    """Return what is left of unseen rows of the efforts that are recorded, the two ways (see `_two_ways`)."""
    trials = [fit(own, *rows) for own, rows in _two_ways(design, both)]
    return [_recorded(trial.new, trial.unseen, mix) for trial in trials]


def _likelier(rows: Sequence[RegressionRows], before: Sequence[Array], after: Sequence[Array]) -> tuple[float, float]:
    """Return by how much rows are likelier by what is left of them (M,) after, in all and in standard errors.

    Rows of which nothing is known after (NaN) say nothing.
    """
    sums = []
    for own, first, second in zip(rows, before, after, strict=True):
        both = np.where(np.isfinite(second), first, np.nan)
        gain = np.nan_to_num(_log_likelihood(own, second) - _log_likelihood(own, both))
        sums.append(np.bincount(own.block, gain)[np.unique(own.block)])
    gains = np.concatenate(sums)
    spread = float(np.std(gains)) * np.sqrt(gains.size)
    return float(gains.sum()), float(gains.sum()) / max(spread, 1e-300)


def _log_likelihood(rows: RegressionRows, left: Array) -> Array:
    """Return the logarithm of the likelihood of what is left of rows (M,), noise of a joint being as large as that."""
    sd = np.sqrt(np.maximum(_squares([rows], [left]) / np.maximum(rows.counts, 1), 1e-300))[rows.joint]
    return np.asarray(-np.log(sd) - 0.5 * (left / sd) ** 2)


def _squares(rows: Sequence[RegressionRows], left: Sequence[Array]) -> Array:
    """Return the mean squares of what is left of several kinds of rows, times the rows of each joint (n,)."""
    found = np.zeros(rows[0].n)
    for own, values in zip(rows, left, strict=True):
        known = np.isfinite(values)
        sums = np.bincount(own.joint[known], values[known] ** 2, own.n)
        found += sums * own.counts / np.maximum(np.bincount(own.joint[known], minlength=own.n), 1)
    return found + 1e-300


def _recorded(rows: RegressionRows, left: Array, mix: Array) -> Array:
    """Return what is left of rows (M,) of the efforts that are recorded, of which those of the joints are sums.

    left : (M,) what is left of these. mix : (n, n), columns of which make the sums. NaN where a joint that an effort
    takes part in stands still.
    """
    sums, back = rows.by_time(left), np.linalg.inv(mix)
    found = [sums[:, np.flatnonzero(column)] @ column[column != 0.0] for column in back.T]
    return rows.of_times(np.stack(found, axis=1))


def _both_gain(fall: Array, ratio: Ratio) -> bool:
    """Tell whether the squares of both joints' unseen rows fall by some part (n,), those of one by a visible one."""
    i, j = ratio.pair
    return bool(min(fall[i], fall[j]) > 0.0 and max(fall[i], fall[j]) > MIN_VALIDATION_SHARE)


def _friction(state: State, rows: RegressionRows, j: int, motors: Array) -> Array:
    """Return the friction (N, 2) of a motor that would turn with another joint, too, as columns beside all others."""
    loads, own = Loads(state.robot, state.robot.pi), rows.coupled(motors)
    return np.concatenate([column(law, 0.0, own, j, loads) for law in BASIC[:2]], axis=1)


def _pairs(robot: Robot, motors: Array, at_motor: tuple[bool, ...] | None = None) -> Iterator[tuple[int, int]]:
    """Yield a motor of motors (n, n), and a joint that it would turn with, too, beside one that it turns.

    Motors that turn several joints already are asked again only where their efforts are the motors'.
    """
    n = len(motors)
    shared = (motors != 0.0).sum(axis=0) + (motors != 0.0).sum(axis=1) > 2
    free = ~shared if at_motor is None else ~shared | np.array(at_motor)
    parents, prismatic = [joint.parent for joint in robot.joints], [joint.prismatic for joint in robot.joints]
    for j in np.flatnonzero(free).tolist():
        turned = np.flatnonzero(motors[j]).tolist()
        beside = [i for i in range(n) if any(parents[i] == k or parents[k] == i for k in turned)]
        yield from ((j, i) for i in beside if i not in turned and free[i] and prismatic[i] == prismatic[j])


def _with(state: State, design: FitDesign, j: int, motors: Array, unseen: bool = True) -> FitDesign:
    """Return a design in which the motor j turns with another joint, too: its friction and inertia act on both.

    ``unseen``: in unseen rows as well as in those of the fit.
    """
    loads, sides = Loads(state.robot, state.robot.pi), [design.known.copy(), design.unseen.copy()]
    for own, columns in zip(state.both[: 1 + unseen], sides, strict=False):
        rows = own.coupled(motors)
        for at, law in state.basic:
            if at == j:
                columns[:, [design.at(f"{j}.{law.effect}.{law.linear}")]] = column(law, 0.0, rows, j, loads)
        columns[:, [design.at(f"{j}.motor_inertia")]] = motor_inertia(rows, j)
    return FitDesign(design.names, sides[0], sides[1], design.mean, design.sd)


def _sure(trial: CoefficientEstimate, needed: float) -> bool:
    """Tell whether the friction of a coupling is there beyond doubt, and there again on unseen rows alone."""
    values = trial.theta[-2:]
    ratio = values / np.maximum(trial.errors()[-2:], 1e-300)
    if ratio.max() < needed:
        return False
    other = fit(trial.design.swapped(), trial.new, trial.rows, trial.weights)
    again = other.theta[-2:] / np.maximum(other.errors()[-2:], 1e-300)
    return bool(again[int(np.argmax(ratio))] >= MIN_VALIDATION_ERRORS)


__all__ = [
    "FoundCoupling",
    "Ratio",
    "at_joints",
    "coupled_model",
    "find_coupling",
    "find_coupling_of_efforts",
    "settled_ratios",
]
