"""Every number that decides a diagnosis, in one place: what it is, in which unit, and why it is so large."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Criteria:
    """What must hold before something is said. All errors are those of unseen data."""

    surely: float = 3.5
    """Standard errors by which an effect must lower the unseen error: one in 4,000 by chance, and some twenty are
    tried."""
    known: float = 4.0
    """Standard errors by which an effect's own level must differ from nothing."""
    share: float = 0.05
    """Least part of the unseen squared error that an effect must take away,"""
    each: float = 0.02
    """and so much more for each parameter beyond its first."""
    visible: float = 0.003
    """Least part of the effort (RMS) that an effect must take away: no sensor of an effort is better."""
    alike: float = 1.0
    """Standard errors within which two models are as good as each other,"""
    alike_share: float = 0.02
    """or the part of the squared error: 1 % in RMS."""
    noise: float = 0.03
    """Largest noise of the inertial force, as a part of the effort, that the band of comparison lets through."""
    wider: float = 3.0
    """Times that band, where nothing is found in it."""
    most: int = 3
    """Most effects that are named together."""
    beam: int = 4
    """Sets of effects that are followed at each step."""
    bent: float = 2.5
    """Tolerances by which a base parameter may move for the sake of an effect,"""
    bent_share: float = 0.05
    """where it carries at least this part of the effort."""
    flexible: float = 3.0
    """Standard errors by which a flexible curve must beat what is listed before it is said to leave structure,"""
    flexible_share: float = 0.05
    """and the least part of the base model's squared error that it takes away,"""
    flexible_visible: float = 0.004
    """and of the effort (RMS)."""
    waves: float = 3.0
    """Periods of a wave over the position that a record must hold."""


DEFAULT = Criteria()

__all__ = ["DEFAULT", "Criteria"]
