"""Rivals as the planner uses them: a model with its estimate, what first records know of it, and what it would show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.discrimination import PlannedRival
from signlin_ros.errors import SimulationError
from signlin_ros.experiment.sizes import Size, size_of
from signlin_ros.fitting.candidate import Candidate, candidate
from signlin_ros.fitting.problem import Problem
from signlin_ros.model import Model
from signlin_ros.model.numbers import numbers
from signlin_ros.model.uses import is_sensor
from signlin_ros.names import printed_name
from signlin_ros.simulation import Trajectory, simulate

Array = NDArray[np.float64]

SIMULATION_RTOL = 1e-5
"""Relative tolerance of simulations."""
MAX_LOG_SIGMA = 0.7
"""Largest change of a logarithm from an estimate to a sigma point: about twice or half."""
SIGMA_DIRECTIONS = 2
"""Directions of the largest uncertainty that sigma points are taken in, both ways."""


@dataclass(frozen=True, eq=False)
class Contender:
    """A rival: ``effects`` beyond the model as given, the ``candidate`` that a fit moves, its estimate ``theta`` (n,),
    the ``information`` (n, n) of the first records about it, and the smallest ``size`` at which it is of interest;
    ``told``: the model as it was told, where the estimate may be smaller than that; ``minima``: others of its fit,
    ``behind``: -2 log likelihood of each beside the estimate's; ``scale``: by how many times its inertia and all
    its forces are larger than estimated.
    """

    effects: tuple[str, ...]
    candidate: Candidate
    theta: Array
    information: Array
    size: Size | None = None
    told: Model | None = field(default=None, repr=False)
    minima: tuple[Array, ...] = ()
    behind: tuple[float, ...] = ()
    scale: float = 1.0
    models: dict[bytes, Model] = field(default_factory=dict, repr=False)

    @property
    def name(self) -> str:
        """What it is called."""
        own = " with ".join(printed_name(n) for n in self.effects) or "nothing more"
        return own if self.scale == 1.0 else f"{own} with all forces {100 * (self.scale - 1):g} % larger"

    @property
    def bounds(self) -> tuple[Array, Array]:
        """The least and the largest coordinates, no smaller than its size of interest."""
        low, high = (side.copy() for side in self.candidate.bounds)
        for name, (least, most) in (self.size.bounds if self.size else {}).items():
            i = self.index(name)
            k = self.candidate.coordinates[i]
            low[i] = max(low[i], k.theta(least)) if np.isfinite(least) else low[i]
            high[i] = min(high[i], k.theta(most)) if np.isfinite(most) else high[i]
        return low, high

    def index(self, name: str) -> int:
        """Return the place of a parameter among the coordinates."""
        return [k.name for k in self.candidate.coordinates].index(name)

    def model_at(self, theta: Array) -> Model:
        """Return the model, with its sensors, at some coordinates (n,)."""
        key = theta.tobytes()
        if key not in self.models:
            model, kinds = self.candidate.model_at(theta), dict[str, dict[str, float]]()
            for name, value in self.candidate.named(theta).items():
                kind, _, channel = name.partition(".")
                if kind.startswith("sensor_"):
                    kinds.setdefault(kind, {})[channel] = value
            for kind, values in kinds.items():
                model = model.with_effect(kind, None, **values)
            self.models[key] = model
        return self.models[key]

    @property
    def sigma_points(self) -> list[Array]:
        """Coordinates (n,) of other minima, then a standard error away, where the uncertainty is the largest."""
        values, axes = self._axes
        found = list(self.minima)
        for i in range(min(SIGMA_DIRECTIONS, values.size)):
            step = axes[:, i] / np.sqrt(max(float(values[i]), 1e-12))
            step *= min(1.0, MAX_LOG_SIGMA / max(float(np.abs(step).max()), 1e-12))
            found += [self._beside(s * step) for s in (1.0, -1.0)]
        return found

    @property
    def _axes(self) -> tuple[Array, Array]:
        """Eigenvalues (k,) and directions (n, k) of the information of the coordinates that are at no bound."""
        low, high = self.bounds
        free = np.flatnonzero((self.theta > low) & (self.theta < high))
        values, own = np.linalg.eigh(self.information[np.ix_(free, free)])
        axes = np.zeros((self.theta.size, free.size))
        axes[free] = own
        return values, axes

    def _beside(self, step: Array) -> Array:
        """Return coordinates (n,) a step away, or as far as bounds allow: one that is cut off by itself would be no
        likely value.
        """
        low, high = self.bounds
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(
                step > 0.0, (high - self.theta) / step, np.where(step < 0.0, (low - self.theta) / step, 1.0)
            )
        return np.asarray(self.theta + min(1.0, max(float(room.min(initial=1.0)), 0.0)) * step)

    def nearest(self, theta: Array) -> tuple[Array, float]:
        """Return the minimum (n,) of the first records about which coordinates are, and how far it is behind the best:
        what is known about one of them says nothing of another.
        """
        every = ((self.theta, 0.0), *zip(self.minima, self.behind, strict=True))
        return min(every, key=lambda one: one[1] + float((theta - one[0]) @ self.information @ (theta - one[0])))

    def planned(self) -> PlannedRival:
        """Return the rival for a diagnosis of the planned records: starts of fits, and the sizes of interest."""
        first = [self.told] if self.told else []
        starts = (*first, *(self.model_at(theta) for theta in (self.theta, *self.sigma_points)))
        return PlannedRival(self.effects, starts, self.size.bounds if self.size else {})

    def drawn(self, g: np.random.Generator, count: int) -> list[Array]:
        """Return coordinates (n,) drawn from the estimate's distribution, within bounds."""
        values, axes = self._axes
        spread = axes / np.sqrt(np.maximum(values, 1e-12))
        steps = np.clip(g.standard_normal((count, values.size)) @ spread.T, -1.0, 1.0)
        return [self._beside(step) for step in steps]

    def run(self, theta: Array, t: Array, u: Array, x0: Mapping[str, float]) -> Trajectory | None:
        """Return the motion under a command u (T, m); None where it diverges."""
        model = self.model_at(theta)
        start = np.array([_start(name, x0) for name in model.states])
        try:
            return simulate(model, t, u, start, rtol=SIMULATION_RTOL)
        except SimulationError:
            return None

    def shown(self, theta: Array, run: Trajectory, channels: Sequence[str]) -> Array:
        """Return the sensors' readings (T, channels) of a motion."""
        columns, sensors = [], self.model_at(theta).sensors
        for c in channels:
            values, sensor = run[c], sensors[c]
            late = np.interp(run.t - sensor.delay, run.t, values) if sensor.delay else values
            columns.append(np.asarray(sensor.show(late)))
        return np.column_stack(columns)


def _start(name: str, x0: Mapping[str, float]) -> float:
    """Return where a state starts: a load moves with the plant's own position."""
    if name in x0:
        return x0[name]
    own = name.rpartition(".")[2]
    return x0.get("position", x0.get("displacement", 0.0)) if own == "position" else 0.0


def contender(problem: Problem, model: Model, effects: Sequence[str], information: Array | None) -> Contender:
    """Return a model of the same plant with more effects as a contender; ``information``: see `Contender`, by default
    what priors know.
    """
    base, whole = problem.base, model
    added = {k: use for k, use in model.effects.items() if is_sensor(use) and k not in base.effects}
    shown = [(use.type, channel, v) for use in added.values() for channel, v in use.parameters.items()]
    sensors = {f"{kind}.{channel}": value for kind, channel, value in shown if channel in problem.channels}
    model = model.without_effect(*added)
    keys = tuple(k for k in model.effects if k not in base.effects)
    model = model.with_options(with_position=base.with_position) if base.plant.position_optional else model
    c, given = candidate(problem, model, keys, sensors), numbers(base)
    theta = c.start({**numbers(model), **sensors})
    c = replace(c, values={n: given.get(n, v) for n, v in c.values.items()})
    known = np.diag([1.0 / k.spread**2 for k in c.coordinates]) if information is None else information
    size = size_of(problem, c, theta)
    found = Contender(tuple(effects), c, theta, known, size, whole)
    low, high = found.bounds
    return replace(found, theta=np.clip(theta, low, high))


def information_of(c: Candidate, theta: Array, names: Sequence[str], covariance: Array) -> Array:
    """Return the information (n, n) of coordinates from the covariance of the values of parameters, by their names;
    of a parameter that is not among them, that of its prior.
    """
    slopes, own = c.slopes(theta), [k.name for k in c.coordinates]
    found = np.diag([k.spread**2 if np.isfinite(k.spread) else 1e6 for k in c.coordinates])
    there = [(own.index(n), i) for i, n in enumerate(names) if n in own]
    for a, i in there:
        for b, j in there:
            found[a, b] = covariance[i, j] / (slopes[a] * slopes[b])
    size = np.sqrt(np.maximum(np.diag(found), 1e-18))
    values, axes = np.linalg.eigh(found / np.outer(size, size))
    inverse = (axes / np.maximum(values, 1e-9)) @ axes.T
    return np.asarray(inverse / np.outer(size, size))


__all__ = ["Contender", "contender", "information_of"]
