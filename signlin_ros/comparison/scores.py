"""What a prediction is worth: its error in the unit of the channel, as a fit, and in units of the noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import joined

Array = NDArray[np.float64]

MIN_FIT_PERCENT = 50.0
"""A fit (per cent) below which a model does not follow a channel: its error is then no measure of the noise."""
MIN_ERROR_OVER_NOISE = 2.0
"""An error of so many times the noise is told all the same."""


@dataclass(frozen=True)
class Score:
    """Error of a prediction: ``rmse`` in the channel's unit; ``fit_percent`` = 100 (1 - |y - yhat| / |y - mean y|);
    over noise, None where that is not known, or the fit is so low (`MIN_FIT_PERCENT`) that what looks like noise may
    be missed.
    """

    rmse: float
    fit_percent: float | None
    rmse_over_noise: float | None

    def to_json(self) -> dict[str, float | None]:
        """Return the mapping that the contract calls SCORE."""
        return {"rmse": self.rmse, "fit_percent": self.fit_percent, "rmse_over_noise": self.rmse_over_noise}


def score(measured: Array, predicted: Array, noise: float = 0.0) -> Score | None:
    """Score a prediction (T,) of a measurement (T,); missing samples (NaN) are skipped. None if nothing is left."""
    both = np.isfinite(measured) & np.isfinite(predicted)
    if not both.any():
        return None
    error = measured[both] - predicted[both]
    return rated(float(np.sqrt(np.mean(error**2))), float(np.std(measured[both])), noise)


def rated(rmse: float, spread: float, noise: float) -> Score:
    """Return the score of an error, of a measurement with that standard deviation and that noise."""
    fit = 100.0 * (1.0 - rmse / spread) if spread > 0 else None
    comparable = noise > 0 and (fit is None or fit >= MIN_FIT_PERCENT or rmse > MIN_ERROR_OVER_NOISE * noise)
    return Score(rmse, fit, rmse / noise if comparable else None)


def unfollowed(scores: Mapping[str, Score]) -> list[str]:
    """Return the channels that a model does not follow at all: fits below `MIN_FIT_PERCENT`."""
    return [name for name, one in scores.items() if one.fit_percent is not None and one.fit_percent < MIN_FIT_PERCENT]


def follows_nothing(names: Sequence[str]) -> str:
    """Return in words that channels fit no model, and why that may be."""
    what = f"The {joined(list(names))} {'fits' if len(names) == 1 else 'fit'} no model"
    why = "another unit or axis, two sources in one channel, a sensor that fails, or another input than the recorded"
    return f"{what} (less than {MIN_FIT_PERCENT:g} % of fit): {why}. `signlin check` may tell."


__all__ = ["MIN_FIT_PERCENT", "Score", "follows_nothing", "rated", "score", "unfollowed"]
