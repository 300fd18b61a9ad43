"""Records of an arm: positions, velocities and efforts of all joints at even times, cut at gaps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.numbered import said as said_of_numbers
from signlin_ros.arms.rates import lags_of
from signlin_ros.errors import RecordError
from signlin_ros.model.arm import ArmModel
from signlin_ros.plants.arm import GAIN_PARAMETER
from signlin_ros.records import ModelData, read_record, read_runs
from signlin_ros.records.header import heading

Array = NDArray[np.float64]
MIN_GAP_RATIO = 5.0
"""Times the median step from which on two samples have a gap between them."""
MIN_PART_SECONDS = 2.0
"""Seconds that a part of a record needs."""
EVEN_TOLERANCE = 0.1
"""Part of a step by which samples may be off an even time and count as even."""
SAME_LEVEL_SHARE, PER_LEVEL = 1e-3, 20
"""Part of their range within which two efforts are one level; samples per level from which on levels are few."""
MEASURED_AS = ("effort", "torque", "current", "force", "load", "tau")
"""What is in the names of columns that may be efforts."""
NO_COLUMN = "no column for input"
"""What is said of a record without a column for an effort."""
HELD_OUT = 2 / 3
"""Share of every record that is fitted to, where no other is given to validate with."""


@dataclass(frozen=True, eq=False)
class ArmRun:
    """A part of a record without gaps, evenly sampled: t (T,) s; q, tau (T, n); v (T, n) or None where not measured.

    Units are rad, rad/s and N·m (m, m/s and N of a prismatic joint), tau at the joints. ``steps`` (n,) of the efforts
    where these come in few levels, 0 elsewhere; ``lags`` (n,) s by which velocities were recorded later than positions,
    if any; ``late`` s by which efforts were, where that was asked; ``shown`` (T, n) velocities as they were recorded.
    """

    t: Array
    q: Array
    v: Array | None
    tau: Array
    source: str
    steps: Array
    lags: Array | None = None
    late: float | None = None
    shown: Array | None = None

    @property
    def step(self) -> float:
        """Time between samples in s."""
        return float(self.t[1] - self.t[0])

    def __len__(self) -> int:
        return int(self.t.size)

    def part(self, first: float, last: float) -> ArmRun:
        """Return the samples between two shares of the run, 0 to 1."""
        cut = slice(round(first * len(self)), round(last * len(self)))
        v, shown = (None if x is None else x[cut] for x in (self.v, self.shown))
        return replace(self, t=self.t[cut], q=self.q[cut], v=v, tau=self.tau[cut], shown=shown)


def read_data(model: ArmModel, paths: Sequence[str], signals: Mapping[str, str]) -> list[ModelData]:
    """Return the records in files in the model's terms, joints found by name; raise `RecordError` naming what lacks."""
    try:
        records = [record for path in paths for record in read_runs(path, model, signals)]
    except RecordError as error:
        numbers = _numbered(model, paths) if NO_COLUMN in str(error) else ""
        raise RecordError(f"{error}{numbers or _way_out(model, str(error))}") from error
    for record in records:
        lost = [f"{name}.position" for name in model.robot.names if f"{name}.position" not in record.measured]
        if lost:
            raise RecordError(
                f"{record.source}: {', '.join(lost)} missing; joints are found by name, not by their order: columns "
                f"{lost[0]}, or a JointState, or --signal {lost[0]}=COLUMN; or leave the joint out of joints"
            )
    return records


def _numbered(model: ArmModel, paths: Sequence[str]) -> str:
    """Return the signals of a record whose columns number the joints; nothing of others."""
    labels = read_record(paths[0]).labels.values()
    return said_of_numbers([heading(label).name for label in labels], model.robot)


def _way_out(model: ArmModel, said: str) -> str:
    """Return hints on an arm's file, for an effort in another unit and for a joint that is not there."""
    for i, name in enumerate(model.robot.names):
        if f"{name}.effort is in " in said:
            if model.arm_plant.at_motor[i]:
                ratio = next(abs(c.ratio(name)) for _, c in model.arm.couplings if name in c.joints)
                return f"; or in the model file {name}: {{effort: {{gain: {ratio:.6g}}}}}, the ratio of its motor"
            return f"; or in the model file {name}: {{effort: {{gain: ...}}}}, what one of its units is in N·m (N)"
        if f"the input '{name}.effort' is missing before its first value" in said:
            return "; efforts that were never measured tell nothing of what acts: leave the joint out of joints"
        if f"{NO_COLUMN} '{name}.effort'" in said:
            if not any(word in said.partition("it has")[2].partition("; ")[0].lower() for word in MEASURED_AS):
                return "; without efforts (torques, currents) nothing is told of an arm: positions do not say them"
            return f"; or leave {name} out of joints: it is locked then"
    return ""


def runs_of(model: ArmModel, record: ModelData) -> list[ArmRun]:
    """Return the parts of a record between gaps, sampled evenly; raise `RecordError` where nothing is long enough."""
    names = model.robot.names
    q = np.stack([record.measured[f"{name}.position"] for name in names], axis=1)
    measured = all(f"{name}.velocity" in record.measured for name in names)
    v = np.stack([record.measured[f"{name}.velocity"] for name in names], axis=1) if measured else None
    tau = in_time(record.t, record.u * gains_of(model), model.effort_delays)
    at_motor = np.array(model.arm_plant.at_motor)
    tau = tau @ np.where(at_motor[None, :], model.arm_plant.motors.T, np.eye(len(names))).T
    good = np.isfinite(q).all(axis=1) & np.isfinite(tau).all(axis=1)
    if v is not None:
        good &= np.isfinite(v).all(axis=1)
    at = np.flatnonzero(good)
    step = float(np.median(np.diff(record.t)))
    cuts = np.flatnonzero(np.diff(record.t[at]) > MIN_GAP_RATIO * step) + 1
    found = [
        _even(record.t[part], q[part], None if v is None else v[part], tau[part], step, record.source)
        for part in np.split(at, cuts)
        if part.size > 1 and record.t[part[-1]] - record.t[part[0]] >= MIN_PART_SECONDS
    ]
    if not found:
        raise RecordError(f"{record.source}: no part without gaps is {MIN_PART_SECONDS:g} s long")
    return _at_one_time(found)


def _at_one_time(runs: list[ArmRun]) -> list[ArmRun]:
    """Return the parts of a record with positions and velocities at one time, by what the longest part tells."""
    longest = max(runs, key=len)
    if longest.v is None:
        return runs
    lags, found = lags_of(longest.q, longest.v, longest.step), []
    for run in runs:
        q, v = lags.in_one_time(run.q, run.v, run.step)  # type: ignore[arg-type]
        found.append(replace(run, q=q, v=v, lags=lags.seconds, shown=run.v))
    return found


def late_motion(names: Sequence[str], run: ArmRun) -> list[str]:
    """Return sentences on the joints whose velocity is recorded later than the position by a sample or more, or the
    other way round.
    """
    lags, found = np.zeros(len(names)) if run.lags is None else run.lags, []
    for what, other, sign in (("velocity", "position", 1.0), ("position", "velocity", -1.0)):
        late = sorted((sign * lag, name) for name, lag in zip(names, lags, strict=True) if sign * lag > run.step)
        if late:
            ends = dict.fromkeys([late[0], late[-1]])
            by = " to ".join(f"{lag:.3g} s ({name})" for lag, name in ends)
            of = f"of {len(late)} of {len(names)} joints {what} is recorded later than {other}, by {by}"
            too = f", efforts as {run.late:.3g} s late" if run.late else ""
            found.append(f"{of}: a filter, or its way; both are taken at one time{too}")
    return found


def in_time(t: Array, tau: Array, delays: Sequence[float] | Array) -> Array:
    """Return efforts (T, n) as they were when the motion was, which is recorded earlier by some delays in s."""
    if not np.any(delays):
        return tau
    return np.stack([np.interp(t + delay, t, column) for column, delay in zip(tau.T, delays, strict=True)], axis=1)


def shifted(run: ArmRun, delays: Array) -> ArmRun:
    """Return a run whose efforts are put in time with the motion, by delays (n,) in s."""
    return replace(run, tau=in_time(run.t, run.tau, delays))


def with_delays(model: ArmModel, delays: Array) -> ArmModel:
    """Return a model whose file says that efforts are recorded later than the motion, by more seconds (n,)."""
    content = model.to_dict()
    for name, before, more in zip(model.robot.names, model.effort_delays, delays, strict=True):
        section = content.get(name, {})
        if more:
            content[name] = {**section, "effort": {**section.get("effort", {}), "delay": float(before + more)}}
    return ArmModel.from_dict(content, model.source, model.folder)


def resized(run: ArmRun, gains: Array) -> ArmRun:
    """Return a run whose efforts, which show (n,) times what acts, are as large as what acts."""
    return replace(run, tau=run.tau / gains, steps=run.steps / np.abs(gains))


def of_motors(run: ArmRun, change: Array) -> ArmRun:
    """Return a run whose efforts are those of motors that turn several joints: each is a sum of them (n, n)."""
    tau = run.tau @ change
    return replace(run, tau=tau, steps=np.array([effort_step(column) for column in tau.T]))


def with_gains(model: ArmModel, gains: Array) -> ArmModel:
    """Return a model whose file says that efforts show other sizes than it said, (n,) times what acts."""
    content, efforts = model.to_dict(), dict(model.arm.efforts)
    for name, before, shown in zip(model.robot.names, gains_of(model), gains, strict=True):
        section = content.get(name, {})
        if shown != 1.0:
            own = {"gain": float(before / shown), "unit": efforts[name].unit}
            content[name] = {**section, "effort": {**section.get("effort", {}), **own}}
    return ArmModel.from_dict(content, model.source, model.folder)


def gains_of(model: ArmModel) -> Array:
    """Return the gains of the efforts in N·m (N) per unit of the record (n,)."""
    return np.array([model.parameters[f"{name}.{GAIN_PARAMETER}"] for name in model.robot.names])


def _even(t: Array, q: Array, v: Array | None, tau: Array, step: float, source: str) -> ArmRun:
    """Return samples at even times, in between by straight lines; as they are where they are even already."""
    steps = np.array([effort_step(column) for column in tau.T])
    if np.abs(t - t[0] - step * np.arange(t.size)).max() <= EVEN_TOLERANCE * step:
        return ArmRun(t[0] + step * np.arange(t.size), q, v, tau, source, steps)
    even = np.arange(t[0], t[-1], step)

    def at(values: Array) -> Array:
        return np.stack([np.interp(even, t, column) for column in values.T], axis=1)

    return ArmRun(even, at(q), None if v is None else at(v), at(tau), source, steps)


def effort_step(tau: Array) -> float:
    """Return the step of efforts (T,) that come in few levels; 0 where they do not."""
    same = SAME_LEVEL_SHARE * float(np.ptp(tau))
    levels = np.unique(np.round(tau / same)) if same > 0.0 else np.zeros(1)
    few = levels.size > 1 and levels.size * PER_LEVEL <= tau.size
    return float(np.median(np.diff(levels))) * same if few else 0.0


def sides(
    model: ArmModel, records: Sequence[ModelData], validation: Sequence[ModelData], share: float = HELD_OUT
) -> tuple[list[ArmRun], list[ArmRun]]:
    """Return the runs to fit and those that no fit sees: other records, or the last part of each."""
    runs = [run for record in records for run in runs_of(model, record)]
    if validation:
        return runs, [run for record in validation for run in runs_of(model, record)]
    known, unseen = [run.part(0.0, share) for run in runs], [run.part(share, 1.0) for run in runs]
    long = [k for k, run in enumerate(unseen) if run.t.size and run.t[-1] - run.t[0] >= 0.5 * MIN_PART_SECONDS]
    if not long:
        raise RecordError(
            f"{runs[0].source}: the last {1 - share:.0%} are too short to validate with; give --validation"
        )
    return known, [unseen[k] for k in long]


__all__ = [
    "HELD_OUT",
    "ArmRun",
    "gains_of",
    "in_time",
    "late_motion",
    "of_motors",
    "read_data",
    "resized",
    "runs_of",
    "shifted",
    "sides",
    "with_delays",
    "with_gains",
]
