"""Base parameters that forces hold, set free again where what is found beside them leaves more than noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.blocks import BlockChange
from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.selection import Selection, select_model

Array = NDArray[np.float64]


def with_base_unheld(evidence: Evidence, selection: Selection) -> tuple[Evidence, Selection] | None:
    """Return both estimates without the base parameters that `Evidence.grounded` holds, and what is selected then; None
    where none is held, where what is selected beside them leaves only noise, or where the other leaves not surely less
    of the force, or more of it than a model may that explains it. Forces tell a stiffness wrongly where a spring that
    yields is missing.
    """
    if evidence.unheld is None or evidence.explains_to_noise(selection.chosen):
        return None
    free = Evidence(evidence.dataset, evidence.unheld, evidence.equation_error)
    other = select_model(free)
    before, after = _force_mse(evidence, selection.chosen), _force_mse(free, other.chosen)
    if not other.chosen.effects or before is None or after is None:
        return None
    c = evidence.criteria
    return (free, other) if BlockChange(before, after).falls_to(c.max_force_mse_left, c.min_t) else None


def _force_mse(evidence: Evidence, f: FittedModel) -> Array | None:
    """Return the mean squared force (blocks,) that a model leaves of validation data; None where it cannot be told. Of
    an imposed motion the force is what is predicted.
    """
    squares = f.validation_squares
    imposed = evidence.dataset.plant.motion_is_imposed() and squares.shape[1] == 1
    return squares[:, 0] if imposed else evidence.force_mse(f)


__all__ = ["with_base_unheld"]
