"""A sensor that shows too much or too little in proportion."""

from __future__ import annotations

from dataclasses import replace

from signlin_ros.effects.base import SensorEffect
from signlin_ros.par import Par
from signlin_ros.sensors import Sensor


class SensorGain(SensorEffect):
    """A sensor that shows too much or too little in proportion.

    y = gain x.   [JCGM 200:2012 (VIM), 4.12 sensitivity]
    """

    name = "sensor_gain"
    equation = "y = gain x"
    finding = "the {channel} reads {value:.4g} times what the other channels say"
    experiment = "record motion between two known values"
    command = "creep to and fro"

    gain = Par("-", nominal=1.0, high=10.0, default=1.0, positive=True, doc="what the sensor shows for each unit")

    def sensor(self, before: Sensor, value: float) -> Sensor:
        return replace(before, gain=before.gain * value)
