"""Couplings that the model does not know: a motor that turns with the next joint too, its friction on both."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.fit import CoefficientEstimate, FitDesign, fit
from signlin_ros.arms.heldout import MIN_VALIDATION_ERRORS
from signlin_ros.arms.laws import BASIC, Loads, column, motor_inertia
from signlin_ros.arms.search import MIN_VALIDATION_SHARE, State, needed_errors

Array = NDArray[np.float64]
RATIOS = (1.0, -1.0)
"""Turns of a motor, in those of its own joint, for one of the joint beside it."""


def find_coupling(state: State, estimate: CoefficientEstimate) -> tuple[int, int, Array] | None:
    """Return the joint whose motor turns with another one too, that other, and the motors (n, n); None if none does.

    A coupling stands if its friction is sure beside all other, of unseen rows alone too, and both joints' unseen rows
    gain from it.
    """
    motors = state.rows.pieces[0].motors[: state.robot.n]
    fixed = fit(estimate.design, state.rows, state.new, estimate.weights)
    candidates = list(_candidates(motors))
    needed = needed_errors(2 * len(candidates))
    best: tuple[float, int, int, Array] | None = None
    for j, i, changed in candidates:
        extra = _beside(state, j, changed)
        trial = fit(fixed.design.plus(_COUPLED_EFFECTS, *extra), state.rows, state.new, fixed.weights)
        if not _sure(trial, needed):
            continue
        other = fit(_with(state, fixed.design, j, changed), state.rows, state.new, fixed.weights)
        with np.errstate(divide="ignore", invalid="ignore"):
            fall = 1.0 - (other.rms / fixed.rms) ** 2
            worth = float(np.nansum(np.log(fixed.rms) - np.log(other.rms)))
        if (
            min(fall[i], fall[j]) > 0.0
            and max(fall[i], fall[j]) > MIN_VALIDATION_SHARE
            and (best is None or worth > best[0])
        ):
            best = (worth, j, i, changed)
    return None if best is None else best[1:]


_COUPLED_EFFECTS = ("coupled.viscous_friction", "coupled.coulomb_friction")


def _beside(state: State, j: int, motors: Array) -> tuple[Array, Array]:
    """Return the friction of a motor that would turn with another joint, too, as columns beside all others."""
    loads = Loads(state.robot, state.robot.pi)
    rows = [r.coupled(motors) for r in state.both]
    known, unseen = (np.concatenate([column(law, 0.0, r, j, loads) for law in BASIC[:2]], axis=1) for r in rows)
    return known, unseen


def _candidates(motors: Array) -> Iterator[tuple[int, int, Array]]:
    """Yield the motor j, the joint i beside it that it would turn with, and the motors (n, n)."""
    n = len(motors)
    alone = [np.count_nonzero(motors[k]) == 1 and np.count_nonzero(motors[:, k]) == 1 for k in range(n)]
    for j in range(n):
        for i in (j - 1, j + 1):
            if 0 <= i < n and alone[i] and alone[j]:
                for ratio in RATIOS:
                    changed = motors.copy()
                    changed[j, i] = ratio
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


__all__ = ["find_coupling"]
