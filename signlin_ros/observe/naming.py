"""What a machine has changed in: hypotheses judged by the filter's likelihood of data since then.

They are derived from the model (`signlin_ros.observe.hypotheses`), and where none of these leaves innovations as usual,
every effect of the catalogue that has one level. A quick first word while a diagnosis, which compares the whole
catalogue on validation data, is not asked for yet.
``python -m signlin_ros.observe.naming`` answers a pickled `Question` from its standard input as JSON.
"""

from __future__ import annotations

import json
import pickle
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, minimize_scalar

from signlin_ros.errors import SignlinError
from signlin_ros.model import Model
from signlin_ros.observe.hypotheses import Changed, Hypothesis, ObservedWindow, of_the_catalogue, of_the_model
from signlin_ros.observe.observer import Innovations, KalmanObserver

Array = NDArray[np.float64]

WILDEST = 400.0
"""A squared innovation counts so much at most."""
NAMING_SETTLING = 0.5
"""Seconds after the change that are not judged: the filter finds its state anew."""
TRIES = 14
"""Values of its number that a hypothesis of one number is tried at."""
MAX_EVALUATIONS = 60
"""and that one of several numbers is tried at."""
MIN_LIKELIHOOD_GAIN = 30.0
"""Logarithm of the likelihood ratio that each number of a hypothesis must gain, and that tells two hypotheses apart."""
KEPT = 0.5
"""Share of its gain that a hypothesis must not have had before the change already."""
MIN_EXPLAINED = 0.85
"""Share of what the squared innovations exceed the usual by, which a hypothesis must take away to be named."""
DOUBTS = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
"""Trusts of the model that a hypothesis must be likelier than: that it is wrong in something, and nobody says what."""
MIN_COMPARED_BLOCKS, ALLOWED_ERRORS = 8, 2.0
"""Blocks of a second that tell whether a model is as good as it was, and by how many standard errors it may differ."""
SHIFT_LEAD, CHANGE_TOLERANCE, CHANGE_MOMENT = 2.0, 0.1, 1e-9
"""Seconds before the change with which a shift of a sensor is seen; by how much the change may be dated wrongly; what
comes that near counts as of one time."""


@dataclass(frozen=True)
class Named:
    """A hypothesis: its name, the number found with its unit, the gain in the log-likelihood, further numbers in words.

    ``explained``: the share of what the squared innovations exceeded the usual by that it takes away.
    """

    name: str
    value: float
    unit: str
    gain: float
    further: str = ""
    explained: float = 1.0

    @property
    def sentence(self) -> str:
        """What has changed, in words: ``coulomb_friction, 1.49 times as much``."""
        if not np.isfinite(self.value):
            return self.name
        return f"{self.name}, {self.value:.3g} {self.unit or 'times as much'}{self.further}"


@dataclass(frozen=True)
class Question:
    """What `name_change` is asked; ``shifted``: whether the alarm had the trace of a sensor's shift, as others may."""

    model: Model
    before: ObservedWindow
    since: ObservedWindow
    trust: float
    noise: Mapping[str, float]
    shifted: bool

    def answer(self) -> list[Named]:
        """Return the changes that explain the data, the likeliest first; empty where none does."""
        asked = (self.model, self.before, self.since, self.trust, self.noise)
        found = name_change(*asked)
        again = self.shifted and not found and _Scores(*asked).right_again
        return [Named("sensor_offset", float("nan"), "", 0.0)] if again else found


def name_change(
    model: Model, before: ObservedWindow, since: ObservedWindow, trust: float, noise: Mapping[str, float]
) -> list[Named]:
    """Return possible changes; none where the model is as good as it was, or where no hypothesis takes away
    most of what is unusual.

    ``since`` begins where the change did, on the clock of ``before``. ``trust``, ``noise``: of the guard before the
    change. What a hypothesis gains on the data before it is a fault that the model had all along; one that gains less
    than the same model with less trust in it names nothing: any force would do as well. What gains about as much as the
    likeliest is told too, in the order in which machines change.
    """
    scores = _Scores(model, before, since, trust, noise)
    for hypotheses in (of_the_model(model, since), of_the_catalogue(model, since)):
        found = _likeliest(named for h in hypotheses if (named := scores.judged(h)))
        if found:
            return found
    return []


def _likeliest(found: Iterable[Named]) -> list[Named]:
    """Return the hypotheses that gain most or about as much, each name once, in the order in which they came."""
    best: dict[str, Named] = {}
    for named in found:
        if named.name not in best or named.gain > best[named.name].gain:
            best[named.name] = named
    most = max((named.gain for named in best.values()), default=0.0)
    return [named for named in best.values() if named.gain > most - MIN_LIKELIHOOD_GAIN]


@dataclass(frozen=True)
class _Score:
    """Log-likelihood of innovations, the sum of their capped squares, and how many there are."""

    likelihood: float
    squares: float
    count: int

    @classmethod
    def of(cls, innovations: Innovations) -> _Score:
        squares = np.minimum(innovations.sizes**2, WILDEST)
        likelihood = -0.5 * float(np.sum(np.log(innovations.variance + 1e-300) + squares))
        return cls(likelihood, float(squares.sum()), squares.size)

    def excess(self, usual: float) -> float:
        """Return by how much the squares exceed the usual mean square, in the log-likelihood."""
        return 0.5 * (self.squares - self.count * usual)


NO_SCORE = _Score(-np.inf, np.inf, 0)


@dataclass(frozen=True)
class _Scores:
    """Data before and since a change, and how likely a machine makes them."""

    model: Model
    before: ObservedWindow
    since: ObservedWindow
    trust: float
    noise: Mapping[str, float]

    def judged(self, h: Hypothesis) -> Named | None:
        """Return the name of a hypothesis; None where it gains too little, had gained before, or leaves the unusual."""
        return self._shift(h) if h.channel else self._other_machine(h)

    # ---------------------------------------------------------------- likelihood

    def _scored(self, data: ObservedWindow, changed: Changed, first: float, apart: float = -np.inf) -> _Score:
        """Score data from ``first`` s on under a changed machine, whose sensors are shifted from ``apart`` s on."""
        shown = dict(data.measured)
        for name, offset in (changed.offsets or {}).items():
            shown[name] = shown[name] - offset * (data.t >= apart)
        try:
            innovations = self._innovations(data.t, shown, changed.gain * data.u, changed.model)
        except SignlinError:
            return NO_SCORE
        return _Score.of(innovations.part(innovations.t >= first))

    def _innovations(self, t: Array, shown: Mapping[str, Array], u: Array, model: Model) -> Innovations:
        observer = KalmanObserver(model, shown, self.noise, (self.trust,))
        return observer.record(t, shown, u)[1]

    def _since(self, changed: Changed) -> _Score:
        return self._scored(self.since, changed, self.since.t[0] + NAMING_SETTLING)

    def _before(self, changed: Changed) -> _Score:
        return self._scored(self.before, changed, self.before.t[0] + NAMING_SETTLING)

    @cached_property
    def now(self) -> _Score:
        """The model as it is on the data since the change."""
        return self._since(Changed(self.model))

    @cached_property
    def was(self) -> _Score:
        """The model as it is on the data before the change."""
        return self._before(Changed(self.model))

    @cached_property
    def usual(self) -> float:
        """The mean square of innovations before the change, 1 at least: what the filter holds for noise."""
        return max(self.was.squares / max(self.was.count, 1), 1.0)

    @property
    def right_again(self) -> bool:
        """Whether the model is as good as it was once its state is found anew, as a shift leaves it and no force does.

        The mean squares of innovations before and since the change, by batch means over blocks of a second, must not
        differ by more than their standard error allows.
        """
        was, now = self._blocks(self.before), self._blocks(self.since)
        if min(was.size, now.size) < MIN_COMPARED_BLOCKS:
            return False
        error = float(np.sqrt(was.var(ddof=1) / was.size + now.var(ddof=1) / now.size))
        return bool(now.mean() - was.mean() <= ALLOWED_ERRORS * error)

    def _blocks(self, data: ObservedWindow) -> Array:
        """Return the mean squared innovation in each second of data, after the filter has found its state."""
        try:
            innovations = self._innovations(data.t, data.measured, data.u, self.model)
        except SignlinError:
            return np.array([])
        seconds = np.floor(innovations.t - data.t[0] - NAMING_SETTLING)
        squares = np.minimum(innovations.sizes**2, WILDEST)
        return np.array([squares[seconds == k].mean() for k in np.unique(seconds[seconds >= 0])])

    @cached_property
    def doubted(self) -> float:
        """The gain, since the change, of trusting the model less: what a force of any course explains."""
        found = [replace(self, trust=trust)._since(Changed(self.model)).likelihood for trust in DOUBTS]
        return max(found) - self.now.likelihood

    def _explained(self, now: _Score, then: _Score) -> float:
        """Return the share of the excess over the usual that a hypothesis takes away; 0 where there is hardly any."""
        excess = now.excess(self.usual)
        return (excess - then.excess(self.usual)) / excess if excess > MIN_LIKELIHOOD_GAIN else 0.0

    # ---------------------------------------------------------------- another machine

    def _other_machine(self, h: Hypothesis) -> Named | None:
        price = MIN_LIKELIHOOD_GAIN * len(h.low)
        if self.now.excess(self.usual) <= price:
            return None
        values, score = self._best(h)
        made = h.made(*values)
        gain = score.likelihood - self.now.likelihood
        if not gain > price:
            return None
        old = max(self._before(made).likelihood - self.was.likelihood, 0.0)
        net = gain - old * self.now.count / max(self.was.count, 1)
        explained = self._explained(self.now, score)
        if net <= max(price, KEPT * gain) or explained < MIN_EXPLAINED or gain - price <= self.doubted:
            return None
        return Named(h.name, values[0], h.unit, net - price, h.further.format(*values), min(explained, 1.0))

    def _best(self, h: Hypothesis) -> tuple[tuple[float, ...], _Score]:
        """Return the numbers of a hypothesis that make the data since the change likeliest, and how likely."""
        known = dict[tuple[float, ...], _Score]()

        def cost(*values: float) -> float:
            try:
                known[values] = self._since(h.made(*values))
            except SignlinError:
                return 1e30
            found = -known[values].likelihood
            return found if np.isfinite(found) else 1e30

        values = self._simplex(h, cost) if len(h.low) > 1 else self._on_grid(h, cost)
        return values, known.get(values) or self._since(h.made(*values))

    def _on_grid(self, h: Hypothesis, cost: Callable[..., float]) -> tuple[float, ...]:
        """Return the one number that is likeliest: the best of a grid, or one between its neighbours."""
        grid = np.linspace(h.low[0], h.high[0], TRIES // 2)
        costs = [cost(float(value)) for value in grid]
        k = int(np.argmin(costs))
        bounds = (float(grid[max(k - 1, 0)]), float(grid[min(k + 1, grid.size - 1)]))
        found = minimize_scalar(cost, bounds=bounds, method="bounded", options={"maxiter": TRIES // 2})
        return (float(found.x) if found.fun < costs[k] else float(grid[k]),)

    def _simplex(self, h: Hypothesis, cost: Callable[..., float]) -> tuple[float, ...]:
        low, high = np.array(h.low), np.array(h.high)
        starts = [low + (high - low) * share for share in (0.35, 0.5, 0.65)]
        best = min(starts, key=lambda x: cost(*x))
        options = {"maxfev": MAX_EVALUATIONS, "xatol": 1e-3, "fatol": 1.0}
        found = minimize(lambda x: cost(*np.clip(x, low, high)), best, method="Nelder-Mead", options=options)
        return tuple(np.clip(found.x, low, high).tolist())

    # ---------------------------------------------------------------- a shifted sensor

    @cached_property
    def _moment(self) -> ObservedWindow:
        """The last `SHIFT_LEAD` s before the change, and what comes of the others' data before they are judged."""
        at = self.since.t[0]
        parts = (self.before, self.before.t >= at - SHIFT_LEAD), (self.since, self.since.t < at + NAMING_SETTLING)
        shown = {n: np.concatenate([data.measured[n][near] for data, near in parts]) for n in self.since.measured}
        t, u = (np.concatenate([getattr(data, name)[near] for data, near in parts]) for name in ("t", "u"))
        return ObservedWindow(t, shown, u)

    def _shift(self, h: Hypothesis) -> Named | None:
        """Name a shift: a step of one channel must explain the moment of the change, and leave the rest usual.

        Its gain is that of the moment and that on the data since then, on which the others are judged.
        """
        first = self.since.t[0] - CHANGE_TOLERANCE
        moment = self._scored(self._moment, Changed(self.model), first)
        if moment.excess(self.usual) <= MIN_LIKELIHOOD_GAIN:
            return None

        def cost(size: float, apart: float) -> float:
            return -self._scored(self._moment, h.made(size), first, apart).likelihood

        size, apart = min(self._steps(h.channel), key=lambda step: cost(*step), default=(0.0, first))
        bounds = sorted((0.5 * size, 1.5 * size))
        found = minimize_scalar(cost, bounds=bounds, args=(apart,), method="bounded", options={"maxiter": TRIES})
        size = float(np.clip(found.x, h.low[0], h.high[0]))
        made = h.made(size)
        shifted, rest = self._scored(self._moment, made, first, apart), self._since(made)
        explained = self._explained(moment, shifted)
        left = rest.excess(self.usual) > max((1 - MIN_EXPLAINED) * moment.excess(self.usual), MIN_LIKELIHOOD_GAIN)
        gain = shifted.likelihood - moment.likelihood
        if explained < MIN_EXPLAINED or left or gain <= MIN_LIKELIHOOD_GAIN:
            return None
        gain += rest.likelihood - self.now.likelihood - MIN_LIKELIHOOD_GAIN
        return Named(h.name, size, h.unit, gain, "", min(explained, 1.0))

    def _steps(self, channel: str) -> list[tuple[float, float]]:
        """Return the innovations near the change, and their times in s: a first guess."""
        data = self._moment
        try:
            found = self._innovations(data.t, data.measured, data.u, self.model)
        except SignlinError:
            return []
        near = (np.abs(found.t - self.since.t[0]) <= CHANGE_TOLERANCE) & (
            found.channel == list(data.measured).index(channel)
        )
        delay = self.model.sensors[channel].delay
        return [
            (value, t + delay - CHANGE_MOMENT)
            for value, t in zip(found.value[near].tolist(), found.t[near].tolist(), strict=True)
        ]


def answers(found: Sequence[Named]) -> list[dict[str, object]]:
    """Return hypotheses as JSON: ``name``, ``value`` (None where it is not known), ``unit``, ``gain``, ``sentence``."""
    return [{**asdict(n), "value": n.value if np.isfinite(n.value) else None, "sentence": n.sentence} for n in found]


def main() -> None:
    """Answer a pickled question from the standard input."""
    question = pickle.load(sys.stdin.buffer)
    sys.stdout.write(json.dumps(answers(question.answer())))


__all__ = ["Changed", "Named", "ObservedWindow", "Question", "answers", "main", "name_change"]


if __name__ == "__main__":
    main()
