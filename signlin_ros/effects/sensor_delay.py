"""A sensor that shows what was a while ago."""

from __future__ import annotations

from dataclasses import replace

from signlin_ros.effects.base import SensorEffect
from signlin_ros.par import Par
from signlin_ros.sensors import Sensor


class SensorDelay(SensorEffect):
    """A sensor that shows what was a while ago.

    y(t) = x(t - T).   [Astrom and Wittenmark, Computer-Controlled Systems, 1997, sec. 2.3]
    """

    name = "sensor_delay"
    equation = "y(t) = x(t - T)"
    finding = "the {channel} is seen {value:.3g} s late"
    experiment = "apply steps of the input and sample faster"
    command = "steps with rests"

    T = Par("s", nominal=0.005, high=1.0, default=0.0, doc="delay")

    def sensor(self, before: Sensor, value: float) -> Sensor:
        return replace(before, delay=before.delay + value)
