"""A record as the checks look at it: what several of them need is worked out once."""

from __future__ import annotations

import functools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.factors import other_units
from signlin_ros.checks.linear import Base, linear_base
from signlin_ros.checks.observer import Followed, LinearPrediction, follow, prediction, summed
from signlin_ros.checks.travel import Travel, travel
from signlin_ros.model import Model
from signlin_ros.noise import Noise, noise_level, quantum_of
from signlin_ros.records import ModelData

Array = NDArray[np.float64]

MAX_NOISE_SAMPLES = 20_000
"""So many samples tell the noise of a channel."""
VARIANCE_BLOCKS = 8
MIN_SAMPLES = 20
"""Fewer samples tell nothing."""
SIGNED_OVER_NOISE = 4.0
"""Times its noise from which on a velocity has a sign."""


class Look:
    """A record and a model, and what is known of them.

    ``channels``: measured states and outputs; ``position``, ``velocity``: their names in this model, whether measured
    or not.
    """

    def __init__(self, model: Model, record: ModelData) -> None:
        self.model, self.record = model.under(record.conditions), record
        self.channels = tuple(record.measured)
        self.position, self.velocity = model.plant.position, model.plant.velocity
        self.reported: tuple[str, ...] = ()
        self._noise: dict[str, Noise] = {}
        self._quantum: dict[str, float] = {}

    def on(self, record: ModelData, reported: tuple[str, ...]) -> Look:
        """Return the look at a record after a check that has ``reported`` something of these inputs and channels."""
        other = self if record is self.record else Look(self.model, record)
        other.reported = reported
        return other

    @property
    def t(self) -> Array:
        """The stamps (T,) in s."""
        return self.record.t

    @functools.cached_property
    def step(self) -> float:
        """The median time between samples in s."""
        return float(np.median(np.diff(self.t))) if self.t.size > 1 else 0.0

    @functools.cached_property
    def duration(self) -> float:
        """From the first sample to the last in s."""
        return float(self.t[-1] - self.t[0]) if self.t.size else 0.0

    @functools.cached_property
    def _inputs(self) -> dict[str, Array]:
        return {name: np.ascontiguousarray(self.record.u[:, j]) for j, name in enumerate(self.record.inputs)}

    def of(self, name: str) -> Array:
        """Return the values (T,) of an input or a measured channel; NaN is a missing sample."""
        return self.record.measured[name] if name in self.record.measured else self._inputs[name]

    def finite(self, name: str) -> tuple[Array, Array]:
        """Return times and values of an input or channel where it is measured."""
        values = self.of(name)
        good = np.isfinite(values)
        return (self.t, values) if good.all() else (self.t[good], values[good])

    def noise(self, name: str) -> Noise:
        """Return the noise of a channel, from its finest differences alone."""
        if name not in self._noise:
            self._noise[name] = self._noise_of(name)
        return self._noise[name]

    def _noise_of(self, name: str) -> Noise:
        t, y = self.finite(name)
        parts = list(_blocks(y.size))
        found = [noise_level(t[part], y[part]) for part in parts]
        return found[int(np.argsort([n.sigma for n in found])[len(found) // 2])]

    def quantum(self, name: str) -> float:
        """Return the step of a channel's values, 0 where they come in none."""
        if name not in self._quantum:
            self._quantum[name] = quantum_of(self.finite(name)[1][:MAX_NOISE_SAMPLES])
        return self._quantum[name]

    def unit(self, name: str) -> str:
        """Return the unit of an input or channel."""
        return self.record.units.get(name, self.model.units[name])

    def others(self, name: str) -> dict[str, float]:
        """Return other units that an input or channel may be in, and how many of them one of its own is."""
        units = self.record.units
        said = self.model.is_rotary is not None or self.position in units or self.velocity in units
        return other_units(self.unit(name), self.model.turns(units) if said else None)

    @functools.cached_property
    def base(self) -> Base | None:
        """The linear part of the model; None where it has none to speak of."""
        return linear_base(self.model)

    @functools.cached_property
    def travel(self) -> Travel | None:
        """How position and velocity go together; None where they are not both recorded, or too briefly."""
        q, v = self.position, self.velocity
        if q not in self.channels or v not in (*self.channels, *self.record.inputs):
            return None
        at = np.isfinite(self.of(q)) & np.isfinite(self.of(v))
        return travel(self.t[at], self.of(q)[at], self.of(v)[at], self.noise(q).sigma, self.noise(v).sigma)

    @functools.cached_property
    def followed(self) -> Followed | None:
        """The record as an observer of the linear base follows it."""
        return follow(self.base, self.record, self.channels) if self.base else None

    @functools.cached_property
    def predicted(self) -> LinearPrediction | None:
        """What that leaves."""
        return summed(self.followed) if self.followed else None

    @functools.cached_property
    def resisted(self) -> LinearPrediction | None:
        """What that leaves where dry friction, a load and gravity may act, of whatever size: what any machine has."""
        v = self.motion
        if self.base is None or v is None or self.model.plant.motion_is_imposed():
            return self.predicted
        forces = {"dry friction": -np.sign(v), "load": np.ones(v.size)}
        free = {"dry friction": self._moving, "load": ""}
        if self.position in self.channels and self.model.turns(self.record.units):
            q = np.nan_to_num(self.of(self.position))
            forces |= {"gravity": np.sin(q), "gravity aside": np.cos(q)}
            free |= {"gravity": "", "gravity aside": ""}
        return prediction(self.base, self.record, self.channels, forces, free)

    @property
    def _moving(self) -> str:
        return self.velocity if self.velocity in self.channels else self.position

    @functools.cached_property
    def motion(self) -> Array | None:
        """The velocity (T,), 0 where it is not clear of its noise; None where no motion is recorded."""
        if self.velocity in self.channels:
            v, noise = self.of(self.velocity), self.noise(self.velocity).sigma
        elif self.position in self.channels:
            v = np.gradient(self.of(self.position), self.t)
            noise = self.noise(self.position).sigma / max(self.step, 1e-300)
        else:
            return None
        v = np.nan_to_num(v)
        return np.where(np.abs(v) > SIGNED_OVER_NOISE * noise, v, 0.0)


def _blocks(size: int) -> Iterator[slice]:
    """Yield a few stretches of a long record, or all of it."""
    if size <= MAX_NOISE_SAMPLES:
        yield slice(0, size)
        return
    length = MAX_NOISE_SAMPLES // VARIANCE_BLOCKS
    for first in np.linspace(0, size - length, VARIANCE_BLOCKS).astype(int):
        yield slice(int(first), int(first) + length)


__all__ = ["MIN_SAMPLES", "Look"]
