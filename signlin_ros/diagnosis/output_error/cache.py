"""The memo of a diagnosis: what was fitted once is not fitted again. It is the one thing in it that changes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.output_error.fitted import FittedModel
from signlin_ros.diagnosis.output_error.fitting import StartedFits
from signlin_ros.fitting.fit import Fit
from signlin_ros.model import Model

Kind = tuple[str, ...]
"""What tells one set of effects from another: `FittedModel.kind`."""
Asked = tuple[tuple[str, ...], Model | None]
"""Names of effects, and the model whose values of them a fit starts from."""


@dataclass(eq=False)
class FitCache:
    """Fits of one problem, by what they are of.

    best : the fit of the least training error by then, by the keys of its effects (`FittedModel.kind`).
    multi_start : a fit of one more effect from all its starts, None where it diverged; by all keys and the channel.
    started : the first fits of one effect beside the base, which are asked for again from more starts.
    asked : what `OutputErrorEstimator.fitted` returned, by effects and start.
    weighed : the models that a selection weighed, in the order in which it met them.
    searched : names of the effects that were tried on top of others.
    force_mse : mean squared force (blocks,) that a model as written leaves of validation data.
    undriven_shares : share of the stretch of each resonant load's coupling that the motion does not make, by effect.
    """

    best: dict[Kind, FittedModel] = field(default_factory=dict)
    multi_start: dict[Kind, Fit | None] = field(default_factory=dict)
    started: StartedFits = field(default_factory=StartedFits)
    asked: list[tuple[Asked, FittedModel]] = field(default_factory=list)
    weighed: list[FittedModel] = field(default_factory=list)
    searched: dict[tuple[str, ...], set[str]] = field(default_factory=dict)
    force_mse: dict[FittedModel, NDArray[np.float64]] = field(default_factory=dict)
    undriven_shares: dict[FittedModel, dict[str, float]] = field(default_factory=dict)

    @property
    def from_all_starts(self) -> set[str]:
        """The effects that were fitted by themselves from all their starts."""
        return {name for *before, name, _ in self.multi_start if not before}

    def keep(self, *found: FittedModel) -> None:
        """Keep models that a selection weighs."""
        self.weighed += [f for f in found if f not in self.weighed]


__all__ = ["FitCache"]
