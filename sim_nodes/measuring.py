"""What the sensors of a simulated drive show, delays included."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from signlin_ros.model import Model
from signlin_ros.sensors import Sensor

Array = NDArray[np.float64]


class Measuring:
    """The sensors of a model's states along a run that is sampled every ``step`` s.

    Between samples the states are taken as straight lines; before the first one they are as there.
    """

    def __init__(self, model: Model, step: float, x0: Array) -> None:
        self.model = model
        steps = np.array([model.sensors[name].delay / step for name in model.states])
        self._whole = np.floor(steps).astype(int)
        self._part = steps - self._whole
        depth = int(self._whole.max()) + 2
        self._as_it_is = all(sensor == Sensor() for sensor in model.sensors.values())
        self._newest_first = deque([x0] * depth, maxlen=depth)

    def take(self, x: Array) -> None:
        """Go on by one step, to the state x (n,)."""
        self._newest_first.appendleft(x)

    def shown(self) -> Array:
        """Return the sensors' readings now (n,)."""
        if self._as_it_is:
            return np.array(self._newest_first[0])
        kept, columns = np.array(self._newest_first), np.arange(self._whole.size)
        later, earlier = kept[self._whole, columns], kept[self._whole + 1, columns]
        return self.model.shown_states(later + self._part * (earlier - later))
