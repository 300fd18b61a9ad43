"""`experiment` and `designed`: from rivals and first records to the next experiment, the chapters in their order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.progress import CancelledError
from signlin_ros.diagnosis.results import Diagnosis
from signlin_ros.errors import InputError
from signlin_ros.experiment import text
from signlin_ros.experiment.distance import Pair, RivalBench
from signlin_ros.experiment.limits import Limits, limits_of
from signlin_ros.experiment.naming import open_names, with_named
from signlin_ros.experiment.plan import ExperimentPlan, PlanRow, PlanText, Remedy
from signlin_ros.experiment.preview import preview
from signlin_ros.experiment.promise import promised
from signlin_ros.experiment.remedies import remedies, sampled
from signlin_ros.experiment.search import (
    ENOUGH,
    MIN_LINEAR_RATIO,
    NEEDED_EVIDENCE,
    RESERVE,
    CommandSearch,
    CommandTrial,
)
from signlin_ros.experiment.setting import (
    KnownLimits,
    bench_of,
    chosen,
    known_rivals,
    likely_ones,
    named,
    open_ones,
)
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.threads import one_thread

Array = NDArray[np.float64]

WINDOWS, MIN_RUN_SECONDS, MAX_RUN_SECONDS = 25, 2.0, 10.0
"""Windows of the horizon that a run holds at least, and s of it at least and, unless they need more, at most."""
DRAWN, DOWN, TIMES = 12, 0.85, 12
"""Machines drawn from each estimate that must stay within the limits; by what a command is made smaller, how often."""
LONGER, WORTH_LONGER = 2.0, 1.3
"""Times as long a record is planned where one is not enough and nobody said how long; times as much it must show."""
SAME_STEP, MAX_FINER = 0.02, 20.0
"""Share by which a step may differ from that of the first records and be the same; times as fine as it may be."""
EVERY = 20_000
"""Most samples of a run."""


@dataclass(frozen=True)
class ExperimentWishes:
    """What was asked for: rivals by name, limits by name, length in s, time between samples in s, part of the limits to
    spare, and the seed of what is drawn.
    """

    between: tuple[str, ...] = ()
    limits: Mapping[str, float] = field(default_factory=dict)
    duration: float | None = None
    dt: float | None = None
    spare: float = 0.2
    seed: int = 1


@one_thread
def experiment(
    diagnosis: Diagnosis | Mapping[str, Any],
    records: Sequence[ModelData],
    limits: Mapping[str, float] | None = None,
    *,
    between: Sequence[str] = (),
    duration: float | None = None,
    dt: float | None = None,
    spare: float = 0.2,
    seed: int = 1,
    progress: Callable[[str, float], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
    after: str = "",
) -> ExperimentPlan:
    """Return the experiment that tells the rivals of a diagnosis apart, as `signlin experiment` does.

    ``diagnosis``: what `diagnose` returned for ``records``, or its JSON. ``limits`` by name (the input, states,
    ``travel``, ``slew``); what is not given is what the records visited. ``between``: rivals by name, see `with_named`;
    ``duration`` and ``dt`` in s; ``spare``: part of each limit that no rival may use; ``progress`` and ``cancelled``
    as in `diagnose`. Raises `InputError` where there are no two rivals, `CancelledError` when it is stopped.
    """
    content = diagnosis if isinstance(diagnosis, Mapping) else diagnosis.to_json()
    given = Model.from_yaml(content["given_model"], "diagnosis")
    tell, stop = progress or (lambda what, share: None), cancelled or (lambda: False)
    tell("rivals", 0.0)
    rivals = with_named(known_rivals(content["rivals"]), given, records, between or open_names(content), stop)
    wishes = ExperimentWishes(tuple(between), limits or {}, duration, dt, spare, seed)
    return designed(given, records, rivals, wishes, tell, after, stop)


@one_thread
def designed(
    given: Model,
    records: Sequence[ModelData],
    rivals: Sequence[KnownLimits],
    wishes: ExperimentWishes,
    tell: Callable[[str, float], None] = lambda what, share: None,
    after: str = "",
    cancelled: Callable[[], bool] = lambda: False,
) -> ExperimentPlan:
    """Return the next experiment for the rivals of a diagnosis of some records.

    ``tell`` is told what is done, and how much of all; ``cancelled``: asked whether to stop, which raises
    `CancelledError`. Raises `InputError` where there are no two rivals, and for what was asked for and cannot be.
    """

    def check() -> None:
        if cancelled():
            raise CancelledError("stopped")

    rest, every = list[KnownLimits](), list(rivals)
    if wishes.between:
        rivals = every = named(rivals, wishes.between)
    bench = bench_of(given, records, every, check) if every else None
    if bench is not None and not wishes.between:
        limits = limits_of(bench.problem, wishes.limits)
        rivals, rest = chosen([r for r in open_ones(bench, every) if _rests(bench, every.index(r), limits)])
        kept = [every.index(r) for r in rivals]
        contenders = tuple(bench.contenders[k] for k in kept)
        bench = replace(bench, contenders=contenders, behind=bench.behind[kept])
        bench = replace(bench, likely=likely_ones(bench))
    if bench is None or len(rivals) < 2:
        name = "+".join(rivals[0].effects) if rivals else "nothing"
        why = f"nothing to tell apart: these records leave only one model, with {name.replace('_', ' ')}"
        raise InputError(f"{why}; --between A,B names others" if not wishes.between else "--between: name two rivals")
    if bench.problem.plant.motion_is_imposed():
        raise InputError(f"the plant {given.plant.name} has its motion imposed: a command cannot be designed for it")
    limits = limits_of(bench.problem, wishes.limits)
    step = bench.problem.scale.step
    if wishes.dt is not None and not np.isclose(wishes.dt, step, rtol=SAME_STEP):
        most = 0.5 * bench.problem.base.update_period
        if not step / MAX_FINER <= wishes.dt <= most:
            allowed = f"{step / MAX_FINER:.3g} to {most:.3g} s, with first records of {step:.3g} s"
            raise InputError(f"--dt: found {wishes.dt:g}; allowed: {allowed}")
        bench = sampled(bench, wishes.dt)
    search = CommandSearch(bench, limits, _times(bench, wishes), wishes.spare, tell, wishes.seed)
    if search.most <= 0.0:
        raise InputError(f"holding the machine takes {bench.bias:g}, more than its limit {search.limits.input:g}")
    plan = _planned(search, rest, wishes, after)
    if wishes.duration is not None or search.spent or not _short(plan):
        return plan
    tell("a record twice as long", 0.5)
    t = _times(bench, replace(wishes, duration=LONGER * plan.duration))
    longer = _planned(CommandSearch(bench, limits, t, wishes.spare, tell, wishes.seed), rest, wishes, after)
    return longer if _expects(longer) > WORTH_LONGER * _expects(plan) else plan


def _short(plan: ExperimentPlan) -> bool:
    """Tell whether a plan tells rivals apart, but less surely than a plan asks for."""
    return NEEDED_EVIDENCE / LONGER <= _expects(plan) < ENOUGH


def _expects(plan: ExperimentPlan) -> float:
    """Return the least that a plan expects of pairs that some command tells apart."""
    return min((one.expected for one in plan.pairs if not (one.alike or one.nested)), default=np.inf)


def _rests(bench: RivalBench, i: int, limits: Limits) -> bool:
    """Tell whether a rival stays within the limits at rest: one that runs away is not the machine."""
    step = bench.problem.scale.step
    t = np.arange(0.0, MIN_RUN_SECONDS, step)
    run = bench.run(i, t, np.full(t.size, float(bench.bias)))
    return run is not None and limits.share(run)[0] < 1.0


def _times(bench: RivalBench, wishes: ExperimentWishes) -> Array:
    problem = bench.problem
    step = wishes.dt or float(f"{problem.scale.step:.4g}")
    least = max(MIN_RUN_SECONDS, WINDOWS * max(problem.base.update_period, 2 * problem.scale.step))
    duration = wishes.duration or float(np.clip(problem.scale.duration, least, max(least, MAX_RUN_SECONDS)))
    count = round(duration / step)
    if not 100 <= count <= EVERY:
        allowed = f"{100 * step:g} to {EVERY * step:g} s at {step:g} s a sample"
        raise InputError(f"--duration: found {duration:g}; allowed: {allowed}")
    return np.asarray(step * np.arange(count))


def _planned(
    search: CommandSearch, rest: Sequence[KnownLimits], wishes: ExperimentWishes, after: str
) -> ExperimentPlan:
    tell = search.tell
    every, reach = list(search.pairs), search.reached()
    if not search.tried:
        why = max(search.refused, key=lambda n: search.refused[n], default="")
        what = "no command under which every rival moves stays within the limit of"
        raise InputError(f"--limit: {what} {why} with {search.spare:g} to spare")
    own = dict(zip(every, reach.tolist(), strict=True))
    least = {pair: min(r, own.get(pair[::-1], r)) for pair, r in own.items()}
    asked = [p for p in every if least[p] >= MIN_LINEAR_RATIO * NEEDED_EVIDENCE]
    asked = asked or [p for p in every if least[p] >= max(NEEDED_EVIDENCE, 0.5 * max(least.values()))]
    asked = asked or [p for p in every if p in (every[0], every[0][::-1])]
    whole = list(search.tried)
    search.ask(asked)
    best = search.climbed() or search.climbed(mix=True) or search.loudest()
    if best is None:  # none serves them all: those of the proposal, or its first
        search.ask([p for p in asked if 0 in p] or asked[:1])
        best = search.climbed() or search.loudest()
    if best is None:
        search.ask(search.pairs[:1])
        best = search.climbed() or search.loudest()
    if best is None:
        raise InputError("no command could be found within the limits")
    best = _within(search, search.improved(best))
    tell("what it would show", 0.9)
    told = promised(search, best, every, least, whole)
    cures = [r for one in told if one.alike for r in _cures(search, one, every, whole)]
    return _plan(search, best, told, cures, rest, after)


def _within(search: CommandSearch, best: CommandTrial) -> CommandTrial:
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


def _cures(search: CommandSearch, one: PlanText, every: Sequence[Pair], whole: Sequence[CommandTrial]) -> list[Remedy]:
    """Return the remedies for two rivals that are alike."""
    search.tell(f"what would tell {one.rivals[0]} from {one.rivals[1]}", 0.95)
    names = [c.name for c in search.bench.contenders]
    other = _whole(search, every, whole)
    return remedies(other, (names.index(one.rivals[0]), names.index(one.rivals[1])))


def _whole(search: CommandSearch, every: Sequence[Pair], whole: Sequence[CommandTrial]) -> CommandSearch:
    """Return a search of all pairs with what was tried for all of them."""
    options = (search.spare, _quiet, search.seed, list(every), list(whole))
    return CommandSearch(search.bench, search.limits, search.t, *options)


def _quiet(what: str, share: float) -> None:
    """Tell nothing."""


def _plan(
    search: CommandSearch,
    best: CommandTrial,
    told: Sequence[PlanText],
    cures: Sequence[Remedy],
    rest: Sequence[KnownLimits],
    after: str,
) -> ExperimentPlan:
    bench, base = search.bench, search.bench.problem.base
    name = base.inputs[0]
    units = {**base.units, **bench.problem.units}
    apart = [one for one in told if not one.alike and one.expected >= NEEDED_EVIDENCE]
    enough = bool(apart) and all(one.expected >= ENOUGH for one in told if one.expected >= NEEDED_EVIDENCE)
    asked = [one for one in told if not one.nested]
    verdict = "none" if not apart else "enough" if enough and len(apart) == len(asked) else "little"
    rows = tuple(_row(search, one, units.get(name, "")) for one in _rows(search, best))
    plan = ExperimentPlan(
        verdict=verdict,
        sentence="",
        words=search.words(best, units.get(name, "")),
        t=search.t,
        u=best.u,
        input=name,
        unit=units.get(name, ""),
        rivals=tuple(c.name for c in bench.contenders),
        pairs=tuple(told),
        families=rows,
        limits=_limits(search.limits, name),
        assumed=search.limits.assumed,
        spare=search.spare,
        visits=_visits(search, best),
        units=units,
        smallest=text.smallest(bench, told),
        remedies=tuple(cures),
        notes=text.notes(search, rest, told),
        after=after,
        preview=preview(search, best, told),
        tried=len(search.tried),
        reference=base.plant.closed_loop,
        known=tuple(c.planned() for c in bench.contenders),
    )
    return replace(plan, sentence=text.sentence(plan))


def _rows(search: CommandSearch, best: CommandTrial) -> list[CommandTrial]:
    rows = [one for one in search.by_family() if one.family.name != best.family.name]
    rows = [search.refitted(one) for one in sorted(rows, key=lambda one: -one.least)[:12]]
    return [best, *sorted(rows, key=lambda one: (-min(one.least, RESERVE * ENOUGH), one.peak))]


def _row(search: CommandSearch, one: CommandTrial, unit: str) -> PlanRow:
    real = one.real is not None
    name = one.family.name
    distance = float(one.real.min()) if one.real is not None else np.nan
    return PlanRow(name, search.words(one, unit), one.peak, one.share, distance, real, one.family.texts, one.u)


def _limits(limits: Limits, name: str) -> dict[str, float]:
    found = {name: limits.input, **limits.states}
    return found | ({"slew": limits.slew} if np.isfinite(limits.slew) else {})


def _visits(search: CommandSearch, best: CommandTrial) -> dict[str, float]:
    """Return the largest value of every limited quantity over all rivals' estimates."""
    runs = [search.bench.run(i, search.t, best.u) for i in range(len(search.bench.contenders))]
    found = dict.fromkeys(search.limits.states, 0.0)
    for run in (run for run in runs if run is not None):
        for name in search.limits.states:
            values = search.limits.values(run, name)
            if values is not None:
                found[name] = max(found[name], float(np.abs(values).max()))
    return found


__all__ = ["ExperimentWishes", "designed", "experiment"]
