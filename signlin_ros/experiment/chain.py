"""Several commands in one record, one after the other, where no single one tells all rivals apart.

What two parts of a record show adds up: a law refitted to both leaves no less than refitted to each. So the best
commands for single pairs follow each other, each time the one after which a wrong rival is least likely to win. Of two
laws at a distance d that is exp(-d/8) at most, of several the sum over their pairs at most [Bhattacharyya's bound:
Kailath, IEEE Trans. Communication Technology 15 (1967) 52, doi:10.1109/TCOM.1967.1089532]; a pair that no command tells
apart decides nothing for the others. [What such a sum loses is submodular in the commands, and the greedy choice is
within 1 - 1/e of the best: Nemhauser, Wolsey and Fisher 1978, doi:10.1007/BF01588971]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.experiment.distance import Pair
from signlin_ros.experiment.families import Family
from signlin_ros.experiment.parts import REST_PART, Part
from signlin_ros.experiment.plan import PlanText
from signlin_ros.experiment.promise import foretold, promised
from signlin_ros.experiment.search import ENOUGH, NEEDED_EVIDENCE, RECOVERS, RESERVE, CommandSearch, CommandTrial

Array = NDArray[np.float64]

DRAWN, DOWN, MAX_REDUCTIONS = 12, 0.85, 12
"""Machines drawn from each estimate that must stay within the limits; by what a command is made smaller, how often."""
MOST_COMMANDS, MOST_SAMPLES = 4, 20_000
"""Most commands in one record, and most samples of it."""
PAIRS_HELPED, LEAST_GAIN = 4, 0.1
"""Pairs, the hardest, for which commands are looked for; part by which one more must lower the bound on an error."""
WORTH_LONGER = 1.3
"""Times as much that a longer record must show."""


@dataclass(frozen=True, eq=False)
class EndedSearch:
    """A search that has ended: its ``best`` command, what that promises (``told``), every pair of rivals, the linear
    distance that any command reaches of it (``least``), and what was tried for ``every`` one (``whole``); ``single``:
    the search of single commands, which are part of the best one.
    """

    search: CommandSearch
    single: CommandSearch
    best: CommandTrial
    told: tuple[PlanText, ...]
    every: tuple[Pair, ...]
    least: Mapping[Pair, float]
    whole: tuple[CommandTrial, ...]

    @property
    def expects(self) -> float:
        """The least that is expected of pairs that some command tells apart."""
        return min((one.expected for one in self.told if not (one.alike or one.nested)), default=np.inf)

    def for_pairs(self, pairs: Sequence[Pair] = ()) -> CommandSearch:
        """Return a search for some pairs, all by default, with what was tried, and as much left to do as at first."""
        s = self.single
        bench = replace(s.bench, used={"runs": 0, "fits": 0})
        found = CommandSearch(bench, s.limits, s.t, s.spare, _quiet, s.seed, list(self.every), list(self.whole))
        if pairs:
            found.ask(pairs)
        return found

    def pairs_of(self, told: Sequence[PlanText]) -> list[Pair]:
        """Return the pairs, both ways, of entries of a table."""
        names = [c.name for c in self.search.bench.contenders]
        asked = {frozenset(map(names.index, one.rivals)) for one in told}
        return [pair for pair in self.every if frozenset(pair) in asked]


def _quiet(what: str, share: float) -> None:
    """Tell nothing."""


def within_limits(search: CommandSearch, best: CommandTrial) -> CommandTrial:
    """Return a command made smaller until machines drawn from every estimate stay within the limits."""
    g = np.random.default_rng(search.seed)
    drawn = [(i, theta) for i, c in enumerate(search.bench.contenders) for theta in c.drawn(g, DRAWN)]
    for _ in range(MAX_REDUCTIONS):
        runs = [search.bench.run(i, search.t, best.u, theta) for i, theta in drawn]
        worst = max((search.limits.share(run)[0] for run in runs if run is not None), default=0.0)
        if worst <= 1.0 - 0.5 * search.spare:
            return search.recovered(best)
        parts = tuple(replace(p, peak=DOWN * p.peak) for p in best.parts)
        smaller = search.screened(best.family, parts)
        if smaller is None:
            break
        best = smaller
    return search.recovered(best)


def chained(first: EndedSearch) -> EndedSearch:
    """Return a search whose command is followed by others, for the pairs that are not told apart with as much as a plan
    asks for; the same where no other command helps, or rivals do not come back from all of them.
    """
    apart = [one for one in first.told if not (one.alike or one.nested)]
    weak = sorted((one for one in apart if one.expected < ENOUGH), key=lambda one: one.expected)[:PAIRS_HELPED]
    best_of = {one.rivals: more for one in weak if (more := _best_for(first, one))}
    options = list(best_of.values())
    alone = {rivals: more.least for rivals, more in best_of.items()}
    told = tuple(replace(one, most=max(one.most, alone.get(one.rivals, 0.0))) for one in first.told)
    first = replace(first, told=told)
    added = _added(np.array([one.expected for one in weak]), [_shown(first, weak, more) for more in options])
    longer = _one_after_the_other(first, [first.best, *(options[k] for k in added)]) if added else None
    if longer is None:
        return first
    search, best = longer
    new = {one.rivals: one for one in promised(search, best, first.pairs_of(apart), first.least, [])}
    told = tuple(_still_apart(one, new[one.rivals]) if one.rivals in new else one for one in told)
    names = {one.rivals for one in weak}
    before, after = (
        sum(min(one.expected, ENOUGH) for one in side if one.rivals in names) for side in (first.told, told)
    )
    return replace(first, search=search, best=best, told=told) if after > WORTH_LONGER * before else first


def _best_for(first: EndedSearch, one: PlanText) -> CommandTrial | None:
    """Return the best single command for two rivals: the quietest that is enough, else the loudest."""
    first.search.tell(f"what tells {one.rivals[0]} from {one.rivals[1]}", 0.6)
    search = first.for_pairs(first.pairs_of([one]))
    return search.climbed() or search.loudest()


def _shown(first: EndedSearch, told: Sequence[PlanText], trial: CommandTrial) -> Array:
    """Return the distance (pairs,) of each two rivals under a command, the smallest of both ways and of what the first
    records leave open of the true one.
    """
    search = first.single
    return np.array([min(foretold(search, trial.u, pair) for pair in first.pairs_of([one])) for one in told])


def _added(now: Array, shown: Sequence[Array]) -> list[int]:
    """Return which commands are added, in their order: each time the one by which the distances (pairs,) of now and of
    those that were ``shown`` leave the smallest bound on an error, those beyond what is asked for as that.
    """
    found, most = list[int](), RESERVE * ENOUGH
    while shown and len(found) < MOST_COMMANDS - 1:
        left = [_bound(np.minimum(now + more, most)) for more in shown]
        best = int(np.argmin(left))
        if left[best] > (1.0 - LEAST_GAIN) * _bound(np.minimum(now, most)):
            break
        now = now + shown[best]
        found.append(best)
    return found


def _bound(distances: Array) -> float:
    """Return Bhattacharyya's bound on how likely a wrong one of rivals wins, of the distances (pairs,) of each two."""
    return float(np.exp(-distances / 8.0).sum())


def _one_after_the_other(
    first: EndedSearch, commands: Sequence[CommandTrial]
) -> tuple[CommandSearch, CommandTrial] | None:
    """Return commands as one, and its search; None where it is too long, or where rivals do not come back from it."""
    s = first.single
    times = (s.t[1] - s.t[0]) * np.arange(len(commands) * s.t.size)
    if times.size > MOST_SAMPLES:
        return None
    bench = first.for_pairs().bench
    search = CommandSearch(bench, s.limits, times, s.spare, s.tell, s.seed, list(first.search.pairs))
    rest, parts = Part("rest", 0.0, 1.0, REST_PART), list[Part]()
    for one in commands:
        parts += [*([rest] if parts else []), *_of_length(one.parts, 1.0)]
    names = dict.fromkeys(one.family.name.removesuffix(", refined") for one in commands)
    family = Family(", then ".join(names), tuple(parts), tuple(one.family for one in commands))
    trial = search.screened(family, tuple(parts))
    done = within_limits(search, trial) if trial else None
    sound = done is not None and done.back <= max(RECOVERS * done.least, NEEDED_EVIDENCE / 2)
    return (search, done) if done is not None and sound else None


def _still_apart(before: PlanText, now: PlanText) -> PlanText:
    """Return what a longer record promises of two rivals that some command tells apart."""
    return replace(now, most=max(before.most, now.most), alike=False, nested=False)


def _of_length(parts: Sequence[Part], share: float) -> tuple[Part, ...]:
    """Return parts that take so large a share of the time together."""
    total = sum(p.share for p in parts)
    return tuple(replace(p, share=share * p.share / total) for p in parts)


__all__ = ["MOST_SAMPLES", "WORTH_LONGER", "EndedSearch", "chained", "within_limits"]
