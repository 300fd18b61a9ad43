"""What a diagnosis would see of a command: the errors of both rivals over the windows of a second, noisy run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.output_error.score import beyond_noise, improvement, windowed
from signlin_ros.experiment.distance import Pair, RivalBench
from signlin_ros.follow.segments import PreparedSegment

Array = NDArray[np.float64]


def seen_in_windows(bench: RivalBench, pairs: Sequence[Pair], t: Array, u: Array, seed: int) -> Array:
    """Return by how many standard errors the true rival of each pair (pairs,) is better over windows of the horizon
    than the other one, refitted, as a diagnosis tells: of a second run by blocks, or of both runs beyond their noise.
    """
    problem, g = bench.problem, np.random.default_rng(seed)
    segments: dict[int, PreparedSegment | None] = {}
    for i in {i for i, _ in pairs}:
        run = bench.run(i, t, u)
        segments[i] = None if run is None else bench.segment(i, run)
    found = np.zeros(len(pairs))
    for k, (i, j) in enumerate(pairs):
        clean = segments[i]
        if clean is None:
            continue
        theta = bench.refitted(j, clean)[1]
        noisy = replace(clean, y=clean.y + problem.noise * g.standard_normal(clean.y.shape), whole=False)
        second = replace(problem, segments=(noisy,))
        true, other = bench.contenders[i], bench.contenders[j]
        a, b = (
            windowed(second, replace(c.candidate, starts={}), x, bench.gains)
            for c, x in ((true, true.theta), (other, theta))
        )
        noise = beyond_noise(b, a, np.full(a.shape[1], clean.t.size), np.ones(a.shape[1]))
        found[k] = max(
            improvement(b, a, problem.noise).t_ratio,
            noise * np.sqrt(2.0) if noise > DEFAULT_CRITERIA.min_validation_t else 0.0,
        )
    return found


__all__ = ["seen_in_windows"]
