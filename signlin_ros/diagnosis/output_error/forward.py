"""Forward selection by output errors: one effect after the other, as long as each is a step [Ljung, 1999, ch. 16]."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from signlin_ros.diagnosis.output_error.estimator import OutputErrorEstimator
from signlin_ros.diagnosis.output_error.fitted import FittedModel

BEAM = 2
"""How many single effects a search tries with every other one where none is enough by itself."""


def forward_selection(
    motion: OutputErrorEstimator,
    depth: int,
    names: Sequence[str] | None = None,
    single: Callable[[FittedModel], FittedModel | None] = lambda _: None,
) -> list[list[FittedModel]]:
    """Return the steps from the base to what is proposed: of each what was taken, then the other options, least error
    first. The first is the base; the last holds what was tried in vain too. ``names``: tried, all by default;
    ``single`` finds the one effect that is enough where the first step leaves more than noise.
    """
    now = motion.base
    path = [[now]]
    while len(now.effects) < depth and (len(path) == 1 or not now.white):
        options = motion.extensions(now, names)
        alike = motion.alike(now, options)
        if len(path) == 1 and not (alike and alike[0].white) and (whole := single(alike[0] if alike else now)):
            return [path[0], [whole, *options]]
        if not (now.white or (alike and alike[0].white)):
            options += motion.bred(now, names)
            alike = motion.alike(now, options)
        if not alike and depth > 1 and not (now.white or now.effects):
            options += [two for one in options[:BEAM] for two in motion.extensions(one, names)]
            options = [*{one.kind: motion.best(one) for one in options}.values()]  # a larger one may show the way
            alike = motion.alike(now, options)
        if not alike:
            path[-1] += [one for one in options if one not in path[-1]]
            break
        now = alike[0]
        path.append([now, *(one for one in options if one is not now)])
    path[0][0] = motion.best(path[0][0])
    return path


__all__ = ["forward_selection"]
