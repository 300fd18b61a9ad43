"""The machines of all families, by name."""

from __future__ import annotations

from benchmarks.machines import amplifiers, axes, coasting, complete, foreign, guests, motors, rigs, stages, visitors
from benchmarks.machines.rig import MACHINES

FAMILIES = (motors, axes, coasting, stages, rigs, amplifiers, foreign, complete, visitors, guests)

__all__ = ["FAMILIES", "MACHINES"]
