"""How well a planned command would tell rivals apart: what is promised of each two of them.

An estimate is uncertain and a record has noise: the promise is the least that refits give of machines drawn from the
first records' estimates, with the sensors' noise, as a diagnosis would see them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.effects import EFFECTS
from signlin_ros.experiment.contenders import Contender
from signlin_ros.experiment.distance import LOST, Pair, RivalBench
from signlin_ros.experiment.minima import overlap
from signlin_ros.experiment.plan import PlanText
from signlin_ros.experiment.search import NEEDED_EVIDENCE, SIGMA_POINTS, CommandSearch, CommandTrial
from signlin_ros.follow.segments import PreparedSegment

Array = NDArray[np.float64]
MACHINES_DRAWN = 8
"""Machines drawn of each rival, each of which the others are refitted to a noisy record of."""
LARGEST_REFITTED = 3
"""Commands of the largest linear distance of a pair that are refitted, to say what any command would show."""


def promised(
    search: CommandSearch,
    best: CommandTrial,
    every: Sequence[Pair],
    least: Mapping[Pair, float],
    whole: Sequence[CommandTrial],
) -> list[PlanText]:
    """Return how well each two rivals are told apart: both ways, from sigma points of the true one, and drawn."""
    bench, first = search.bench, search.bench.behind
    found, names = [], [c.name for c in bench.contenders]
    drawn = {i: _records(search, best.u, i) for i in dict.fromkeys(i for i, _ in every)}
    for i, j in dict.fromkeys((min(p), max(p)) for p in every):
        ways = [p for p in ((i, j), (j, i)) if p in least]
        near = {p: _imitations(search, best.u, p) for p in ways}
        expected = min(value for found_of in near.values() for value, _ in found_of)
        places = [k for k, p in enumerate(search.pairs) if set(p) == {i, j}]
        seen = float(best.certainties[places].min()) if best.certainties is not None and places else np.nan
        most, alike, nested = max(expected, 0.0), False, False
        if expected < NEEDED_EVIDENCE:
            most = least[ways[0]]
            most = max(expected, _most(search, ways, every, whole)) if most >= NEEDED_EVIDENCE else most
            nested = most < NEEDED_EVIDENCE and _kin(bench.contenders[i], bench.contenders[j])
            way = richer(bench.contenders, i, j)
            imitated = nested and way in least and not _idle(search, best.u, way)
            least_of = min(value for value, _ in near[way]) if imitated else 0.0
            if imitated and max(least_of, _most(search, [way], every, whole)) < NEEDED_EVIDENCE:
                nested = False  # other parameters imitate what it adds, whichever the command: a symmetry
            alike = bool(most < NEEDED_EVIDENCE) and not nested
        else:
            for p in ways:
                starts = [theta for _, theta in near[p]]
                margins = [bench.margin(p[1], shown, own, starts) for shown, own in drawn[p[0]]]
                expected = max(min([expected, *margins]), 0.0)
        so_far = abs(float(first[i] - first[j]))
        found.append(PlanText((names[i], names[j]), expected, seen, so_far, most, alike, nested))
    return found


def _records(search: CommandSearch, u: Array, i: int) -> list[tuple[PreparedSegment, float]]:
    """Return noisy readings of machines drawn from a rival's estimate under a command, and the squares that the rival,
    refitted, leaves of them.
    """
    bench, g = search.bench, np.random.default_rng((search.seed, i))
    found = list[tuple[PreparedSegment, float]]()
    for theta in bench.contenders[i].drawn(g, MACHINES_DRAWN):
        run = bench.run(i, search.t, u, theta)
        if run is not None:
            clean = bench.segment(i, run, theta)
            noise = bench.problem.noise * g.standard_normal(clean.y.shape)
            noisy = replace(clean, y=np.ascontiguousarray(clean.y + noise))
            found.append((noisy, bench.left(i, noisy, theta)))
    return found


def richer(contenders: Sequence[Contender], i: int, j: int) -> Pair:
    """Return two rivals with that first which has all effects of the other and more; (-1, -1) where none has."""
    a, b = set(contenders[i].effects), set(contenders[j].effects)
    return (j, i) if a < b else (i, j) if b < a else (-1, -1)


def _kin(a: Contender, b: Contender) -> bool:
    """Tell whether one rival contains the other: it has more effects, or is a richer law of one family."""
    if a.scale != b.scale:
        return False
    if set(a.effects) < set(b.effects) or set(b.effects) < set(a.effects):
        return True
    if len(a.effects) != 1 or len(b.effects) != 1:
        return False
    first, second = a.effects[0], b.effects[0]
    if overlap(first, second):
        return True
    families = [EFFECTS[name].family for name in (first, second)]
    return bool(families[0]) and families[0] == families[1] and a.theta.size != b.theta.size


def _idle(search: CommandSearch, u: Array, pair: Pair) -> bool:
    """Tell whether what the first rival of a pair has beyond the second does nothing under a command, all else as it
    is.
    """
    bench, (rich, simple) = search.bench, pair
    own, other, run = bench.contenders[simple], bench.contenders[rich], bench.run(rich, search.t, u)
    if run is None:
        return True
    theta = own.candidate.start(other.candidate.named(other.theta))
    return bench.squares(simple, bench.segment(rich, run), theta) < NEEDED_EVIDENCE


def _imitations(search: CommandSearch, u: Array, pair: Pair) -> list[tuple[float, Array]]:
    """Return the distances of the second rival of a pair from the first one's estimate and its sigma points, and where
    it comes nearest to each (n,).
    """
    bench, (i, j) = search.bench, pair
    runs = [(theta, bench.run(i, search.t, u, theta)) for theta in _likely(search, i)]
    found = [bench.imitated(j, bench.segment(i, run, theta)) for theta, run in runs if run is not None]
    return [(0.0 if v >= LOST else v, at) for v, at in found] or [(0.0, bench.contenders[j].theta)]


def _likely(search: CommandSearch, i: int) -> list[Array]:
    """Return the coordinates (n,) at which a rival is thought to be true: its estimate, and the first sigma points."""
    c = search.bench.contenders[i]
    return [c.theta, *c.sigma_points[:SIGMA_POINTS]]


def foretold(search: CommandSearch, u: Array, pair: Pair) -> float:
    """Return the smallest distance from a rival's estimate or one of its sigma points, the other one refitted from its
    estimate and from its first sigma points: what commands are chosen by.
    """
    values = [search.distance(pair, u, theta) for theta in _likely(search, pair[0])]
    return min((v for v in values if np.isfinite(v)), default=0.0)


def _most(search: CommandSearch, ways: Sequence[Pair], every: Sequence[Pair], whole: Sequence[CommandTrial]) -> float:
    """Return the largest real distance of two rivals over the commands of the largest linear ones."""
    places = [k for k, p in enumerate(every) if p in ways]
    near = sorted(whole, key=lambda one: -float(one.linear[places].min()))[:LARGEST_REFITTED]
    return max((min(_real(search.bench, search.t, one.u, p) for p in ways) for one in near), default=0.0)


def _real(bench: RivalBench, t: Array, u: Array, pair: Pair) -> float:
    run = bench.run(pair[0], t, u)
    cost = LOST if run is None else bench.imitated(pair[1], bench.segment(pair[0], run))[0]
    return 0.0 if cost >= LOST else cost


__all__ = ["foretold", "promised", "richer"]
