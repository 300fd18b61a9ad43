"""The machines of all families, by name."""

from __future__ import annotations

from benchmarks.machines import (
    amplifiers,
    axes,
    coasting,
    complete,
    foreign,
    guests,
    lodgers,
    motors,
    rigs,
    stages,
    tenants,
    visitors,
)
from benchmarks.machines.rig import MACHINES

FAMILIES = (motors, axes, coasting, stages, rigs, amplifiers, foreign, complete, visitors, guests, lodgers, tenants)

__all__ = ["FAMILIES", "MACHINES"]
