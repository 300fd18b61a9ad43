"""What a planned command would show: the two rivals hardest to tell apart, one refitted to imitate the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.experiment.plan import PlanText
from signlin_ros.experiment.search import CommandSearch, CommandTrial

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PreviewCurve:
    """Two rivals by name; t (T,), what the first shows, ``true`` (T, channels), what the other one, refitted, shows,
    ``other`` (T, channels), the ``noise`` (channels) and the distance so far (T,).
    """

    rivals: tuple[str, str]
    t: Array
    true: Array
    other: Array
    channels: tuple[str, ...]
    units: tuple[str, ...]
    noise: Array
    distance: Array


def preview(search: CommandSearch, best: CommandTrial, told: Sequence[PlanText]) -> list[PreviewCurve]:
    """Return the predicted readings of the two rivals that are hardest to tell apart; both ways."""
    names = [c.name for c in search.bench.contenders]
    hard = min((one for one in told if not (one.alike or one.nested)), key=lambda one: one.expected, default=told[0])
    i, j = (names.index(n) for n in hard.rivals)
    return [shown for shown in (_shown(search, best, a, b) for a, b in ((i, j), (j, i))) if shown]


def _shown(search: CommandSearch, best: CommandTrial, i: int, j: int) -> PreviewCurve | None:
    bench = search.bench
    run = bench.run(i, search.t, best.u)
    if run is None:
        return None
    segment = bench.segment(i, run)
    theta = bench.refitted(j, segment)[1]
    other = bench.run(j, search.t, best.u, theta)
    if other is None:
        return None
    channels, units = bench.problem.channels, {**bench.problem.base.units, **bench.problem.units}
    return PreviewCurve(
        (bench.contenders[i].name, bench.contenders[j].name),
        search.t,
        segment.y,
        bench.contenders[j].shown(theta, other, channels),
        channels,
        tuple(units.get(c, "") for c in channels),
        bench.problem.noise,
        bench.growing(j, segment, theta),
    )


__all__ = ["PreviewCurve", "preview"]
