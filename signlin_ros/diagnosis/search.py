"""From a base model and records to what is missing: fits, competition, validation, verdict."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from signlin_ros.diagnosis.data import measured_channels
from signlin_ros.diagnosis.fit import FAR, Filter, Fit, fit, follow_records, further, likelihood, tidied
from signlin_ros.diagnosis.judge import Residue, gain_in_blocks, gain_on, residues, whiteness
from signlin_ros.diagnosis.problem import (
    Gains,
    Problem,
    linear_base,
    pieces,
    prepare,
    segment,
    white_noise,
    with_measured_position,
)
from signlin_ros.diagnosis.rank import (
    FRONT,
    Ranked,
    Trial,
    applicable,
    assess,
    compete,
    cost_of,
    deeper,
    descend,
    evidence,
    extended,
    free_parameters,
    ranked,
    searched,
    simplified,
    trusted,
    without,
)
from signlin_ros.diagnosis.timing import CLEARLY, WAYS, better_hold
from signlin_ros.effects import EFFECTS, find_effect
from signlin_ros.errors import InputError, SimulationError
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
SPARSE = 50.0
"""Samples so many times further apart than the fastest motion lasts may be why a model diverges."""
STRAINED = 60.0
"""What the priors may cost, in -2 log likelihood, of a model that needs no second opinion: beyond, known parameters may
be bent so that a wrong effect fits."""
MOVED = 12.0
"""What an effect must save of the priors, in -2 log likelihood, if it stands for parameters moved far from nominal."""
SHARE, PART = 0.05, 0.2
"""Least share of the squared innovations on unseen data that one more effect must take away from a poor model; where
structure remains, it must also be that share of what the base model lacks, or `PART` of what the last step left."""
SIMPLE = 0.15
"""Relative difference in squared innovations below which the simpler of two imperfect models is taken."""
ROUNDED = 0.6
"""A residual smaller than this share of the step in which a channel is shown is its rounding."""
DRAWS, SENSITIVE = 4, 0.1
"""Draws of uncertain parameters, and the share of what is left that they must make where motion is chaotic."""
AWAKE = 1.35
"""What an observer may leave, in multiples of the noise, where it follows a state that is moved at random: the noise,
by how much its gain follows that, and steps of an encoder."""
NEEDED = 30.0
"""A model is imperfect if a higher gain is more likely than the lowest one by this in -2 log likelihood."""
NOTHING, NEEDLESS = 1e-6, 0.1
"""What a parameter is held at, as a share of its value, to see whether it is needed, and the share of an effect's gain
that one must make without which it is another effect."""
REAL = 3.0
"""Standard errors by which an added effect must differ from nothing."""
SLIGHT = 1e-3
"""Share of the driving force, or of the largest input, beneath which an effect is not worth a name."""
WIDE = 6
"""How many of those that can be added to a set are looked at more closely; with states of their own all are."""
SLOW = 10
"""Steps that those with states get for that, whose shape takes longer to be found; others two."""
MOST_FINISHED = 4
"""How many of these are fitted out."""
MOST_IMPOSED = 12
"""The same where motion is imposed: no observer helps there to find the shape of a hysteresis in a few steps."""
BEAM = 4
"""How many singles are tried with a second effect where no single is enough."""
DEPTH = 3
"""Most effects that one diagnosis adds."""
EXPLAINED = 0.95
"""Least share of the missing part of the motion that the named effects must explain on unseen data."""
BLOCK = 0.25
"""Length of the blocks in s by which errors on unseen data are compared."""

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Step:
    """A model on the way from the base to the proposal: what it is, and its innovations on unseen data.

    ``unseen``: at the gain of its fit. ``gain``: fall of -2 log likelihood against the step
    before (singles: the base), ``certainty`` in standard errors, ``share``: of the squared innovations.
    """

    ranked: Ranked
    unseen: tuple[Array, ...]
    gain: float = 0.0
    certainty: float = 0.0
    share: float = 0.0


@dataclass(frozen=True)
class Beside:
    """What an effect takes away beside others, as a share of the squared errors that these leave (their geometric mean
    over channels).
    """

    others: tuple[str, ...]
    share: float


@dataclass(frozen=True)
class Findings:
    """Everything that a search found.

    ``steps``: base, then one more effect each. ``singles``: every effect alone, best first, with its innovations on
    unseen data. ``pairs``: what was tried on top of each single. ``left``: the residual of the proposal;
    ``held_out``: innovations of the base and of the proposal on unseen data, at the gain where this is judged;
    ``followed``: the same at the middle gain. ``beside``: what effects promised beside others, on the data that was
    fitted to. ``declined``: why effects that lower the error were refused. ``beyond_doubt``: whether the last step
    lowers the error on unseen data so; one that was asked for may not.
    """

    problem: Problem
    unseen: Problem
    filter: Filter
    steps: tuple[Step, ...]
    singles: tuple[Step, ...]
    pairs: tuple[Ranked, ...]
    outside: tuple[str, ...]
    left: tuple[Residue, ...]
    held_out: tuple[tuple[Array, ...], tuple[Array, ...]]
    followed: tuple[tuple[Array, ...], tuple[Array, ...]]
    beside: Mapping[str, Sequence[Beside]]
    declined: Mapping[str, str]
    beyond_doubt: bool = True

    @property
    def final(self) -> Step:
        """The proposed model."""
        return self.steps[-1]

    @functools.cached_property
    def structured(self) -> bool:
        """Whether the residual of the proposed model shows structure that is no noise."""
        return structured(self.problem, self.final.ranked, self.filter)

    @functools.cached_property
    def driven_by_noise(self) -> bool:
        """Whether that structure is what noise in the input leaves."""
        return self.structured and driven_by_noise(self.problem, self.final.ranked)

    @functools.cached_property
    def unseen_noise(self) -> Array:
        """Standard deviation (ny) of the noise on unseen data: what the proposal leaves there but structure."""
        left = residues(self.held_out[1], self.problem.noise)
        return np.array([r.noise if r.structure < 0.5 else s.noise for r, s in zip(left, self.left, strict=True)])

    @property
    def unaccounted(self) -> bool:
        """Whether structure is left that is not what noise in the input leaves."""
        return self.structured and not self.driven_by_noise


def judged(problem: Problem, r: Ranked) -> Fit:
    """Return the fit by whose residual a model is judged: that at the lowest gain, where most shows of what is missing.

    Where the motion is so sensitive there that noise and the uncertainty of the parameters alone make what is left
    (chaos under cogging, contacts), it is the one of highest likelihood.
    """
    low, c = r.low, r.fit.candidate
    if low is r.fit or low.cost - r.fit.cost <= NEEDED:
        return low
    reference = follow_records(problem, c, r.fit.theta, low.gains, False)
    if reference is None:
        return low
    floor = np.nanmean(np.concatenate(r.fit.innovations) ** 2, axis=0)
    left = np.nanmean(np.concatenate(reference[0]) ** 2, axis=0) - floor
    w, V = np.linalg.eigh(np.linalg.pinv(r.fit.hessian, hermitian=True))
    root = V * np.sqrt(np.maximum(w, 0.0))
    spread = np.zeros_like(left)
    draw = np.random.default_rng(0).standard_normal
    for _ in range(DRAWS):
        theta = np.clip(r.fit.theta + root @ draw(w.size), *c.bounds)
        noise = [draw(s.y.shape) * np.sqrt(floor) for s in problem.segments]
        noisy = tuple(replace(s, y=s.y + n) for s, n in zip(problem.segments, noise, strict=True))
        moved = follow_records(problem, c, theta, low.gains, False, noisy)
        if moved is None:
            return r.fit
        change = [a - b - n for a, b, n in zip(moved[0], reference[0], noise, strict=True)]
        spread += np.nanmean(np.concatenate(change) ** 2, axis=0) / DRAWS
    matters = left > SHARE * floor
    return r.fit if matters.any() and bool((spread > SENSITIVE * left)[matters].all()) else low


def structured(problem: Problem, r: Ranked, filter: Filter) -> bool:
    """Tell whether the residual of a fitted model shows structure that is no noise of the filter's colour."""
    at = judged(problem, r)
    if at.cost - r.fit.cost > NEEDED or any(one.structured for one in residues(at.innovations, problem.noise)):
        return True
    whitened = [filter.apply(e) for e in at.innovations]
    rounding = np.nanstd(np.concatenate(at.innovations), axis=0) < ROUNDED * problem.quanta
    return not all(whiteness([e[:, c] for e in whitened], steps=bool(rounding[c])).white for c in range(rounding.size))


def driven_by_noise(problem: Problem, r: Ranked) -> bool:
    """Tell whether what a model leaves is what noise in the input leaves: it is gone at the highest gain.

    Noise in the input moves the state at random: an observer that is wide awake follows that, and only the noise of the
    sensors is left. A force that the model lacks is no white noise, and shows at any gain.
    """
    c = r.fit.candidate
    if problem.scale.imposed or c.filtered:
        return False
    found = fit(problem, c, problem.levels[0], r.fit.theta, 10)
    if found is None or any(one.structured for one in residues(found.innovations, problem.noise)):
        return False
    left = np.sqrt(np.nanmean(np.concatenate(found.innovations) ** 2, axis=0))
    return bool((left < AWAKE * problem.noise).all())


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
    (known, notes), (unseen, more) = _cut(first, channels), _cut(second, channels)
    problem = replace(prepare(model, known, channels), notes=notes)
    segments = tuple(segment(problem.base, problem.channels, part) for part in unseen)
    return problem, replace(problem, segments=segments, noise=white_noise(segments), notes=more)


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
) -> Findings:
    """Find what a model lacks; see `Findings`. ``run``: where candidates are fitted, threads by default.

    ``only``: one effect that is added in any case. Raises `InputError` where it does not apply or the base diverges.
    Where the model does not say when its input acts, and the records say so clearly, all is done again with that.
    """
    own = ThreadPoolExecutor(os.cpu_count() or 1) if run is None else None

    def found(model: Model, *notes: str) -> Findings:
        problem, unseen = prepared(model, data, validation)
        problem = replace(problem, notes=(*problem.notes, *notes))
        return _Search(problem, unseen, run or own, progress or _silent, depth).run(only)  # type: ignore[arg-type]

    try:
        first = found(model)
        hold = "" if model.input_hold else _hold(first, run or own)  # type: ignore[arg-type]
        if not hold:
            return first
        second = found(model.with_options(input_hold=hold), _said(model, hold))
        return second if _clearer(second, first) else first
    finally:
        if own:
            own.shutdown(wait=True, cancel_futures=True)


def _hold(f: Findings, run: Executor) -> str:
    """Return when the input acts, if otherwise than it was taken; see `signlin_ros.diagnosis.timing`."""
    options = {r.label + str(r.sensors): r for r in (s.ranked for s in (f.steps[0], f.final, *f.singles[:1]))}
    return better_hold(f.problem, list(options.values()), f.filter, run.map)


def _said(model: Model, hold: str) -> str:
    name = model.inputs[0]
    return f"{name} acts {WAYS[hold]} (input_hold: {hold}; input_hold: forward in the model file forbids it)"


def _clearer(a: Findings, b: Findings) -> bool:
    """Tell whether one proposal explains more than another, and leaves no structure or needs fewer effects: among
    models that are wrong anyway, another timing is one more imitation.
    """
    better = a.final.ranked.evidence < b.final.ranked.evidence - CLEARLY
    return better and (not a.structured or len(a.final.ranked.effects) < len(b.final.ranked.effects))


def _too_slow(problem: Problem) -> str:
    """Return what is to be said of samples that are much further apart than the model's fastest motion lasts."""
    _, A, _, _ = linear_base(problem.base, problem.channels)
    fastest = float(np.max(np.abs(np.linalg.eigvals(A)))) if A.size else 0.0
    if fastest * problem.scale.step < SPARSE:
        return ""
    return f": its fastest motion lasts {1.0 / fastest:.2g} s, the samples are {problem.scale.step:.3g} s apart"


def _tidied(step: Step) -> Step:
    """Return a step whose parameters are said as one would say them."""
    r = step.ranked
    return replace(step, ranked=replace(r, fit=tidied(r.fit), low=tidied(r.low)))


def _silent(what: str, done: float) -> None:
    return


def plausible(problem: Problem, r: Ranked) -> bool:
    """Tell whether the parameters of all that was added are those of the effects, not of what they imitate."""
    model = r.fit.fitted()
    added = [use for key, use in model.effects.items() if key not in problem.base.effects]
    return all(find_effect(use.type, "effects").plausible(use.parameters) for use in added)


def _is_essential(model: Model, parameter: str) -> bool:
    """Tell whether a parameter of a model, ``key.name``, is essential to its effect."""
    key, _, name = parameter.partition(".")
    return key in model.effects and name in find_effect(model.effects[key].type, "effects").essential


def needless(problem: Problem, r: Ranked, before: Ranked) -> tuple[str, str] | None:
    """Return an effect that was added to ``before``, and a parameter essential to it that the fit hardly needs.

    What an effect gains may be what a filter gains that corrects its own states, whatever the effect.
    """
    f, known = r.fit, {k.name for k in before.fit.candidate.coordinates}
    c, added = f.candidate, [i for i, k in enumerate(f.candidate.coordinates) if k.name not in known]
    essential = [i for i in added if _is_essential(c.model, c.coordinates[i].name)]
    start = fit(problem, before.fit.candidate, f.gains, before.fit.theta, 2, f.filter) if essential else None
    for i in essential:
        k = c.coordinates[i]
        none = k.theta(NOTHING * k.value(float(f.theta[i])))
        held = tuple(replace(k, low=none, high=none) if j == i else o for j, o in enumerate(c.coordinates))
        theta = np.where(np.arange(f.theta.size) == i, none, f.theta)
        found = fit(problem, replace(c, coordinates=held), f.gains, theta, 10, f.filter)
        gained = start.cost - f.cost if start else np.inf
        if found and found.cost - f.cost < max(NEEDED, NEEDLESS * gained):
            key, _, name = k.name.partition(".")
            return c.model.effects[key].type, name
    return None


def negligible(problem: Problem, r: Ranked, before: Ranked) -> str:
    """Return an effect added to ``before`` whose forces (or what it takes from the input) are beneath notice, whatever
    their significance: in so fine a fit it stands in for the shape of a sensor's noise, or for a filter's; or "".
    """
    values, model = r.fit.parameters(), r.fit.candidate.model
    for key in r.fit.candidate.label:
        use = model.effects.get(key)
        if use is None or use.type in before.effects:
            continue
        pars = find_effect(use.type, "effects").pars()
        units = {n: p.unit for n, p in pars.items() if f"{key}.{n}" in values and p.unit[:1] in ("F", "U")}
        level = {n for n, unit in units.items() if unit in ("F", "U")} or set(units)
        sizes = [abs(values[f"{key}.{n}"]) / problem.scale.of(units[n]) for n in level]
        if sizes and max(sizes) < SLIGHT:
            return use.type
    return ""


def _only(trials: list[Trial], name: str, model: Model) -> list[Trial]:
    """Return the trials of one effect; raise `InputError` if it cannot be added."""
    find_effect(name, "effect")
    found = [t for t in trials if t.effect == name]
    if not found:
        has = any(use.type == name for use in model.effects.values())
        why = "the model has it already" if has else f"it does not apply to {model.plant.name}"
        raise InputError(f"effect {name!r} cannot be added: {why}")
    return found


def _prior(f: Fit) -> float:
    """Return what the priors cost: large where known parameters had to move far to imitate what is missing."""
    pairs = zip(f.candidate.coordinates, f.theta, strict=True)
    return float(sum(((x - c.prior) / c.spread) ** 2 for c, x in pairs))


def _evidence(r: Ranked) -> float:
    return r.evidence


def _values(r: Ranked, effect: str) -> dict[str, float]:
    """Return the fitted parameters of an effect that was added last under its name; none for one of a sensor."""
    model, label = r.fit.fitted(), r.fit.candidate.label
    keys = [k for k in label if k in model.effects and model.effects[k].type == effect]
    return dict(model.effects[keys[-1]].parameters) if keys else {}


def _simple(singles: Sequence[Ranked]) -> list[Ranked]:
    """Return the effects that explain a good part of what the best explains, those of few parameters first; none that
    has parts, which are tried on top of each other.
    """
    best = singles[0].evidence if singles else 0.0
    worst = max((r.evidence for r in singles), default=0.0)
    whole = [r for r in singles if not (r.sensors or EFFECTS[r.label].parts(_values(r, r.label)))]
    good = [r for r in whole if worst - r.evidence > 0.4 * (worst - best)]
    return sorted(good, key=lambda r: (len(r.fit.theta), r.evidence))


_Screened = tuple[float, Ranked, Trial, Fit]
"""What a trial promises on top of what was fitted, less being better; both; and its fit so far."""


def _screening(s: _Screened) -> float:
    return s[0]


def _going_on(tried: Sequence[_Screened]) -> list[_Screened]:
    """Return which of the trials on top of one set, best first, are looked at more closely."""
    return [s for i, s in enumerate(tried) if i < WIDE or EFFECTS[s[2].effect].states]


def _between(before: Ranked, options: Sequence[Ranked], after: Ranked) -> list[Ranked]:
    """Return the options, but for those with faults of sensors, that add a part of what one set adds to another."""
    return [r for r in options if set(before.effects) < set(r.effects) < set(after.effects) and not r.sensors]


class _Search:
    def __init__(self, problem: Problem, unseen: Problem, run: Executor, progress: Progress, depth: int) -> None:
        self.problem, self.unseen, self.executor, self.progress, self.depth = problem, unseen, run, progress, depth
        self.filter = Filter(np.zeros(len(problem.channels)))
        self.pairs: list[Ranked] = []
        self.beside: dict[str, list[Beside]] = {}
        self.declined: dict[str, str] = {}
        self.known: dict[str, Trial] = {}

    def run(self, only: str | None = None) -> Findings:
        self.progress("preparing", 0.0)
        trials, outside = applicable(self.problem)
        if only is not None:
            trials = _only(trials, only, self.problem.base)
        self.known = {t.effect: t for t in trials if t.added}
        base = self._base()
        self.progress("single effects", 0.1)
        base, singles = self._whiten(base, self._singles(base, trials))
        path = self._forced(base, singles) if only else self._path(base, singles, trials)
        self.progress("validation", 0.9)
        shown = self._shown(path, singles)
        at = judged(self.problem, path[-1].ranked)
        return Findings(
            self.problem,
            self.unseen,
            self.filter,
            tuple(map(_tidied, path)),
            tuple(map(_tidied, shown)),
            tuple(self.pairs),
            tuple(outside),
            tuple(residues(at.innovations, self.problem.noise)),
            self._both(path, at.gains),
            self._both(path, self.problem.levels[1]),
            self.beside,
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

    def _singles(self, base: Ranked, trials: list[Trial]) -> list[Ranked]:
        """Return every effect alone, best first; searched as thoroughly as is needed for one that is enough."""
        singles = compete(self.problem, base, trials, self.executor)
        if not (self.filter.rho.any() or self._enough(min([base, *singles], key=_evidence))):
            singles = searched(self.problem, trials, singles, self.executor)
            if not self._enough(min([base, *singles], key=_evidence)):
                front = [deeper(self.problem, r, self.executor.map) for r in singles[:2]]
                singles = sorted([*front, *singles[2:]], key=_evidence)
        return simplified(self.problem, trials, singles, self.executor)

    # ------------------------------------------------------------ noise

    def _colour(self, r: Ranked) -> Filter:
        """Return the colour of what a model leaves."""
        return Filter(np.array([one.filter for one in residues(r.low.innovations, self.problem.noise)]))

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
        coloured noise.
        """
        good = [base, *sorted(singles, key=_evidence)[:FRONT]]
        colours = [self._colour(r) for r in good]
        if any(c.rho.any() for c in colours):
            found = [self._in_colour(r, c) for r, c in zip(good, colours, strict=True)]
            self.filter = colours[int(np.argmin(found))]
        if not self.filter.rho.any():
            return base, singles
        refitted = self.executor.map(self._again, singles)
        return self._polished(base), sorted(refitted, key=_evidence)

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
        path = [self._step(base)]
        options, whole = singles, None
        for depth in range(self.depth):
            front = [*map(self._polished, options[:2]), *options[2:]]
            step = self._best_step(path, [*self._parts(front), *front])
            half = self._halfway(path, step, front)
            whole = step if half is not step else whole
            step = half
            if step is not None:
                kept = [p for p in path if set(p.ranked.effects) < set(step.ranked.effects)]
                path = [*kept, step if kept[-1] is path[-1] else self._compared(kept[-1], step.ranked)]
            elif depth > 0 or (self._enough(path[0].ranked) and _prior(path[0].ranked.fit) <= STRAINED):
                break
            self.progress("more effects", 0.3 + 0.15 * depth)
            if depth + 1 < self.depth or step is None:
                options = self._more(path[-1].ranked, singles, trials)
        if whole is not None and path[-1].ranked.evidence >= whole.ranked.evidence + TIE:
            kept = [p for p in path if set(p.ranked.effects) < set(whole.ranked.effects)]
            path = [*kept, whole if len(kept) == 1 else self._compared(kept[-1], whole.ranked)]
        return self._by_rungs(path, singles)

    def _by_rungs(self, path: list[Step], singles: list[Ranked]) -> list[Step]:
        """Return a path from the base to two effects at once with the better of the two alone in between."""
        if len(path) != 2 or len(path[1].ranked.effects) != 2:
            return path
        alone = _between(path[0].ranked, singles, path[1].ranked)
        first = min(alone, key=_evidence, default=path[0].ranked)
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
        return (self._best_step(path, parts) if parts else None) or step

    def _parts(self, options: list[Ranked]) -> list[Ranked]:
        """Return the best option with the effect that was added last in its parts: one that is rich stands in for
        several simple ones.
        """
        best = min(options, key=_evidence, default=None)
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

    def _together(self, before: Ranked, parts: Sequence[tuple[Trial, dict[str, float]]]) -> Ranked | None:
        """Return several effects added at once, fitted out from their starts."""
        r = before
        for trial, start in parts:
            pars = EFFECTS[trial.effect].pars()
            c = extended(self.problem, r, trial, {n: pars[n].nearest(v) for n, v in start.items()})
            fits = descend(self.problem, c, c.start(r.fit.parameters()), self.problem.levels[1:], 10, self.filter)
            found = ranked(self.problem, (*r.effects, trial.effect), r.sensors, fits)
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
        """Return the best option that lowers the error on unseen data beyond doubt, or None."""
        for option in self._simplest_first(sorted(options, key=_evidence))[:3]:
            if option.evidence >= path[-1].ranked.evidence - (TIE if len(path) > 1 else 0.0):
                return None
            r = self._plainer(self._pruned(option, path))
            self._reached(r, path)
            last = path[-1].ranked
            if r.effects == last.effects or r.evidence >= last.evidence or self._refused(r, last):
                continue
            step = self._compared(path[-1], r)
            if self._unbent(path, step) or self._beyond_doubt(path, step):
                return step
        return None

    def _refused(self, r: Ranked, last: Ranked) -> bool:
        """Tell whether what a set adds is not what it is called, and note why."""
        if not plausible(self.problem, r):
            return True
        if not self._real(r, last):
            self.declined[r.label] = f"its parameters do not differ from nothing by {REAL:g} standard errors"
            return True
        slight = negligible(self.problem, r, last)
        if slight:
            self.declined[slight] = f"it would be less than {100 * SLIGHT:g} % of what drives"
            return True
        spare = needless(self.problem, r, last)
        if spare:
            self.declined[spare[0]] = f"without its {spare[1]} it explains nearly as much"
        return spare is not None

    def _unbent(self, path: list[Step], step: Step) -> bool:
        """Tell whether a step frees known parameters that were bent to imitate it, and does no harm on unseen data: the
        first, or one that is another explanation than the step before, and enough, or one that frees them from a strain
        which is out of the question.
        """
        last, r = path[-1].ranked, step.ranked
        freed = _prior(last.fit) - _prior(r.fit)
        if freed <= MOVED or step.certainty <= -SURE:
            return False
        other = not set(last.effects) < set(r.effects)
        return len(path) == 1 or ((other or freed > STRAINED) and self._enough(r))

    def _beyond_doubt(self, path: list[Step], step: Step) -> bool:
        """Tell whether a step lowers the error on unseen data beyond doubt, and is no patch."""
        last, r = path[-1].ranked, step.ranked
        strong = last.evidence - r.evidence > STRONG and not self.filter.rho.any()
        needed = FURTHER if len(path) > 1 else LIKELY if strong else SURE
        if step.gain <= 0 or step.certainty <= needed:
            return False
        poor = len(path) > 1 and not self._enough(last)
        if poor and (step.share < SHARE or (not self._enough(r) and self._patch(path, r))):
            return False
        return step.certainty > FURTHER or not self._wandering(last)

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
            best = min(fewer, key=_evidence, default=r)
            for f in fewer:
                better = f.effects == path[-1].ranked.effects and f.evidence < path[-1].ranked.evidence
                if better and plausible(self.problem, f):
                    path[-1] = self._compared(path[-2], f)
            if best is r or best.evidence > r.evidence:
                return r
            r = best
        return r

    def _plainer(self, r: Ranked) -> Ranked:
        """Return a set of several effects with those replaced that are nothing but simpler ones, for their values."""
        for effect in r.effects if len(r.effects) > 1 else ():
            simpler = EFFECTS[effect].simpler(_values(r, effect))
            for name, start in simpler.items():
                before = without(self.problem, r, effect) if name in self.known and name not in r.effects else None
                found = self._together(before, [(self.known[name], start)]) if before else None
                if found and found.evidence < r.evidence:
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

    def _simplest_first(self, options: list[Ranked]) -> list[Ranked]:
        """Where even the best leaves structure, put simpler ones before it that explain nearly as much.

        Likelihoods then exaggerate: what an imperfect model gains by one more parameter is often imitation.
        """
        if not options or self._enough(options[0]):
            return options
        best = options[0]
        near = [r for r in options if r.fit.cost - best.fit.cost < SIMPLE * float(best.fit.count.max())]
        first = min(near, key=lambda r: (free_parameters(self.problem, r.fit), r.evidence))
        return [first, *(r for r in options if r is not first)]

    def _real(self, r: Ranked, before: Ranked) -> bool:
        """Tell whether the amplitudes of what was added differ together from nothing, by `REAL` standard errors.

        A parameter that acts in steps, as a delay in whole samples, has no standard error: its evidence decides alone.
        """
        known = {c.name for c in before.fit.candidate.coordinates}
        covariance = np.linalg.pinv(r.fit.hessian, hermitian=True)
        coordinates = r.fit.candidate.coordinates
        added = [i for i, c in enumerate(coordinates) if c.name not in known]
        gains = [i for i in added if coordinates[i].name.startswith("sensor_gain.")]
        if any(abs(r.fit.theta[i]) > 0.98 * coordinates[i].high for i in gains):
            return False  # no sensor is that wrong: it stands in for something else
        free = [i for i in added if not coordinates[i].log or coordinates[i].name.startswith("sensor_")]
        steps = r.fit.candidate.equations.delaying if self.problem.scale.imposed else frozenset()
        amplitudes = [i for i in free if r.fit.hessian[i, i] > 0.0 and coordinates[i].name not in steps]
        a, spread = r.fit.theta[amplitudes], covariance[np.ix_(amplitudes, amplitudes)]
        wald = float(a @ np.linalg.pinv(spread, hermitian=True) @ a)
        return not amplitudes or wald > chi2.ppf(2 * norm.cdf(REAL) - 1, len(amplitudes))

    def _enough(self, r: Ranked) -> bool:
        return not structured(self.problem, r, self.filter)

    def _wandering(self, r: Ranked) -> bool:
        """Tell whether noise in the input would leave what a model leaves: errors then go together for long."""
        return not self._enough(r) and driven_by_noise(self.problem, r)

    def _more(self, now: Ranked, singles: list[Ranked], trials: list[Trial]) -> list[Ranked]:
        """Return sets with one effect more than ``now``; where one is not enough, on top of other singles too, and
        then with either effect of the best pair exchanged for every other.
        """
        starts = [now] if now.effects else []
        if len(now.effects) <= 1 and not (self._enough(now) and _prior(now.fit) <= STRAINED):
            starts += [r for r in _simple(singles) if r.effects != now.effects][: BEAM - len(starts)]
        found = self._extend(starts, trials)
        if found and len(starts) > 1 and len(found[0].effects) == 2:
            done = {r.effects for r in starts}
            halves = [s for s in singles if len(s.effects) == 1 and s.effects[0] in found[0].effects]
            found = sorted(found + self._extend([h for h in halves if h.effects not in done], trials), key=_evidence)
        self.pairs += found
        return found

    def _extend(self, starts: Sequence[Ranked], trials: list[Trial]) -> list[Ranked]:
        """Return the best of all trials on top of the starts, fitted out, best first."""
        jobs = [
            (before, t)
            for i, before in enumerate(starts)
            for t in trials
            if t.effect not in before.effects and (i == 0 or not t.sensors)
        ]
        enough = bool(starts) and self._enough(starts[0])
        tried = [r for r in self.executor.map(lambda j: self._tried(j[0], j[1], enough), jobs) if r is not None]
        tried.sort(key=_screening)
        going_on = [s for before in starts for s in _going_on([s for s in tried if s[1] is before])]
        screened = sorted((s for s in self.executor.map(self._screened, going_on) if s is not None), key=_screening)
        self._remember(starts, [*tried, *screened])
        most = MOST_IMPOSED if self.problem.scale.imposed else MOST_FINISHED
        front, rest = screened[:2], screened[2:most]
        finished = self._all_finished(front)
        if finished and self._enough(finished[0]):
            rest = [s for s in rest if s[0] < front[0][0] + STRONG]
        return sorted(finished + self._all_finished(rest), key=_evidence)

    def _remember(self, starts: Sequence[Ranked], screened: Sequence[_Screened]) -> None:
        """Note what every effect takes away beside others."""
        for before in starts:
            mine = [(s[2].effect, s[3]) for s in screened if s[1] is before]
            left = (
                likelihood(self.problem.short, before.fit.candidate, before.fit.theta, mine[0][1].gains)
                if mine
                else 0.0
            )
            for name, f in mine:
                share = 1.0 - float(np.exp(min(f.cost - left, 0.0) / f.count.sum()))
                self.beside.setdefault(name, []).append(Beside(before.effects, share))

    def _all_finished(self, screened: Sequence[_Screened]) -> list[Ranked]:
        """Return trials fitted out, best first."""
        found = self.executor.map(lambda s: self._finished(*s[1:]), screened)
        return sorted((r for r in found if r is not None), key=_evidence)

    def _tried(self, before: Ranked, trial: Trial, enough: bool) -> _Screened | None:
        """Return a trial on top of what was fitted, after two steps at the gain that suits what was fitted."""
        gains = before.fit.gains if before.fit is not before.low else self.problem.levels[1]
        known, found = before.fit.parameters(), []
        few = None if self.problem.scale.imposed else 1 if enough else 3  # of an imposed motion none leads to another
        if EFFECTS[trial.effect].resonant and not enough:
            few = None
        for start in trial.starts[:few]:
            c = extended(self.problem, before, trial, start)
            found.append(fit(self.problem.short, c, gains, c.start(known), 2))
        best = min((f for f in found if f), key=cost_of, default=None)
        return self._promise(before, trial, best)

    def _screened(self, tried: _Screened) -> _Screened | None:
        """Return a trial after some further steps; None if it diverges where it is not followed by a filter."""
        _, before, trial, first = tried
        return self._promise(
            before, trial, further(self.problem.short, first, SLOW if EFFECTS[trial.effect].states else 2)
        )

    def _promise(self, before: Ranked, trial: Trial, f: Fit | None) -> _Screened | None:
        """Return a trial with what it promises, followed as far as that is to be trusted."""
        best = next(iter(trusted(self.problem.short, [f])), None) if f else None
        return (
            None if best is None else (evidence(self.problem.short, best, len(before.effects) + 1), before, trial, best)
        )

    def _finished(self, before: Ranked, trial: Trial, start: Fit) -> Ranked | None:
        fits = descend(self.problem, start.candidate, start.theta, self.problem.levels, 10, self.filter)
        return ranked(self.problem, (*before.effects, trial.effect), (*before.sensors, *trial.sensors), fits)

    # ------------------------------------------------------------ unseen data

    def _unseen(self, r: Ranked, gains: Gains) -> tuple[Array, ...]:
        """Return the innovations on unseen data at a gain; large where it diverges."""
        f = r.low if gains is r.low.gains else r.fit
        found = follow_records(self.unseen, f.candidate, f.theta, gains, False)
        if found is None:
            return tuple(np.full(s.y.shape, 1e3) * self.problem.noise for s in self.unseen.segments)
        return tuple(found[0])

    def _both(self, path: Sequence[Step], gains: Gains) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        return self._unseen(path[0].ranked, gains), self._unseen(path[-1].ranked, gains)

    def _step(self, r: Ranked) -> Step:
        return Step(r, self._unseen(r, r.fit.gains))

    def _compared(self, before: Step, r: Ranked) -> Step:
        """Return a set of effects with what it gains on unseen data: at the gain of its fit or, where that is little,
        block by block and at the middle gain too: motion that is lost for once counts for no more than that.
        """
        step = self._step(r)
        block = max(int(BLOCK / self.problem.scale.step), 8)
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
            singles = sorted([final, *(r for r in singles if r.effects != final.effects)], key=_evidence)
        return list(self.executor.map(lambda r: self._compared(path[0], r), singles))


__all__ = ["Findings", "Step", "search"]
