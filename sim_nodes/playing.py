"""A command played to a machine: what is sent when, when it is given up, and what was recorded. No ROS here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import InputError, choices, suggest
from signlin_ros.model import Model
from signlin_ros.records import Record, Signal, read_record, write_record

Array = NDArray[np.float64]

WAITING, PLAYING, PAUSED, DONE, ABORTED = "waiting", "playing", "paused", "done", "aborted"
"""Where a play is: until the first state; while the command is sent; between runs; at the end."""
MAX_ARRIVAL_OFFSET = 0.5
"""Steps by which times of arrival may be off an even clock, to be taken as one."""


@dataclass(frozen=True)
class Command:
    """Times t (T,) from 0 in s, and values u (T,) of the first input, held from each time to the next."""

    t: Array
    u: Array

    @property
    def step(self) -> float:
        """The median time between values in s."""
        return float(np.median(np.diff(self.t)))

    @property
    def duration(self) -> float:
        """From the first value to the end of the last one, in s."""
        return float(self.t[-1]) + self.step

    def at(self, time: float) -> float:
        """Return the value at a time from the start; 0 before and after."""
        if not 0.0 <= time < self.duration:
            return 0.0
        return float(self.u[int(np.searchsorted(self.t, time + 1e-9, side="right")) - 1])


def read_command(model: Model, path: str, limit: float, ramp: float = 0.0) -> Command:
    """Return the command in a file, faded in over ``ramp`` s; raise `InputError` where it is none, or is too large."""
    if not path:
        raise InputError("command: missing; give the file to play, e.g. -p command:=next.csv")
    record, name = read_record(Path(path)), model.inputs[0]
    if name not in record.signals:
        raise InputError(f"{path}: holds no {name}; there are: {choices(record.signals)}")
    t, u = record.t - record.t[0], np.asarray(record.signals[name].values, dtype=float)
    if t.size < 2 or not (np.isfinite(u).all() and (np.diff(t) > 0).all()):
        raise InputError(f"{path}: the command must have finite values at times that increase")
    if limit <= 0.0:
        raise InputError("limit: missing; give the largest |input|, e.g. -p limit:=6.0")
    most = float(np.abs(u).max())
    if most > limit:
        raise InputError(f"{path}: the {name} goes to {most:.6g}, beyond its limit {limit:g}")
    fade = np.clip(t / ramp, 0.0, 1.0) if ramp > 0.0 else 1.0
    return Command(t, u * fade)


def read_limits(model: Model, text: str) -> dict[str, float]:
    """Return limits of states from ``speed=80,position=1.5``; raise `InputError` for what is none."""
    found = {}
    for part in (p.strip() for p in text.split(",") if p.strip()):
        name, _, value = part.partition("=")
        known = model.states
        if name not in known:
            raise InputError(f"limits: unknown state {name!r}; there are: {choices(known)}{suggest(name, known)}")
        try:
            found[name] = float(value)
        except ValueError:
            found[name] = np.nan
        if not found[name] > 0.0:
            raise InputError(f"limits: {name}: found {value!r}; allowed: a positive number")
    return found


@dataclass
class Player:
    """Plays a command ``runs`` times, ``pause`` s apart, and gives up, with zero, as soon as a state comes within
    ``margin`` (a part) of its limit, of a position by its distance from where it was at first, or where no state has
    come for ``timeout`` s. Times in s.
    """

    model: Model
    command: Command
    limits: Mapping[str, float]
    runs: int = 2
    pause: float = 1.0
    timeout: float = 0.1
    margin: float = 0.05
    place: str = WAITING
    why: str = ""
    u: float = 0.0
    rows: list[list[tuple[float, float, Array]]] = field(default_factory=list)
    _begun: float = 0.0
    _latest: float = 0.0
    _first: Array | None = None

    @property
    def over(self) -> bool:
        """Whether nothing more is sent."""
        return self.place in (DONE, ABORTED)

    def take(self, x: Array, now: float) -> float:
        """Take a state x (n,) as the sensors show it, and return the input to send."""
        self._latest = now
        if self._first is None:
            self._first = x.copy()
        fault = self._fault(x)
        if fault:
            self._abort(fault)
        self._go(now)
        if self.place == PLAYING:
            self.rows[-1].append((now - self._begun, self.u, x.copy()))
        return self.u

    def tick(self, now: float) -> float:
        """Return the input to send at a time without a new state."""
        if self.place in (PLAYING, PAUSED) and now - self._latest > self.timeout:
            self._abort(f"no state has come for {now - self._latest:.3g} s")
        return self.u

    def stop(self, why: str) -> None:
        """Give up."""
        if not self.over:
            self._abort(why)

    def _go(self, now: float) -> None:
        """Go on to where a play is now, and what is sent there."""
        if self.place == WAITING:
            self.place, self._begun = PAUSED, now + self.pause
        if self.place == PLAYING and now - self._begun >= self.command.duration:
            self.place = DONE if len(self.rows) >= self.runs else PAUSED
            self._begun = now + self.pause
        if self.place == PAUSED and now >= self._begun:
            self.place, self._begun = PLAYING, now
            self.rows.append([])
        self.u = self.command.at(now - self._begun) if self.place == PLAYING else 0.0

    def _fault(self, x: Array) -> str:
        """Return which limit a state comes near to."""
        if not np.isfinite(x).all():
            return ""  # a sensor without a value says nothing; the time since the last state counts
        for name, most in self.limits.items():
            i = self.model.states.index(name)
            start = self._first[i] if self._first is not None and name == self.model.plant.position else 0.0
            if abs(x[i] - start) > (1.0 - self.margin) * most:
                return f"{name} is at {x[i] - start:.4g}, within {100 * self.margin:g} % of its limit {most:g}"
        return ""

    def _abort(self, why: str) -> None:
        if self.place != ABORTED:
            self.place, self.why, self.u = ABORTED, why, 0.0

    def record(self, run: int) -> Record:
        """Return a run as a record: what was sent, and what the sensors showed, at the times of the states."""
        rows = self.rows[run]
        t = evened(np.array([r[0] for r in rows]))
        signals = {self.model.inputs[0]: Signal(np.array([r[1] for r in rows]))}
        states = np.array([r[2] for r in rows])
        signals |= {name: Signal(states[:, i]) for i, name in enumerate(self.model.states)}
        return Record(t, signals, f"run {run + 1}")

    def written(self, path: str) -> list[str]:
        """Write the runs that are complete, the first to ``path``, others beside it, and return the files."""
        target, files = Path(path), []
        whole = self.rows if self.place == DONE else self.rows[:-1]
        for k in range(len(whole)):
            file = target if k == 0 else target.with_name(f"{target.stem}_again{k if k > 1 else ''}{target.suffix}")
            write_record(self.record(k), file)
            files.append(str(file))
        return files


def evened(t: Array) -> Array:
    """Return times of arrival (T,) as those of an even clock, where they are but late by less than half a step."""
    if t.size < 3:
        return t
    k = np.arange(t.size)
    step = (t[-1] - t[0]) / (t.size - 1)
    late = t - step * k
    even = t[0] + step * k + float(np.median(late - t[0]))
    return even - even[0] if np.quantile(np.abs(t - even), 0.99) < MAX_ARRIVAL_OFFSET * step else t


__all__ = ["ABORTED", "DONE", "PAUSED", "PLAYING", "WAITING", "Command", "Player", "read_command", "read_limits"]
