"""What the force witness says of a model and its records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.missing import inertia
from signlin_ros.diagnosis.criteria import DEFAULT, Criteria
from signlin_ros.diagnosis.force.flexible import Curve, structured
from signlin_ros.diagnosis.force.laws import laws
from signlin_ros.diagnosis.force.record import Piece, best_cutoff, piece
from signlin_ros.diagnosis.force.regression import TINY, Base, Fit, Regression, base_of, side, telling
from signlin_ros.diagnosis.force.search import Search
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.scale import Scale

Array = NDArray[np.float64]

LATE = 0.5
"""Samples by which the effort may come early or late: when an input acts between its samples is rarely known. An
imposed motion is measured beside its force: lateness of that is what presliding looks like, and no guess."""
APART = 1.2
"""Times the quiet band that a wider one must be to be tried."""


@dataclass(frozen=True, eq=False)
class Testimony:
    """What the force witness found: ``search`` with every set of laws that it fitted, and the least that suffices.

    ``flexible``: what a flexible curve makes of what that leaves.
    """

    search: Search
    flexible: Curve

    @property
    def fit(self) -> Fit:
        """The chosen set."""
        return self.search.chosen

    @property
    def effects(self) -> tuple[str, ...]:
        """Its names, in the order in which they were found."""
        return tuple(n for n, _ in self.fit.members)

    def percent(self, fit: Fit | None = None) -> float:
        """Return the force left of unseen data in per cent of the effort."""
        return self.search.r.percent(fit or self.fit)


def hear(
    model: Model,
    known: Sequence[ModelData],
    unseen: Sequence[ModelData],
    rotary: bool,
    criteria: Criteria = DEFAULT,
) -> Testimony:
    """Ask the force witness; records without gaps. The quiet band first, a wider one where nothing is found in it."""
    cutoff = best_cutoff(model, known, criteria.noise)
    first = _in_band(model, known, unseen, rotary, criteria, cutoff)
    step = first.search.r.known.pieces[0].step
    wide = min(criteria.wider * cutoff, 0.12 / step)
    if (first.effects and not first.flexible.visible) or wide < APART * cutoff:
        return first
    second = _in_band(model, known, unseen, rotary, criteria, wide)
    better = (second.effects and not second.flexible.visible) or (
        not first.effects and not first.flexible.visible and second.flexible.visible and second.effects
    )
    return second if better else first


def _in_band(
    model: Model,
    known: Sequence[ModelData],
    unseen: Sequence[ModelData],
    rotary: bool,
    criteria: Criteria,
    cutoff: float,
) -> Testimony:
    found, other = ([piece(model, d, cutoff) for d in side_] for side_ in (known, unseen))
    current = "current" in model.states and "current" in known[0].measured
    moved = telling(model, found[0], base_of(model, current))
    late = TINY if model.plant.motion_is_imposed() else LATE
    spread = np.array([*(s for _, s in moved.values()), late])
    base = Base((*moved, "timing"), spread)
    r = Regression(
        model,
        laws(model, rotary or _waves(model, found) >= criteria.once, found[0].position_measured),
        side(model, found, moved),
        side(model, other, moved),
        base,
        criteria,
        current,
    )
    search = Search(r, scale_of(model, found), rotary, model.gear)
    search.run()
    return Testimony(search, structured(search, search.chosen))


def _waves(model: Model, pieces: Sequence[Piece]) -> float:
    """Return how many waves of order 1 the records travel."""
    return max(float(np.ptp(p.values[model.plant.position])) for p in pieces) / (2 * np.pi)


def scale_of(model: Model, pieces: Sequence[Piece]) -> Scale:
    """Return how large things are in records."""
    plant = model.plant

    def rms(values: list[Array]) -> float:
        size = float(np.sqrt(np.mean(np.concatenate(values) ** 2)))
        return size if size > 0 else 1.0

    q = [p.values[plant.position] for p in pieces]
    travel = max(float(np.max(np.abs(x))) for x in q) or 1.0
    return Scale(
        rms([p.effort for p in pieces]),
        travel,
        rms([p.values[plant.velocity] for p in pieces]),
        rms([p.acceleration for p in pieces]),
        rms([p.values["current"] for p in pieces]) if "current" in pieces[0].values else 1.0,
        max(float(np.max(np.abs(p.u[:, 0]))) for p in pieces) or 1.0,
        pieces[0].step,
        max(float(p.t[-1]) for p in pieces),
        inertia(model),
    )


__all__ = ["Testimony", "hear", "scale_of"]
