"""States that are not measured, and measured ones without their noise: the model's own, corrected by what is measured.

`KalmanObserver` takes samples as they come and works them off when asked; `observed_states` does a whole record.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.observe.events import INPUT, QUERY, run_filters
from signlin_ros.observe.meter import NoiseMeter
from signlin_ros.observe.steps import pushed_states, step_address

Array = NDArray[np.float64]

FILTER_TRUSTS = (0.003, 0.03, 0.3, 3.0)
"""Shares by which the model may be wrong: one filter for each."""
MAX_FILTER_STEP = 1.25e-3
"""Seconds that the filter carries a state in one step."""
MOST_STEPS = 40
"""Steps between two samples at most: slow samples are followed in longer ones."""
UNKNOWN_DEVIATION = 1e3
"""Standard deviation of a velocity or a current of which nothing is known yet, in its SI unit."""
HARDLY_KNOWN = 1e-2
"""The same of a state that an effect has of its own."""
MAX_LEARNT_INNOVATION, LEARNT_OVER, TOO_LARGE = 400.0, 200.0, 3.0
"""A squared innovation counts so much at most; their mean is taken over so many samples; above this mean they are too
large even for the filter that trusts the model least, and the noise is taken as so much larger."""


Event = tuple[float, int, "Array | float"]
"""When, a kind of `signlin_ros.observe.events`, and an input (m,) or a measured value."""


@dataclass(frozen=True)
class _Events:
    """Events in the order of their times (E,): kinds (E,) and values (E, width)."""

    times: Array
    kinds: NDArray[np.int64]
    values: Array

    @classmethod
    def of(cls, events: list[Event], width: int) -> _Events:
        times = np.array([event[0] for event in events])
        kinds = np.array([event[1] for event in events], dtype=np.int64)
        values = np.zeros((times.size, width))
        for row, event in zip(values, events, strict=True):
            row[: np.size(event[2])] = event[2]
        return cls(times, kinds, values)

    def after(self, first: int) -> _Events:
        return _Events(self.times[first:], self.kinds[first:], self.values[first:])


@dataclass(frozen=True)
class StateEstimate:
    """The state x (n,) at time t in s, and its standard deviations (n,)."""

    t: float
    x: Array
    std: Array


@dataclass(frozen=True)
class Innovations:
    """What samples differed by from what was expected: time t (E,) in s, channel (E,), value and its variance (E,).

    ``x`` (E, n): the state after each.
    """

    t: Array
    channel: NDArray[np.int64]
    value: Array
    variance: Array
    x: Array

    @classmethod
    def of(cls, events: _Events, found: Array, n: int) -> Innovations:
        """Read what the filters have found at events (E, ...)."""
        seen = events.kinds >= 0
        return cls(events.times[seen], events.kinds[seen], found[seen, 0], found[seen, 1], found[seen, 2 : 2 + n])

    @classmethod
    def joined(cls, parts: Sequence[Innovations]) -> Innovations:
        """Put some together, one after the other."""
        names = ("t", "channel", "value", "variance", "x")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    def part(self, which: NDArray[np.bool_]) -> Innovations:
        """Return some of them, by a mask (E,)."""
        return Innovations(self.t[which], self.channel[which], self.value[which], self.variance[which], self.x[which])

    @property
    def sizes(self) -> Array:
        """Innovations in their standard deviations (E,)."""
        return np.asarray(self.value / np.sqrt(np.maximum(self.variance, 1e-300)))


class KalmanObserver:
    """The state of a running machine from measured states, by an extended Kalman filter on the model's equations.

    Parameters
    ----------
    model : the model; its sensors' offsets, gains and delays are taken off, its input delay is kept.
    channels : names of the states that are measured.
    noise : standard deviation of each channel's noise, in its unit as shown; measured along the way where not given.
    trusts : shares by which the model may be wrong; the likeliest of these filters is believed.
    doubt : share of what a jump of an input does that is not known, whatever the trust. Steady motion does not tell it.

    Times are in s; those of `take` must increase.
    """

    def __init__(
        self,
        model: Model,
        channels: Iterable[str],
        noise: Mapping[str, float] | None = None,
        trusts: Iterable[float] = FILTER_TRUSTS,
        doubt: float = 0.0,
    ) -> None:
        self.model = model
        self.channels = tuple(model.canonical(name) for name in channels)
        unknown = [name for name in self.channels if name not in model.states]
        if unknown or not self.channels:
            raise InputError(f"{', '.join(unknown) or 'no channel'}: an observer needs measured states of the model")
        self._sensors = [model.sensors[name] for name in self.channels]
        self._late = max(sensor.delay for sensor in self._sensors)
        self._states = np.array([model.states.index(name) for name in self.channels])
        self._address = step_address(model.structure)
        self._trusts, self._doubt = np.array(sorted(trusts)), float(doubt)
        self._disturbed = _disturbed(model)
        known = {model.canonical(name): value for name, value in (noise or {}).items()}
        self._meters = [NoiseMeter(known.get(name)) for name in self.channels]
        self._inputs, self._acted = np.zeros(len(model.inputs)), np.zeros(len(model.inputs))
        self._excess, self._factor = np.ones(len(self.channels)), np.ones(len(self.channels))
        self._learning = True
        self.reset()

    def reset(self) -> None:
        """Forget the state, not the noise: after a gap, or where time has jumped."""
        n, count = self._disturbed.size, self._trusts.size
        self._X, self._D, self._U = np.zeros((count, n)), np.zeros((count, n)), np.tile(np.eye(n), (count, 1, 1))
        self._usual, self._score, self._clock = np.zeros((count, n)), np.zeros(count), np.zeros(1)
        self._missed = np.zeros(len(self.channels), dtype=np.int64)
        self._queue: list[Event] = []
        self._gaps: list[float] = []
        self._last, self._started = -np.inf, False
        self._step = MAX_FILTER_STEP

    def adopt(self, other: KalmanObserver) -> None:
        """Go on where the observer of another model has got to: the states of one name, the noise, what is queued."""
        self._meters = [other.meter(name) or meter for name, meter in zip(self.channels, self._meters, strict=True)]
        if not other._started:
            return
        last = other.estimate()
        x, deviation = _start(self.model, dict(zip(other.model.states, last.x.tolist(), strict=True)))
        known = dict(zip(other.model.states, last.std.tolist(), strict=True))
        deviation = np.array([known.get(name, d) for name, d in zip(self.model.states, deviation, strict=True)])
        self._X[:, : x.size], self._D[:, : x.size] = x, deviation**2
        self._clock[0], self._last, self._started = other._clock[0], other._last, True
        if self._inputs.size == other._inputs.size:
            self._inputs[:], self._acted[:] = other._inputs, other._acted

    def meter(self, channel: str) -> NoiseMeter | None:
        """Return the noise meter of a channel, None where its noise is not measured."""
        return dict(zip(self.channels, self._meters, strict=True)).get(channel)

    def hold_noise(self) -> None:
        """Let the noise grow no more with innovations that are too large: from now on they count against the model."""
        self._learning = False

    # ---------------------------------------------------------------- what comes

    def take_input(self, t: float, u: ArrayLike) -> None:
        """Take an input (m,) that is held from time t on."""
        value = np.array(u, dtype=float).reshape(self._inputs.size)
        self._queue.append((t + self.model.delay, INPUT, value))

    def lose(self, t: float) -> None:
        """Take note that what came before time t does not tell the state from then on: something was lost."""
        self._gaps.append(t - self._late)

    def take(self, t: float, measured: Mapping[str, float]) -> None:
        """Take what the sensors show at time t, by name; NaN and absent is not measured."""
        if t <= self._last:
            raise InputError(f"time does not increase: {t} after {self._last}")
        self._last = t
        for c, (name, sensor) in enumerate(zip(self.channels, self._sensors, strict=True)):
            value = measured.get(name, np.nan)
            if value == value:
                self._meters[c].take(t, value)
                self._queue.append((t - sensor.delay, c, float(sensor.true(value))))

    # ---------------------------------------------------------------- what it tells

    def work(self) -> Innovations:
        """Work off all samples that are in order up to now, and return how they differed from what was expected."""
        self._queue.sort(key=lambda event: event[0])
        ready = self._last - self._late
        count = next((i for i, event in enumerate(self._queue) if event[0] > ready), len(self._queue))
        events, self._queue = self._queue[:count], self._queue[count:]
        if not self._started:
            events = self._begin(events)
        found = [self._between(part) for part in self._parts(events)]
        innovations = found[0] if len(found) == 1 else Innovations.joined(found)
        if self._learning:
            self._learn(innovations)
        return innovations

    def _parts(self, events: list[Event]) -> Iterator[list[Event]]:
        """Yield the events between gaps in turn; what is known of the state is doubted before each but the first."""
        ready = self._last - self._late
        for gap in [gap for gap in self._gaps if gap <= ready]:
            count = next((i for i, event in enumerate(events) if event[0] >= gap), len(events))
            yield events[:count]
            events = events[count:]
            self._doubt_state()
        self._gaps = [gap for gap in self._gaps if gap > ready]
        yield events

    def _between(self, events: list[Event]) -> Innovations:
        """Run the filters over events without a gap."""
        arrays = _Events.of(events, max(self._inputs.size, 1))
        return Innovations.of(arrays, self._run_all(arrays, *self._filters), len(self.model.states))

    def _doubt_state(self) -> None:
        """Let the state be as little known as at the start; its values stay, and what is usual."""
        _, spread = _start(self.model, {})
        position = self.model.plant.position
        if position in self.channels:
            spread[self.model.states.index(position)] = UNKNOWN_DEVIATION
        n = spread.size
        variance = np.einsum("fik,fk->fi", self._U**2, self._D)
        variance[:, :n] = np.maximum(variance[:, :n], spread**2)
        self._D[:], self._U[:] = variance, np.eye(variance.shape[1])

    @property
    def _filters(self) -> tuple[NDArray[Any], ...]:
        """All that running the filters changes."""
        known = (self._X, self._U, self._D, self._usual, self._score, self._clock)
        return (*known, self._inputs, self._acted, self._missed)

    def _learn(self, innovations: Innovations) -> None:
        """Let the noise grow where innovations stay larger than they should be, as with stamps that jitter.

        Before a channel's noise was measured they tell nothing of it.
        """
        squares = np.minimum(innovations.sizes**2, MAX_LEARNT_INNOVATION)
        for c in range(len(self.channels)):
            found = squares[innovations.channel == c]
            keep = np.exp(-found.size / LEARNT_OVER)
            if found.size and self._meters[c].known:
                self._excess[c] = keep * self._excess[c] + (1 - keep) * float(np.mean(found)) * max(
                    self._factor[c], 1.0
                )
        self._factor = np.where(self._excess > TOO_LARGE, self._excess, 1.0)

    def estimate(self, t: float | None = None) -> StateEstimate:
        """Return the state at time t, the last sample's by default, after all that came until then."""
        self.work()
        if not self._started:
            raise InputError("nothing was measured yet")
        when = max(self._last if t is None else t, float(self._clock[0]))
        events = [event for event in self._queue if event[0] <= when and event[1] == INPUT] + [(when, QUERY, 0.0)]
        arrays = _Events.of(events, max(self._inputs.size, 1))
        found = self._run_all(arrays, *(part.copy() for part in self._filters))[-1]
        x, variance = found[2:].reshape(2, -1)[:, : len(self.model.states)]
        return StateEstimate(when, x.copy(), np.sqrt(np.maximum(variance, 0.0)))

    def record(self, t: Array, measured: Mapping[str, Array], u: Array) -> tuple[Array, Innovations]:
        """Return the states (T, n) at the times t (T,) of a whole record, and how its samples differed from them."""
        events = self._all_events(t, measured, u)
        events = self._begun(events) if np.any(events.kinds >= 0) else events.after(events.times.size)
        found = self._run_all(events, *self._filters)
        asked = events.kinds == QUERY
        n = len(self.model.states)
        x = np.full((len(t), n), np.nan)
        x[len(t) - int(asked.sum()) :] = found[asked, 2 : 2 + n]
        return x, Innovations.of(events, found, n)

    def _all_events(self, t: Array, measured: Mapping[str, Array], u: Array) -> _Events:
        """Return the events of a whole record in order: inputs and values as they come, then what is asked for."""
        width = max(self._inputs.size, 1)
        parts = [(t + self.model.delay, INPUT, np.asarray(u, dtype=float).reshape(len(t), -1))]
        for c, (name, sensor) in enumerate(zip(self.channels, self._sensors, strict=True)):
            value = np.asarray(measured[name], dtype=float) if name in measured else np.full(len(t), np.nan)
            there = ~np.isnan(value)
            self._meters[c].take_all(t[there], value[there])
            parts.append((t[there] - sensor.delay, c, np.asarray(sensor.true(value[there])).reshape(-1, 1)))
        parts.append((t, QUERY, np.zeros((len(t), 1))))
        times = np.concatenate([when for when, _, _ in parts])
        kinds = np.concatenate([np.full(when.size, kind, dtype=np.int64) for when, kind, _ in parts])
        rows = np.concatenate([np.pad(v, ((0, 0), (0, width - v.shape[1]))) for _, _, v in parts])
        order = np.lexsort((kinds, kinds == QUERY, times))  # of one time: the input, what is measured, what is asked
        return _Events(times[order], kinds[order], rows[order])

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviation of the noise of each channel, as it is known now."""
        return {name: meter.sigma for name, meter in zip(self.channels, self._meters, strict=True)}

    @property
    def usual_noise(self) -> dict[str, float]:
        """Standard deviation of the noise of each channel, the median of what was found up to now."""
        return {name: meter.usual for name, meter in zip(self.channels, self._meters, strict=True)}

    @property
    def trust(self) -> float:
        """The share by which the model is wrong, by the likeliest filter."""
        return float(self._trusts[int(np.argmax(self._score))])

    # ---------------------------------------------------------------- inside

    def _begin(self, events: list[Event]) -> list[Event]:
        """Start the filters at the first measured values; returns the events that are left for them."""
        if all(event[1] < 0 for event in events):
            self._queue = events + self._queue
            return []
        left = self._begun(_Events.of(events, max(self._inputs.size, 1)))
        return events[len(events) - left.times.size :]

    def _begun(self, events: _Events) -> _Events:
        """Start the filters at the first measured values, of which there must be some; returns what is left."""
        first = int(np.argmax(events.kinds >= 0))
        before = np.flatnonzero(events.kinds[:first] == INPUT)
        if before.size:
            self._inputs[:] = events.values[before[-1], : self._inputs.size]
        self._acted[:] = self._inputs
        channels, at = np.unique(events.kinds, return_index=True)
        shown = {self.channels[c]: float(events.values[k, 0]) for c, k in zip(channels, at, strict=True) if c >= 0}
        x, deviation = _start(self.model, shown)
        self._X[:, : x.size], self._D[:, : x.size] = x, deviation**2
        self._clock[0], self._started = events.times[first], True
        return events.after(first)

    def _run_all(self, events: _Events, *known: NDArray[Any]) -> Array:
        n = self._disturbed.size
        times, kinds, values = events.times, events.kinds, events.values
        found = np.full((times.size, 2 + 2 * n), np.nan)
        if not times.size:
            return found
        gains = np.array([sensor.gain for sensor in self._sensors])
        R = self._factor * np.array([max(meter.sigma, 1e-12) for meter in self._meters]) ** 2 / gains**2
        X, U, D, usual, score, clock, u, acted, missed = known
        self._step = max(self._step, (times[-1] - clock[0]) / len(times) / MOST_STEPS)
        fixed = (self._states, R, missed, self._step, found)
        done = run_filters(
            self._address, times, kinds, values, clock, X, U, D, usual, score, self._trusts, self._doubt, u, acted,
            self._disturbed, self.model.p, *fixed,
        )  # fmt: skip
        if done < len(times):
            self.reset()
            raise InputError("the observer's state ran away")
        return found


def _disturbed(model: Model) -> Array:
    """Return 1 for the states of effects, and the pushes, whose equations may be wrong (n + pushes,)."""
    plant = model.plant
    kinematic = {plant.position} if plant.velocity in model.states else set()
    kinematic |= {name for name in model.states if name.endswith(".position")}
    pushes = [1.0] * len(pushed_states(model.structure))
    return np.array([0.0 if name in kinematic else 1.0 for name in model.states] + pushes)


def _start(model: Model, measured: Mapping[str, float]) -> tuple[Array, Array]:
    """Return the state (n,) of which only the first measured values are known, and its standard deviations (n,).

    What hangs on the machine is where the machine is.
    """
    x, states = model.x0.astype(float).copy(), model.states
    position = model.plant.position
    if position in measured and position in states:
        shift = measured[position] - x[states.index(position)]
        x += [shift if name.endswith(".position") else 0.0 for name in states]
    for name, value in measured.items():
        if name in states:
            x[states.index(name)] = value
    own = [("." in name or name in model.plant.own_state_names.values()) for name in states]
    spread = np.where(own, HARDLY_KNOWN, UNKNOWN_DEVIATION) * [name not in measured for name in states]
    if position in states and position not in measured:
        spread[states.index(position)] = 0.0  # where it began counts as known: nobody sees it
    return x, spread


def observed_states(model: Model, t: Array, measured: Mapping[str, Array], u: Array) -> tuple[Array, Innovations]:
    """Return the states (T, n) at every sample of a record, each from what was measured until then, and innovations.

    ``measured`` (T,) by name as the sensors show it, u (T, m). The level of the noise alone is taken from the whole
    record.
    """
    noise = {name: NoiseMeter.of(t, values) for name, values in measured.items()}
    observer = KalmanObserver(model, measured, noise)
    return observer.record(t, measured, u)


__all__ = ["Innovations", "KalmanObserver", "StateEstimate", "observed_states"]
