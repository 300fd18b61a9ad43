"""Forward selection by the motion witness alone: one effect after the other, pairs where none is enough by itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from signlin_ros.diagnosis.motion.fitted import Fitted

if TYPE_CHECKING:
    from signlin_ros.diagnosis.motion.witness import Motion

BEAM = 2
"""How many single effects are tried with every other one."""


def search(motion: Motion, depth: int, names: Sequence[str] | None = None) -> list[list[Fitted]]:
    """Return the steps from the base to what is proposed: of each what was taken, then the other options that there
    were, least error first. The first is the base; the last holds what was tried in vain, too. ``names``: of the
    effects that are tried, all of them by default.
    """
    now = motion.base
    path = [[now]]
    while len(now.effects) < depth and (len(path) == 1 or not now.white):
        options = motion.extensions(now, names)
        alike = motion.alike(now, options)
        if not (now.white or (alike and alike[0].white)):
            options += motion.bred(now, names)
            alike = motion.alike(now, options)
        if not alike and depth > 1 and not (now.white or now.effects):
            options += [two for one in options[:BEAM] for two in motion.extensions(one, names)]
            alike = motion.alike(now, options)
        if not alike:
            path[-1] += [one for one in options if one not in path[-1]]
            break
        now = alike[0]
        path.append([now, *(one for one in options if one is not now)])
    path[0][0] = motion.best(path[0][0])
    return path


__all__ = ["search"]
