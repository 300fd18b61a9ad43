"""What the monitor does, without ROS: how far A_k, B_k and the model are from the machine, and since when.

Times are whole nanoseconds of one clock, and are passed in.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from signlin_ros.errors import InputError
from signlin_ros.linearization import Linearization, Linearizer
from signlin_ros.model import Model
from signlin_ros.nodes.channels import Channels
from signlin_ros.nodes.told import ERROR, LEVEL_OK, NANO, WARN, Health, Refusal, Update
from signlin_ros.observe.detect import Alarm
from signlin_ros.observe.naming import ObservedWindow, Question
from signlin_ros.observe.steps import CERTAIN_SHARE
from signlin_ros.observe.watch import Watch
from signlin_ros.predict import without_dry_friction
from signlin_ros.records import Record, Signal

Array = NDArray[np.float64]

PREDICTION_PARTS = 10
"""An update period is predicted in so many parts, each with its mean input."""
NAMING_SPAN = 20 * NANO
"""Nanoseconds of data before and after a change that its name is taken from."""
LEAST_FITTED = 5
"""Predictions that a fit is told of at least."""
RIGHT_TO = 1 - CERTAIN_SHARE
"""Share by which the equations of a model that is right may be off: so well are base parameters known by default."""


@dataclass(frozen=True)
class MonitorSettings:
    """How the monitor judges: ``keep``, ``window``, ``learn`` in s, ``warn_above`` in multiples of the usual error.

    ``ignored``: channels that are left out (see `Channels`).
    """

    keep: float = 120.0
    window: float = 10.0
    learn: float = 30.0
    warn_above: float = 3.0
    ignored: str = ""


@dataclass(frozen=True)
class MonitorScore:
    """One judged update: stamp in ns, error (n,) of A_k, B_k and of the friction-free model at the period's end.

    ``rms``, ``rms_bare``, ``fit`` (n,): over the window.
    """

    stamp: int
    error: Array
    bare: Array
    rms: Array
    rms_bare: Array
    fit: Array


@dataclass(frozen=True)
class _Judged:
    stamp: int
    error: Array
    bare: Array
    truth: Array


class MonitorLogic:
    """States, inputs and updates in; scores, alarms, health and records out."""

    def __init__(self, settings: MonitorSettings, now: int) -> None:
        self.settings = settings
        self.refused: dict[str, int] = {}
        self.model: Model | None = None
        self.reset(now)

    # ---------------------------------------------------------------- what comes

    def configure(self, model: Model, now: int) -> None:
        """Take another model to watch with; what was seen stays, what is usual is learnt anew."""
        bare = without_dry_friction(model).with_options(operating_point="start")
        self._bare, self.bare_linearizer = bare, Linearizer(bare)
        self.model, self.channels = model, Channels(model, self.settings.ignored)
        self._forget_model(now)

    def learn_anew(self, now: int) -> None:
        """Forget an alarm, and learn anew what is usual; what was seen stays."""
        self._forget_model(now)

    def reset(self, now: int) -> None:
        """Forget all that was seen: the clock has jumped."""
        self._epoch = now
        self._shown: deque[tuple[int, dict[str, float]]] = deque()
        self._inputs: deque[tuple[int, Array]] = deque()
        self._forget_model(now)

    def _forget_model(self, now: int) -> None:
        self._watch: Watch | None = None
        self._states: deque[tuple[float, Array]] = deque()
        self._updates: deque[Update] = deque()
        self._judged: deque[_Judged] = deque()
        self.usual_error: Array | None = None
        self._since = now

    def take_input(self, value: Array | Refusal, now: int) -> None:
        """Hold an input (m,) from now on."""
        if isinstance(value, Refusal):
            self._refuse(f"input_{value.kind}")
            return
        self._inputs.append((now, value))
        if self._watch is not None:
            self._watch.take_input(self._seconds(now), value)

    def take_shown(self, shown: Mapping[str, float] | Refusal, stamp: int) -> None:
        """Take what the sensors show, by the model's names; a repeated or older stamp is refused."""
        if isinstance(shown, Refusal):
            self._refuse(shown.kind)
            return
        if self._shown and stamp <= self._shown[-1][0]:
            self._refuse("repeated" if stamp == self._shown[-1][0] else "out_of_order")
            return
        dead = self.channels.dead if self.model is not None else ()
        shown = shown if self.model is None else self.channels.told(shown)
        self._shown.append((stamp, dict(shown)))
        if self.model is None or not shown:
            return
        if self.channels.dead != dead or self._watch is None or not set(shown) <= set(self._watch.channels):
            self._watch = Watch(
                self.model, tuple(name for name in self.model.states if name in shown), self.settings.learn
            )
            if self._inputs:
                self._watch.take_input(self._seconds(stamp), self._inputs[-1][1])
        self._watch.take(self._seconds(stamp), shown)

    def take_update(self, update: Update) -> bool:
        """Take a model that the linearizer has published; returns whether it is one of the present model."""
        fits = self.model is not None and update.result.B.shape == (len(self.model.states), len(self.model.inputs))
        if fits:
            self._updates.append(update)
        return fits

    def _refuse(self, kind: str) -> None:
        self.refused[kind] = self.refused.get(kind, 0) + 1

    def _seconds(self, stamp: int) -> float:
        return (stamp - self._epoch) / NANO

    # ---------------------------------------------------------------- what is told

    def work(self, now: int) -> tuple[list[MonitorScore], Alarm | None]:
        """Do all that is due; returns the updates that could be judged, and a change as it is called."""
        self._drop(now)
        if self._watch is None or self.model is None:
            return [], None
        try:
            innovations, alarm = self._watch.work()
        except InputError:  # the state ran away: begin anew
            self._forget_model(now)
            return [], None
        self._states.extend(zip(innovations.t.tolist(), innovations.x, strict=True))
        period = round(self.model.update_period * NANO)
        scores = []
        while self._updates and self._states and self._seconds(self._updates[0].stamp + period) <= self._states[-1][0]:
            scores += self._judge(self._updates.popleft(), period)
        return scores, alarm

    @property
    def alarm(self) -> Alarm | None:
        """The change that was called, if one was."""
        return None if self._watch is None else self._watch.alarm

    @property
    def alarm_stamp(self) -> int | None:
        """When the change that was called began, in ns."""
        return None if self.alarm is None else self._epoch + round(self.alarm.onset * NANO)

    def question(self, now: int) -> Question | None:
        """Return the question of what has changed, once `NAMING_SPAN` of data since then are there; None before.

        Raises `InputError` where less than that is kept.
        """
        watch, alarm, onset = self._watch, self.alarm, self.alarm_stamp or 0
        if alarm is None or watch is None or self.model is None or watch.trust is None or now < onset + NAMING_SPAN:
            return None
        since, before = (
            self._stretch(self.model, onset, onset + NAMING_SPAN),
            self._stretch(self.model, onset - NAMING_SPAN, onset),
        )
        return Question(self.model, before, since, watch.trust, watch.sigma, alarm.kind == "shift")

    def _stretch(self, model: Model, since: int, until: int) -> ObservedWindow:
        record = self.record(model, since, until)
        begun = next(stamp for stamp, _ in self._shown if stamp >= max(since, self._inputs[0][0]))
        measured = {n: record.signals[n].values for n in model.states if n in record.signals}
        return ObservedWindow(
            self._seconds(begun) + record.t, measured, np.column_stack([record.signals[n].values for n in model.inputs])
        )

    def record(
        self, model: Model | None = None, since: int = 0, until: int | None = None, most: int | None = None
    ) -> Record:
        """Return the latest data as a record, from ``since`` to ``until`` in ns, and from the first input on.

        The input of a row is its mean up to the next one: it may change in between. Of more than ``most`` rows the
        newest are taken. Raises `InputError` where nothing was seen.
        """
        model = model or self.model
        since = max(since, self._inputs[0][0]) if self._inputs else since
        rows = [(stamp, shown) for stamp, shown in self._shown if since <= stamp and (until is None or stamp < until)]
        if model is None or len(rows) < 2 or not self._inputs:
            raise InputError("nothing to record yet: states and inputs must have come for a while")
        rows = rows[-most:] if most else rows
        t = np.array([stamp - rows[0][0] for stamp, _ in rows]) / NANO
        left = [name for name in model.states if name not in self.channels.dead]
        names = [name for name in left if any(name in shown for _, shown in rows)]
        signals = {n: Signal(np.array([shown.get(n, np.nan) for _, shown in rows]), model.units[n]) for n in names}
        u = self._held(np.array([stamp for stamp, _ in rows]))
        inputs = {name: Signal(u[:, i], model.units[name]) for i, name in enumerate(model.inputs)}
        return Record(t, {**inputs, **signals}, source="what the monitor has kept")

    def _held(self, rows: NDArray[np.int64]) -> Array:
        """Return the mean of each input (T, m) from each of these stamps (T,) to the next one."""
        stamps = np.array([stamp for stamp, _ in self._inputs])
        values = np.array([value for _, value in self._inputs])
        at = (np.append(stamps, rows[-1] + 1) - stamps[0]) / NANO
        until = np.vstack([np.zeros(values.shape[1]), np.cumsum(values * np.diff(at)[:, None], axis=0)])
        t = (rows - stamps[0]) / NANO
        reached = np.column_stack([np.interp(t, at, column) for column in until.T])
        newest = values[np.searchsorted(stamps, rows[-1:], side="right") - 1]
        return np.vstack([np.diff(reached, axis=0) / np.diff(t)[:, None], newest])

    def health(self, now: int) -> Health:
        """Return the state of affairs for /diagnostics."""
        level, message = self._verdict(now)
        values = {"refused": str(sum(self.refused.values())), "kept [s]": f"{self._kept:.1f}"}
        if self._watch is not None:
            values["guard"] = "learning" if self._watch.trust is None else f"trusts the model to {self._watch.trust:g}"
            values["gaps"] = f"{self._watch.gaps}{', settling after one' if self._watch.settling else ''}"
            values["change"] = f"{100 * self._watch.detector.level:.0f} % of what calls a change"
        if self.model is not None and self.channels.sentence:
            values["channels"] = self.channels.sentence
        if self._judged and self.model is not None:
            score = self._score()
            for i, name in enumerate(self.model.states):
                values[f"error of {name} over a period [{self.model.units[name]}]"] = f"{score.rms[i]:.4g}"
                values[f"the same without friction [{self.model.units[name]}]"] = f"{score.rms_bare[i]:.4g}"
        return Health(level, message, values)

    def _verdict(self, now: int) -> tuple[int, str]:
        if self.model is None:
            return WARN, "waiting for the linearizer's model_yaml"
        if not self._shown or now - self._shown[-1][0] > 3 * self.model.update_period * NANO:
            return ERROR, "no states"
        if self.alarm is not None:
            ago = (now - (self.alarm_stamp or now)) / NANO
            return ERROR, f"the machine is not what the model says, since {ago:.1f} s ago"
        if self.usual_error is not None and self._judged:
            worst = float(np.max(self._score().rms / np.maximum(self.usual_error, np.finfo(float).tiny)))
            if worst > self.settings.warn_above:
                return WARN, f"predictions are {worst:.1f} times as wrong as usual"
        if self._watch is None or self._watch.trust is None:
            return LEVEL_OK, "learning what is usual"
        return self._usual(self._watch.trust)

    def _usual(self, trust: float) -> tuple[int, str]:
        """Return what is said while all is as usual: also whether that is right, by the guard's trust and by the fit.

        The guard is the likeliest of filters that take the model's equations for wrong by a share. Beyond what base
        parameters are known to by default, that is not what a model which is right would leave.
        """
        fits = self._fits()
        told = f"; over an update period {fits}" if fits else ""
        dead = f"; {self.channels.sentence}" if self.channels.dead else ""
        if trust > RIGHT_TO:
            doubt = f"the model is not right: what it hears is about {100 * trust:.0f} % off its equations"
            return WARN, f"as usual, but {doubt}{told}; ~/diagnose may say why{dead}"
        level = WARN if dead else LEVEL_OK
        return level, f"as usual; the model is right to about {100 * trust:g} %{told}{dead}"

    def _fits(self) -> str:
        """Return the fits of A_k and B_k over the window in words; empty where there are none."""
        if not self._judged or self.model is None:
            return ""
        pairs = zip(self.model.states, self._score().fit.tolist(), strict=True)
        return ", ".join(f"{name} fits to {fit:.0f} %" for name, fit in pairs if np.isfinite(fit))

    # ---------------------------------------------------------------- inside

    @property
    def _kept(self) -> float:
        return (self._shown[-1][0] - self._shown[0][0]) / NANO if self._shown else 0.0

    def _drop(self, now: int) -> None:
        """Forget what is too old."""
        oldest = now - round(self.settings.keep * NANO)
        while self._shown and self._shown[0][0] < oldest:
            self._shown.popleft()
        while len(self._inputs) > 1 and self._inputs[1][0] < oldest:
            self._inputs.popleft()
        while self._states and self._states[0][0] < self._seconds(oldest):
            self._states.popleft()

    def _state_at(self, t: float) -> Array | None:
        """Return the state (n,) last known at time t (s)."""
        for when, x in reversed(self._states):
            if when <= t:
                return x
        return None

    def _mean_inputs(self, start: int, period: int) -> Array:
        """Return the mean input (PARTS, m) in each part of a period that begins at ``start`` ns."""
        delay = round((self.model.delay if self.model else 0.0) * NANO)
        edges = start - delay + np.linspace(0, period, PREDICTION_PARTS * 4 + 1)[:-1]
        heard = list[tuple[int, Array]]()
        for one in reversed(self._inputs):  # of minutes that are kept, those of one period
            heard.append(one)
            if one[0] <= edges[0]:
                break
        stamps, values = np.array([stamp for stamp, _ in heard[::-1]]), np.array([value for _, value in heard[::-1]])
        at = np.maximum(np.searchsorted(stamps, edges, side="right") - 1, 0)
        return np.asarray(values[at].reshape(PREDICTION_PARTS, 4, -1).mean(axis=1))

    def _judge(self, update: Update, period: int) -> list[MonitorScore]:
        start, end = self._seconds(update.stamp), self._seconds(update.stamp + period)
        before, after = self._state_at(start), self._state_at(end)
        if before is None or after is None or not self._inputs or self.model is None:
            return []
        u = self._mean_inputs(update.stamp, period)
        reached = _carried(update.result, before, u, period / NANO)
        kept = [self.model.states.index(name) for name in self._bare.states]
        free = after.copy()
        free[kept] = _carried(self.bare_linearizer(before[kept], u[0]), before[kept], u, period / NANO)
        self._judged.append(_Judged(update.stamp, reached - after, free - after, after))
        while self._judged[0].stamp < update.stamp - self.settings.window * NANO:
            self._judged.popleft()
        if self.usual_error is None and self._watch is not None and self._watch.trust is not None:
            self.usual_error = np.maximum(self._score().rms, self._watch.trust * self._sizes())
        return [self._score()]

    def _sizes(self) -> Array:
        """Return how large the states (n,) were over the window (RMS); of a position, by how much a period changes it.

        Times the guard's trust this is the error that a machine without noise may still make: a model that is right to
        0.3 % says no more.
        """
        sizes = np.sqrt(np.mean(np.square([j.truth for j in self._judged]), axis=0))
        if self.model is not None and {self.model.plant.position, self.model.plant.velocity} <= set(self.model.states):
            position, velocity = map(self.model.states.index, (self.model.plant.position, self.model.plant.velocity))
            sizes[position] = sizes[velocity] * self.model.update_period
        return np.asarray(sizes)

    def _score(self) -> MonitorScore:
        last = self._judged[-1]
        error, bare, truth = (np.array([getattr(j, n) for j in self._judged]) for n in ("error", "bare", "truth"))
        spread = np.sqrt(np.sum((truth - truth.mean(axis=0)) ** 2, axis=0))
        size = np.sqrt(np.sum(error**2, axis=0))
        enough = len(self._judged) >= LEAST_FITTED
        fit = np.where((spread > 0) & enough, 100 * (1 - size / np.where(spread > 0, spread, 1.0)), np.nan)
        rms = [np.sqrt(np.mean(e**2, axis=0)) for e in (error, bare)]
        return MonitorScore(last.stamp, last.error, last.bare, rms[0], rms[1], fit)


def _carried(model: Linearization, x: Array, u: Array, span: float) -> Array:
    """Return the state (n,) that x' = A x + B u + c reaches from x after ``span`` s under inputs (PARTS, m)."""
    n, m = model.B.shape
    block = np.zeros((n + m + 1, n + m + 1))
    block[:n, :n], block[:n, n : n + m], block[:n, -1] = model.A, model.B, model.c
    step = expm(block * span / len(u))[:n]
    for held in u:
        x = step @ np.concatenate([x, held, [1.0]])
    return np.asarray(x)


__all__ = ["MonitorLogic", "MonitorScore", "MonitorSettings"]
