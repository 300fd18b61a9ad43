"""A running machine watched by its model: is the model still right, and if not, since when.

While all is well, filters that trust the model to different degrees run side by side; the likeliest of them then stands
guard alone, with a trust and a noise that do not adapt: its innovations grow where the model has become wrong.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from signlin_ros.model import Model
from signlin_ros.observe.detect import Alarm, ChangeDetector
from signlin_ros.observe.observer import Innovations, KalmanObserver
from signlin_ros.observe.steps import CERTAIN_SHARE

Array = NDArray[np.float64]

GUARDS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
"""Shares by which the model may be wrong, of which the likeliest is kept."""
JUMP_DOUBT = 1 - CERTAIN_SHARE
"""Share of what a jump of an input does that a guard does not know."""
START_TIME = 1.0
"""Seconds at the start that tell nothing of the model."""
MAX_GUARD_INNOVATION = 400.0
"""A squared innovation counts so much at most."""
GAP_PACES, PACE_SAMPLES, LEAST_PACE = 5.0, 100, 20
"""An interval of so many usual ones is a gap; usual is the median of so many of the last ones, and so many at least."""
SETTLING, SETTLING_GAPS = START_TIME, 6.0
"""The state is found anew after a gap: nothing is judged for so many times its length, and for so many seconds at most.
A short stall, of which a busy machine has one a second, leaves the rest of that second to be judged."""
SHIFT, TOGGLED, FORM_SAMPLES, FEWEST_FORMS = 5.0, 60, 6, 8
"""What a shift does is tried with one of so many standard deviations of the noise, to and fro every so many samples;
so many innovations are looked at, and so many shifts are needed."""
REVERSAL_TIME = 0.4
"""How long, in s, a reversal is near."""
STANDING_SHARE = 0.02
"""Share of the largest speed seen, below which a machine counts as standing or turning."""
IN_MOTION, AFTER_REVERSAL, SLOWED = 0, 1, 2
"""Situations: in motion; just after a reversal; slower than that."""


class Pace:
    """How often something comes, and since when it is missed."""

    def __init__(self) -> None:
        self._last, self._intervals = np.nan, deque[float](maxlen=PACE_SAMPLES)

    def take(self, t: float) -> bool:
        """Take a time in s; returns whether something was lost since the one before."""
        missed = self.missed(t)
        if self._last == self._last:
            self._intervals.append(t - self._last)
        self._last = t
        return missed

    def since(self, t: float) -> float:
        """Return the seconds since it came last."""
        return t - self._last

    def missed(self, t: float) -> bool:
        """Tell whether it should have come again before time t. What comes at any time, as on a change, is not."""
        if len(self._intervals) < LEAST_PACE or t - self._last <= GAP_PACES * min(self._intervals):
            return False
        rising = sorted(self._intervals)  # of a hundred, at every message: a tenth of the time of NumPy's percentiles
        usual, long = _quantile(rising, 0.5), _quantile(rising, 0.9)
        return long < GAP_PACES * usual < t - self._last


def _quantile(rising: list[float], share: float) -> float:
    """Return a quantile of values in order, a straight line between two of them."""
    place = share * (len(rising) - 1)
    k = min(int(place), len(rising) - 2)
    return rising[k] + (place - k) * (rising[k + 1] - rising[k])


class Watch:
    """Takes what comes, learns for ``learn`` s, then holds an `Alarm` as soon as the machine has changed.

    Times are in s, and increase; `work` does all that is due.
    """

    def __init__(self, model: Model, channels: Iterable[str], learn: float = 30.0) -> None:
        self.model, self.channels, self._learn = model, tuple(channels), learn
        self.detector = ChangeDetector(learn)
        self._guards = {
            trust: KalmanObserver(model, self.channels, trusts=(trust,), doubt=JUMP_DOUBT) for trust in GUARDS
        }
        self._likelihood = dict.fromkeys(GUARDS, 0.0)
        self._heard: list[tuple[float, Array | Mapping[str, float] | None]] = []
        self._pace, self._input_pace = Pace(), Pace()
        self._gaps, self.gaps = list[tuple[float, float]](), 0
        """Gaps, from when they are noticed until the state is known again, and how many there were."""
        self._last = -np.inf
        self._begun, self._fastest, self._slow_at = np.nan, 0.0, -np.inf

    @property
    def alarm(self) -> Alarm | None:
        """The change that was called, if one was."""
        return self.detector.alarm

    @property
    def trust(self) -> float | None:
        """The trust of the guard; None while it is being learnt."""
        return next(iter(self._guards)) if len(self._guards) == 1 else None

    @property
    def settling(self) -> bool:
        """Whether nothing is judged now, because something was lost."""
        return bool(self._gaps) and self._last < self._gaps[-1][1]

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviation of the noise of each channel."""
        return next(iter(self._guards.values())).sigma

    def take_input(self, t: float, u: ArrayLike) -> None:
        """Take an input (m,) that is held from time t on."""
        self._input_pace.take(t)
        if self.trust is None:
            self._heard.append((t, np.array(u, dtype=float)))
        for guard in self._guards.values():
            guard.take_input(t, u)

    def take(self, t: float, shown: Mapping[str, float]) -> None:
        """Take what the sensors show at time t, by name; after a gap nothing is judged for `SETTLING` s."""
        before, self._last = self._last, t
        lost = t - before if self._pace.take(t) else 0.0
        if self._input_pace.missed(t) and not self._input_pace.missed(t - SETTLING):
            lost = max(lost, self._input_pace.since(t))
        if lost:
            self._lose(t, lost)
        if self.trust is None:
            self._heard.append((t, dict(shown)))
        for guard in self._guards.values():
            guard.take(t, shown)

    def _lose(self, t: float, lost: float) -> None:
        """Doubt the state at time t, after so many seconds without what should have come."""
        until = t + min(SETTLING, SETTLING_GAPS * lost)
        if self.settling:
            self._gaps[-1] = (self._gaps[-1][0], max(self._gaps[-1][1], until))
        else:
            self._gaps.append((t, until))
            self.gaps += 1
        if self.trust is None:
            self._heard.append((t, None))
        for guard in self._guards.values():
            guard.lose(t)

    def work(self) -> tuple[Innovations, Alarm | None]:
        """Work off what has come; returns the innovations of the likeliest guard, and a change as it is called."""
        found = {trust: guard.work() for trust, guard in self._guards.items()}
        t = next(iter(found.values())).t
        if t.size and self._begun != self._begun:
            self._begun = float(t[0])
        if len(found) == 1:
            (innovations,) = found.values()
            return innovations, self._guard(innovations)
        for trust, innovations in found.items():
            self._compare(trust, innovations)
        best = max(self._likelihood, key=lambda trust: self._likelihood[trust])
        if t.size and t[-1] - self._begun >= self._learn:
            self._decide(best)
        return found[best], None

    def _compare(self, trust: float, innovations: Innovations) -> None:
        late = innovations.part(self._tells(innovations.t))
        z, variance = late.sizes, late.variance
        self._likelihood[trust] -= 0.5 * float(
            np.sum(np.log(variance + 1e-300) + np.minimum(z**2, MAX_GUARD_INNOVATION))
        )

    def _decide(self, trust: float) -> None:
        """Keep one guard, whose noise is the usual one from now on; what it sees of what was heard is what is usual."""
        noise = self._guards[trust].usual_noise
        guard, usual = self._repeated(trust, noise, None)
        self.detector = ChangeDetector(self._learn, signatures=self._signatures(trust, noise, usual))
        self._guards, self._heard = {trust: guard}, []
        self._guard(usual)

    def _signatures(self, trust: float, noise: Mapping[str, float], plain: Innovations) -> dict[int, Array]:
        """Return the innovations that a shift of each channel causes, from the data up to now."""
        forms = {}
        for c, name in enumerate(self.channels):
            form = _form(plain, self._repeated(trust, noise, name)[1], c, SHIFT * noise[name])
            if form is not None:
                forms[c] = form
        return forms

    def _repeated(
        self, trust: float, noise: Mapping[str, float], shifted: str | None
    ) -> tuple[KalmanObserver, Innovations]:
        """Return who heard all again and its innovations, one channel shifted to and fro every `TOGGLED` samples."""
        observer, count = KalmanObserver(self.model, self.channels, noise, (trust,), JUMP_DOUBT), 0
        observer.hold_noise()
        for t, what in self._heard:
            if what is None:
                observer.lose(t)
                continue
            if not isinstance(what, Mapping):
                observer.take_input(t, what)
                continue
            if shifted is not None and shifted in what:
                away = (count // TOGGLED) % 2
                count += 1
                observer.take(t, {**what, shifted: what[shifted] + away * SHIFT * noise[shifted]})
            else:
                observer.take(t, what)
        return observer, observer.work()

    def _guard(self, innovations: Innovations) -> Alarm | None:
        seen = innovations.part(self._tells(innovations.t))
        self._gaps = [gap for gap in self._gaps if self._last < gap[1] + SETTLING]
        return self.detector.take(seen.t, seen.sizes, self._situations(seen.t, seen.x), seen.channel)

    def _tells(self, t: Array) -> NDArray[np.bool_]:
        """Return at which of the times (E,) the state is known well enough to judge the model by it."""
        told = np.ones(t.shape, dtype=bool)
        for begun, until in [(-np.inf, self._begun + START_TIME), *self._gaps]:
            told &= (t < begun) | (t >= until)
        return told

    def _situations(self, t: Array, x: Array) -> NDArray[np.int64]:
        """Return the situation (E,) at each of the states x (E, n)."""
        velocity = self.model.plant.velocity
        if velocity not in self.model.states or not t.size:
            return np.full(t.size, IN_MOTION, dtype=np.int64)
        speed = np.abs(x[:, self.model.states.index(velocity)])
        fastest = np.maximum(np.maximum.accumulate(speed), self._fastest)
        slow = speed <= STANDING_SHARE * fastest
        last = np.maximum(np.maximum.accumulate(np.where(slow, t, -np.inf)), self._slow_at)
        self._fastest, self._slow_at = float(fastest[-1]), float(last[-1])
        return np.where(slow, SLOWED, np.where(t - last < REVERSAL_TIME, AFTER_REVERSAL, IN_MOTION)).astype(np.int64)


def _form(plain: Innovations, shifted: Innovations, channel: int, size: float) -> Array | None:
    """Return the median over all shifts of what they add to a channel's innovations (`FORM_SAMPLES`,); None if there
    is none.

    That is, in standard deviations, of a shift of the given size.
    """
    added = (shifted.sizes - plain.sizes)[plain.channel == channel]
    starts = np.arange(TOGGLED, added.size - FORM_SAMPLES, TOGGLED)
    if size <= 0.0 or starts.size < FEWEST_FORMS:
        return None
    to_and_fro = np.where((starts // TOGGLED) % 2 == 1, 1.0, -1.0)
    form = np.median([side * added[k : k + FORM_SAMPLES] for k, side in zip(starts, to_and_fro, strict=True)], axis=0)
    return form if np.linalg.norm(form) > 0.0 else None


__all__ = ["GUARDS", "Watch"]
