"""Every number that decides in a diagnosis, with its unit, what it means, and why it is what it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Criteria:
    """What decides; all are compared on data that no fit saw, unless said otherwise.

    What is to be named
    -------------------
    certainty : standard errors by which an effect lowers the windowed error. One in some twenty effects lowers it by
        2 by chance, and each step chooses the best of them. Where it leaves nothing but noise, on known and unseen
        data together: on known data alone noise lowers it by no more than 2.
    least : standard errors on unseen data by themselves, in any case.
    share : least part of the squared error beyond the sensors' noise that one effect takes away.
    coefficient : standard errors by which an added coefficient differs from nothing; it may belong to a richer law.
    known : largest standard error of a shape parameter, as a part of it (of its logarithm): to better than half.
    worse : standard errors by which no channel's error may rise, as soon as that is `alike`.
    alike : difference of root mean squares, as a part of it, that a printed table does not show.
    tie : standard errors within which the simpler of two models is taken.
    waves : least number of waves of a periodic force that a record must pass: a part of one is any smooth curve.
    far : tolerances by which a base parameter may be off before that is told first.

    What counts as left over
    ------------------------
    dependent : part of the squared residual that follows from the model's own motion. Right models leave 0.007 at most.
    """

    certainty: float = 3.5
    least: float = 2.0
    share: float = 0.05
    coefficient: float = 4.0
    known: float = 0.5
    worse: float = 2.0
    alike: float = 0.01
    tie: float = 1.0
    waves: float = 3.0
    far: float = 5.0
    dependent: float = 0.02


__all__ = ["Criteria"]
