"""A sensor whose zero is not where zero is."""

from __future__ import annotations

from dataclasses import replace

from signlin_ros.effects.base import CHANNEL_UNIT, SensorEffect
from signlin_ros.par import Par
from signlin_ros.sensors import Sensor


class SensorOffset(SensorEffect):
    """A sensor whose zero is not where zero is.

    y = x + offset.   [JCGM 200:2012 (VIM), 4.28 zero error]
    """

    name = "sensor_offset"
    equation = "y = x + offset"
    finding = "the {channel} reads {value:.3g} {unit} too much everywhere"
    experiment = "record a stretch at rest whose true value is known"
    command = "long holds"

    offset = Par(CHANNEL_UNIT, nominal=0.0, low=-1e9, default=0.0, doc="what the sensor shows at 0")

    def sensor(self, before: Sensor, value: float) -> Sensor:
        return replace(before, offset=before.offset + value)
