"""The quietest command that is enough: real refits, from which every rival comes back to itself, within the limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.experiment.distance import LOST, Pair, RivalBench
from signlin_ros.experiment.families import COMMAND_FAMILIES, LADDER, Family, mixed
from signlin_ros.experiment.limits import Limits
from signlin_ros.experiment.parts import Part, in_words, rendered
from signlin_ros.experiment.windows import seen_in_windows
from signlin_ros.follow.segments import PreparedSegment

Array = NDArray[np.float64]
Tell = Callable[[str, float], None]

NEEDED_EVIDENCE, ENOUGH = 10.0, 60.0
"""-2 log likelihood by which rivals are told apart at all, and that a plan asks for, beyond what noise takes away."""
SURE = 1.3
"""Standard errors of the noise, which a margin d has 2 sqrt(d) of, by which it is still enough: nine times in ten."""
RESERVE = (SURE + (SURE**2 + ENOUGH) ** 0.5) ** 2 / ENOUGH
"""Times `ENOUGH` that is asked for at the estimates and at sigma points: noise takes some of it away."""
SIGMA_POINTS = 2
"""Sigma points of each rival that are looked at."""
FURTHER = 2
"""Peaks of the ladder beyond the quietest that is enough among which the best is taken: an estimate that is somewhat
off must not decide whether a machine breaks away."""
RECOVERS = 0.2
"""Part of the distance within which a rival must come back to itself, refitted to its own prediction."""
FAMILIES_REFITTED, MIXED, CHANGED = 6, 4, 40
"""Families of a peak that are refitted for real; best of them that are mixed; random changes of the best."""
LADDER_STRIDE, MIN_LINEAR_RATIO, SOUGHT = 3, 3.0, 30
"""Steps of the ladder between the peaks at which pairs are looked at first; a pair is asked for from that multiple of
what is needed on, by linear refits, which tell too much; commands that are refitted where none is enough."""
RECOVERED = 6
"""Most of these of which all rivals are refitted from sigma points: that is what costs most."""
MOST_FOLLOWED = 4000
"""Runs through the observer after which nothing is improved any more, nor a longer record tried."""
REFIT_AT = 0.5
"""Part of `ENOUGH` in one linear refit below which a real one is not worth while: it only tells less."""


@dataclass(frozen=True, eq=False)
class CommandTrial:
    """A command that was tried: its family, parts, u (T,), the part of its limits that it uses, the linear distance of
    every pair, and the real one where that was found out (pairs,). ``back``: by how much rivals miss themselves;
    ``sure`` (pairs,): the smallest real one of the sigma points too; ``certainties`` (pairs,): standard errors by which
    a second run would show the difference over windows.
    """

    family: Family
    parts: tuple[Part, ...]
    u: Array
    share: float
    linear: Array
    real: Array | None = None
    back: float = 0.0
    sure: Array | None = None
    certainties: Array | None = None
    asked: float = 0.0

    @property
    def peak(self) -> float:
        """The largest |input|, beside that at rest."""
        return float(np.abs(self.u - self.u[0]).max())

    @property
    def least(self) -> float:
        """The smallest distance: the real one where known, with sigma points where these are known."""
        known = [v for v in (self.sure, self.real, self.linear) if v is not None]
        return float(known[0].min(initial=np.inf))


@dataclass(eq=False)
class CommandSearch:
    """A search within limits at times t (T,); ``pairs``: those that are asked for; ``tried``: all that was tried;
    ``refused``: how often some limit was not kept, by its name, and ``still``: how often a rival did not move.
    """

    bench: RivalBench
    limits: Limits
    t: Array
    spare: float
    tell: Tell
    seed: int = 1
    pairs: list[Pair] = field(default_factory=list)
    tried: list[CommandTrial] = field(default_factory=list)
    refused: dict[str, int] = field(default_factory=dict)
    still: dict[int, int] = field(default_factory=dict)
    kept: dict[tuple[Pair, bytes, bytes], float] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        """Ask for all pairs, unless some were named."""
        self.pairs = self.pairs or self.bench.pairs

    @property
    def most(self) -> float:
        """The largest input beside that at rest."""
        return self.limits.input - abs(self.bench.bias)

    @property
    def spent(self) -> bool:
        """Whether so much was followed that the best by then is taken."""
        return self.bench.used["fits"] >= MOST_FOLLOWED

    def command(self, parts: Sequence[Part]) -> Array:
        """Return the command u (T,) of some parts about what holds the machine, no larger than its limit."""
        u = self.bench.bias + rendered(parts, self.t, self.limits.slew)
        return np.asarray(np.clip(u, -self.limits.input, self.limits.input))

    def screened(
        self, family: Family, parts: tuple[Part, ...], asked: float = 0.0, floor: float = 0.0
    ) -> CommandTrial | None:
        """Return a command with its linear distances, infinite where they were not asked for since one is less than the
        ``floor``; None where a rival would leave the limits, or hardly move.
        """
        u = self.command(parts)
        share, why, runs = self.bench.share(self.t, u, self.limits)
        if share > 1.0 - self.spare or not runs:
            self.refused[why] = self.refused.get(why, 0) + 1
            return None
        segments = {i: self.bench.segment(i, run) for i, run in enumerate(runs)}
        still = [i for i, s in segments.items() if not self.bench.moves(s)]
        for i in still:
            self.still[i] = self.still.get(i, 0) + 1
        if still:
            return None
        linear = np.full(len(self.pairs), np.inf)
        for k in self._hardest():
            i, j = self.pairs[k]
            distance = self.bench.linear(j, segments[i])
            linear[k] = 0.0 if distance >= LOST else distance
            if linear[k] < floor:
                break
        found = CommandTrial(family, parts, u, share, linear, asked=asked)
        self.tried.append(found)
        return found

    def _hardest(self) -> list[int]:
        """Return the places of the pairs, those first that the last command told least apart."""
        if not self.tried:
            return list(range(len(self.pairs)))
        return [int(k) for k in np.argsort(self.tried[-1].linear, kind="stable")]

    def refitted(self, one: CommandTrial, least: float = 0.0) -> CommandTrial:
        """Return a command with real distances; those that are left once one is less than ``least`` stay linear."""
        if one.real is not None:
            return one
        bench, real = self.bench, one.linear.copy()
        _, _, runs = bench.share(self.t, one.u, self.limits)
        segments = {i: bench.segment(i, run) for i, run in enumerate(runs)}
        for k in np.argsort(one.linear, kind="stable").tolist():
            i, j = self.pairs[k]
            found = bench.refitted(j, segments[i])[0] if i in segments else LOST
            real[k] = 0.0 if found >= LOST else found
            if real[k] < least:
                break
        return self._replaced(one, replace(one, real=real))

    def _replaced(self, one: CommandTrial, done: CommandTrial) -> CommandTrial:
        self.tried = [done if other is one else other for other in self.tried]
        return done

    def recovered(self, one: CommandTrial, least: float = 0.0) -> CommandTrial:
        """Return a command with real distances from sigma points too, and the largest cost at which a rival, refitted
        from its estimate and its other minima, misses itself at one; infinite where one leaves the limits. It is given
        up, without windows, once a distance is less than ``least``.
        """
        if one.sure is not None:
            return one
        bench, back, one = self.bench, 0.0, self.refitted(one)
        sure = np.zeros(0) if one.real is None else one.real.copy()
        share, _, _ = bench.share(self.t, one.u, self.limits, points=True)
        if share > 1.0 - self.spare:
            return self._replaced(one, replace(one, back=np.inf, share=share, sure=sure))
        for i, theta in [(i, x) for i, c in enumerate(bench.contenders) for x in c.sigma_points[:SIGMA_POINTS]]:
            run = bench.run(i, self.t, one.u, theta)
            if run is None:
                continue
            seen = bench.segment(i, run, theta)
            back = max(back, bench.refitted(i, seen)[0])
            own = [k for k, pair in enumerate(self.pairs) if pair[0] == i]
            for k in sorted(own, key=lambda k: float(sure[k])):
                sure[k] = min(sure[k], self.distance(self.pairs[k], one.u, theta, seen))
                if sure[k] < least:
                    return self._replaced(one, replace(one, back=back, sure=sure))
        certainties = seen_in_windows(bench, self.pairs, self.t, one.u, self.seed)
        done = replace(one, back=back, share=max(share, one.share), sure=sure, certainties=certainties)
        return self._replaced(one, done)

    def distance(self, pair: Pair, u: Array, theta: Array, seen: PreparedSegment | None = None) -> float:
        """Return the distance of the second rival of a pair, refitted from its estimate and its sigma points, from what
        the first one shows (``seen``) of a command at some coordinates; infinite where that diverges. It is kept.
        """
        bench, (i, j), key = self.bench, pair, (pair, u.tobytes(), theta.tobytes())
        if key not in self.kept:
            run = None if seen else bench.run(i, self.t, u, theta)
            seen = bench.segment(i, run, theta) if run else seen
            c = bench.contenders[j]
            cost = bench.refitted(j, seen, [c.theta, *c.sigma_points[:SIGMA_POINTS]])[0] if seen else np.inf
            self.kept[key] = cost if not seen or cost < LOST else 0.0
        return self.kept[key]

    def enough(self, one: CommandTrial) -> bool:
        """Tell whether a command has enough by real refits and by windows of a second run, and every rival comes back
        to itself.
        """
        seen = one.certainties is not None and float(one.certainties.min(initial=np.inf)) >= DEFAULT_CRITERIA.min_t
        return seen and one.least >= RESERVE * ENOUGH and one.back <= RECOVERS * one.least

    # ------------------------------------------------------------ the ladder of peaks

    def reached(self) -> Array:
        """Return the largest linear distance of every pair (pairs,) over all families at some peaks."""
        for part in LADDER[::-LADDER_STRIDE]:
            self.tell(f"what commands of {part * self.most:.3g} would show", 0.0)
            self._screen(part * self.most)
        return self.largest()

    def ask(self, pairs: Sequence[Pair]) -> None:
        """Ask for some of the pairs only, from now on."""
        keep = [self.pairs.index(pair) for pair in pairs]
        self.pairs = list(pairs)
        self.tried = [
            replace(one, linear=one.linear[keep], real=None, sure=None, certainties=None) for one in self.tried
        ]

    def climbed(self, mix: bool = False) -> CommandTrial | None:
        """Return the best command of the quietest peaks that have one that is enough; None where none has. ``mix``: of
        mixtures of families that help each other.
        """
        best, left = None, len(LADDER)
        for k, part in enumerate(LADDER):
            self.tell(f"commands of {part * self.most:.3g}", (k + len(LADDER) * mix) / (2 * len(LADDER)))
            level = self._screen(part * self.most, NEEDED_EVIDENCE)
            found = self._best_of(self._mixtures(level, part * self.most) if mix else level)
            if found is not None and best is None:
                left = FURTHER + 1
            best = max((one for one in (best, found) if one), key=lambda one: one.least, default=None)
            left -= 1
            if left <= 0:
                break
        return best

    def _screen(self, peak: float, floor: float = 0.0) -> list[CommandTrial]:
        """Return all families at a peak."""
        known = {one.family.name: one for one in self.tried if np.isclose(one.asked, peak)}
        level = [known.get(f.name) or self.screened(f, f.at(peak), peak, floor) for f in COMMAND_FAMILIES]
        return [one for one in level if one]

    def _mixtures(self, level: Sequence[CommandTrial], peak: float) -> list[CommandTrial]:
        near = sorted(level, key=lambda one: -float(one.linear.min()))[:MIXED]
        families = [mixed(a.family, b.family) for n, a in enumerate(near) for b in near[n + 1 :]]
        return [one for one in (self.screened(f, f.at(peak), peak, NEEDED_EVIDENCE) for f in families) if one]

    def _best_of(self, level: Sequence[CommandTrial]) -> CommandTrial | None:
        worth = [one for one in level if float(one.linear.min()) >= REFIT_AT * RESERVE * ENOUGH]
        good = list[CommandTrial]()
        for one in sorted(worth, key=lambda one: -float(one.linear.min()))[:FAMILIES_REFITTED]:
            most = max([RESERVE * ENOUGH, *(other.least for other in good)])
            done = self.refitted(one, most)
            if done.least >= most:
                done = self.recovered(done, most)
                good += [done] if self.enough(done) else []
        return max(good, key=lambda one: one.least, default=None)

    def loudest(self) -> CommandTrial | None:
        """Return the command of the largest real distance that rivals come back from, where none is enough."""
        best: CommandTrial | None = None
        left = RECOVERED
        for one in sorted(self.tried, key=lambda one: -float(one.linear.min()))[:SOUGHT]:
            least = 0.0 if best is None else best.least
            if float(one.linear.min()) <= least or left == 0 or (best is not None and self.spent):
                break
            done = self.refitted(one, least)
            if done.least > least and done.sure is None:
                left -= 1
                self.tell("what rivals would show of the best commands", 0.5 + 0.3 * (1.0 - left / RECOVERED))
                done = self.recovered(done, least)
            sound = np.isfinite(done.back) and done.back <= max(RECOVERS * done.least, NEEDED_EVIDENCE / 2)
            if done.certainties is not None and done.least > least and (sound or best is None):
                best = done
        return best

    def improved(self, one: CommandTrial) -> CommandTrial:
        """Return a command after random changes of its parts that keep its peak, if a real refit says it is better."""
        g, best = np.random.default_rng(self.seed), one
        for _ in range(CHANGED):
            if self.spent:
                break
            parts = changed(g, best.parts)
            family = Family(f"{one.family.name}, refined", parts, (one.family,))
            trial = self.screened(family, parts, floor=best.least)
            if trial is not None and trial.peak <= one.peak * 1.001 and float(trial.linear.min()) > best.least:
                trial = self.refitted(trial, best.least)
                if trial.least > best.least:
                    trial = self.recovered(trial, best.least)
                    sound = self.enough(trial) or (not self.enough(one) and trial.certainties is not None)
                    best = trial if sound and trial.least > best.least else best
        return best

    def largest(self) -> Array:
        """Return the largest linear distance of every pair (pairs,) over all that was tried."""
        known = [np.where(np.isfinite(one.linear), one.linear, 0.0) for one in self.tried]
        return np.asarray(np.max([np.zeros(len(self.pairs)), *known], axis=0))

    def by_family(self) -> list[CommandTrial]:
        """Return the best command of each family: the quietest that is enough, else that of the largest distance."""
        found: dict[str, CommandTrial] = {}
        for one in self.tried:
            best = found.get(one.family.name)
            if ", " not in one.family.name and (best is None or _before(one, best)):
                found[one.family.name] = one
        return list(found.values())

    def words(self, one: CommandTrial, unit: str) -> str:
        """Return a command in words."""
        return in_words(one.parts, float(self.t[-1] - self.t[0]) + float(self.t[1] - self.t[0]), unit)


def _before(one: CommandTrial, other: CommandTrial) -> bool:
    """Tell whether a command goes before another of its family."""
    a, b = (min(x.least, RESERVE * ENOUGH) for x in (one, other))
    return a > b or (a == b and one.peak < other.peak)


def changed(g: np.random.Generator, parts: Sequence[Part]) -> tuple[Part, ...]:
    """Return parts of which one is changed a little: its frequency, its size, its share of the time, or its place."""
    found, i = list(parts), int(g.integers(len(parts)))
    what, part = int(g.integers(4)), found[i]
    if what == 0:
        found[i] = replace(part, frequency=part.frequency * float(np.exp(g.normal(0.0, 0.4))))
    elif what == 1:
        most = max(abs(p.peak) for p in parts)
        size = min(abs(part.peak) * float(np.exp(g.normal(0.0, 0.3))), most)
        found[i] = replace(part, peak=float(np.sign(part.peak)) * size)
    elif what == 2:
        found[i] = replace(part, share=part.share * float(np.exp(g.normal(0.0, 0.4))))
    else:
        j = int(g.integers(len(parts)))
        found[i], found[j] = found[j], found[i]
    return tuple(found)


__all__ = ["ENOUGH", "NEEDED_EVIDENCE", "CommandSearch", "CommandTrial", "changed"]
