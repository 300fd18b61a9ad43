"""Every number that decides in a diagnosis, in one place: its unit, what it means, and why it is what it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Criteria:
    """What decides; all is compared on data that no fit saw, unless said otherwise."""

    # ------------------------------------------------------------ what is named
    certainty: float = 3.5
    """Standard errors by which an effect lowers the validation error: the best of twenty lowers it by 2 by chance."""
    least: float = 2.0
    """Standard errors by which it lowers it on validation data by themselves, where known and validation data together
    tell."""
    each: float = 0.02
    """Least part of the squared force that a law takes away for each parameter, beside none or a simpler law."""
    coefficient: float = 4.0
    """Standard errors by which an added level differs from nothing; it may belong to a richer law."""
    known: float = 0.5
    """Largest standard error of a shape parameter, as a part of it: to better than half."""
    worse: float = 2.0
    """Standard errors by which no channel's error may rise, as soon as that is `alike`."""
    alike: float = 0.01
    """Difference of root mean squares, as a part of it, that a printed table does not show."""
    tie: float = 1.0
    """Standard errors within which the simpler of two models is taken."""
    most: int = 3
    """Most effects that are named together."""
    beam: int = 4
    """Sets of laws that the equation-error estimate follows at each step."""
    waves: float = 3.0
    """Periods of a wave over the position that a record must hold, where its order is free;"""
    once: float = 1.0
    """and where it is known, as of a weight."""

    # ------------------------------------------------------------ what is known beforehand
    far: float = 5.0
    """Tolerances by which a base parameter may be off before that is told first."""
    bent: float = 2.5
    """Tolerances by which a base parameter may move for the sake of a law,"""
    bent_share: float = 0.05
    """where it carries at least this part of the effort."""

    # ------------------------------------------------------------ what can be seen
    noise: float = 0.0175
    """Largest noise of the inertial force, as a part of the effort, in the band where forces are compared."""
    wider: float = 3.0
    """Times that band, where nothing is found in it."""
    sees: float = 2.5
    """Times the sensors' noise that the force left must be, for the equation-error estimate to tell what is in it."""

    # ------------------------------------------------------------ what counts as left over
    near: float = 2.0
    """Times the sensors' noise beneath which the windows of a model are near it: what is left must be noise then."""
    dependent: float = 0.02
    """Part of the squared residual that follows from the model's own motion. Right models leave 0.007 at most."""
    flexible: float = 3.0
    """Standard errors by which a flexible curve must lower the unseen force before it is said to leave structure,"""
    flexible_share: float = 0.05
    """and the least part of the base model's squared error that it takes away."""
    part: float = 0.25
    """Part of the squared force beyond the noise that a proposal may leave, where the motion shows structure."""
    large: float = 0.05
    """Part of the effort, or of a channel where none is seen (RMS), from which on what is left is missing."""


DEFAULT_CRITERIA = Criteria()

__all__ = ["DEFAULT_CRITERIA", "Criteria"]
