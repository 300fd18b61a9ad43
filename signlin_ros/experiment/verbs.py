"""`experiment` and `designed`: from rivals and first records to the next experiment, the chapters in their order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.progress import CancelledError
from signlin_ros.diagnosis.results import Diagnosis
from signlin_ros.errors import InputError, joined
from signlin_ros.experiment import text
from signlin_ros.experiment.chain import MOST_SAMPLES, WORTH_LONGER, EndedSearch, chained, within_limits
from signlin_ros.experiment.common_scale import is_scaled, with_larger_forces
from signlin_ros.experiment.distance import RivalBench
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
    movable,
    named,
    open_ones,
)
from signlin_ros.model import Model
from signlin_ros.names import printed_name
from signlin_ros.records import ModelData
from signlin_ros.threads import one_thread

Array = NDArray[np.float64]

WINDOWS, MIN_RUN_SECONDS, MAX_RUN_SECONDS = 25, 2.0, 10.0
"""Windows of the horizon that a run holds at least, and s of it at least and, unless they need more, at most."""
FAMILIES_TOLD, FAMILIES_OF_SEVERAL = 12, 6
"""Families whose best command is refitted and told, of two rivals and of more: each pair costs refits."""
LONGER = 2.0
"""Times as long a record is planned for two rivals where one is not enough and nobody said how long."""
SAME_STEP, MAX_FINER = 0.02, 20.0
"""Share by which a step may differ from that of the first records and be the same; times as fine as it may be."""


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

    rest, held, every = list[KnownLimits](), list[KnownLimits](), list(rivals)
    if wishes.between:
        rivals = every = named(rivals, wishes.between)
    bench = bench_of(given, records, every, check) if every else None
    larger = [is_scaled(name) for name in wishes.between]
    if bench is not None and any(larger):
        bench = replace(bench, contenders=with_larger_forces(bench.contenders, larger))
    if bench is not None and not wishes.between:
        limits = limits_of(bench.problem, wishes.limits)
        bench, still = movable(bench, limits)
        held = [every[i] for i in sorted(still)]
        free = [r for r in open_ones(bench, every) if r not in held and _rests(bench, every.index(r), limits)]
        rivals, rest = chosen(free)
        kept = [every.index(r) for r in rivals]
        contenders = tuple(bench.contenders[k] for k in kept)
        bench = replace(bench, contenders=contenders, behind=bench.behind[kept])
        bench = replace(bench, likely=likely_ones(bench))
    if bench is None or len(rivals) < 2:
        name = "+".join(rivals[0].effects) if rivals else "nothing"
        why = f"nothing to tell apart: these records leave only one model, with {printed_name(name)}"
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
    found = ended(search)
    if wishes.duration is None and _short(found):
        tell("a longer record", 0.5)
        found = _longer(found, bench, wishes)
    return _plan(found, rest, held, after)


def _short(found: EndedSearch) -> bool:
    """Tell whether a search tells rivals apart, but less surely than a plan asks for."""
    if len(found.search.bench.contenders) > 2:
        return found.expects < ENOUGH
    return NEEDED_EVIDENCE / LONGER <= found.expects < ENOUGH and not found.search.spent


def _longer(found: EndedSearch, bench: RivalBench, wishes: ExperimentWishes) -> EndedSearch:
    """Return a search of a longer record, where that is worth while: of several commands, each for the pairs that those
    before it tell apart least, or for two rivals of one command.
    """
    if len(bench.contenders) > 2:
        return chained(found)
    s = found.search
    t = _times(bench, replace(wishes, duration=LONGER * float(s.t[-1] - s.t[0] + s.t[1] - s.t[0])))
    longer = ended(CommandSearch(bench, s.limits, t, s.spare, s.tell, s.seed))
    return longer if longer.expects > WORTH_LONGER * found.expects else found


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
    if not 100 <= count <= MOST_SAMPLES:
        allowed = f"{100 * step:g} to {MOST_SAMPLES * step:g} s at {step:g} s a sample"
        raise InputError(f"--duration: found {duration:g}; allowed: {allowed}")
    return np.asarray(step * np.arange(count))


def ended(search: CommandSearch) -> EndedSearch:
    """Return a search of the best command for all pairs that some command tells apart, or for those of the proposal."""
    tell = search.tell
    every, reach = list(search.pairs), search.reached()
    if not search.tried:
        raise InputError(_why_none(search))
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
    best = within_limits(search, search.improved(best))
    tell("what it would show", 0.9)
    told = tuple(promised(search, best, every, least, whole))
    return EndedSearch(search, search, best, told, tuple(every), least, tuple(whole))


def _why_none(search: CommandSearch) -> str:
    """Return why no command could be tried: no rival moved, or a limit was not kept."""
    still = joined([search.bench.contenders[i].name for i in sorted(search.still)])
    if not search.refused:
        return f"--limit: no command within the limits moves {still} beyond the noise; --between names other rivals"
    why = max(search.refused, key=lambda n: search.refused[n])
    what = f"no command under which every rival moves stays within the limit of {why}, with {search.spare:g} to spare"
    return f"--limit: {what}" + (f": the smaller ones do not move {still}" if still else "")


def _cures(found: EndedSearch, one: PlanText) -> list[Remedy]:
    """Return the remedies for two rivals that are alike."""
    found.search.tell(f"what would tell {one.rivals[0]} from {one.rivals[1]}", 0.95)
    i, j = found.pairs_of([one])[0]
    return remedies(found.for_pairs(), (min(i, j), max(i, j)))


def _plan(found: EndedSearch, rest: Sequence[KnownLimits], held: Sequence[KnownLimits], after: str) -> ExperimentPlan:
    search, best, told = found.search, found.best, found.told
    cures = [r for one in told if one.alike for r in _cures(found, one)]
    bench, base = search.bench, search.bench.problem.base
    name = base.inputs[0]
    units = {**base.units, **bench.problem.units}
    apart = [one for one in told if not one.alike and one.expected >= NEEDED_EVIDENCE]
    enough = bool(apart) and all(one.expected >= ENOUGH for one in told if one.expected >= NEEDED_EVIDENCE)
    asked = [one for one in told if not one.nested]
    verdict = "none" if not apart else "enough" if enough and len(apart) == len(asked) else "little"
    unit = units.get(name, "")
    rows = (_row(search, best, unit), *(_row(found.single, one, unit) for one in _rows(found)))
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
        notes=text.notes(search, rest, told, held),
        after=after,
        preview=preview(search, best, told),
        tried=len(search.tried),
        reference=base.plant.closed_loop,
        known=tuple(c.planned() for c in bench.contenders if c.scale == 1.0),
    )
    return replace(plan, sentence=text.sentence(plan))


def _rows(found: EndedSearch) -> list[CommandTrial]:
    """Return the best single command of each other family, the quietest of those that are enough first."""
    single = found.single
    rows = [one for one in single.by_family() if one.family.name != found.best.family.name]
    most = FAMILIES_TOLD if len(single.bench.contenders) == 2 else FAMILIES_OF_SEVERAL
    rows = [single.refitted(one) for one in sorted(rows, key=lambda one: -one.least)[:most]]
    return sorted(rows, key=lambda one: (-min(one.least, RESERVE * ENOUGH), one.peak))


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


__all__ = ["ExperimentWishes", "designed", "ended", "experiment"]
