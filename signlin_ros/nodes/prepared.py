"""What a linearizer makes of a model before it takes it, so that taking it is a matter of a moment; without ROS."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signlin_ros.errors import InputError
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.observe import KalmanObserver

SHORTEST_PERIOD = 1e-4
"""Seconds; a node cannot publish faster."""
AT_START = "start"
"""The operating point that needs no input: the state itself."""


@dataclass(frozen=True)
class Prepared:
    """A model with what it needs to be taken at once: its linearizer, and its observer where one is at work.

    ``at_start``: the linearizer for while no input is known, which a midpoint would need.
    """

    model: Model
    linearizer: Linearizer
    observer: KalmanObserver | None
    at_start: Linearizer

    @classmethod
    def of(cls, model: Model, observer: KalmanObserver | None = None) -> Prepared:
        """Make what a model needs; may raise `InputError`."""
        linearizer = checked_linearizer(model)
        known = model.operating_point == AT_START
        return cls(
            model,
            linearizer,
            observer,
            linearizer if known else Linearizer(model.with_options(operating_point=AT_START)),
        )


def checked_linearizer(model: Model) -> Linearizer:
    """Return a linearizer that has done one point, so that all is compiled; may raise `InputError`."""
    if model.update_period < SHORTEST_PERIOD:
        raise InputError(f"update_period: found {model.update_period:g} s; a node needs {SHORTEST_PERIOD:g} s")
    linearizer = Linearizer(model)
    linearizer(model.x0, np.zeros(len(model.inputs)))
    return linearizer


__all__ = ["AT_START", "SHORTEST_PERIOD", "Prepared", "checked_linearizer"]
