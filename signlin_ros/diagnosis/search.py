"""From a base model and records to what is missing: fits, competition, validation, verdict."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.adding import Adding
from signlin_ros.diagnosis.data import measured_channels, unit_asked
from signlin_ros.diagnosis.derived import without_derived
from signlin_ros.diagnosis.findings import (
    Findings,
    Step,
    at_stake,
    driven_by_noise,
    judged,
    left_by,
    on_unseen,
    structured,
)
from signlin_ros.diagnosis.fit import FAR, Filter, Fit, fit, tidied
from signlin_ros.diagnosis.judge import gain_in_blocks, gain_on, residues
from signlin_ros.diagnosis.problem import (
    LEAST_SAMPLES,
    Gains,
    Problem,
    added_keys,
    check_moving,
    constant_inputs,
    linear_base,
    moves,
    pieces,
    prepare,
    segment,
    white_noise,
    with_measured_position,
)
from signlin_ros.diagnosis.rank import (
    FRONT,
    STRAINED,
    Ranked,
    Trial,
    afloat,
    applicable,
    assess,
    compete,
    deeper,
    descend,
    evidence,
    evidence_of,
    extended,
    extends,
    free_parameters,
    ranked,
    roughness,
    searched,
    sharpened,
    simplified,
    strain,
    unfiltered,
    without,
)
from signlin_ros.diagnosis.refusals import plausible, refusal, sound, vague
from signlin_ros.diagnosis.several import LARGEST, at_once, best_sets
from signlin_ros.diagnosis.timing import CLEARLY, WAYS, better_hold
from signlin_ros.effects import EFFECTS, find_effect
from signlin_ros.errors import InputError, RecordError, SimulationError
from signlin_ros.model import Model
from signlin_ros.records import ModelData

Array = NDArray[np.float64]

TIE = 6.0
"""Difference in evidence below which two explanations are as good as each other."""
SURE, LIKELY = 2.0, 1.0
"""Standard errors by which an effect must lower the error on data that the fit did not see, and by which one must
whose evidence on the data that it was fitted to is `STRONG`, in white noise."""
CERTAIN, FURTHER = 2.5, 3.5
"""Standard errors for what is named at all in a model that stays imperfect with it, and for a second and further
effect, which is the best of some twenty that each might patch what is left.
"""
STRONG = 30.0
NOISE = 1.1
"""What may be left of unseen data, in multiples of their white noise, that is nothing else."""
SPARSE = 50.0
"""Samples so many times further apart than the fastest motion lasts may be why a model diverges."""
MOVED = 12.0
"""What an effect must save of the priors, in -2 log likelihood, if it stands for parameters moved far from nominal."""
SHARE, PART = 0.05, 0.2
"""Least share of the squared innovations on unseen data that one more effect must take away from a poor model; where
structure remains, it must also be that share of what the base model lacks, or `PART` of what the last step left."""
SIMPLE = 0.15
"""Relative difference in squared innovations below which the simpler of two imperfect models is taken."""
MUCH = 0.3
"""Share of the squared innovations on unseen data that a model must leave less than one that evidence prefers."""
TRIED, MOST_TRIED = 3, 9
"""How many options for the next step are held against unseen data, and how many with those whose parameters are
impossible: of two strong effects, one more fits best with those."""
RIVAL = 0.5
"""How far from the best single, as a part of what that gains, the next is gone on from to deeper minima too."""
BEAM = 4
"""How many singles are tried with a second effect where no single is enough."""
WORTH = 0.3
"""Least share of the squared innovations that an effect must take where gains are made for noise in the inputs: that is
recorded with them, and so bends a model by some of what it leaves."""
DEPTH = 3
"""Most effects that one diagnosis adds."""
EXPLAINED = 0.95
"""Least share of the missing part of the motion that the named effects must explain on unseen data."""
BLOCK, BLOCKS = 0.25, 20
"""Length of the blocks in s by which errors on unseen data are compared; shorter where there would be fewer of them."""

Progress = Callable[[str, float], None]


def held_out(data: Sequence[ModelData]) -> tuple[list[ModelData], list[ModelData]]:
    """Return the first two thirds of every record, and the last third."""
    cut = [len(d) * 2 // 3 for d in data]
    return [d.part(0, c) for d, c in zip(data, cut, strict=True)], [d.part(c) for d, c in zip(data, cut, strict=True)]


def prepared(
    model: Model, data: Sequence[ModelData], validation: Sequence[ModelData] | None
) -> tuple[Problem, Problem]:
    """Return the estimation and the validation problem, which share channels, noise and gains."""
    first, second = (list(data), list(validation)) if validation else held_out(data)
    model = with_measured_position(model, [*first, *second])
    channels = measured_channels(model, [*first, *second])
    given = [*data, *(validation or ())]
    check_moving(given, channels)
    if not validation:
        _check_held_out(data, second, channels)
    (known, notes), (unseen, more) = _cut(first, channels), _cut(second, channels)
    own, position = without_derived(model, [*known, *unseen], channels), model.plant.position
    notes += tuple(f"{c} was computed from {position}: it tells nothing more" for c in channels if c not in own)
    notes += constant_inputs(model, given)
    problem = replace(prepare(model, known, own), notes=notes)
    segments = tuple(segment(problem.base, problem.channels, part) for part in unseen)
    return problem, replace(problem, segments=segments, noise=white_noise(segments), notes=more)


def _check_held_out(data: Sequence[ModelData], last: Sequence[ModelData], channels: tuple[str, ...]) -> None:
    """Raise `RecordError` where the last thirds of records are too short, or nothing moves in them."""
    for whole, part in zip(data, last, strict=True):
        if len(part) < LEAST_SAMPLES:
            needed = f"at least {3 * LEAST_SAMPLES} are needed, or {LEAST_SAMPLES} and a validation record"
            raise RecordError(f"{whole.source}: {len(whole)} samples, of which the last third is held out; {needed}")
    if not any(moves(part, channels) for part in last):
        why = "nothing moves in the last third, which is held out; give a validation record"
        raise RecordError(f"{data[0].source}: {why}")


def _cut(data: Sequence[ModelData], channels: tuple[str, ...]) -> tuple[list[ModelData], tuple[str, ...]]:
    """Return the pieces of records, and the notes on what is left out of them."""
    found = [pieces(d, channels) for d in data]
    return [part for parts, _ in found for part in parts], tuple(note for _, notes in found for note in notes)


def search(
    model: Model,
    data: Sequence[ModelData],
    validation: Sequence[ModelData] | None = None,
    run: Executor | None = None,
    progress: Progress | None = None,
    depth: int = DEPTH,
    only: str | None = None,
    driven: Callable[[Problem], Problem | None] | None = None,
) -> Findings:
    """Find what a model lacks; see `Findings`. ``run``: where candidates are fitted, threads by default.

    ``only``: one effect that is added in any case. ``driven``: with gains as of `driven_by_inputs`, say, where it finds
    that these matter. Raises `InputError` where an effect does not apply or the base diverges. Where the model does not
    say when its input acts, and the records say so clearly, all is done again with that.
    """
    own = ThreadPoolExecutor(os.cpu_count() or 1) if run is None else None

    def begun(model: Model, *notes: str) -> _Search:
        problem, unseen = prepared(model, data, validation)
        if driven and (other := driven(problem)):
            problem, unseen = other, replace(unseen, levels=other.levels, driven=True)
        problem = replace(problem, notes=(*problem.notes, *notes))
        return _Search(problem, unseen, run or own, progress or _silent, depth, only)  # type: ignore[arg-type]

    def otherwise(hold: str | float) -> _Search:
        return begun(model.with_options(input_hold=hold), _said(model, hold))

    try:
        one, second = begun(model), None
        early = "" if model.input_hold else one.hold_at_first()
        if early:
            other = otherwise(early)
            second = other.run()
            if not second.structured and not other.hold(second):
                return second
        first = one.run()
        hold = "" if model.input_hold or second else one.hold(first)
        second = otherwise(hold).run() if hold else second
        return second if second and _clearer(second, first, one.block) else first
    finally:
        if own:
            own.shutdown(wait=True, cancel_futures=True)


def _said(model: Model, hold: str | float) -> str:
    name = model.inputs[0]
    way = WAYS[hold] if isinstance(hold, str) else f"from {hold:g} steps before its sample on"
    return f"{name} acts {way} (input_hold: {hold}; input_hold: forward in the model file forbids it)"


def _clearer(a: Findings, b: Findings, block: int) -> bool:
    """Tell whether one proposal explains more than another, and leaves no structure or needs fewer effects, or the same
    and explains unseen data much better: among models that are wrong anyway, another timing is one more imitation.
    """
    mine, other = a.final.ranked, b.final.ranked
    if mine.evidence >= other.evidence - CLEARLY:
        return False
    if not a.structured or len(mine.effects) < len(other.effects):
        return True
    return set(mine.effects) == set(other.effects) and _much_better(b.followed[1], a.followed[1], block)


def _much_better(before: Sequence[Array], after: Sequence[Array], block: int) -> bool:
    """Tell whether innovations (T, ny) on unseen data are much less than others, beyond doubt."""
    gain, certainty, share = gain_on(before, after, block)
    return gain > 0 and certainty > CERTAIN and share > MUCH


def _too_slow(problem: Problem) -> str:
    """Return what is to be said of samples that are much further apart than the model's fastest motion lasts."""
    _, A, _, _ = linear_base(problem.base, problem.channels)
    fastest = float(np.max(np.abs(np.linalg.eigvals(A)))) if A.size else 0.0
    if fastest * problem.scale.step < SPARSE:
        return ""
    apart = f"its fastest motion lasts {1.0 / fastest:.2g} s, the samples are {problem.scale.step:.3g} s apart"
    return f": {apart}{unit_asked(problem.scale.step)}"


def _tidied(step: Step) -> Step:
    """Return a step whose parameters are said as one would say them."""
    r = step.ranked
    return replace(step, ranked=replace(r, fit=tidied(r.fit), low=tidied(r.low)))


def _in_order(path: Sequence[Step]) -> list[Step]:
    """Return steps that name effects in the order in which they were added."""
    found: list[Step] = []
    for step in path:
        before = found[-1].ranked.effects if found else ()
        known = [e for e in before if e in step.ranked.effects]
        effects = (*known, *(e for e in step.ranked.effects if e not in known))
        found.append(replace(step, ranked=replace(step.ranked, effects=effects)))
    return found


def _silent(what: str, done: float) -> None:
    return


def _only(trials: list[Trial], name: str, model: Model) -> list[Trial]:
    """Return the trials of one effect; raise `InputError` if it cannot be added."""
    effect = find_effect(name, "effect")
    found = [t for t in trials if t.effect == name]
    if not found:
        has = any(use.type == name for use in model.effects.values())
        why = "the model has it already" if has else f"it does not apply to {model.plant.name}"
        why = why if has or effect.proposed else "no fit finds its lists; give them in the model file"
        raise InputError(f"effect {name!r} cannot be added: {why}")
    return found


def _values(r: Ranked, effect: str) -> dict[str, float]:
    """Return the fitted parameters of an effect that was added last under its name; none for one of a sensor."""
    key = _key(r, effect)
    return dict(r.fit.fitted().effects[key].parameters) if key else {}


def _key(r: Ranked, effect: str) -> str:
    """Return the key of an effect that was added last under its name, "" if it is one of a sensor."""
    known = r.fit.candidate.model.effects
    return next((k for k in reversed(r.fit.candidate.label) if k in known and known[k].type == effect), "")


def _simple(singles: Sequence[Ranked]) -> list[Ranked]:
    """Return the effects that explain a good part of what the best explains, those of few parameters first; none that
    has parts, which are tried on top of each other.
    """
    best = singles[0].evidence if singles else 0.0
    worst = max((r.evidence for r in singles), default=0.0)
    whole = [r for r in singles if not (r.sensors or EFFECTS[r.label].parts(_values(r, r.label)))]
    good = [r for r in whole if worst - r.evidence > 0.4 * (worst - best)]
    return sorted(good, key=lambda r: (len(r.fit.theta), r.evidence))


def _between(before: Ranked, options: Sequence[Ranked], after: Ranked) -> list[Ranked]:
    """Return the options, but for those with faults of sensors, that add a part of what one set adds to another."""
    return [r for r in options if set(before.effects) < set(r.effects) < set(after.effects) and not r.sensors]


class _Search:
    def __init__(
        self, problem: Problem, unseen: Problem, run: Executor, progress: Progress, depth: int, only: str | None
    ) -> None:
        self.problem, self.unseen, self.executor, self.progress = problem, unseen, run, progress
        self.depth, self.only = depth, only
        self.filter = Filter(np.zeros(len(problem.channels)))
        self.adding = Adding(problem, run)
        self.pairs: list[Ranked] = []
        self.declined: dict[str, str] = {}
        self.told: dict[int, tuple[Ranked, Filter, bool]] = {}
        self.wander: dict[int, tuple[Ranked, bool]] = {}
        samples = sum(s.t.size for s in unseen.segments)
        self.block = max(min(int(BLOCK / problem.scale.step), samples // BLOCKS), 8)
        self.progress("preparing", 0.0)
        self.trials, self.outside = applicable(problem)
        if only is not None:
            self.trials = _only(self.trials, only, problem.base)
        self.known = {t.effect: t for t in self.trials if t.added}
        self.base = self._base()
        self.progress("single effects", 0.1)
        self.alone = self._competed(self.base, self.trials)

    def hold_at_first(self) -> str | float:
        """Return when the input acts, if otherwise than it was taken, where that explains more than any single effect
        does, and none of these is enough.
        """
        best = min([self.base, *self.alone], key=evidence_of)
        hold, gain = ("", 0.0) if self._enough(best) else self._hold([self.base])
        return hold if gain > self.base.evidence - best.evidence else ""

    def hold(self, f: Findings) -> str | float:
        """Return when the input acts, if otherwise than it was taken, by what was found."""
        return self._hold([s.ranked for s in (f.steps[0], f.final, *f.singles[:1])])[0]

    def _hold(self, options: list[Ranked]) -> tuple[str | float, float]:
        different = {r.label + str(r.sensors): r for r in options}
        return better_hold(self.problem, list(different.values()), self.filter, self.executor.map)

    def run(self) -> Findings:
        base, trials, only = self.base, self.trials, self.only
        base, singles = self._whiten(base, self._sharpened(self._singles(base, self.alone, trials)))
        path = self._forced(base, singles) if only else self._path(base, singles, trials)
        self.pairs += self._exchanged(base, path[-1].ranked, singles)
        self.progress("validation", 0.9)
        shown = self._shown(path, singles)
        at = judged(self.problem, path[-1].ranked)
        return Findings(
            self.problem,
            self.unseen,
            self.filter,
            tuple(map(_tidied, _in_order(path))),
            tuple(map(_tidied, shown)),
            tuple(self.pairs),
            tuple(self.outside),
            left_by(self.problem, at),
            self._both(path, at.gains),
            self._both(path, self.problem.levels[1]),
            self.adding.beside,
            self.declined,
            not only or self._best_step(path[:1], [path[-1].ranked]) is not None,
        )

    def _base(self) -> Ranked:
        """Return the base model fitted; if all that it leaves is coloured noise, that is the noise's colour."""
        base = assess(self.problem, None)
        if base is None:
            raise SimulationError(
                f"{self.problem.base.source}: the model diverges on these records{_too_slow(self.problem)}"
            )
        white, self.filter = self.filter, self._colour(base)
        if self.filter.rho.any() and not self._enough(self._polished(base)):
            self.filter = white
        return base

    def _competed(self, base: Ranked, trials: list[Trial]) -> list[Ranked]:
        """Return every effect alone, best first."""
        singles = compete(self.problem, base, trials, self.executor)
        first = [self._unborrowed(base, afloat(self.problem, r, self.executor.map)) for r in singles[:1]]
        return sorted([*first, *singles[1:]], key=evidence_of)

    def _singles(self, base: Ranked, singles: list[Ranked], trials: list[Trial]) -> list[Ranked]:
        """Return every effect alone, best first, searched as thoroughly as is needed for one that is enough."""
        if not (self.filter.rho.any() or self._enough(min([base, *singles], key=evidence_of))):
            singles = [self._unborrowed(base, r) for r in searched(self.problem, trials, singles, self.executor)]
            singles = sorted(singles, key=evidence_of)
            if not self._enough(min([base, *singles], key=evidence_of)):
                singles = self._deeper(base, singles)
        return simplified(self.problem, trials, singles, self.executor)

    def _sharpened(self, singles: list[Ranked]) -> list[Ranked]:
        """Return every effect alone, the best with other powers where it is not enough."""
        if not singles or not EFFECTS[singles[0].label].graded or self._enough(singles[0]):
            return singles
        best = sharpened(self.problem, singles[0], self.filter, self.executor.map)
        return sorted([best, *singles[1:]], key=evidence_of)

    def _deeper(self, base: Ranked, singles: list[Ranked]) -> list[Ranked]:
        """Return every effect alone, the best gone on from to deeper minima, and the next where it explains as much."""
        first = singles[0].evidence if singles else 0.0
        reach = RIVAL * abs(base.evidence - first)
        front = [r for r in singles[:2] if r.evidence <= first + reach]
        found = [self._unborrowed(base, deeper(self.problem, r, self.executor.map)) for r in front]
        return sorted([*found, *singles[len(front) :]], key=evidence_of)

    def _unborrowed(self, base: Ranked, r: Ranked) -> Ranked:
        """Return a load that floats as the common observer follows it, where it is not what it is called: what is left
        of a filter that corrects it says nothing of the noise, nor of how good others are.
        """
        found = refusal(self.problem, r, base) if roughness(r.fit) else None
        if not found:
            return r
        if found[1]:
            self.declined[found[0]] = found[1]
        fits = unfiltered(self.problem, r.low, self.problem.levels)
        return ranked(self.problem, r.effects, r.sensors, fits) or r

    # ------------------------------------------------------------ noise

    def _colour(self, r: Ranked) -> Filter:
        """Return the colour of what a model leaves."""
        left = residues(r.low.innovations, self.problem.white(r.low.gains))
        return Filter(np.array([one.filter for one in left]), np.array([one.average for one in left]))

    def _in_colour(self, r: Ranked, colour: Filter) -> float:
        """Return the evidence of a model fitted to the end in noise of that colour."""
        before, self.filter = self.filter, colour
        found = self._polished(r).evidence
        self.filter = before
        return found

    def _whiten(self, base: Ranked, singles: list[Ranked]) -> tuple[Ranked, list[Ranked]]:
        """Take the noise's colour from the model that is best with the colour of what it leaves; where it matters, fit
        all again with it.

        Coloured noise is borrowed by flexible models as long as it is taken for white; and what is missing looks like
        coloured noise. So does what too low a gain leaves where it is made for inputs that act sooner or later.
        """
        if self.problem.levels[0].moved:
            return base, singles
        good = [base, *sorted(singles, key=evidence_of)[:FRONT]]
        colours = [self._colour(r) for r in good]
        if any(c.rho.any() for c in colours):
            found = [self._in_colour(r, c) for r, c in zip(good, colours, strict=True)]
            self.filter = colours[int(np.argmin(found))]
        if not self.filter.rho.any():
            return base, singles
        refitted = self.executor.map(self._again, singles)
        return self._polished(base), sorted(refitted, key=evidence_of)

    def _again(self, r: Ranked, steps: int = 4, far: float = FAR) -> Ranked:
        """Fit a set of effects again at the lowest gain with the present filter."""
        low = self.problem.levels[-1]
        found = fit(self.problem, r.low.candidate, low, r.low.theta, steps, self.filter, far)
        return r if found is None else self._with_low(r, found)

    def _with_low(self, r: Ranked, low: Fit) -> Ranked:
        best = low if r.fit is r.low or low.cost < r.fit.cost else r.fit
        return replace(r, fit=best, low=low, evidence=evidence(self.problem, best, len(r.effects)))

    def _polished(self, r: Ranked) -> Ranked:
        """Return a set of effects fitted to the very end, so that what is added to it gains nothing by that."""
        again = self._again(r, 12, 0.0)
        if again.fit is again.low:
            return again
        found = fit(self.problem, r.fit.candidate, r.fit.gains, r.fit.theta, 12, None, 0.0)
        return (
            again
            if found is None
            else replace(again, fit=found, evidence=evidence(self.problem, found, len(r.effects)))
        )

    # ------------------------------------------------------------ what is added

    def _path(self, base: Ranked, singles: list[Ranked], trials: list[Trial]) -> list[Step]:
        """Return the steps from the base to the proposal, each beyond doubt on unseen data."""
        return self._by_rungs(self._at_once(self._one_by_one(base, singles, trials), trials), singles)

    def _one_by_one(self, base: Ranked, singles: list[Ranked], trials: list[Trial]) -> list[Step]:
        """Return the steps from the base, of which each adds what explains most of what the one before left."""
        path = [self._step(base)]
        options, whole = singles, None
        for depth in range(self.depth):
            front = [*self.executor.map(self._polished, options[:2]), *options[2:]]
            step = self._best_step(path, [*self._parts(front), *front])
            half = self._halfway(path, step, front)
            whole = step if half is not step else whole
            step = half
            if step is not None:
                path = self._onto(path, step, path[-1])
            elif depth > 0 or (self._enough(path[0].ranked) and strain(path[0].ranked.fit) <= STRAINED):
                break
            self.progress("more effects", 0.3 + 0.15 * depth)
            if depth + 1 < self.depth or step is None:
                options = self._more(path[-1].ranked, singles, trials)
        if whole is not None and path[-1].ranked.evidence >= whole.ranked.evidence + TIE:
            path = self._onto(path, whole, path[0])
        return path

    def _at_once(self, path: list[Step], trials: list[Trial]) -> list[Step]:
        """Return a path to several plain effects at once where one after the other left structure, or took three, and
        these explain more; where nothing at all was beyond doubt, there is nothing to stand in for.
        """
        last = path[-1].ranked
        if len(path) == 1 or self.depth < 2 or (self._enough(last) and len(last.effects) < LARGEST):
            return path
        sets = best_sets(self.problem, trials)
        found = [r for r in self.executor.map(lambda s: at_once(self.problem, s, self.filter), sets) if r]
        self.pairs += found
        for option in sorted(found, key=evidence_of):
            path = self._instead(path, option)
        return path

    def _instead(self, path: list[Step], option: Ranked) -> list[Step]:
        """Return a path to a set of effects in place of another one, without those that unseen data have no need of, if
        it explains these much better, or is enough and by evidence better too. What only adds to it must be enough.
        """
        r, last = self._needed(self._plainer(self._pruned(option, path))), path[-1].ranked
        if len(r.effects) < 2 or set(r.effects) <= set(last.effects):
            return path
        if self._enough(r):
            better = r.evidence < last.evidence - TIE
        else:
            better = not set(last.effects) < set(r.effects) and self._better_unseen(last, r)
        if not better:
            return path
        step = None if self._refused(r, path[0].ranked) else self._compared(path[0], r)
        return self._onto(path, step, path[0]) if step is not None and self._beyond_doubt(path[:1], step) else path

    def _needed(self, r: Ranked) -> Ranked:
        """Return a set of effects without those that explain nothing of unseen data beside the others."""
        for effect in r.effects:
            fewer = without(self.problem, r, effect) if len(r.effects) > 1 else None
            if fewer is not None:
                before, after = (self._unseen(m, self.problem.levels[1]) for m in (fewer, r))
                gain, certainty, _ = gain_on(before, after, self.block)
                if gain <= 0 or certainty <= SURE:
                    return self._needed(fewer)
        return r

    def _onto(self, path: list[Step], step: Step, before: Step) -> list[Step]:
        """Return a path that ends in a step, with those before it that are part of it; it came from ``before``."""
        kept = [p for p in path if set(p.ranked.effects) < set(step.ranked.effects)]
        return [*kept, step if kept[-1] is before else self._compared(kept[-1], step.ranked)]

    def _by_rungs(self, path: list[Step], singles: list[Ranked]) -> list[Step]:
        """Return a path from the base to two effects at once with the better of the two alone in between."""
        if len(path) != 2 or len(path[1].ranked.effects) != 2:
            return path
        alone = _between(path[0].ranked, singles, path[1].ranked)
        first = min(alone, key=evidence_of, default=path[0].ranked)
        if first.evidence >= path[0].ranked.evidence:
            return path
        rung = self._compared(path[0], self._polished(first))
        last = self._compared(rung, path[1].ranked)
        return [path[0], rung, last] if rung.gain > 0 and last.gain > 0 and last.certainty > CERTAIN else path

    def _halfway(self, path: list[Step], step: Step | None, options: list[Ranked]) -> Step | None:
        """Return the best step to a part of what a step adds, where that is several effects at once and one of them is
        beyond doubt by itself: from there on all others compete again.
        """
        if step is None or len(step.ranked.effects) - len(path[-1].ranked.effects) < 2:
            return step
        parts = _between(path[-1].ranked, options, step.ranked)
        part = self._best_step(path, parts) if parts else None
        return part if part is not None and part.gain > 0 else step

    def _parts(self, options: list[Ranked]) -> list[Ranked]:
        """Return the best option with the effect that was added last in its parts: one that is rich stands in for
        several simple ones.
        """
        best = min(options, key=evidence_of, default=None)
        if best is None or not best.effects or best.sensors:
            return []
        effect = EFFECTS[best.effects[-1]]
        whole = effect.parts(_values(best, effect.name))
        sets = [{n: p for n, p in s.items() if n not in best.effects} for s in whole if set(s) <= set(self.known)]
        before = without(self.problem, best, effect.name) if sets else None
        if before is None:
            return []
        found = self.executor.map(lambda s: self._together(before, [(self.known[n], s[n]) for n in s]), sets)
        return [r for r in found if r is not None]

    def _together(
        self,
        before: Ranked,
        parts: Sequence[tuple[Trial, dict[str, float]]],
        alert: bool = True,
        like: Fit | None = None,
    ) -> Ranked | None:
        """Return several effects added at once, fitted out from their starts; ``alert``: see `Candidate`; ``like``: the
        fit whose parameters the others start from, where it knows them.
        """
        r, known = before, like.parameters() if like else {}
        for trial, start in parts:
            pars = EFFECTS[trial.effect].pars()
            c = extended(self.problem, r, trial, {n: pars[n].nearest(v) for n, v in start.items()})
            c = replace(c, alert=alert)
            values = {n: known.get(n, v) for n, v in r.fit.parameters().items()}
            fits = descend(self.problem, c, c.start(values), self.problem.levels[1:], 10, self.filter)
            known = {}
            found = ranked(self.problem, (*r.effects, trial.effect), (*r.sensors, *trial.sensors), fits)
            if found is None:
                return None
            r = found
        return r

    def _forced(self, base: Ranked, singles: list[Ranked]) -> list[Step]:
        """Return the base and the best fit of the effect that was asked for, whatever it gains."""
        if not singles:
            raise SimulationError(f"{self.problem.base.source}: with this effect the model diverges on these records")
        first = self._step(base)
        return [first, self._compared(first, self._polished(singles[0]))]

    def _best_step(self, path: list[Step], options: list[Ranked]) -> Step | None:
        """Return the best option that lowers the error on unseen data beyond doubt, or None; where one is refused that
        would have been enough, the simplest is sought anew. Of those that leave structure, one that explains unseen
        data much better is taken: by evidence, where a model is wrong, the one wins that bends furthest.
        """
        left, anew, best, tried = sorted(options, key=evidence_of), True, None, 0
        for _ in range(min(MOST_TRIED, len(left))):
            option = self._simplest(left) if anew else left[0]
            anew = option is left[0] and self._enough(option)
            left = [r for r in left if r is not option]
            tried += plausible(self.problem, option)
            if tried > TRIED:
                break
            if option.evidence >= path[-1].ranked.evidence - (TIE if len(path) > 1 else 0.0):
                break
            step = self._sure_step(path, option)
            if step is not None and (best is None or self._better_unseen(best.ranked, step.ranked)):
                best = step
            if best is not None and self._enough(best.ranked):
                break
        return best

    def _sure_step(self, path: list[Step], option: Ranked) -> Step | None:
        """Return the step to an option, without what it does not need, if it is beyond doubt and no imitation."""
        r = self._plainer(self._pruned(option, path))
        self._reached(r, path)
        last = path[-1].ranked
        if not self._gains(r, last):
            return None
        kept = self._parent(r, last) if self._refused(r, last) else r
        if kept is None:
            return None
        step = self._seen_awake(path[-1], self._compared(path[-1], kept))
        return step if self._unbent(path, step) or self._beyond_doubt(path, step) else None

    def _gains(self, r: Ranked, last: Ranked) -> bool:
        """Tell whether a set is another one than the last, and explains more than it beyond what does not count."""
        least = roughness(last.fit) if set(last.effects) < set(r.effects) else 0.0
        return r.effects != last.effects and r.evidence < last.evidence - least

    def _parent(self, r: Ranked, last: Ranked) -> Ranked | None:
        """Return a set that was refused with the simpler effect, which one of it extends, in that one's place, if this
        is not refused: a play of next to nothing beside friction is an elastic coupling.
        """
        for effect in (e for e in r.effects if e not in last.effects):
            values = _values(r, effect)
            names = [n for n in extends(effect) if n in self.known and n not in r.effects]
            before = without(self.problem, r, effect) if names else None
            for name in names:
                part = (self.known[name], {n: values[n] for n in EFFECTS[name].pars() if n in values})
                found = self._together(before, [part], True, r.fit) if before else None
                if found and self._gains(found, last) and not self._refused(found, last):
                    return found
        return None

    def _better_unseen(self, a: Ranked, b: Ranked) -> bool:
        """Tell whether a model explains unseen data much better than another, beyond doubt, at the middle gain."""
        middle = self.problem.levels[1]
        return _much_better(self._unseen(a, middle), self._unseen(b, middle), self.block)

    def _refused(self, r: Ranked, last: Ranked) -> bool:
        """Tell whether what a set adds is not what it is called, and note why."""
        found = refusal(self.problem, r, last)
        if found and found[1]:
            self.declined[found[0]] = found[1]
        return found is not None

    def _takes_enough(self, step: Step) -> bool:
        """Tell whether a step takes more than noise in the inputs bends a model by, where gains are made for that."""
        return not self.problem.driven or step.share >= WORTH

    def _unbent(self, path: list[Step], step: Step) -> bool:
        """Tell whether a step frees known parameters that were bent to imitate it, and does no harm on unseen data: the
        first, or one that is another explanation than the step before, and enough, or one that frees them from a strain
        which is out of the question.

        A loss that would be a tie is no harm, however sure, nor is one that the uncertainty of its parameters makes:
        what was bent may be the same model but for the priors.
        """
        last, r = path[-1].ranked, step.ranked
        freed = strain(last.fit) - strain(r.fit)
        if freed <= MOVED or not self._takes_enough(step):
            return False
        if step.certainty <= -SURE and step.gain <= -TIE and -step.gain > at_stake(self.unseen, r.fit):
            return False
        other = not set(last.effects) < set(r.effects)
        return len(path) == 1 or ((other or freed > STRAINED) and self._enough(r))

    def _beyond_doubt(self, path: list[Step], step: Step) -> bool:
        """Tell whether a step lowers the error on unseen data beyond doubt, and is no patch."""
        last, r = path[-1].ranked, step.ranked
        strong = last.evidence - r.evidence > STRONG and not self.filter.rho.any()
        needed = SURE if self._to_the_noise(path, step) else FURTHER if len(path) > 1 else LIKELY if strong else SURE
        if step.gain <= 0 or step.certainty <= needed or not self._takes_enough(step):
            return False
        poor = len(path) > 1 and not self._enough(last)
        if poor and (step.share < SHARE or (not self._enough(r) and self._patch(path, r))):
            return False
        if step.gain < at_stake(self.unseen, last.fit):
            return False  # so much a model that is right may lose there, and one that is wrong gain by chance
        return step.certainty > FURTHER or not self._wandering(last)

    def _to_the_noise(self, path: list[Step], step: Step) -> bool:
        """Tell whether a further step leaves nothing but noise, on unseen data too, where the last one left more: what
        patches one record does not do that on another.
        """
        if len(path) < 2 or self._enough(path[-1].ranked) or not self._enough(step.ranked):
            return False
        left = np.sqrt(np.nanmean(np.concatenate(step.unseen) ** 2, axis=0))
        return bool((left < NOISE * self.unseen.white(step.ranked.fit.gains)).all())

    def _seen_awake(self, before: Step, step: Step) -> Step:
        """Return a step as certain as it is at the highest gain, where that is beyond doubt and noise in the input may
        be to blame below: there the observer follows what it leaves, and the rest is as good as independent.
        """
        if step.gain <= 0 or step.certainty > FURTHER or not self._wandering(before.ranked):
            return step
        first, second = (self._unseen(s.ranked, self.problem.levels[0]) for s in (before, step))
        gain, certainty, _ = gain_on(first, second, self.block)
        return replace(step, certainty=certainty) if gain > 0 and certainty > FURTHER else step

    def _patch(self, path: list[Step], r: Ranked) -> bool:
        """Tell whether a set of effects explains little beyond the last step: neither `SHARE` of what the base model
        lacks nor `PART` of what is left, in squared innovations on unseen data at the middle gain, in any channel.
        """
        models, middle = (path[0].ranked, path[-1].ranked, r), self.problem.levels[1]
        first, last, now = (np.nanmean(np.concatenate(self._unseen(one, middle)) ** 2, axis=0) for one in models)
        lacking = [np.maximum(e - self.unseen.noise**2, SHARE * e) for e in (first, last)]
        return not any(((last - now) / e > least).any() for e, least in zip(lacking, (SHARE, PART), strict=True))

    def _pruned(self, r: Ranked, path: list[Step]) -> Ranked:
        """Return a set of effects without those that are not worth their parameters beside the others.

        One more effect can show the way out of a local minimum of what was there before: the last step of the path is
        then fitted anew.
        """
        while len(r.effects) > 1:
            fewer = [f for f in self.executor.map(functools.partial(without, self.problem, r), r.effects) if f]
            best = min(fewer, key=evidence_of, default=r)
            for f in fewer:
                better = f.effects == path[-1].ranked.effects and f.evidence < path[-1].ranked.evidence
                if better and sound(self.problem, f):
                    path[-1] = self._compared(path[-2], f)
            if best is r or best.evidence > r.evidence:
                return r
            r = best
        return r

    def _plainer(self, r: Ranked) -> Ranked:
        """Return a set of effects with those replaced that are nothing but simpler ones, for their values, where these
        are as good, followed in the same way. What tells it from these is nothing where it is not known.
        """
        for effect in r.effects:
            values = _values(r, effect)
            nothing = [n for n in vague(r.fit, _key(r, effect)) if n in EFFECTS[effect].telling]
            simpler = EFFECTS[effect].simpler(values | dict.fromkeys(nothing, 0.0))
            for name, start in simpler.items():
                before = without(self.problem, r, effect) if name in self.known and name not in r.effects else None
                parts = [(self.known[name], start)] if before else []
                found = self._together(before, parts, r.fit.candidate.alert, r.fit) if before else None
                if found and found.evidence < r.evidence + TIE:
                    return self._plainer(found)
        return r

    def _reached(self, r: Ranked, path: list[Step]) -> None:
        """Fit the base model again from where a set of effects led its parameters, where it has effects of its own.

        A base model that is stuck in a local minimum would credit what is added with the way out.
        """
        if len(path) > 1 or not self.problem.base.effects:
            return
        f: Ranked | None = r
        for effect in r.effects:
            f = without(self.problem, f, effect) if f else None
        if f and f.evidence < path[0].ranked.evidence - TIE and plausible(self.problem, f):
            path[0] = self._step(self._polished(f))

    def _simplest(self, options: Sequence[Ranked]) -> Ranked:
        """Return the best of options, best first; where even that leaves structure, the simplest that explains nearly
        as much.

        Likelihoods then exaggerate: what an imperfect model gains by one more parameter is often imitation.
        """
        best = options[0]
        if self._enough(best):
            return best
        near = [r for r in options if r.fit.cost - best.fit.cost < SIMPLE * float(best.fit.count.max())]
        return min(near, key=lambda r: (free_parameters(self.problem, r.fit), r.evidence))

    def _enough(self, r: Ranked) -> bool:
        """Tell whether a set of effects leaves nothing but noise; what was told once is remembered."""
        known = self.told.get(id(r))
        if known is None or known[0] is not r or known[1] is not self.filter:
            known = self.told[id(r)] = (r, self.filter, not structured(self.problem, r, self.filter))
        return known[2]

    def _wandering(self, r: Ranked) -> bool:
        """Tell whether noise in the input would leave what a model leaves: errors then go together for long; what was
        told once is remembered.
        """
        if self._enough(r):
            return False
        known = self.wander.get(id(r))
        if known is None:
            known = self.wander[id(r)] = (r, driven_by_noise(self.problem, r))
        return known[1]

    def _more(self, now: Ranked, singles: list[Ranked], trials: list[Trial]) -> list[Ranked]:
        """Return sets with one effect more than ``now``; where one is not enough, on top of other singles too, and
        then with either effect of the best pair exchanged for every other.

        Where that is not enough either, one rich effect may stand for two, of which each explains little alone.
        """
        starts = [now] if now.effects else []
        if len(now.effects) <= 1 and not (self._enough(now) and strain(now.fit) <= STRAINED):
            starts += _simple([r for r in singles if r.effects != now.effects])[: BEAM - len(starts)]
        found = self.adding.best(starts, trials, self.filter)
        if found and len(starts) > 1 and len(found[0].effects) == 2:
            done = {r.effects for r in starts}
            halves = [s for s in singles if len(s.effects) == 1 and s.effects[0] in found[0].effects]
            found += self.adding.best([h for h in halves if h.effects not in done], trials, self.filter)
            if not self._enough(min(found, key=evidence_of)):
                found += self.adding.awake([r for r in starts if r is not now], trials, self.filter)
        self.pairs += found
        return sorted([*found, *self._reached_by(found, singles)], key=evidence_of)

    def _reached_by(self, pairs: Sequence[Ranked], singles: list[Ranked]) -> list[Ranked]:
        """Return the parts of the best pairs that are far better alone than these are among the singles, and put them
        there: one more effect showed the way out of a local minimum.
        """
        best = [r for r in sorted(pairs, key=evidence_of) if len(r.effects) == 2 and not r.sensors][:FRONT]
        parts = self.executor.map(lambda w: without(self.problem, *w), [(r, e) for r in best for e in r.effects])
        found: dict[tuple[str, ...], Ranked] = {}
        for part in sorted((r for r in parts if r), key=evidence_of):
            known = next((r for r in singles if r.effects == part.effects), None)
            if known and part.evidence < known.evidence - STRONG:
                singles[singles.index(known)] = found.setdefault(part.effects, part)
        return list(found.values())

    def _exchanged(self, base: Ranked, final: Ranked, singles: Sequence[Ranked]) -> list[Ranked]:
        """Return what is proposed with each of several effects exchanged for what explained as much alone."""
        alone = {r.label: r for r in singles if base.evidence - r.evidence > STRONG}
        jobs = [
            (effect, r)
            for effect in (final.effects if len(final.effects) > 1 else ())
            for r in alone.values()
            if effect in alone and r.label not in final.effects and abs(r.evidence - alone[effect].evidence) < TIE
        ]
        return [r for r in self.executor.map(lambda job: self._in_place(final, *job), jobs) if r]

    def _in_place(self, final: Ranked, effect: str, r: Ranked) -> Ranked | None:
        """Return what is proposed with a single effect, as it was fitted, in place of one of its own."""
        before, values = without(self.problem, final, effect), r.fit.parameters()
        if before is None:
            return None
        keys = tuple(added_keys(self.problem, r.fit.candidate.model, r.label))
        trial = Trial(r.label, keys, {n: values[n] for n in r.sensors})
        return self._together(before, [(trial, _values(r, r.label))], final.fit.candidate.alert)

    # ------------------------------------------------------------ unseen data

    def _unseen(self, r: Ranked, gains: Gains) -> tuple[Array, ...]:
        return on_unseen(self.unseen, r, gains)

    def _both(self, path: Sequence[Step], gains: Gains) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        return self._unseen(path[0].ranked, gains), self._unseen(path[-1].ranked, gains)

    def _step(self, r: Ranked) -> Step:
        return Step(r, self._unseen(r, r.fit.gains))

    def _compared(self, before: Step, r: Ranked) -> Step:
        """Return a set of effects with what it gains on unseen data: at the gain of its fit or, where that is little,
        block by block and at the middle gain too: motion that is lost for once counts for no more than that.
        """
        step, block = self._step(r), self.block
        first = [before.ranked.fit.filter.apply(e) for e in before.unseen]
        second = [r.fit.filter.apply(e) for e in step.unseen]
        gain, certainty, share = gain_on(first, second, block)
        middle = self.problem.levels[1]
        if certainty < FURTHER or gain <= 0:
            floor = self.unseen.noise**2
            there = (self._unseen(before.ranked, middle), self._unseen(r, middle))
            more = [gain_in_blocks(a, b, block, floor) for a, b in ((first, second), there)]
            if certainty >= CERTAIN and gain > 0:
                more.append((gain, certainty, share))
            gain, certainty, share = max(more, key=lambda g: g[1])
        return replace(step, gain=gain, certainty=certainty, share=share)

    def _shown(self, path: Sequence[Step], singles: list[Ranked]) -> list[Step]:
        """Return every single effect compared with the base; a proposal of one may have come from a pair."""
        final = path[-1].ranked
        if len(final.effects) == 1:
            singles = sorted([final, *(r for r in singles if r.effects != final.effects)], key=evidence_of)
        return list(self.executor.map(lambda r: self._compared(path[0], r), singles))


__all__ = ["held_out", "prepared", "search"]
