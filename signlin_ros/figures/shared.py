"""What the figures share: the options of a model, and the size of an error."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.model import Model

Array = NDArray[np.float64]


def options(model: Model) -> dict[str, Any]:
    """Return the key of a model: the parts that its numbers depend on."""
    return {
        "plant": model.plant.name,
        "parameters": model.parameters,
        "effects": {key: use.parameters for key, use in model.effects.items()},
        "sign_order": model.sign_order,
        "sign_scale": model.sign_scale,
        "linearization": model.linearization,
        "update_period": {"value": model.update_period, "unit": "s"},
    }


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))
