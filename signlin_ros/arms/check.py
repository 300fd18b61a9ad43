"""What may be wrong with records of an arm, joint by joint, before anything is concluded from them.

Joints are known by name; whether a name is right shows in the numbers: a velocity is its own position's slope, an
effort moves its own joint.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.data import ArmRun, effort_step, late_motion, runs_of
from signlin_ros.arms.fit import prior
from signlin_ros.arms.piece import ArmSegment, chosen_band
from signlin_ros.arms.study import MAX_STEP_SHARE, least_range
from signlin_ros.checks.as_read import AsRead
from signlin_ros.checks.base import Check, changed, values_of, with_channel
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.jitter import Jitter
from signlin_ros.checks.repeated_values import RepeatedValues
from signlin_ros.checks.run import NO_CURE, check_cures
from signlin_ros.checks.run import check as generic
from signlin_ros.checks.sparse_channel import SparseChannel
from signlin_ros.filters import slope
from signlin_ros.model.arm import ArmModel
from signlin_ros.plants.arm import GAIN_PARAMETER
from signlin_ros.records import ModelData
from signlin_ros.robots import Joint, inverse_dynamics, regressor

Array = NDArray[np.float64]
GENERIC: tuple[type[Check], ...] = (AsRead, RepeatedValues, Jitter, SparseChannel)
"""Checks of any record that hold for an arm's, too."""
QUANTITIES = ("position", "velocity", "effort")
MIN_FINITE_SHARE = 0.9
"""Part of the samples of the densest channel that every other one needs."""
DEGREE, MILLIMETRE = np.pi / 180.0, 1e-3
ALIKE = 0.9
"""Correlation from which on two signals are the same."""
SLOPE_TOLERANCE = 0.2
"""Relative difference from which on a velocity is not the slope of its position."""
SAME_UNIT = 0.5
"""Part by which a position may change otherwise than its velocity says, and both be in one unit."""
LIMIT_TOLERANCE = 0.02
"""Part of a limit by which a calibrated sensor may be beyond it."""
GAIN_RANGE = 2.0
"""Factor by which an effort may be off the URDF's."""
MIN_GAIN_ERRORS = 8.0
"""Standard errors that a factor needs; rows are correlated, so these are many."""
URDF_ERRORS = 3.0
"""Standard errors, of what the URDF leaves open, by which a factor has to be beyond that range."""
BETTER = 0.3
"""By how much more of an effort another joint's motion has to explain for the two to be exchanged."""


def check(
    model: ArmModel, records: Sequence[ModelData], cures: Collection[str] = ()
) -> tuple[list[ModelData], list[Finding]]:
    """Return records with cures applied, and what was found in them; raise `InputError` for a cure that none offers.

    Cures that do no harm are applied; others if their names are among ``cures``, none with ``none`` there.
    """
    sound, found = [], []
    for record in records:
        (cured,), told = generic(model, [record], [NO_CURE] if NO_CURE in cures else (), kinds=GENERIC)
        for looks in (_channels, _motion, _limits, _efforts):
            if looks is _efforts and any(finding.open for finding in told):
                break  # what the motion is not, no effort fits
            for finding in list(looks(model, cured)):
                if not finding.cure or finding.cure not in [other.cure for other in told]:
                    cured, treated = _treated(cured, replace(finding, source=record.source), cures)
                    told.append(treated)
        sound.append(cured)
        found += told
    check_cures(cures, found)
    return sound, found


def _treated(record: ModelData, finding: Finding, cures: Collection[str]) -> tuple[ModelData, Finding]:
    wanted = finding.cure in cures or (finding.harmless and NO_CURE not in cures)
    if finding.action is None or not wanted:
        return record, finding
    return finding.action(record), finding.done()


def _found(
    check: str, channel: str, severity: str, sentence: str, cure: str = "", remedy: str = "", **more: Any
) -> Finding:
    return Finding(check, channel, severity, sentence, cure, remedy, **more)


# ---------------------------------------------------------------- channels


def _channels(model: ArmModel, record: ModelData) -> Iterator[Finding]:
    """Yield channels that are sparse, constant, wrapped, or not there."""
    names = model.robot.names
    there = [f"{n}.{q}" for n in names for q in QUANTITIES if q == "effort" or f"{n}.{q}" in record.measured]
    counts = {channel: int(np.isfinite(values_of(record, channel)).sum()) for channel in there}
    most = max(counts.values())
    for channel, count in counts.items():
        if count < MIN_FINITE_SHARE * most:
            said = f"{channel} has {count} samples where others have {most}: only rows in which all joints are"
            yield _found("mixed_rates", channel, "offer", f"{said} there count; record all joints at one rate")
    missing = [name for name in names if f"{name}.velocity" not in record.measured]
    if missing:
        whose = "no joint's velocity" if len(missing) == len(names) else f"no velocity of {', '.join(missing)}"
        said = f"{whose} is recorded: velocities of all joints are differentiated from their positions"
        yield _found("no_velocity", ", ".join(f"{n}.velocity" for n in missing), "note", said)
    for i, name in enumerate(names):
        yield from _of_joint(model, record, i, name)


def _of_joint(model: ArmModel, record: ModelData, i: int, name: str) -> Iterator[Finding]:
    joint = model.robot.joints[i]
    q, u = _finite(record, f"{name}.position"), _finite(record, f"{name}.effort")
    if q.size < 2 or u.size < 2:
        return
    jumps = int(np.count_nonzero(np.abs(np.diff(q)) > np.pi)) if not joint.prismatic else 0
    if jumps and np.abs(q).max() < 2.5 * np.pi:
        said = f"{name}.position jumps by a turn {jumps} times: an angle that wraps"
        cure = changed(f"{name}.position", _unwrapped)
        said_cure = f"unwrap_{name}", "it is unwrapped"
        yield _found("wrapped_angle", f"{name}.position", "note", said, *said_cure, harmless=True, action=cure)
        q = _unwrapped(q)
    if np.ptp(q) < least_range(joint):
        said = f"{name} hardly moves ({np.ptp(q):.2g} {joint.position_unit}): nothing is told of it"
        yield _found("no_motion", f"{name}.position", "offer", f"{said}; move it, or leave it out of joints")
    if np.ptp(u) == 0.0:
        said = f"{name}.effort is {u[0]:g} in every sample: nothing measures it"
        yield _found("frozen_channel", f"{name}.effort", "refuse", f"{said}; leave {name} out of joints")
        return
    step = effort_step(u)
    if step > MAX_STEP_SHARE * np.std(u):
        said = f"{name}.effort comes in steps of {step:.2g}, its spread is {np.std(u):.2g}"
        yield _found("coarse_effort", f"{name}.effort", "offer", f"{said}: nothing is told of this joint")


def _finite(record: ModelData, channel: str) -> Array:
    values = values_of(record, channel)
    return np.asarray(values[np.isfinite(values)])


def _unwrapped(values: Array) -> Array:
    found, good = np.array(values, dtype=float), np.isfinite(values)
    found[good] = np.unwrap(found[good])
    return found


# ---------------------------------------------------------------- motion


def _motion(model: ArmModel, record: ModelData) -> Iterator[Finding]:
    """Yield velocities that are not the slopes of their positions: units, signs, names."""
    names = model.robot.names
    if any(f"{name}.velocity" not in record.measured for name in names):
        return
    pieces = _pieces(model, record)
    rates = np.concatenate([np.stack([slope(c, p.step) for c in p.q.T], axis=1) for p in pieces])
    v = np.concatenate([p.v for p in pieces])
    yield from (_found("late_motion", "velocity", "note", said) for said in late_motion(names, pieces[0].run))
    alike = _correlations(rates, v)
    factors = np.sum(rates * v, axis=0) / np.maximum(np.sum(v**2, axis=0), 1e-300)
    for i, name in enumerate(names):
        others = [j for j in range(len(names)) if j != i]
        best = max(others, key=lambda j: alike[i, j], default=i)
        if abs(alike[i, i]) < 0.5 and alike[i, best] > ALIKE:
            said = f"{name}.velocity does not go with {name}.position, but {names[best]}.velocity does"
            yield _found("joint_names", f"{name}.velocity", "refuse", f"{said}: are the names right?")
        elif abs(alike[i, i]) > ALIKE and abs(factors[i] - 1.0) > SLOPE_TOLERANCE:
            yield _wrong_rate(model, record, i, float(factors[i]))


def _wrong_rate(model: ArmModel, record: ModelData, i: int, factor: float) -> Finding:
    """Return the finding on a velocity whose position changes ``factor`` times as fast."""
    name, joint = model.robot.names[i], model.robot.joints[i]
    said = f"{name}.position changes {factor:.3g} times as fast as {name}.velocity says"
    channel = f"{name}.velocity"
    size, short, unit = _other_unit(joint)
    if abs(factor * size - 1.0) < SLOPE_TOLERANCE:
        cure = changed(f"{name}.position", lambda q: q * size)
        ways, action = (f"{name}_position_in_{short}", f"the position is taken as {unit}"), cure
        return _found("unit", f"{name}.position", "refuse", f"{said}: it looks to be in {unit}", *ways, action=action)
    if abs(factor / size - 1.0) < SLOPE_TOLERANCE:
        cure = changed(channel, lambda v: v * size)
        ways, action = (f"{name}_velocity_in_{short}", f"the velocity is taken as {unit} per s"), cure
        return _found("unit", channel, "refuse", f"{said}: it looks to be in {unit} per s", *ways, action=action)
    if abs(factor + 1.0) < SLOPE_TOLERANCE:
        ways, action = (f"turn_{name}_velocity", "its sign is turned"), changed(channel, np.negative)
        return _found("sign", channel, "refuse", f"{said}: the signs of the two differ", *ways, action=action)
    why = "the unit of the time or of one of the two, or a gear between them"
    return _found("unit", channel, "refuse", f"{said}: {why}")


def _other_unit(joint: Joint) -> tuple[float, str, str]:
    """Return the unit in which a joint's position may be recorded beside rad (m): its size, its symbol and its name."""
    return (MILLIMETRE, "mm", "millimetres") if joint.prismatic else (DEGREE, "deg", "degrees")


def _pieces(model: ArmModel, record: ModelData) -> list[ArmSegment]:
    runs: list[ArmRun] = runs_of(model, record)
    band = chosen_band(runs)
    return [ArmSegment(model.robot, model.arm_plant.places, run, band) for run in runs]


def _correlations(a: Array, b: Array) -> Array:
    """Return the correlations (n, n) of columns of a and columns of b (T, n); 0 where nothing changes."""
    sides = [(x - x.mean(axis=0)) / np.maximum(np.linalg.norm(x - x.mean(axis=0), axis=0), 1e-300) for x in (a, b)]
    return np.asarray(sides[0].T @ sides[1])


# ---------------------------------------------------------------- limits


def _limits(model: ArmModel, record: ModelData) -> Iterator[Finding]:
    """Yield positions, velocities and efforts beyond what the URDF allows."""
    for joint in model.robot.joints:
        limits, name = dict(joint.limits), joint.name
        q = _finite(record, f"{name}.position")
        low, high = limits.get("lower", 0.0), limits.get("upper", 0.0)
        room = LIMIT_TOLERANCE * (high - low)
        if high > low and q.size and (q.min() < low - room or q.max() > high + room):
            unit = joint.position_unit
            said = f"{name}.position goes from {q.min():.3g} to {q.max():.3g} {unit}, its URDF allows"
            said = f"{said} {low:.3g} to {high:.3g} {unit}"
            size, short, other = _other_unit(joint)
            within = low - room <= q.min() * size and q.max() * size <= high + room
            if within and np.ptp(q) > 2.0 * (high - low):
                cure, both = _in_other_unit(record, name, size)
                what = "it and its velocity are" if both else "it is"
                ways, action = (f"{name}_position_in_{short}", f"{what} taken as {other}"), cure
                yield _found("unit", f"{name}.position", "refuse", f"{said}: {other}?", *ways, action=action)
            else:
                yield _found("limits", f"{name}.position", "note", f"{said}: another zero, or another robot")
        yield from _beyond(model, record, name, limits)


def _in_other_unit(record: ModelData, name: str, size: float) -> tuple[Callable[[ModelData], ModelData], bool]:
    """Return the cure of a position in a unit of a size, and whether the velocity beside it is in the same one."""
    v = record.measured.get(f"{name}.velocity")
    if v is None:
        return changed(f"{name}.position", lambda values: values * size), False
    q = record.measured[f"{name}.position"]
    good = np.isfinite(q) & np.isfinite(v)
    step = float(np.median(np.diff(record.t[good])))
    rate = slope(q[good], step)
    both = abs(float(rate @ v[good]) / max(float(v[good] @ v[good]), 1e-300) - 1.0) < SAME_UNIT
    names = [f"{name}.position", f"{name}.velocity"][: 1 + both]

    def cure(record: ModelData) -> ModelData:
        for one in names:
            record = changed(one, lambda values: values * size)(record)
        return record

    return cure, both


def _beyond(model: ArmModel, record: ModelData, name: str, limits: dict[str, float]) -> Iterator[Finding]:
    joint = model.robot.joints[model.robot.names.index(name)]
    gain = model.parameters[f"{name}.{GAIN_PARAMETER}"]
    channels = {"velocity": (1.0, f"{joint.position_unit}/s"), "effort": (gain, joint.effort_unit)}
    for what, (factor, unit) in channels.items():
        most = limits.get(what, 0.0)
        if most <= 0.0 or (what == "velocity" and f"{name}.velocity" not in record.measured):
            continue
        values = np.abs(factor * _finite(record, f"{name}.{what}"))
        peak = float(np.percentile(values, 99.0)) if values.size else 0.0
        if peak > (1.0 + LIMIT_TOLERANCE) * most:
            said = f"{name}.{what} reaches {peak:.3g} {unit}, its URDF allows {most:.3g} {unit}"
            yield _found("limits", f"{name}.{what}", "note", f"{said}: its unit, its gain, or another robot")


# ---------------------------------------------------------------- efforts


@dataclass(frozen=True)
class _Fitted:
    """An effort fitted by what the URDF says of a joint, and by friction: the factor, its error, friction, R²."""

    factor: float
    error: float
    friction: float
    friction_error: float
    explained: float


def _efforts(model: ArmModel, record: ModelData) -> Iterator[Finding]:
    """Yield efforts with another sign, of another size than the URDF's, or of another joint."""
    if any(np.ptp(_finite(record, f"{name}.effort")) == 0.0 for name in model.robot.names):
        return
    pieces, n = _pieces(model, record), model.robot.n
    if any(name in model.link_side for name in model.robot.names):
        return
    bodies, moves, tau = _bodies(pieces), _motions(pieces, n), np.concatenate([p.tau for p in pieces])
    motions = [_columns(bodies[:, j], moves, j) for j in range(n)]
    fits = [[_fitted(tau[:, i], motions[j]) for j in range(n)] for i in range(n)]
    yield from _exchanged(model, fits)
    yield from _joints_exchanged(model, pieces, moves, tau, [fits[i][i].explained for i in range(n)])
    for i, name in enumerate(model.robot.names):
        yield from _of_effort(model, record, i, name, fits[i][i], pieces, motions[i])


def _bodies(pieces: Sequence[ArmSegment]) -> Array:
    """Return what the URDF's bodies need (T, n), filtered."""
    needed = [inverse_dynamics(p.robot, p.q, p.v, p.a) for p in pieces]
    return np.concatenate([p.filtered(x) for p, x in zip(pieces, needed, strict=True)])


def _bodies_in(order: list[int], pieces: Sequence[ArmSegment]) -> Array:
    """Return the same at the rows alone, the joints' records taken in an order: near enough, and quick."""
    rows = [(p.robot, [x[p.index][:, order] for x in (p.q, p.v, p.a)]) for p in pieces]
    return np.concatenate([inverse_dynamics(robot, q, v, a) for robot, (q, v, a) in rows])


def _motions(pieces: Sequence[ArmSegment], n: int) -> tuple[Array, Array, Array]:
    """Return dry friction of size one, velocities and accelerations (T, n each), filtered."""
    signs = [p.filtered(np.tanh(p.v / (3.0 * p.noise[:n]))) for p in pieces]
    v, a = ([p.filtered(getattr(p, what)) for p in pieces] for what in ("v", "a"))
    return np.concatenate(signs), np.concatenate(v), np.concatenate(a)


def _columns(body: Array, moves: tuple[Array, Array, Array], j: int) -> Array:
    """Return what an effort is fitted by (T, 5): a joint's body (T,), and the motion of the joint j."""
    return np.stack([body, *(move[:, j] for move in moves), np.ones(len(body))], axis=1)


def _joints_exchanged(
    model: ArmModel,
    pieces: Sequence[ArmSegment],
    moves: tuple[Array, Array, Array],
    tau: Array,
    explained: Sequence[float],
) -> Iterator[Finding]:
    """Yield two joints whose records are each other's as a whole: the URDF explains the efforts of all if they are
    exchanged. Joints whose efforts it explains have nothing to gain.
    """
    joints, best = model.robot.joints, (BETTER, -1, -1)
    if len(joints) - sum(explained) < BETTER or model.arm.couplings:
        return
    for i, j in itertools.combinations(range(len(joints)), 2):
        if joints[i].prismatic != joints[j].prismatic:
            continue
        order = list(range(len(joints)))
        order[i], order[j] = j, i
        bodies = _bodies_in(order, pieces)
        fits = [_fitted(tau[:, own], _columns(bodies[:, at], moves, own)) for at, own in enumerate(order)]
        gain = sum(fit.explained for fit in fits) - sum(explained)
        best = max(best, (gain, i, j))
    if best[1] >= 0:
        a, b = joints[best[1]].name, joints[best[2]].name
        said = f"the efforts go with the URDF if the records of {a} and {b} are exchanged: the names are exchanged"
        ways = (f"exchange_joints_{a}_{b}", "the two joints are exchanged")
        yield _found("joint_names", f"{a}, {b}", "refuse", said, *ways, action=_exchange_all(a, b))


def _exchange_all(a: str, b: str) -> Callable[[ModelData], ModelData]:
    def cure(record: ModelData) -> ModelData:
        for what in (q for q in QUANTITIES if q == "effort" or f"{a}.{q}" in record.measured):
            record = _exchange(f"{a}.{what}", f"{b}.{what}")(record)
        return record

    return cure


def _left_open(model: ArmModel, pieces: Sequence[ArmSegment], i: int, X: Array) -> float:
    """Return the relative standard error of an effort's factor by what the URDF leaves open (its tolerance).

    A wrist whose centre of mass is on its axis hardly needs an effort: the URDF's error may be all of it.
    """
    body, others = X[:, 0], X[:, 1:]
    new = body - others @ np.linalg.lstsq(others, body, rcond=None)[0]
    units = np.concatenate([p.filtered(regressor(p.robot, p.q, p.v, p.a)[:, i]) for p in pieces])
    sd = prior(model.robot, model.arm.tolerance)
    return float(np.linalg.norm((new @ units) * sd) / max(float(new @ body), 1e-300))


def _fitted(tau: Array, X: Array) -> _Fitted:
    """Return the fit of an effort (T,) by columns (T, 5): rigid body, sign, velocity, motor's inertia, offset."""
    size = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    theta, *_ = np.linalg.lstsq(X / size, tau, rcond=None)
    left = tau - X / size @ theta
    sigma2 = float(left @ left) / max(len(tau) - X.shape[1], 1)
    errors = np.sqrt(sigma2 * np.maximum(np.diag(np.linalg.pinv((X / size).T @ (X / size))), 0.0)) / size
    theta = theta / size
    spread = float(np.sum((tau - tau.mean()) ** 2))
    explained = 1.0 - float(left @ left) / spread if spread > 0.0 else 0.0
    return _Fitted(float(theta[0]), float(errors[0]), float(theta[1]), float(errors[1]), explained)


def _exchanged(model: ArmModel, fits: list[list[_Fitted]]) -> Iterator[Finding]:
    names = model.robot.names
    for i in range(len(names)):
        for j in range(i):
            gain = min(fits[i][j].explained - fits[i][i].explained, fits[j][i].explained - fits[j][j].explained)
            if gain > BETTER:
                a, b = names[j], names[i]
                said = f"the effort of {a} goes with the motion of {b}, and that of {b} with the motion of {a}"
                ways = (f"exchange_{a}_{b}", "the two efforts are exchanged")
                action = _exchange(f"{a}.effort", f"{b}.effort")
                channel = f"{a}.effort, {b}.effort"
                yield _found("joint_names", channel, "refuse", f"{said}: the names are exchanged", *ways, action=action)


def _exchange(a: str, b: str) -> Callable[[ModelData], ModelData]:
    def cure(record: ModelData) -> ModelData:
        first, second = values_of(record, a).copy(), values_of(record, b).copy()
        return with_channel(with_channel(record, a, second), b, first)

    return cure


def _of_effort(
    model: ArmModel, record: ModelData, i: int, name: str, fit: _Fitted, pieces: Sequence[ArmSegment], X: Array
) -> Iterator[Finding]:
    channel = f"{name}.effort"
    gain = model.parameters[f"{name}.{GAIN_PARAMETER}"]
    sure = abs(fit.factor) > MIN_GAIN_ERRORS * fit.error
    rubs = abs(fit.friction) > MIN_GAIN_ERRORS * fit.friction_error
    against = (sure and fit.factor < 0.0) if sure else (rubs and fit.friction < 0.0)
    coarse = effort_step(_finite(record, channel)) > MAX_STEP_SHARE * np.std(_finite(record, channel))
    if coarse:
        return
    if against and not (rubs and fit.friction > 0.0):
        ways, action = (f"turn_{name}_effort", "its sign is turned"), changed(channel, np.negative)
        said = f"{channel} acts against the motion: its sign is turned"
        severity = "refuse" if sure and rubs and fit.factor < 0.0 else "offer"
        yield _found("sign", channel, severity, said, *ways, action=action)
        return
    off = max(abs(fit.factor), 1.0 / max(abs(fit.factor), 1e-300))
    if not (sure and fit.explained > 0.5 and off > GAIN_RANGE):
        return
    if off > GAIN_RANGE * (1.0 + URDF_ERRORS * _left_open(model, pieces, i, X)):
        unit = model.robot.joints[i].effort_unit
        said = f"{channel} is {abs(fit.factor):.3g} times what the URDF's masses need"
        way = f"effort: {{gain: {gain / abs(fit.factor):.3g}}} would fit them ({unit} per unit of the record)"
        yield _found("effort_scale", channel, "offer", f"{said}: a current, the motor's side of the gear? {way}")


__all__ = ["check"]
