"""An input that arrives late."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par
from signlin_ros.scale import Scale

MAX_DELAY_SAMPLES = 12
"""Delays that are tried one by one where none leads to another."""
MIN_DELAY_STEPS = 0.01
"""Least delay in samples that is one: what is less is jitter of the clock, or the lag of a winding that has settled."""


class InputDelay(Effect):
    """An input that arrives late.

    u(t) -> u(t - T).   [Astrom and Wittenmark, Computer-Controlled Systems, 1997, sec. 2.3]
    """

    name = "input_delay"
    equation = "u(t) -> u(t - T)"
    finding = "the response comes {T:.3g} s after the input"
    experiment = "apply steps of the input and sample faster"
    command = "steps with rests"

    T = Par("s", nominal=0.005, high=10.0, doc="delay")

    @classmethod
    def starts(cls, scale: Scale) -> list[dict[str, float]]:
        """Return a short and a longer delay; where motion is imposed, a delay acts in whole
        samples and none leads to the next: then one for each of the first samples.
        """
        late = (k + 0.75 for k in range(MAX_DELAY_SAMPLES)) if scale.imposed else (1.5, 4.5)
        return [{"T": samples * scale.step} for samples in late]

    @classmethod
    def is_resolved(cls, p: Mapping[str, float], step: float) -> bool:
        return p["T"] >= MIN_DELAY_STEPS * step

    def delay(self, p: Any) -> Any:
        return p.T
