"""A running machine watched by its model: is the model still right, and if not, since when.

While all is well, filters that trust the model to different degrees run side by side; the likeliest of them then stands
guard alone, with a trust that does not adapt: its innovations grow where the model has become wrong.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from signlin_ros.model import Model
from signlin_ros.observe.detect import Alarm, ChangeDetector
from signlin_ros.observe.observer import Innovations, KalmanObserver

Array = NDArray[np.float64]

GUARDS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
"""Shares by which the model may be wrong, of which the likeliest is kept."""
SETTLING = 1.0
"""Seconds at the start that tell nothing of the model."""
WILDEST = 400.0
"""A squared innovation counts so much at most."""
AFTER = 0.4
"""How long, in s, a reversal is near."""
SLOW = 0.02
"""Share of the largest speed seen, below which a machine counts as standing or turning."""
MOVING, TURNED, SLOWED = 0, 1, 2
"""Situations: in motion; just after a reversal; slower than that."""


class Watch:
    """Takes what comes, learns for ``learn`` s, then holds an `Alarm` as soon as the machine has changed.

    Times are in s, and increase; `work` does all that is due.
    """

    def __init__(self, model: Model, channels: Iterable[str], learn: float = 30.0) -> None:
        self.model, self.channels, self._learn = model, tuple(channels), learn
        self.detector = ChangeDetector(learn)
        self._guards = {trust: KalmanObserver(model, self.channels, trusts=(trust,)) for trust in GUARDS}
        self._likelihood = dict.fromkeys(GUARDS, 0.0)
        self._learnt: dict[float, list[tuple[Array, Array, Array]]] = {trust: [] for trust in GUARDS}
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
    def sigma(self) -> dict[str, float]:
        """Standard deviation of the noise of each channel."""
        return next(iter(self._guards.values())).sigma

    def take_input(self, t: float, u: ArrayLike) -> None:
        """Take an input (m,) that is held from time t on."""
        for guard in self._guards.values():
            guard.take_input(t, u)

    def take(self, t: float, shown: Mapping[str, float]) -> None:
        """Take what the sensors show at time t, by name."""
        for guard in self._guards.values():
            guard.take(t, shown)

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
        late = innovations.t >= self._begun + SETTLING
        z, variance = innovations.sizes[late], innovations.variance[late]
        self._likelihood[trust] -= 0.5 * float(np.sum(np.log(variance + 1e-300) + np.minimum(z**2, WILDEST)))
        self._learnt[trust].append((innovations.t[late], z, innovations.x[late]))

    def _decide(self, best: float) -> None:
        """Keep one guard; what it has seen is what is usual."""
        self._guards = {best: self._guards[best]}
        for t, z, x in self._learnt[best]:
            self.detector.take(t, z, self._situations(t, x))
        self._learnt = {}

    def _guard(self, innovations: Innovations) -> Alarm | None:
        situations = self._situations(innovations.t, innovations.x)
        return self.detector.take(innovations.t, innovations.sizes, situations)

    def _situations(self, t: Array, x: Array) -> NDArray[np.int64]:
        """Return the situation (E,) at each of the states x (E, n)."""
        velocity = self.model.plant.velocity
        if velocity not in self.model.states or not t.size:
            return np.full(t.size, MOVING, dtype=np.int64)
        speed = np.abs(x[:, self.model.states.index(velocity)])
        fastest = np.maximum(np.maximum.accumulate(speed), self._fastest)
        slow = speed <= SLOW * fastest
        last = np.maximum(np.maximum.accumulate(np.where(slow, t, -np.inf)), self._slow_at)
        self._fastest, self._slow_at = float(fastest[-1]), float(last[-1])
        return np.where(slow, SLOWED, np.where(t - last < AFTER, TURNED, MOVING)).astype(np.int64)


__all__ = ["GUARDS", "Watch"]
