"""Whether what an input is said to have done for a moment is what drove the motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.base import with_channel
from signlin_ros.checks.look import Look
from signlin_ros.checks.observer import follow
from signlin_ros.masks import ends_of_runs, of_runs
from signlin_ros.noise import NORMAL_QUARTILE

Array = NDArray[np.float64]

ANSWER_SAMPLES = 10
"""So many samples after it, what the input did for a moment has been answered."""
MIN_ANSWER = 5.0
"""Least size of an answer that is missed where there is none, in standard deviations of what the observer leaves."""


def never_reached(look: Look, name: str, values: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which (T,) of the runs of samples in which an input differs from ``values`` (T,) have not driven the
    motion, which goes on as if the input had been these; and which (T,) are too small to tell.

    The change of the innovations from sample to sample is regressed on the answer to each run, which is 1 where nothing
    of it reached the machine, and 0 where all did. Errors of the model that last for longer than a sample, as friction,
    hardly show in that. The answer to all the rest must be in there, or the input's unit or sign is in doubt. One
    observer follows both: one that is made for wild inputs would believe the sensors alone.
    """
    found, small = np.zeros(values.size, dtype=np.bool_), values != look.of(name)
    other = follow(look.base, with_channel(look.record, name, values), look.channels) if look.base else None
    as_said = look.followed if other else None
    if other is None or as_said is None:
        return found, small
    j = look.record.inputs.index(name)
    kept = np.where(np.arange(other.u.shape[1]) == j, 0.0, other.u)
    three = [replace(other, u=u).innovations() for u in (as_said.u, other.u, kept)]
    changes, rest, without = (np.diff(one, axis=0, prepend=one[:1]) for one in three)
    usual = np.median(np.abs(changes), axis=0) / NORMAL_QUARTILE
    noisy = usual > 0.0
    changes, rest, without = (one[:, noisy] / usual[noisy] for one in (changes, rest, without))
    answers, whole = changes - rest, rest - without
    of, size = ends_of_runs(as_said.u[:, j] != other.u[:, j])
    ends = np.minimum(np.minimum(size + ANSWER_SAMPLES, np.append(of[1:], changes.shape[0])), changes.shape[0])
    elsewhere = ~of_runs(changes.shape[0], of, ends)
    if not 2.0 * abs(float(np.sum((rest * whole)[elsewhere]))) < float(np.sum(whole[elsewhere] ** 2)):
        return found, small
    sums = np.cumsum(np.stack([np.sum(changes * answers, axis=1), np.sum(answers**2, axis=1)]), axis=1)
    sums = np.concatenate([np.zeros((2, 1)), sums], axis=1)
    both, own = (one[ends] - one[of] for one in sums)
    large = own > MIN_ANSWER**2
    missed = large & (2.0 * np.abs(both - own) < own)
    begins, after = ends_of_runs(values != look.of(name))
    for first, last, t in zip(begins, after, look.t[begins], strict=True):
        at = np.flatnonzero(np.abs(as_said.t[of] - t) < 0.5 * as_said.step)
        if at.size:
            found[first:last], small[first:last] = missed[at[0]], not large[at[0]]
    return found, small


__all__ = ["never_reached"]
