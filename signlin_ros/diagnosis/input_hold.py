"""How recorded inputs act between their samples, where the model leaves that to the records (``input_hold: auto``).

The base model, refitted, and the laws that take away most of the missing force are fitted with the inputs held, which
is what is assumed; where the best of these leaves more than noise, with inputs that were sampled from what goes on in
between; and where that is surely better, with all others. Errors are those over windows of the training data, in
blocks; the best of one hold is set against the best of another, since a base that lacks something large prefers what
imitates it. Validation data may only forbid what was found.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.dataset import Dataset
from signlin_ros.diagnosis.equation_error.estimate import LATE_SENSOR, EquationErrorResult
from signlin_ros.diagnosis.output_error import OutputErrorEstimator
from signlin_ros.diagnosis.output_error.fitting import LAST_STEPS
from signlin_ros.diagnosis.output_error.score import improvement, log_mse, windowed
from signlin_ros.diagnosis.output_error.trials import seen_loads
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.errors import InputError, SimulationError
from signlin_ros.fitting.fit import fit
from signlin_ros.model import LINEAR, Model
from signlin_ros.names import AT_NOISE_RATIO

Array = NDArray[np.float64]
Names = tuple[str, ...]
Hold = str | float

FIRST = "centred"
"""What is tried first: it lies between the others, so if one of them is better than held inputs, so is this."""
FURTHER_HOLDS: tuple[Hold, ...] = (LINEAR, "backward")
"""What is tried after it, if it is better than held inputs."""
LEADING = 3
"""Single laws that are fitted beside the base and the set that the force names."""
BETTER_HOLD_RATIO = 0.9
"""What another hold leaves in some channel, as a part of what held inputs leave (RMS), at most."""


@dataclass(frozen=True, eq=False)
class HoldTrial:
    """A hold: mean squared errors (blocks, channels) over windows of the training data by the effects fitted beside the
    base, what gives those of validation data, and the coordinates ``at`` which they were found.
    """

    motion: OutputErrorEstimator
    known: Mapping[Names, Array]
    unseen: Mapping[Names, Callable[[], Array]]
    at: Mapping[Names, Array]

    @property
    def model(self) -> Model:
        """The model whose inputs act so."""
        return self.motion.training.base

    @property
    def hold(self) -> Hold:
        """How its inputs act."""
        return self.model.input_hold

    @property
    def best(self) -> Names:
        """The effects of the least error."""
        noise = self.motion.training.noise
        return min(self.known, key=lambda names: log_mse(self.known[names], noise))

    @property
    def level(self) -> float:
        """The least error, as one number."""
        return log_mse(self.known[self.best], self.motion.training.noise)


def asks_hold(dataset: Dataset) -> bool:
    """Tell whether records are to show how their inputs act: an imposed motion has a rule of its own."""
    return dataset.model.asks_hold and not dataset.model.plant.motion_is_imposed()


def at_noise(motion: OutputErrorEstimator, squares: Array) -> bool:
    """Tell whether mean squared errors (blocks, channels) of training data are those of noise: no hold matters then."""
    return bool(np.all(np.sqrt(np.nanmean(squares, axis=0)) <= AT_NOISE_RATIO * motion.training.noise))


def with_hold(
    dataset: Dataset, motion: OutputErrorEstimator, force: EquationErrorResult | None, criteria: Criteria
) -> tuple[Dataset, OutputErrorEstimator] | None:
    """Return the data set and its base with the hold that the records show; None where inputs act as if held, or where
    nothing tells.
    """
    held = _tried(motion, force, stop=True)
    if at_noise(motion, held.known[held.best]):
        return None
    first = _other(motion, force, FIRST)
    if first is None or not _better(held, first, criteria):
        return None
    named = [first, *(one for hold in FURTHER_HOLDS if (one := _other(motion, force, hold)) is not None)]
    best = min(named, key=lambda one: one.level)
    same = 2.0 * criteria.visible_change * len(dataset.training.channels)
    best = first if best.hold == LINEAR and first.level - best.level < same else best
    unseen = improvement(held.unseen[held.best](), best.unseen[best.best](), dataset.validation.noise)
    if unseen.t_ratio < -criteria.max_rise_t:
        return None
    if not _better(_again(held, force, best), best, criteria):
        return None
    told = _said(dataset, held, best)
    problem = replace(best.motion.training, notes=(*best.motion.training.notes, told))
    return replace(dataset, training=problem, validation=best.motion.validation, hold_note=told), best.motion


def _tried(motion: OutputErrorEstimator, force: EquationErrorResult | None, stop: bool = False) -> HoldTrial:
    """Fit the base and the leading laws with the hold of an estimate; ``stop``: as soon as one leaves but noise."""
    gains, problem, base = motion.training.observer_gains[1], motion.training, motion.base
    known: dict[Names, Array] = {(): base.training_squares}
    rest: dict[Names, Callable[[], Array]] = {(): lambda: base.validation_squares}
    at: dict[Names, Array] = {}
    for names, start in _leading(motion, force):
        if stop and at_noise(motion, min(known.values(), key=lambda squares: log_mse(squares, problem.noise))):
            break
        motion.progress.check()
        try:
            c, theta = motion.candidate_at(names, start)
        except InputError:
            continue
        found = fit(motion.short, c, gains, theta, LAST_STEPS)
        if found is not None:
            known[names] = windowed(problem, c, found.theta, gains)
            at[names] = found.theta
            rest[names] = functools.partial(windowed, motion.validation, c, found.theta, gains)
    return HoldTrial(motion, known, rest, at)


def _leading(motion: OutputErrorEstimator, force: EquationErrorResult | None) -> Iterator[tuple[Names, Model]]:
    """Yield the effects that the force names, and the single laws that leave least of it, with their values; then the
    loads behind a coupling that show in it.
    """
    if force is None:
        return
    single = sorted((f for f in force.sets.values() if len(f.members) == 1), key=lambda f: f.training_mse)
    chosen = [force.fit] if force.effects else []
    for f in [*chosen, *(one for one in single if one.names != force.fit.names)][: LEADING + 1]:
        with suppress(InputError):  # a value that a model may not have
            model, names = force.with_laws(f), tuple(n for n, _ in f.members)
            yield names, model
            if late := force.late_beside(f, motion.training.channels):
                yield (LATE_SENSOR, *names), model.with_effect(LATE_SENSOR, None, **late)
    for name, model in seen_loads(motion.training):
        yield (name,), model


def _again(held: HoldTrial, force: EquationErrorResult | None, other: HoldTrial) -> HoldTrial:
    """Return held inputs with the laws that are best with another hold fitted from where they arrived there: a minimum
    that a fit did not find is no hold.
    """
    motion, names, known = held.motion, other.best, dict(held.known)
    start = next((model for one, model in _leading(motion, force) if one == names), None)
    if start is not None and names in other.at:
        c, _ = motion.candidate_at(names, start)
        found = fit(motion.short, c, motion.training.observer_gains[1], other.at[names], LAST_STEPS)
        if found is not None:
            squares = windowed(motion.training, c, found.theta, motion.training.observer_gains[1])
            known[names] = min(known.get(names, squares), squares, key=lambda one: log_mse(one, motion.training.noise))
    return replace(held, known=known)


def _other(motion: OutputErrorEstimator, force: EquationErrorResult | None, hold: Hold) -> HoldTrial | None:
    """Return the trial of another hold; None where the base diverges with it."""
    try:
        return _tried(motion.acting(hold), force)
    except SimulationError:
        return None


def _better(before: HoldTrial, after: HoldTrial, criteria: Criteria) -> bool:
    """Tell whether the best of a hold is surely, and visibly, better than the best of another."""
    found = improvement(before.known[before.best], after.known[after.best], before.motion.training.noise)
    sure = found.t_ratio >= criteria.min_t and not found.worsens(criteria)
    return sure and bool(np.any(found.rmse_ratios <= BETTER_HOLD_RATIO))


def _errors(one: HoldTrial, names: Names) -> Array:
    """Return the RMS errors (channels,) over windows of training data of some effects, or of the best where they
    fail.
    """
    return np.asarray(np.sqrt(np.nanmean(one.known.get(names, one.known[one.best]), axis=0)))


def _said(dataset: Dataset, held: HoldTrial, taken: HoldTrial) -> str:
    """Return a sentence on the hold that was taken, with the error that falls for it: the base's, if that shows it."""
    shows = np.all(_errors(taken, ()) <= _errors(held, ())) and np.any(
        _errors(taken, ()) <= BETTER_HOLD_RATIO * _errors(held, ())
    )
    names = () if shows else taken.best
    a, b = _errors(held, names), _errors(taken, names)
    k = int(np.argmin(b / a))
    channel, problem = dataset.training.channels[k], dataset.training
    unit = problem.unit_of(channel)
    figures = phrases.error_changes(channel, dataset.horizon, a[k], b[k], unit)
    return phrases.input_acts(taken.hold, figures, names)


__all__ = ["asks_hold", "at_noise", "with_hold"]
