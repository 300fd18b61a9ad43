"""The coordinate over which an effect shows: the one that tells most of what it does along the record.

Velocity, position (within its period, or its turn), current, input, and each of them by direction of motion; travel
since the last reversal and the twist of a coupling for effects with a memory; time where nothing else will do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.data import arriving
from signlin_ros.diagnosis.onestep import Motion, Target, dependence, measured_columns, smoothed
from signlin_ros.diagnosis.problem import added_keys
from signlin_ros.effects import Effect, find_effect

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

AS_GOOD = 0.02
"""Shares of the variance that differ by less count as equal: then the simpler coordinate is taken."""
FLAT = 0.02
"""Variance over square of the mean below which an effect does the same everywhere."""
TELLS = 0.6
"""A coordinate that tells less of what an effect does is no use; then it is shown over time."""
MATTERS = 0.1
"""A coordinate is asked if what the effect does depends on it at least by this share of what it depends on most."""
BINS = 40
SLOW = 0.02
"""Slower than this share of the RMS velocity is not told from standing when reversals are looked for."""
STANDING, CREEPING = 0.002, 0.02
"""Below these shares of the RMS velocity a machine stands; the second where dry friction stays in the model, whose
direction is then a matter of noise."""
SPIKES = (0.005, 0.995)
"""What is beyond these quantiles does not decide over the coordinate."""
LEAST_SHOWN = 0.15
"""At least this share of the samples is shown over the travel since a reversal."""
SETTLED, BEYOND = 0.1, 3.0
"""After a reversal an effect has settled where so much of its change is left; shown is so many times that travel."""


@dataclass(frozen=True, eq=False)
class Place:
    """A coordinate: ``x`` (N,) in ``unit``, and ``side`` (N,), the direction of motion where it is told apart (else 0).

    ``inside`` (N,): what is shown; ``dense``: bins are narrow near 0. ``per`` (N,): what is lacking is shown for a unit
    of this, e.g. a voltage for each ampere. ``single``: x is the time, and samples are shown, not means.
    """

    name: str
    unit: str
    x: Array
    side: Array
    inside: Mask
    dense: bool = False
    per: Array | None = None
    single: bool = False

    @property
    def label(self) -> str:
        """What to write on the axis."""
        return f"{self.name} [{self.unit}]"


def place_of(motion: Motion, goal: Target, width: int, does: Array) -> Place:
    """Return the coordinate that tells most of what an effect ``does`` (N,) at its target, before the filter."""
    scene = _Scene(motion, goal, width, does)
    place = _best(scene, does)
    if any(surface.kind == "switch" for surface in motion.without.trace.surfaces):
        place = replace(place, inside=place.inside & ~scene.standing(CREEPING))
    return place


def _best(scene: _Scene, does: Array) -> Place:
    motion, goal = scene.motion, scene.goal
    kind = find_effect(motion.effect, "effects")
    if kind.resistance is not Effect.resistance and goal.kind == "state" and goal.name == "current":
        return scene.place("time", "s", scene.time, per=scene.column("current"))
    options = list(_options(scene, kind))
    does = np.where(scene.standing(STANDING), np.nan, does)
    does = np.clip(does, *np.nanquantile(does, SPIKES))
    known = np.isfinite(does)
    if np.var(does[known]) < FLAT * np.mean(does[known]) ** 2:
        return options[0]
    shares = [share_told(option, does) for option in options]
    if kind.spring is not Effect.spring and shares[0] > TELLS:  # the loop of a spring is what everybody knows
        return options[0]
    if max(shares) < TELLS:
        return scene.busiest()
    return next(o for o, share in zip(options, shares, strict=True) if share >= max(shares) - AS_GOOD)


def share_told(place: Place, does: Array) -> float:
    """Return the share of the variance of ``does`` (N,) that its means over bins of a coordinate account for."""
    good = place.inside & np.isfinite(does) & np.isfinite(place.x)
    if np.count_nonzero(good) < 4 * BINS:
        return 0.0
    x, y, side = place.x[good], does[good], place.side[good]
    left = 0.0
    for s in np.unique(side):
        own = y[side == s][np.argsort(x[side == s], kind="stable")]
        left += sum(float(np.sum((part - part.mean()) ** 2)) for part in np.array_split(own, BINS) if part.size)
    total = float(np.sum((y - y.mean()) ** 2))
    return 1.0 - left / total if total > 0 else 0.0


class _Scene:
    """The records of a motion end to end, as the target sees them: between samples for a state, else at them."""

    def __init__(self, motion: Motion, goal: Target, width: int, does: Array) -> None:
        self.motion, self.goal, self.width, self.does = motion, goal, width, does
        self.plant = motion.model.plant
        self.records = [measured_columns(motion, i) for i in range(len(motion.problem.segments))]
        self.time = self._at([s.t - s.t[0] for s in motion.problem.segments])

    def _at(self, parts: list[Array], width: int = 1) -> Array:
        between = self.goal.kind == "state"
        return smoothed([(p[1:] + p[:-1]) / 2 if between else p[1:] for p in parts], width)

    def unit(self, name: str) -> str:
        """Return the unit of a state, an input or an output, as the records have it."""
        return self.motion.problem.shown(self.motion.model.units[name])

    @property
    def position_unit(self) -> str:
        """The unit of positions, as the records have it."""
        return self.motion.problem.shown(self.plant.position_unit)

    def own(self, name: str) -> Array:
        """Return a state (N,) as the model with the effect has it."""
        i = self.motion.model.states.index(name)
        return self._at([X[:, i] for X in self.motion.after])

    def column(self, name: str) -> Array:
        """Return a state or a channel (N,): measured where it is, through the same filter as what is lacking."""
        if name in self.records[0]:
            return self._at([record[name] for record in self.records], self.width)
        return self.own(name)

    @property
    def known(self) -> set[str]:
        """Names of what `column` can return."""
        return {*self.records[0], *self.motion.model.states}

    def input(self) -> Array:
        """Return the first input (N,), held."""
        parts = [s.u[:-1, 0] for s in self.motion.problem.segments]
        return smoothed(parts, self.width)

    def direction(self) -> Array:
        """Return the sign of the velocity (N,), the last one where it stands."""
        return np.concatenate([sides for sides, _ in self.travels()])

    def travels(self) -> Iterator[tuple[Array, Array]]:
        """Yield for each record direction and travel since the last reversal, between samples or at them."""
        for i, s in enumerate(self.motion.problem.segments):
            v = self._motion(i)
            q = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * np.diff(s.t))])
            moving = np.abs(v) > SLOW * np.sqrt(np.mean(v**2))
            last = np.maximum.accumulate(np.where(moving, np.arange(v.size), 0))
            side = np.sign(v)[last]
            turned = np.flatnonzero(np.diff(side, prepend=side[0]))
            since = np.concatenate([[-1], turned])[np.searchsorted(turned, np.arange(v.size), side="right")]
            yield side[1:], np.where(since < 0, np.nan, q - q[np.maximum(since, 0)])[1:]

    def standing(self, share: float) -> Mask:
        """Return where (N,) the machine stands: what dry friction does there depends on everything."""
        parts = [np.abs(self._motion(i)) for i in range(len(self.records))]
        size = float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
        return self._at(parts) < share * size

    def _motion(self, i: int) -> Array:
        name = self.plant.velocity
        if name in self.motion.model.states:
            return np.asarray(self.motion.after[i][:, self.motion.model.states.index(name)])
        return np.asarray(self.motion.problem.segments[i].u[:, self.motion.model.inputs.index(name)])

    def place(self, name: str, unit: str, x: Array, **more: object) -> Place:
        """Return a coordinate that shows everything."""
        return Place(name, unit, x, np.zeros(x.size), np.isfinite(x), **more)  # type: ignore[arg-type]

    def busiest(self) -> Place:
        """Return the time, of a stretch in which the effect does most."""
        count = max(min(self.does.size, self.does.size // 8), min(self.does.size, 200))
        power = np.convolve(np.nan_to_num(self.does) ** 2, np.ones(count), mode="valid")
        first = int(np.argmax(power))
        inside = np.zeros(self.does.size, dtype=np.bool_)
        inside[first : first + count] = True
        return replace(self.place("time", "s", self.time, single=True), inside=inside)


# -------------------------------------------------------------------- what to choose from


def _options(scene: _Scene, kind: type[Effect]) -> Iterator[Place]:
    """Yield coordinates, the simplest first."""
    if scene.motion.of_sensor:
        yield from _of_sensor(scene)
        return
    if kind.states:
        yield from _of_memory(scene, kind)
    if scene.motion.model.delay > scene.motion.without.delay:
        yield _late(scene)
    needed = dependence(scene.motion, scene.goal)
    direction = scene.direction()
    plain = [option for find in (_velocity, _position, _turned, _current, _input) for option in find(scene, needed)]
    yield from plain
    yield from (replace(option, side=direction) for option in plain if not option.dense)
    if not plain:
        yield scene.busiest()


def _named(scene: _Scene, name: str, needed: dict[str, float]) -> Iterator[str]:
    """Yield a name if what the effect does depends on it, as far as that is known."""
    if name in scene.known | set(scene.motion.model.inputs) and needed.get(name, 0.0 if needed else 1.0) >= MATTERS:
        yield name


def _velocity(scene: _Scene, needed: dict[str, float]) -> Iterator[Place]:
    for name in _named(scene, scene.plant.velocity, needed):
        x = scene.column(name) if name in scene.known else scene.input()
        yield scene.place(name, scene.unit(name), x, dense=True)


def _position(scene: _Scene, needed: dict[str, float]) -> Iterator[Place]:
    for name in _named(scene, scene.plant.position, needed):
        yield scene.place(name, scene.position_unit, scene.column(name))


def _turned(scene: _Scene, needed: dict[str, float]) -> Iterator[Place]:
    """Yield the position within its period."""
    for name in _named(scene, scene.plant.position, needed):
        x, unit = scene.column(name), scene.position_unit
        period = _period(scene, float(np.nanmax(x) - np.nanmin(x)))
        if period is not None:
            yield scene.place(f"{name} within its period of {period:.4g} {unit}", unit, np.mod(x, period))


def _period(scene: _Scene, travel: float) -> float | None:
    """Return the period of the effect over position, or a whole turn where there are several; None without."""
    motion, kind = scene.motion, find_effect(scene.motion.effect, "effects")
    if kind.periodic:
        key = next(k for k in added_keys(motion.problem, motion.model, kind.name))
        order = motion.model.value(f"{key}.{kind.periodic[0]}")
        return 2 * np.pi / order if order * travel > 2 * np.pi else None
    return 2 * np.pi if scene.position_unit == "rad" and travel > 2 * np.pi else None


def _current(scene: _Scene, needed: dict[str, float]) -> Iterator[Place]:
    for name in _named(scene, "current", needed):
        yield scene.place(name, "A", scene.column(name))


def _input(scene: _Scene, needed: dict[str, float]) -> Iterator[Place]:
    for name in _named(scene, scene.motion.model.inputs[0], needed):
        if name != scene.plant.velocity:
            yield scene.place(name, scene.unit(name), scene.input())


def _late(scene: _Scene) -> Place:
    """The change of the input over the delay, which is what an input that comes late lacks."""
    model, late = scene.motion.model, scene.motion.model.delay - scene.motion.without.delay
    parts = [s.u[:-1, 0] - arriving(s.t, s.u[:, :1], late)[:, 0] for s in scene.motion.problem.segments]
    name, unit = model.inputs[0], scene.unit(model.inputs[0])
    return scene.place(f"change of {name} over {1e3 * late:.3g} ms", unit, smoothed(parts, scene.width))


def _of_memory(scene: _Scene, kind: type[Effect]) -> Iterator[Place]:
    motion = scene.motion
    side, since = (np.concatenate(parts) for parts in zip(*scene.travels(), strict=True))
    loops = [replace(position, side=side) for position in _position(scene, {})]
    if kind.spring is not Effect.spring:
        yield from loops
    names = [n for n in motion.model.states if n not in motion.without.states and n.endswith(".position")]
    if names and scene.plant.position in motion.model.states:
        twist = scene.own(scene.plant.position) - scene.own(names[0])
        yield scene.place("twist of the coupling", scene.position_unit, twist)
    place = scene.place("travel since the last reversal", scene.position_unit, since)
    yield replace(place, side=side, inside=place.inside & _settling(since, scene.does * side))
    yield from loops


def _settling(travel: Array, along: Array) -> Mask:
    """Return where (N,) the travel since a reversal is not much longer than what it takes for an effect to settle."""
    good = np.isfinite(travel) & np.isfinite(along)
    size = np.abs(np.where(good, travel, np.inf))
    order = np.argsort(size)[: np.count_nonzero(good)]
    parts = np.array_split(order, 4 * BINS)
    if parts[-1].size < 4:
        return good
    means = np.array([along[p].mean() for p in parts])
    final = float(np.median(means[len(means) // 2 :]))
    far = np.flatnonzero(np.abs(means - final) > SETTLED * abs(means[0] - final))
    settled = min(int(far[-1]) + 1, len(parts) - 1) if far.size else len(parts) - 1
    least = float(size[parts[int(LEAST_SHOWN * len(parts))]].max())
    return np.asarray(size <= max(BEYOND * float(size[parts[settled]].max()), least))


def _of_sensor(scene: _Scene) -> Iterator[Place]:
    name, unit = scene.goal.name, scene.goal.unit
    index = scene.motion.model.states.index(name) if name in scene.motion.model.states else None
    shown = [record[name] for record in scene.records]
    parts = shown if index is None else [X[:, index] for X in scene.motion.after]
    yield scene.place(name, unit, scene._at(parts))
    rates = [np.gradient(p, s.t) for p, s in zip(parts, scene.motion.problem.segments, strict=True)]
    yield scene.place(f"rate of change of {name}", f"{unit}/s", scene._at(rates))


__all__ = ["Place", "place_of", "share_told"]
