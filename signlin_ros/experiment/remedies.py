"""What else would tell rivals apart, where no command within the limits does: tried by the same number."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.equations import inertia
from signlin_ros.errors import InputError
from signlin_ros.experiment.common_scale import INERTIAS
from signlin_ros.experiment.contenders import Contender, contender
from signlin_ros.experiment.distance import LOST, Pair, RivalBench
from signlin_ros.experiment.families import COMMAND_FAMILIES
from signlin_ros.experiment.plan import Remedy
from signlin_ros.experiment.promise import richer
from signlin_ros.experiment.search import NEEDED_EVIDENCE, CommandSearch
from signlin_ros.fitting.problem import Problem, prepare
from signlin_ros.model import Model
from signlin_ros.records import ModelData

Array = NDArray[np.float64]

REMEDY_COMMANDS, PEAKS = 3, (1.0, 0.5, 0.2)
"""Commands of the largest distance that are tried with each remedy; peaks of those within wider limits."""
UNRECORDED_NOISE = 0.01
"""Noise of a channel that nobody recorded, as a part of its spread."""
ADDED_INERTIA = 0.5
"""A known inertia that is added, as a part of the machine's own."""
FASTER_SAMPLING, WIDER_LIMITS = 4, 2.0
"""How many times as fast is sampled, and as wide limits are."""


def remedies(search: CommandSearch, pair: Pair) -> list[Remedy]:
    """Return what would tell two rivals apart, those that are enough, the largest distance first: of one that has all
    effects of the other and more, if it is true, since it loses nothing if it is not.
    """
    i, j = sorted(pair)
    both = [(i, j), (j, i)]
    both = [way for way in both if way == richer(search.bench.contenders, i, j)] or both
    names = (search.bench.contenders[i].name, search.bench.contenders[j].name)
    own = [k for k, p in enumerate(search.pairs) if set(p) == {i, j}]
    best = sorted(search.tried, key=lambda one: -float(one.linear[own].min(initial=np.inf)))[:REMEDY_COMMANDS]
    commands = [one.u for one in best]
    found = [*_channels(search, both, commands), *_wider(search, both), *_heavier(search, both, commands)]
    found += _faster(search, both)
    told = [Remedy(what, distance, names) for what, distance in found if distance >= NEEDED_EVIDENCE]
    return sorted(told, key=lambda r: -r.distance)


def least(bench: RivalBench, both: Sequence[Pair], t: Array, u: Array) -> float:
    """Return the smaller of both ways' real distances for a command."""
    values = []
    for i, j in both:
        run = bench.run(i, t, u)
        cost = LOST if run is None else bench.refitted(j, bench.segment(i, run))[0]
        values.append(0.0 if cost >= LOST else cost)
    return min(values)


def _among(ways: Sequence[Pair]) -> list[Pair]:
    """Return ways of two rivals of a bench in a bench that holds nothing but the first way's two, in its order."""
    return [(0, 1), (1, 0)][: len(ways)]


def _channels(search: CommandSearch, both: Sequence[Pair], commands: Sequence[Array]) -> Iterator[tuple[str, float]]:
    """Yield every quantity that was not recorded, with the distance that it would add."""
    problem, bench = search.bench.problem, search.bench
    plant = problem.base.plant
    every = [*problem.base.states, *problem.base.outputs]
    every += [plant.position] if plant.position_optional else []
    for name in dict.fromkeys(every):
        if name in problem.channels or "." in name:
            continue
        for u in commands[:1]:
            wider = seen_with(bench, both[0], search.t, u, (*problem.channels, name))
            if wider is not None:
                yield (
                    f"record the {name} too (with noise of {100 * UNRECORDED_NOISE:g} %)",
                    least(wider, _among(both), search.t, u),
                )


def _wider(search: CommandSearch, both: Sequence[Pair]) -> Iterator[tuple[str, float]]:
    """Yield every limit, twice as wide."""
    problem = search.bench.problem
    plant = problem.plant
    for name in (*search.limits.states, problem.base.inputs[0]):
        limits = search.limits.wider(WIDER_LIMITS, name)
        other = CommandSearch(
            search.bench, limits, search.t, search.spare, lambda what, share: None, search.seed, list(both)
        )
        for part in PEAKS:
            for family in COMMAND_FAMILIES:
                other.screened(family, family.at(part * other.most))
        good = sorted(other.tried, key=lambda one: -one.least)[:REMEDY_COMMANDS]
        most = max((least(search.bench, both, search.t, one.u) for one in good), default=0.0)
        what = {plant.position: "travel", plant.velocity: "speed"}.get(name, name)
        yield f"allow twice the {what}", most


def _heavier(search: CommandSearch, both: Sequence[Pair], commands: Sequence[Array]) -> Iterator[tuple[str, float]]:
    """Yield a known inertia that is added."""
    bench, base = search.bench, search.bench.problem.base
    name = next((n for n in INERTIAS if n in base.parameters), "")
    if not name or not inertia(base):
        return
    more = float(f"{ADDED_INERTIA * inertia(base):.2g}")
    contenders = tuple(_loaded(bench.contenders[i], name, more) for i in both[0])
    heavier = replace(bench, contenders=contenders)
    most = max((least(heavier, _among(both), search.t, u) for u in commands), default=0.0)
    yield f"add a known inertia of {more:g} {base.units.get(name, 'kg·m²' if name == 'J' else 'kg')}", most


def _loaded(c: Contender, name: str, more: float) -> Contender:
    """Return a rival with a known inertia more: what was known of its own is known of the sum."""
    names = [k.name for k in c.candidate.coordinates]
    if name not in names:
        values = {**c.candidate.values, name: c.candidate.values[name] + more}
        model = c.candidate.model.with_parameters({name: values[name]})
        return replace(c, candidate=replace(c.candidate, values=values, model=model), models={})
    i, k = names.index(name), c.candidate.coordinates[names.index(name)]

    def heavier(theta: Array) -> Array:
        return np.where(np.arange(theta.size) == i, k.theta(k.value(float(theta[i])) + more), theta)

    scale, before = np.ones(c.theta.size), k.value(float(c.theta[i]))
    scale[i] = (before + more) / before if k.log else 1.0
    information, minima = c.information * np.outer(scale, scale), tuple(map(heavier, c.minima))
    return replace(c, theta=heavier(c.theta), information=information, minima=minima, models={})


def _faster(search: CommandSearch, both: Sequence[Pair]) -> Iterator[tuple[str, float]]:
    """Yield samples that are closer."""
    problem = search.bench.problem
    step = problem.scale.step / FASTER_SAMPLING
    t = np.arange(0.0, search.t[-1] - search.t[0] + step / 2, step)
    worth = sorted(search.tried, key=lambda one: -float(one.linear.min(initial=np.inf)))[:1]
    for one in worth:
        u = np.interp(t, search.t, one.u)
        finer = seen_with(search.bench, both[0], t, u, search.bench.problem.channels)
        if finer is not None:
            yield f"sample every {1e3 * step:.3g} ms", least(finer, _among(both), t, u)


def seen_with(
    bench: RivalBench, places: Sequence[int], t: Array, u: Array, channels: Sequence[str]
) -> RivalBench | None:
    """Return some rivals as other channels, or other times t (T,), would show them; None where they cannot."""
    problem = bench.problem
    base = problem.base
    if base.plant.position in channels and base.plant.position not in base.states and base.plant.position_optional:
        base = base.with_options(with_position=True)
    seen = [_seen(bench.contenders[k], base) for k in places]
    run = seen[0].run(seen[0].theta, t, bench.inputs(u), bench.x0)
    if run is None or not set(channels) <= {*run.states, *run.outputs}:
        return None
    g, noise = np.random.default_rng(0), dict(zip(problem.channels, problem.noise.tolist(), strict=True))
    measured = {c: run[c] for c in channels}
    size = {c: noise.get(c, UNRECORDED_NOISE * float(np.std(v)) or 1e-9) for c, v in measured.items()}
    noisy = {c: v + size[c] * g.standard_normal(t.size) for c, v in measured.items()}
    data = ModelData(t, bench.inputs(u), noisy, None, base.inputs, base.states, dict(problem.units), "command")
    other = prepare(base, [data], tuple(channels))
    contenders = tuple(_as_before(other, c) for c in seen)
    old = dict(zip(problem.channels, bench.spread.tolist(), strict=True))
    spread = np.array([old.get(c, size[c]) for c in channels])
    gains = other.observer_gains[min(problem.observer_gains.index(bench.gains), len(other.observer_gains) - 1)]
    return replace(bench, problem=other, contenders=contenders, gains=gains, spread=spread, likely=frozenset())


def _as_before(problem: Problem, old: Contender) -> Contender:
    """Return a rival for other records, with what the first ones know of it: coordinates are in units of a record."""
    c = contender(problem, old.model_at(old.theta), old.effects, old.information)
    pairs = list(zip(c.candidate.coordinates, old.candidate.coordinates, strict=True))

    def moved(theta: Array) -> Array:
        return np.array([k.theta(before.value(float(x))) for (k, before), x in zip(pairs, theta, strict=True)])

    theta = moved(old.theta)
    units = c.candidate.slopes(theta) / old.candidate.slopes(old.theta)
    information = old.information * np.outer(units, units)
    minima = tuple(moved(one) for one in old.minima)
    return replace(
        c,
        theta=theta,
        information=information,
        size=old.size,
        told=old.told,
        minima=minima,
        behind=old.behind,
        scale=old.scale,
    )


def sampled(bench: RivalBench, step: float) -> RivalBench:
    """Return all rivals as samples that are another step in s apart would show them, with noise as it was.

    Raises `InputError` where they cannot be followed so.
    """
    part = bench.problem.parts[0]
    t = np.arange(0.0, part.t[-1] - part.t[0], step)
    u = np.interp(t, part.t - part.t[0], part.u[:, 0])
    found = seen_with(bench, range(len(bench.contenders)), t, u, bench.problem.channels)
    if found is None:
        raise InputError(f"--dt: with samples {step:g} s apart {bench.contenders[0].name} diverges")
    return replace(found, likely=bench.likely)


def _seen(c: Contender, base: Model) -> Contender:
    """Return a rival whose model at its estimate has the states of a base model."""
    model = c.model_at(c.theta)
    if base.with_position and not model.with_position:
        model = model.with_options(with_position=True)
    return replace(c, models={c.theta.tobytes(): model})


__all__ = ["least", "remedies", "sampled", "seen_with"]
