"""What a record could tell at all: parameters and effects, alone and together."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.base import Check
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.linear import linear_base
from signlin_ros.checks.look import Look
from signlin_ros.checks.observer import FORGETTING_SHARE, Followed
from signlin_ros.errors import SignlinError, joined
from signlin_ros.model import Model

Array = NDArray[np.float64]

CHANGE = 1e-3
"""Parameters are changed by this share to see what that changes."""
MAX_RELATIVE_ERROR = 2.0
"""A parameter known to no better than so many times its own size is not told."""
CONDITIONAL_ERROR = 0.3
"""A group moves together whose members are each known to this share if the others are, but not so together."""
WEAK = 0.05
"""Least eigenvalue of the correlations of what parameters do, where they are independent."""
COLLINEAR = 1e-6
"""Below this two parameters are one in the equations, whatever the motion."""
PART = 0.3
"""Least part that a member has in the direction in which a group moves."""
MAX_HIDDEN_SHARE = 0.3
"""An effect is not told that can be as large as this share of what drives (RMS), and is not seen."""
MAX_CORRELATION = 0.98
"""Two effects look alike whose answers have this correlation, base parameters allowed for."""
SEEN_STANDARD_ERRORS = 3.0
"""Standard errors that make a thing seen."""
RESIDUAL_SHARE = 0.03
"""What is left of a channel, as a share of what it does, where nothing is missing."""
CORRELATED_SAMPLES = 20
"""So many samples that follow each other count as one: what a model lacks lasts."""


@dataclass(frozen=True, eq=False)
class Identified:
    """How well a record tells parameters: the standard errors (k,) of their logarithms if all others are known, and
    the groups that move together in this record, but need not in another one of the same channels.
    """

    names: tuple[str, ...]
    alone: Array
    groups: tuple[tuple[str, ...], ...]


class Excitation(Check):
    """The motion does not excite what a parameter or an effect does, or excites two of them alike.

    Test: how far each parameter moves the innovations of an observer, against what is left of them; the standard
    errors of all together come from the inverse of their information, groups from its weakest direction [Belsley, Kuh,
    Welsch, Regression Diagnostics, 1980, ch. 3]. By the record's own size of what is left, taken as
    `CORRELATED_SAMPLES` times as lasting as white noise: the bounds are 3 standard errors of an amplitude, one of a
    logarithm. Where the motion is imposed, effects add to the measured force as they are. Cure: another motion.
    """

    name = "excitation"
    needs_time = True
    needs_input = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield one note for the record."""
        if look.followed is None or look.predicted is None or look.reported:
            return
        identified = identified_parameters(look.model, look.followed)
        said = [*_of_parameters(identified), *_of_effects(look, look.followed)] if identified else []
        if said:
            yield self.note("", f"this record tells {'; '.join(said)}")


def identified_parameters(model: Model, f: Followed) -> Identified | None:
    """Return how well a record tells the parameters of the plant; None where nothing can be said."""
    before = f.innovations()
    moved = {name: answer for name in _free(model) if (answer := _moved(model, f, name, before)) is not None}
    if not moved:
        return None
    names = list(moved)
    information: Array = _information(list(moved.values()), _doubt(f, before))
    size = np.sqrt(np.maximum(np.diag(information), 1e-12))
    weak, directions = np.linalg.eigh(information / size[:, None] / size)
    groups = [_group(names, size, float(weak[k]), directions[:, k]) for k in np.flatnonzero(weak < WEAK)]
    merged = _merged([group for group in groups if group], names)
    always = _merged([_group(names, size, 0.0, directions[:, k]) for k in np.flatnonzero(weak < COLLINEAR)], names)
    return Identified(tuple(names), 1.0 / size, tuple(group for group in merged if group not in always))


def _free(model: Model) -> list[str]:
    """Return the parameters of the plant that have a size."""
    return [n for n, par in model.plant.pars().items() if not par.structural and model.parameters[n] > 0.0]


def _moved(model: Model, f: Followed, name: str, before: Array) -> Array | None:
    """Return how the logarithm of a parameter moves the innovations (T, ny); None where it cannot be changed."""
    try:
        base = linear_base(model.with_parameters({name: (1.0 + CHANGE) * model.parameters[name]}))
    except SignlinError:
        return None
    return None if base is None else np.asarray((f.innovations(f.discrete(base)) - before) / CHANGE)


def _group(names: list[str], size: Array, weak: float, direction: Array) -> tuple[str, ...]:
    """Return the parameters that a weak direction (k,) of the information moves together; none where they are known
    all the same.
    """
    members = [i for i in range(len(names)) if abs(direction[i]) > PART and 1.0 / size[i] < CONDITIONAL_ERROR]
    if len(members) < 2 or 1.0 / np.sqrt(max(weak, 1e-12)) / np.median(size[members]) < 1.0:
        return ()
    return tuple(names[i] for i in members)


def _doubt(f: Followed, left: Array) -> Array:
    """Return the standard deviation (ny,) of what is not known of every channel: what is left (T, ny) where a model
    follows it, and no more than its noise or `RESIDUAL_SHARE` of what it does, where an effect is missing that is
    still to be found.
    """
    noise = np.diff(f.y, 4, axis=0).std(axis=0) / np.sqrt(70.0)
    least = np.maximum(noise, RESIDUAL_SHARE * f.y.std(axis=0))
    return np.asarray(np.maximum(np.minimum(left[int(FORGETTING_SHARE * left.shape[0]) :].std(axis=0), least), 1e-300))


def _information(moved: list[Array], doubt: Array) -> Array:
    """Return the information (k, k) of answers (T, ny) each, in a doubt (ny,)."""
    first = int(FORGETTING_SHARE * moved[0].shape[0])
    answers = np.stack([(m[first:] / doubt).ravel() for m in moved])
    return np.asarray(np.einsum("at,bt->ab", answers, answers)) / CORRELATED_SAMPLES


def _merged(groups: list[tuple[str, ...]], names: list[str]) -> tuple[tuple[str, ...], ...]:
    """Return groups of which none shares a member with another one, members in the order of ``names``."""
    found: list[set[str]] = []
    for group in groups:
        apart = [other for other in found if not other & set(group)]
        found = [*apart, set(group).union(*(other for other in found if other & set(group)))]
    return tuple(tuple(name for name in names if name in group) for group in found)


def _of_parameters(identified: Identified) -> Iterator[str]:
    unknown = [n for n, alone in zip(identified.names, identified.alone, strict=True) if alone > MAX_RELATIVE_ERROR]
    if unknown:
        yield f"nothing of {joined(unknown)}"
    for group in identified.groups:
        yield f"{joined(group)} only together: they move as one"


def _of_effects(look: Look, f: Followed) -> Iterator[str]:
    """Yield which effects of the motion it does not tell, or not from each other."""
    shapes = _shapes(look, f)
    if look.model.plant.motion_is_imposed():  # what is measured is their force itself, beside what the base makes of it
        columns = np.stack(list(shapes.values())) if shapes else np.zeros((0, 0))
        yield from _together(list(shapes), columns @ columns.T, ())
        return
    way = _per_force(look.model)
    if way is None or not shapes:
        return
    kept = np.array([way[look.model.states.index(name)] for name in f.base.states])
    answers = [f.answer(kept, shape) for shape in shapes.values()]
    row = int(np.argmax(np.abs(kept)))
    drive = float(f.rates()[row] / abs(kept[row]))
    information = _information(answers, _doubt(f, f.innovations()))
    seen = np.sqrt(np.maximum(np.diag(information), 1e-300))
    sizes = np.array([float(np.sqrt(np.mean(shape**2))) for shape in shapes.values()])
    hidden = [
        n
        for n, least, size in zip(shapes, SEEN_STANDARD_ERRORS / seen, sizes, strict=True)
        if least * size > MAX_HIDDEN_SHARE * drive
    ]
    if hidden:
        yield f"nothing of {joined(hidden)}, were it {100 * MAX_HIDDEN_SHARE:.0f} % of what drives"
    yield from _together(list(shapes), information, hidden)


def _together(names: list[str], information: Array, hidden: Collection[str]) -> Iterator[str]:
    """Yield which effects look alike by their information (k, k), those that are hidden aside."""
    seen = np.sqrt(np.maximum(np.diag(information), 1e-300))
    alike = np.abs(information / seen[:, None] / seen) > MAX_CORRELATION
    pairs = [(names[i], names[j]) for i, j in zip(*np.nonzero(np.triu(alike, 1)), strict=True)]
    for group in _merged([pair for pair in pairs if not set(pair) & set(hidden)], names):
        yield f"{joined(group)} only together"


def _shapes(look: Look, f: Followed) -> dict[str, Array]:
    """Return the regressor (T,) of every effect of the motion, by name, where velocity or position are recorded."""
    found: dict[str, Array] = {}
    columns = dict(zip(f.channels, f.y.T, strict=True))
    columns |= dict(zip(f.base.inputs, f.u.T, strict=True))
    q, v = columns.get(look.position), columns.get(look.velocity)
    if v is None and q is not None:
        v = np.gradient(q, f.t)
    if v is not None:
        found |= {"viscous friction": v, "Coulomb friction": np.sign(v), "a constant load": np.ones_like(v)}
    if q is not None and look.model.parameters.get("k", 0.0) == 0.0:
        found["a spring"] = q - q.mean()
    return found


def _per_force(model: Model) -> Array | None:
    """Return the change of every state's rate (n,) for a unit of force on the mass; None where none answers to it."""
    probe = model.with_effect("constant_load", key="probe", F0=1.0)
    with_it, without = linear_base(probe), linear_base(probe.with_parameters({"probe.F0": 0.0}))
    return None if with_it is None or without is None else with_it.c - without.c
