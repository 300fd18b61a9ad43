"""Couplings that the model does not know: a motor that turns with the next joint too, its friction on both.

The efforts of a record are those of the joints, or those of the motors: then a joint's effort is that of its own motor
with that of the other one, T^T u of efforts u. Likelihoods of unseen rows, with the logarithm of det T for each sample,
tell one coupling from another, and from none.   [Vuong, Econometrica 57(2), 1989]
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.data import ArmRun, of_motors
from signlin_ros.arms.fit import CoefficientEstimate, FitDesign, fit
from signlin_ros.arms.heldout import MIN_VALIDATION_ERRORS
from signlin_ros.arms.laws import BASIC, Loads, column, motor_inertia
from signlin_ros.arms.piece import RegressionRows
from signlin_ros.arms.search import MIN_VALIDATION_SHARE, State, needed_errors
from signlin_ros.model.arm import ArmModel
from signlin_ros.model.arm_file import Coupling
from signlin_ros.robots import Robot

Array = NDArray[np.float64]
RATIOS = (1.0, -1.0)
"""Turns of a motor, in those of its own joint, for one of the joint beside it."""
COUPLED_EFFECTS = ("coupled.viscous_friction", "coupled.coulomb_friction")
"""Names of the friction of a motor that turns with another joint, too, as columns of a fit."""
SINGULAR = 1e-9
"""Determinant of motors that do not move the joints independently."""


@dataclass(frozen=True, eq=False)
class FoundCoupling:
    """A motor that turns with another joint, too: its own joint, that other, and the motors from the joints (n, n)."""

    motor: int
    joint: int
    motors: Array
    worth: float

    @property
    def pair(self) -> tuple[int, int]:
        """The two joints in the order of the file."""
        return min(self.motor, self.joint), max(self.motor, self.joint)


def find_coupling(state: State, estimate: CoefficientEstimate) -> FoundCoupling | None:
    """Return the coupling that unseen rows gain most from, efforts being those of the joints; None if none stands.

    A coupling stands if its friction is sure beside all other, of unseen rows alone too, and both joints' unseen rows
    gain from it.
    """
    motors = state.rows.pieces[0].motors[: state.robot.n]
    fixed = fit(estimate.design, state.rows, state.new, estimate.weights)
    candidates = list(_candidates(state.robot, motors))
    needed = needed_errors(2 * len(candidates))
    best: FoundCoupling | None = None
    for j, i, changed in candidates:
        extra = _beside(state, j, changed)
        trial = fit(fixed.design.plus(COUPLED_EFFECTS, *extra), state.rows, state.new, fixed.weights)
        if not _sure(trial, needed):
            continue
        other = fit(_with(state, fixed.design, j, changed), state.rows, state.new, fixed.weights)
        with np.errstate(divide="ignore", invalid="ignore"):
            worth = float(np.nansum(np.log(fixed.rms) - np.log(other.rms)))
            fall = 1.0 - (other.rms / fixed.rms) ** 2
        if _both_gain(fall, i, j) and (best is None or worth > best.worth):
            best = FoundCoupling(j, i, changed, worth)
    return best


def find_coupling_of_efforts(
    state: State, estimate: CoefficientEstimate, at_motor: tuple[bool, ...]
) -> FoundCoupling | None:
    """Return the coupling that unseen rows gain most from where efforts are those of the motors; None if none stands.

    It stands if unseen rows are likelier by it beyond doubt, both joints' rows gain, and no coupling of which efforts
    are those of the joints makes them likelier.
    """
    before = state.rows.pieces[0].motors[: state.robot.n]
    base = [fit(d, *rows) for d, rows in _two_ways(estimate.design, state.both)]
    candidates = list(_candidates(state.robot, before, at_motor))
    candidates = [(j, i, P) for j, i, P in candidates if not {i, j} & state.barred]
    needed = needed_errors(2 * len(candidates))
    best: FoundCoupling | None = None
    for j, i, changed in candidates:
        design, change = _with(state, estimate.design, j, changed), np.asarray(np.linalg.solve(before, changed))
        rows = state.rows.of_motors(change), state.new.of_motors(change)
        trials = [fit(d, *both) for d, both in _two_ways(design, rows)]
        size = np.zeros(state.robot.n)
        size[[i, j]] = 0.5 * np.log(abs(np.linalg.det(change)))
        worth, errors = _likelier(base, trials, size)
        if errors < needed or (best is not None and worth <= best.worth):
            continue
        if _both_gain(1.0 - _squares(trials) / _squares(base), i, j):
            best = FoundCoupling(j, i, changed, worth)
    if best is None:
        return None
    for j, changed in ((j, P) for j, i, P in candidates if {i, j} == {best.motor, best.joint}):
        trials = [fit(d, *both) for d, both in _two_ways(_with(state, estimate.design, j, changed), state.both)]
        if _likelier(base, trials)[0] >= best.worth:
            return None
    return best


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


def _two_ways(
    design: FitDesign, both: tuple[RegressionRows, RegressionRows]
) -> Iterator[tuple[FitDesign, tuple[RegressionRows, RegressionRows]]]:
    """Yield a design with its rows, and with its two sides exchanged: of the two ways each row is unseen in one."""
    design = replace(design, before=None, worked={})
    yield design, both
    yield design.swapped(), (both[1], both[0])


def _likelier(
    base: list[CoefficientEstimate], trials: list[CoefficientEstimate], size: Array | float = 0.0
) -> tuple[float, float]:
    """Return by how much unseen rows are likelier by some fits than by others, in all and in standard errors.

    size : (n,) logarithm of how much larger the joints' efforts are in the trials.
    """
    sums = []
    for before, after in zip(base, trials, strict=True):
        gain = _log_likelihood(after) - _log_likelihood(before)
        gain += np.broadcast_to(size, before.new.n)[before.new.joint]
        sums.append(np.bincount(before.new.block, gain)[np.unique(before.new.block)])
    gains = np.concatenate(sums)
    spread = float(np.std(gains)) * np.sqrt(gains.size)
    return float(gains.sum()), float(gains.sum()) / max(spread, 1e-300)


def _log_likelihood(estimate: CoefficientEstimate) -> Array:
    """Return the logarithm of the likelihood of each unseen row (M,), noise of a joint being what they leave."""
    left, joint = estimate.unseen, estimate.new.joint
    sd = np.maximum(np.nan_to_num(estimate.rms, nan=1.0), 1e-300)[joint]
    return np.asarray(-np.log(sd) - 0.5 * (left / sd) ** 2)


def _squares(ways: list[CoefficientEstimate]) -> Array:
    """Return the sums of squares of unseen rows (n,) of several fits together, above nothing."""
    return np.asarray(1e-300 + sum(e.new.counts * np.nan_to_num(e.rms) ** 2 for e in ways))


def _both_gain(fall: Array, i: int, j: int) -> bool:
    """Tell whether the squares of both joints' unseen rows fall by some part (n,), those of one by a visible one."""
    return bool(min(fall[i], fall[j]) > 0.0 and max(fall[i], fall[j]) > MIN_VALIDATION_SHARE)


def _beside(state: State, j: int, motors: Array) -> tuple[Array, Array]:
    """Return the friction of a motor that would turn with another joint, too, as columns beside all others."""
    loads = Loads(state.robot, state.robot.pi)
    rows = [r.coupled(motors) for r in state.both]
    known, unseen = (np.concatenate([column(law, 0.0, r, j, loads) for law in BASIC[:2]], axis=1) for r in rows)
    return known, unseen


def _candidates(
    robot: Robot, motors: Array, at_motor: tuple[bool, ...] | None = None
) -> Iterator[tuple[int, int, Array]]:
    """Yield the motor j, the joint i that it would turn with, too, beside one that it turns, and the motors (n, n).

    Motors that turn several joints already are asked again only where their efforts are the motors'.
    """
    n = len(motors)
    shared = (motors != 0.0).sum(axis=0) + (motors != 0.0).sum(axis=1) > 2
    free = ~shared if at_motor is None else ~shared | np.array(at_motor)
    parents, prismatic = [joint.parent for joint in robot.joints], [joint.prismatic for joint in robot.joints]
    for j in np.flatnonzero(free).tolist():
        turned = np.flatnonzero(motors[j]).tolist()
        beside = [i for i in range(n) if any(parents[i] == k or parents[k] == i for k in turned)]
        for i in (i for i in beside if i not in turned and free[i] and prismatic[i] == prismatic[j]):
            for ratio in RATIOS:
                changed = motors.copy()
                changed[j, i] = ratio
                if abs(np.linalg.det(changed)) > SINGULAR:
                    yield j, i, changed


def _with(state: State, design: FitDesign, j: int, motors: Array) -> FitDesign:
    """Return a design in which the motor j turns with another joint, too: its friction and inertia act on both."""
    known, unseen = design.known.copy(), design.unseen.copy()
    loads = Loads(state.robot, state.robot.pi)
    for rows, columns in ((state.rows.coupled(motors), known), (state.new.coupled(motors), unseen)):
        for at, law in state.basic:
            if at == j:
                columns[:, [design.at(f"{j}.{law.effect}.{law.linear}")]] = column(law, 0.0, rows, j, loads)
        columns[:, [design.at(f"{j}.motor_inertia")]] = motor_inertia(rows, j)
    return FitDesign(design.names, known, unseen, design.mean, design.sd)


def _sure(trial: CoefficientEstimate, needed: float) -> bool:
    """Tell whether the friction of a coupling is there beyond doubt, and there again on unseen rows alone."""
    values = trial.theta[-2:]
    ratio = values / np.maximum(trial.errors()[-2:], 1e-300)
    if ratio.max() < needed:
        return False
    other = fit(trial.design.swapped(), trial.new, trial.rows, trial.weights)
    again = other.theta[-2:] / np.maximum(other.errors()[-2:], 1e-300)
    return bool(again[int(np.argmax(ratio))] >= MIN_VALIDATION_ERRORS)


__all__ = ["FoundCoupling", "at_joints", "coupled_model", "find_coupling", "find_coupling_of_efforts"]
