"""Several commands in one record, one after the other, where no single one tells all rivals apart.

What two parts of a record show adds up: a law refitted to both leaves no less than one refitted to each. So a command
for the pairs that another one tells apart least is added to it, not put in its place.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from signlin_ros.experiment.distance import Pair
from signlin_ros.experiment.families import Family
from signlin_ros.experiment.parts import REST_PART, Part
from signlin_ros.experiment.plan import PlanText
from signlin_ros.experiment.promise import promised
from signlin_ros.experiment.search import ENOUGH, NEEDED_EVIDENCE, RECOVERS, RESERVE, CommandSearch, CommandTrial

DRAWN, DOWN, TIMES = 12, 0.85, 12
"""Machines drawn from each estimate that must stay within the limits; by what a command is made smaller, how often."""
MOST_COMMANDS, MOST_SAMPLES = 3, 20_000
"""Most commands in one record, and most samples of it."""


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
    for _ in range(TIMES):
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
    asks for, while that shows more; the same where no other command helps.
    """
    apart = [one for one in first.told if not (one.alike or one.nested)]
    search, best = first.search, first.best
    weak = first.pairs_of([one for one in apart if one.expected < ENOUGH])
    for count in range(2, MOST_COMMANDS + 1):
        longer = _followed(first, best, weak, count) if weak else None
        if longer is None or longer[1].least <= best.least:
            break
        search, best = longer
        known = best.real if best.sure is None else best.sure
        shown = zip(search.pairs, known.tolist() if known is not None else [], strict=False)
        weak = [pair for pair, distance in shown if distance < RESERVE * ENOUGH]
    if best is first.best:
        return first
    new = {one.rivals: one for one in promised(search, best, first.pairs_of(apart), first.least, [])}
    told = tuple(_still_apart(one, new[one.rivals]) if one.rivals in new else one for one in first.told)
    return replace(first, search=search, best=best, told=told)


def _followed(
    first: EndedSearch, best: CommandTrial, weak: Sequence[Pair], count: int
) -> tuple[CommandSearch, CommandTrial] | None:
    """Return a command followed by the best one for some pairs, and its search; None where none is, or where rivals do
    not come back from it.
    """
    s, other = first.single, first.for_pairs(weak)
    times = (s.t[1] - s.t[0]) * np.arange(count * s.t.size)
    more = (other.climbed() or other.loudest()) if times.size <= MOST_SAMPLES else None
    if more is None:
        return None
    search = CommandSearch(other.bench, s.limits, times, s.spare, s.tell, s.seed, list(s.pairs))
    parts = (*_of_length(best.parts, count - 1), Part("rest", 0.0, 1.0, REST_PART), *_of_length(more.parts, 1))
    names = dict.fromkeys((*best.family.name.split(", then "), more.family.name))
    trial = search.screened(Family(", then ".join(names), parts, (*best.family.texts, *more.family.texts)), parts)
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


__all__ = ["MOST_SAMPLES", "EndedSearch", "chained", "within_limits"]
