"""What a prediction is worth: its error in the unit of the channel, as a fit, and in units of the noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Score:
    """Error of a prediction.

    ``rmse`` in the unit of the channel; ``fit_percent`` = 100 (1 - |y - yhat| / |y - mean y|), None where the
    measurement does not move; ``rmse_over_noise``, None where the noise is not known.
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
    y, error = measured[both], measured[both] - predicted[both]
    rmse, spread = float(np.sqrt(np.mean(error**2))), float(np.sqrt(np.mean((y - y.mean()) ** 2)))
    fit = 100.0 * (1.0 - rmse / spread) if spread > 0 else None
    return Score(rmse, fit, rmse / noise if noise > 0 else None)


__all__ = ["Score", "score"]
