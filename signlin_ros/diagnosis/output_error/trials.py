"""What may be missing: every effect that applies, with the points that a fit starts from."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import count

from signlin_ros.effects import EFFECTS, find_effect
from signlin_ros.effects.base import Effect, SensorEffect
from signlin_ros.errors import InputError, ModelError
from signlin_ros.fitting.candidate import Candidate, candidate
from signlin_ros.fitting.fit import Fit
from signlin_ros.fitting.problem import Problem
from signlin_ros.fitting.resonance import load_start
from signlin_ros.fitting.scan import periodic_starts
from signlin_ros.model import Model
from signlin_ros.model.numbers import numbers
from signlin_ros.par import nominal_values

ARC = 0.25
"""Least way in rad over which one sine of the position is more than a load and a spring."""
MAX_WAVES, SAME_ORDER = 6, 0.05
"""Most waves over the position that are fitted together; orders that differ by a smaller share are one."""
SENSOR_DELAYS = (0.5, 1.5, 5.0)
"""Delays of a sensor that a fit starts from, in samples."""


@dataclass(frozen=True)
class Trial:
    """An effect that may be missing, and complete starts; parameters of a sensor: ``sensor_offset.speed``;
    ``inertia``: that of the plant beside, by its name, where the starts tell of it.
    """

    name: str
    starts: tuple[dict[str, float], ...] = ()
    inertia: Mapping[str, float] = field(default_factory=dict)

    @property
    def effect(self) -> type[Effect]:
        """The class of the effect."""
        return EFFECTS[self.name]

    @property
    def channel(self) -> str:
        """The channel that an effect of a sensor is on; empty for others."""
        return next(iter(self.starts[0]), "").partition(".")[2]

    def values(self, model: Model) -> dict[str, float] | None:
        """Return the parameters that a model has of the effect, None if it has it not."""
        uses = [use.parameters for use in model.effects.values() if use.type == self.name]
        if self.channel:
            uses = [{f"{self.name}.{self.channel}": use[self.channel]} for use in uses if self.channel in use]
        return uses[-1] if uses else None

    def starting_from(self, problem: Problem, model: Model | None) -> Trial:
        """Return a trial that starts from the values that a model has of its effect, if it has it."""
        values = self.values(model) if model else None
        if values is None:
            return self
        return replace(self, starts=(values if self.channel else completed(problem, self.effect, values),))


def trials(problem: Problem, names: Sequence[str] | None = None) -> list[Trial]:
    """Return the effects that can be tried on the base model; raise `InputError` for a name that cannot."""
    every = EFFECTS if names is None else names
    found = [one for name in every for one in _trials(problem, name, names is not None)]
    for name in set(names or ()) - {one.name for one in found}:
        has = any(use.type == name for use in problem.base.effects.values())
        why = "the model has it already" if has else _lacking(problem, name)
        raise InputError(f"effect {name!r} cannot be added: {why}")
    return found


def _trials(problem: Problem, name: str, asked: bool) -> list[Trial]:
    effect, base = find_effect(name, "effect"), problem.base
    if any(use.type == name for use in base.effects.values()) and not effect.periodic:
        return []
    forgotten = bool(effect.states and effect.family) and not problem.reverses  # what remembers the way
    if not (asked or (effect.proposed and not too_flat(problem, effect) and not forgotten)):
        return []
    if issubclass(effect, SensorEffect):
        return _of_sensors(problem, name)
    if (effect.plants and base.plant.name not in effect.plants) or name in base.plant.built_in:
        return []
    if problem.scale.imposed and effect.input is not Effect.input:
        return []  # what is imposed is measured, not commanded
    starts = tuple(_starts(problem, effect))
    with suppress(ModelError):  # the plant cannot have it
        wider = base.with_effect(name, key=free_key(base, name), **starts[0]) if starts else None
        if wider is not None and wider.inputs == base.inputs:  # else the record lacks what it depends on
            return [Trial(name, starts), *_seen_loads(problem, effect)]
    return []


def too_flat(problem: Problem, effect: type[Effect]) -> bool:
    """Tell whether an effect goes with the sine of the angle, and the axis turns too little to show more of it than a
    load and a spring; an axis that is said to be linear shows one over a whole period only.
    """
    if not effect.angular or effect.periodic:
        return False
    way = problem.position_range[1] - problem.position_range[0]
    return way < (math.tau if problem.base.is_rotary is False else ARC)


def _lacking(problem: Problem, name: str) -> str:
    """Return why an effect cannot be had: an input that it depends on is not recorded, or the plant has no such."""
    with suppress(ModelError):
        needed = [n for n in problem.base.with_effect(name).inputs if n not in problem.base.inputs]
        if needed:
            return f"it depends on the {needed[0]}, which is not read from the records: --signal {needed[0]}=COLUMN"
    return f"it does not apply to {problem.base.plant.name}"


def tryable(problem: Problem, name: str) -> bool:
    """Tell whether a diagnosis tries an effect by itself, and the plant can have it."""
    return bool(_trials(problem, name, False))


def _of_sensors(problem: Problem, name: str) -> list[Trial]:
    """Return a trial for every channel."""
    late = [steps * problem.scale.step for steps in SENSOR_DELAYS]
    starts = {"sensor_gain": [1.0], "sensor_delay": late}.get(name, [0.0])
    own = problem.base.plant.channels(problem.base.parameters)
    shown = [c for c in problem.channels if c in own and (c in problem.base.states or name != "sensor_delay")]
    return [Trial(name, tuple({f"{name}.{c}": start} for start in starts)) for c in shown]


def free_key(model: Model, name: str) -> str:
    """Return a key under which an effect can be added to a model."""
    keys = (f"{name}_{number}" if number > 1 else name for number in count(1))
    return next(key for key in keys if key not in model.effects)


def _starts(problem: Problem, effect: type[Effect]) -> list[dict[str, float]]:
    if any(par.elements is not None for par in effect.pars().values()):
        return [nominal_values(effect.pars())]
    starts = effect.starts(problem.scale)
    if effect.periodic:
        scanned = _waves(problem, effect, problem.base)
        starts = [{**one, **wave} for one in starts for wave in scanned]
    return [completed(problem, effect, one) for one in starts]


def _seen_loads(problem: Problem, effect: type[Effect]) -> Iterator[Trial]:
    """Yield a trial of the load behind a coupling that shows in what the model lacks."""
    found = load_start(problem, problem.base) if effect.resonant and effect.load_inertia else None
    if found is not None:
        load, driven = found
        start = completed(problem, effect, load)
        yield Trial(effect.name, (start,), {problem.base.plant.inertia_parameter: driven})


def seen_loads(problem: Problem) -> Iterator[tuple[str, Model]]:
    """Yield the effects of a load behind a coupling that show in what the base model lacks, each with the model that
    has them.
    """
    base = problem.base
    for name in (name for name, effect in EFFECTS.items() if effect.load_inertia):
        for trial in _trials(problem, name, False):
            if trial.inertia:
                model = base.with_effect(name, key=free_key(base, name), **trial.starts[0])
                yield name, model.with_parameters(trial.inertia)


def _waves(problem: Problem, effect: type[Effect], model: Model) -> list[dict[str, float]]:
    """Return the waves that show in what a model lacks."""
    return [dict(zip(effect.periodic, one, strict=True)) for one in periodic_starts(problem, model)]


def completed(problem: Problem, effect: type[Effect], values: Mapping[str, float]) -> dict[str, float]:
    """Return parameters of an effect as its declarations and the plant allow them."""
    pars, spring = effect.pars(), problem.base._has_spring
    kept = {n: v for n, v in values.items() if not (pars[n].free_standing and spring)}
    kept |= {n: v for n, v in effect.held.items() if v is not None}
    return {n: v if pars[n].words else pars[n].nearest(v) for n, v in kept.items()}


def rescanned(problem: Problem, trial: Trial, before: Fit) -> Trial:
    """Return a trial with orders and phases as they show in what was fitted before; others as they are."""
    if not trial.effect.periodic or not before.candidate.label:
        return trial
    waves = _waves(problem, trial.effect, before.fitted())
    starts = tuple(completed(problem, trial.effect, trial.starts[0] | wave) for wave in waves)
    return replace(trial, starts=starts or trial.starts)


def trial_of_one_more_wave(problem: Problem, f: Fit) -> Trial | None:
    """Return a trial of the waves that a fit has in its last effect, with one more of those that show in what it
    leaves; None where that is no wave, or has `MAX_WAVES`.
    """
    use = f.fitted().effects.get(f.candidate.label[-1])
    effect = EFFECTS[use.type] if use else Effect
    waves = effect.waves(use.parameters) if use else []
    larger = [one for one in EFFECTS.values() if waves and one.several and one.family == effect.family]
    if not larger or len(waves) >= MAX_WAVES:
        return None
    found = periodic_starts(problem, f.fitted())
    new = [one for one in found if min(abs(one[0] - wave[0]) for wave in waves) > SAME_ORDER * one[0]]
    starts = tuple(completed(problem, larger[0], larger[0].of_waves([*waves, one])) for one in new)
    return Trial(larger[0].name, starts) if starts else None


@dataclass(frozen=True)
class CandidateParts:
    """A model without its sensors, the keys of the effects that were added to it, and what was added to sensors;
    ``inertia``: that of the plant, by its name, where a start tells of it.
    """

    model: Model
    keys: tuple[str, ...]
    sensors: dict[str, float]
    inertia: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, f: Fit) -> CandidateParts:
        """Return the parts of what was fitted."""
        model, label = f.fitted(), f.candidate.label
        sensors = {n: v for n, v in f.parameters().items() if n.startswith("sensor_") and n in label}
        return cls(model, tuple(k for k in label if k in model.effects), sensors)

    @property
    def whole(self) -> Model:
        """The model with its sensors."""
        model, kinds = self.model, dict[str, dict[str, float]]()
        for name, value in self.sensors.items():
            kind, _, channel = name.partition(".")
            kinds.setdefault(kind, {})[channel] = value
        for kind, values in kinds.items():
            model = model.with_effect(kind, None, **values)
        return model

    def without(self, key: str) -> CandidateParts:
        """Return the same without one of the effects."""
        return replace(self, model=self.model.without_effect(key), keys=tuple(k for k in self.keys if k != key))

    def extended(
        self, name: str, start: Mapping[str, float], inertia: Mapping[str, float] | None = None
    ) -> CandidateParts:
        """Return the same with an effect more, at one of the points of a trial, and the plant's ``inertia`` there."""
        if issubclass(EFFECTS[name], SensorEffect):
            return replace(self, sensors={**self.sensors, **start})
        key = free_key(self.model, name)
        model = self.model.with_effect(name, key=key, **start)
        return replace(self, model=model, keys=(*self.keys, key), inertia=inertia or {})

    def candidate(self, problem: Problem) -> Candidate:
        """Return the candidate of a fit: base parameters at nominal, since a model that lacks something bends them."""
        c, given = candidate(problem, self.model, self.keys, self.sensors), numbers(problem.base)
        return replace(c, values={n: given.get(n, v) for n, v in c.values.items()} | dict(self.inertia))


__all__ = [
    "CandidateParts",
    "Trial",
    "completed",
    "free_key",
    "rescanned",
    "too_flat",
    "trial_of_one_more_wave",
    "trials",
    "tryable",
]
