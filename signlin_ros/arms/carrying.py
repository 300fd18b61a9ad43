"""The payload alone, where the file says that it is not known: all else stays as the file has it.

A model that was refined without a load, and a record with one: what is left of the effort is the load's, friction that
grows with it included. No friction is refitted, so the mass is as good as the efforts' gains.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.distance import body_distance
from signlin_ros.arms.fit import CoefficientEstimate, FitDesign, fit
from signlin_ros.arms.keys import Key
from signlin_ros.arms.laws import payload
from signlin_ros.arms.piece import ArmSegment, RegressionRows
from signlin_ros.arms.proposal import Proposal
from signlin_ros.arms.search import settled
from signlin_ros.arms.study import Study, predicted
from signlin_ros.arms.verbs import ArmComparison, ArmDiagnosis, in_file
from signlin_ros.model.arm import ArmModel
from signlin_ros.model.arm_file import Payload
from signlin_ros.robots import inverse_dynamics

Array = NDArray[np.float64]
PAYLOAD_ROUNDS = 4
"""Times that the payload is corrected: friction depends on it only through the sign and size of loads."""


def carried(comparison: ArmComparison) -> ArmDiagnosis:
    """Return the payload that what is left of a model says, of mass and, where its tolerance says so, centre."""
    study = comparison.study
    first = study.model.arm.payload
    assert first is not None  # noqa: S101 - for the type checker
    tolerance = dict(first.tolerance)
    moments = tolerance.get("com", 0.0) > 0.0 or not np.any(first.com)
    mean = np.array([first.m, *(first.m * np.array(first.com))]) if moments else np.array([first.m])
    sd = np.array([tolerance.get("m", np.inf) or np.inf, *[np.inf] * 3]) if moments else np.array([tolerance["m"]])
    values, com = mean.copy(), np.array(first.com)
    for _ in range(PAYLOAD_ROUNDS):
        model = _with(study.model, values, com, moments)
        estimate = _step(study, model, values, com, moments, mean, sd)
        values = values + estimate.theta
    errors = estimate.errors()
    model = _with(study.model, values, com, moments)
    own = study.new.by_joint(study.left(model, study.new))
    units = ("kg", "kg·m", "kg·m", "kg·m")
    names = ("m", "mx", "my", "mz")[: values.size]
    told = {n: (float(v), float(e), u) for n, v, e, u in zip(names, values, errors, units, strict=False)}
    table = replace(comparison.table, model=own)
    state = study.state()  # bodies are told beside the payload, which nothing else moves for
    state.terms = [*in_file(study), (Key("payload", -1), None)]
    bodies = body_distance(settled(state))
    compared, proposed = replace(comparison, table=table, bodies=bodies), Proposal(model, model.urdf)
    return ArmDiagnosis(*(compared, study.state(), estimate, (), (), (), proposed), payload=told, only_payload=True)


def _with(model: ArmModel, values: Array, com: Array, moments: bool) -> ArmModel:
    before = model.arm.payload
    assert before is not None  # noqa: S101 - for the type checker
    m = float(max(values[0], 0.0))
    centre = values[1:] / m if moments and m > 0.0 else com
    return model.with_payload(Payload(before.on, m, tuple(float(v) for v in centre)))


def _step(
    study: Study, model: ArmModel, values: Array, com: Array, moments: bool, mean: Array, sd: Array
) -> CoefficientEstimate:
    """Return the correction of a payload's parameters (1 or 4,), from the model's residual."""
    sides = []
    for rows in (study.rows, study.new):
        left = rows.y - predicted(model, rows)
        body = payload(rows, *study.payload_place)
        columns = body if moments else (body @ np.concatenate([[1.0], com]))[:, None]
        sides.append((left, columns + _through_friction(model, rows, columns)))
    rows, new = (_left(rows, side[0]) for rows, side in zip((study.rows, study.new), sides, strict=True))
    names = ("payload.m", "payload.mx", "payload.my", "payload.mz")[: mean.size]
    return fit(FitDesign(names, sides[0][1], sides[1][1], mean - values, sd), rows, new)


def _through_friction(model: ArmModel, rows: RegressionRows, columns: Array) -> Array:
    """Return the effort (N, k) of load-dependent friction for columns of loads on the joints (N, k)."""
    found = np.zeros(columns.shape)
    for key, use in model.effects.items():
        if use.type != "load_dependent_friction":
            continue
        i = model.arm_plant.place_of(key)
        kappa = use.parameters["kappa_e"] + use.parameters["kappa_d"]
        among = rows.joint == i
        found[among] += kappa * (columns * _turned(model, rows, i)[:, None])[among]
    return found


def _turned(model: ArmModel, rows: RegressionRows, i: int) -> Array:
    """Return sign(load) sign(velocity) of a motor (N,), filtered."""

    def of(piece: ArmSegment) -> Array:
        load = inverse_dynamics(model.robot, piece.q, piece.v, piece.a)[:, i]
        return np.asarray(np.sign(load) * piece.signs[i].sign(piece.signs[i].velocity))

    return np.asarray(rows.motor(i, of))


def _left(rows: RegressionRows, left: Array) -> RegressionRows:
    other = copy(rows)
    other.y = left
    return other


__all__ = ["carried"]
