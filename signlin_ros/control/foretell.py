"""The loop as simulation foretells it: the same law and the same reference, on the model in place of the machine."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control.designs import Task
from signlin_ros.control.drive import Drive, resting
from signlin_ros.control.law import ControlLaw, RunningLaw
from signlin_ros.control.supervision import Foretold
from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.simulation import Stepper

Array = NDArray[np.float64]
MAX_TIME_SHARE = 0.25
"""Share of a period that simulating it may take of the processor; where it takes longer, nothing is foretold."""
RTOL = 1e-4
"""Relative tolerance of the simulation: it foretells sizes."""


class ForetoldLoop:
    """A model in a loop with a law, from what was measured when the loop began."""

    def __init__(self, model: Model, task: Task, law: ControlLaw) -> None:
        self._task, self._law = task, RunningLaw(law)
        self._drive = Drive.of(model, with_position=task.position)
        self.reset(np.zeros(2))
        self.step(np.zeros(3), 0.0)  # what is compiled is compiled before time counts
        self.reset(np.zeros(2))
        begun = time.thread_time()
        self.step(np.zeros(3), 0.0)
        self.possible = time.thread_time() - begun < MAX_TIME_SHARE * task.period
        self.reset(np.zeros(2))

    def reset(self, measured: Array) -> None:
        """Begin anew with a measured position and speed (2,)."""
        drive = self._drive
        x = resting(drive, float(measured[0]))
        x[drive.velocity] = measured[1]
        self._plant = Stepper(drive.model, x, rtol=RTOL)
        self._law.reset()
        self._lost = False

    def step(self, reference: Array, feed: float) -> Foretold | None:
        """Return what this period is like for a reference (3,) and what is fed forward; None where simulation fails."""
        if self._lost:
            return None
        x, drive = self._plant.x, self._drive
        measured = np.array([x[drive.position] if drive.position >= 0 else 0.0, x[drive.velocity]])
        u = self._law(np.ascontiguousarray(reference[:2]), measured, feed)
        column = 0 if self._task.position else 1
        found = Foretold(float(measured[1]), float(reference[column] - measured[column]), u)
        try:
            self._plant.advance(self._task.period, [u])
        except InputError:
            self._lost = True
        return found


__all__ = ["ForetoldLoop"]
