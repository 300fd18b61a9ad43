"""A payload that is not the same in all records: told, and laws are judged beside it.

Records of one arm share its bodies. One in which the arm carries more than in the others bends the bodies of a fit to
all of them, and what is bent shows as laws that are none; so such a record has a payload of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.fit import IN_RECORD, CoefficientEstimate, FitDesign, fit
from signlin_ros.arms.laws import payload
from signlin_ros.arms.piece import RegressionRows
from signlin_ros.arms.warmth import sources_of, within
from signlin_ros.robots.inertia import INERTIAL_NAMES, TEN, moved

Array = NDArray[np.float64]
Place = tuple[int, Array, Array]
PAYLOAD_INERTIA_SPREAD = 1.0
"""Standard deviation of a payload's inertia in its link's frame, in kg·m²; of its mass and moments nothing is known."""


@dataclass(frozen=True, eq=False)
class Loaded:
    """Payloads of records beside the lightest one's, in kg with standard errors (R,), and the records' names."""

    sources: tuple[str, ...]
    masses: Array
    errors: Array

    @property
    def lightest(self) -> int:
        """The record that carries least."""
        return int(np.argmin(self.masses))


def names_in_record(record: int) -> tuple[str, ...]:
    """Return the names of the columns of a record's own payload."""
    return tuple(f"payload{IN_RECORD}{record}.{name}" for name in INERTIAL_NAMES)


def with_payloads(
    design: FitDesign, both: tuple[RegressionRows, RegressionRows], place: Place, lightest: int
) -> FitDesign:
    """Return a design with a payload for each record but the lightest, as what it carries more than that."""
    columns = [payload(rows, *place, TEN) for rows in both]
    for k, source in ((k, source) for k, source in enumerate(sources_of(*both)) if k != lightest):
        known, unseen = (c * within(rows, source)[:, None] for c, rows in zip(columns, both, strict=True))
        names = names_in_record(k)
        design = design.plus(names[:4], known[:, :4], unseen[:, :4])
        design = design.plus(names[4:], known[:, 4:], unseen[:, 4:], 0.0, PAYLOAD_INERTIA_SPREAD)
    return design


def payload_in_record(estimate: CoefficientEstimate, record: int, place: Place) -> Array:
    """Return what a record's own payload adds to the inertial parameters (10 n,)."""
    found = np.zeros(TEN * estimate.rows.n)
    matched = dict(zip(estimate.design.names, estimate.matched.tolist(), strict=True))
    own = np.array([matched.get(name, 0.0) for name in names_in_record(record)])
    joint, R, t = place
    found[TEN * joint : TEN * (joint + 1)] = moved(own, R, t)
    return found


def loaded(estimate: CoefficientEstimate, place: Place, least: float, visible: float) -> Loaded | None:
    """Return how payloads differ between the records of a fit's rows; None where they do not.

    They do where a mass is ``least`` standard errors from nothing, and a joint's squares fall by the part ``visible``.
    """
    sources = sources_of(estimate.rows)
    found, fall = _beside(estimate, sources, place, 0)
    if found.lightest:
        found, fall = _beside(estimate, sources, place, found.lightest)
    return found if (found.masses > least * found.errors).any() and fall > visible else None


def _beside(
    estimate: CoefficientEstimate, sources: tuple[str, ...], place: Place, lightest: int
) -> tuple[Loaded, float]:
    """Return the payloads of all records but one beside that one's, and the part by which a joint's squares fall."""
    rows, masses, own_errors = estimate.rows, np.zeros(len(sources)), np.zeros(len(sources))
    design = with_payloads(estimate.design, (rows, rows), place, lightest)
    trial = fit(design, rows, rows)
    errors = dict(zip(trial.design.names, trial.errors().tolist(), strict=True))
    for k in (k for k in range(len(sources)) if k != lightest):
        masses[k], own_errors[k] = trial[names_in_record(k)[0]], errors[names_in_record(k)[0]]
    with np.errstate(invalid="ignore", divide="ignore"):
        fall = 1.0 - (trial.known_rms / estimate.known_rms) ** 2
    return Loaded(sources, masses, own_errors), float(np.nanmax(fall))


def heavier_records(found: Loaded, least: float) -> list[int]:
    """Return the records that carry more than the lightest one by so many standard errors, at least."""
    heavier: list[int] = np.flatnonzero((found.masses > least * found.errors) & (found.errors > 0.0)).tolist()
    return heavier


def more_than(found: Loaded, names: Sequence[str], link: str, least: float) -> str:
    """Return which records carry how much more than which."""
    rows = [(names[k], found.masses[k], found.errors[k]) for k in heavier_records(found, least)]
    more = ", ".join(f"{name} {mass:.3g} ± {error:.1g} kg" for name, mass, error in rows)
    return f"payload on {link}: {more} more than {names[found.lightest]}"


__all__ = ["Loaded", "heavier_records", "loaded", "more_than", "payload_in_record", "with_payloads"]
