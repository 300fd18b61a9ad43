"""A measured record as a stream of states and inputs, each from what was measured until then."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import RecordError
from signlin_ros.estimate import StateEstimator
from signlin_ros.model import Model
from signlin_ros.nodes.joint import joint_values
from signlin_ros.records import read_for_model

Array = NDArray[np.float64]
LAST_SECOND = 2.0**31
"""Where ROS time ends, in s; it begins at 0."""


@dataclass(frozen=True)
class Sample:
    """One moment: time since the start in s, whole state x (n,), input u (m,), and the joint's values.

    State and joint are as the model's sensors show them, so that what was measured is played as it was.
    ``switch``: only the input is new; it switches between two states.
    """

    t: float
    x: Array
    u: Array
    joint: dict[str, float]
    switch: bool = False


class Playback:
    """A record in a model's terms. States that it does not hold come from `StateEstimator`.

    Raises `RecordError` or `ModelError` where the record does not hold the model's inputs, or none of its
    states.
    """

    def __init__(self, model: Model, path: str) -> None:
        if not path:
            raise RecordError("record: missing; give the file or bag to play, e.g. -p record:=run.csv")
        self.model = model
        self.data = read_for_model(Path(path), model)
        self.t = self.data.t - self.data.t[0]
        self.measured = tuple(name for name in model.states if name in self.data.measured)
        if not self.measured:
            raise RecordError(f"{path}: holds none of the states {', '.join(model.states)}")
        self.step = float(np.median(np.diff(self.t)))

    @property
    def duration(self) -> float:
        """Time from the first sample of one round to that of the next, in s."""
        return float(self.t[-1]) + self.step

    @property
    def clock_start(self) -> float:
        """Time of the first sample on /clock in s: the record's own, or 0 where it has times that ROS cannot hold."""
        return float(self.data.t[0]) if self.not_in_ros is None else 0.0

    @property
    def not_in_ros(self) -> float | None:
        """The record's first or last time in s, whichever ROS cannot hold; None if it can hold both."""
        return next((t for t in self.data.t[[0, -1]].tolist() if not 0.0 <= t < LAST_SECOND), None)

    def round(self) -> Iterator[Sample]:
        """Yield the record's samples once, from an estimator that knows nothing yet."""
        estimator, sensors = self.estimator(), self.model.sensors
        last: Sample | None = None
        for t, i, row in self._moments():
            u = self.data.u[row]
            if i is None:
                if last is not None:
                    yield replace(last, t=t, u=u, switch=True)
                continue
            found = {name: float(self.data.measured[name][i]) for name in self.measured}
            true = {name: sensors[name].true(value) for name, value in found.items() if not math.isnan(value)}
            x = self.model.shown_states(estimator.update(t, true, u))
            state = dict(zip(self.model.states, x.tolist(), strict=True))
            last = Sample(t, x, u, joint_values(self.model, state, u))
            yield last

    def _moments(self) -> Iterator[tuple[float, int | None, int]]:
        """Yield times, the sample that was measured then (None: only the input switches), and the row of the input."""
        rows = range(self.t.size)
        if self.data.acts is None:
            yield from zip(self.t.tolist(), rows, rows, strict=True)
            return
        acts = self.data.acts - self.data.t[0]
        force = np.maximum(np.searchsorted(acts, self.t, side="right") - 1, 0).tolist()
        moments: list[tuple[float, int | None, int]] = list(zip(self.t.tolist(), rows, force, strict=True))
        moments += [(float(acts[k]), None, k) for k in rows if acts[k] > 0.0 and acts[k] != self.t[k]]
        yield from sorted(moments, key=lambda moment: moment[0])

    def estimator(self) -> StateEstimator:
        """Return a new estimator of the whole state from what the record holds."""
        return StateEstimator(self.model, self.measured, rate=1.0 / self.step)

    def notes(self) -> list[str]:
        """Return where the states that were not measured come from, a sentence each."""
        estimator, velocity = self.estimator(), self.model.plant.velocity
        found = []
        if velocity in self.model.states and velocity not in (*self.measured, *estimator.carried):
            source, delay = self.model.plant.position, estimator.delay * 1e3
            found.append(f"{velocity} from {source} by a causal filter, delay {delay:.3g} ms")
        if estimator.carried:
            found.append(f"carried by the model: {', '.join(estimator.carried)}")
        return found

    def rounds(self, loop: bool) -> Iterator[Sample]:
        """Yield the samples of one round, or of endless ones, time going on."""
        start = 0.0
        while True:
            for sample in self.round():
                yield replace(sample, t=start + sample.t)
            if not loop:
                return
            start += self.duration
