"""A time that is in another unit than s."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from signlin_ros.checks.base import Check, timed
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look
from signlin_ros.checks.observer import prediction
from signlin_ros.checks.unit_or_sign import MAX_ERROR_RATIO, MAX_GOOD_RESIDUAL
from signlin_ros.records import ModelData

TIME_UNITS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Other units of a time, in s."""
LOST_STEP, SAMPLED_STEP = 3.0, 0.3
"""A step of so many time constants of the slowest motion is one after which nothing is left of it; one of fewer than
these samples it."""
QUESTION = "unit_of_time"
"""The kind of note by which a reader asks for the unit."""


class TimeUnit(Check):
    """The samples are so far apart that the model comes to rest between them, and would not be if they were ms apart.

    Test: a step is more than `LOST_STEP` of the model's slowest time constants, and less than `SAMPLED_STEP` of them
    in another unit, the largest of which the linear base leaves at most 0.4 of what it leaves otherwise, and 0.35 of
    what the channels do, and at most 0.4 of what it leaves without its inputs: after a short step little is left of any
    channel. A slow log, sampled once in a time constant, does not come to the second part. What the reader asks is
    asked here too, whatever the model says. Cure: the conversion (``t_in_ms``).
    """

    name = "time_unit"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the unit that fits, or the question."""
        asked = next((str(n) for n in look.record.notes if getattr(n, "kind", "") == QUESTION), "")
        unit = _best(look)
        if unit:
            sentence = f"the record fits the model if its time is in {unit}, and not in s"
            cure = _converted(TIME_UNITS[unit])
            yield Finding(self.name, "t", "refuse", sentence, f"t_in_{unit}", "it is taken so", action=cure)
        elif asked:
            yield Finding(self.name, "t", "refuse", asked)


def _best(look: Look) -> str:
    """Return the unit in which the base follows the record; empty where that is s, or none."""
    steps = look.step * look.base.slowest if look.base is not None else 0.0
    if look.base is None or steps <= LOST_STEP:
        return ""
    before = look.predicted.left() if look.predicted else 1.0
    unit = next((unit for unit, factor in TIME_UNITS.items() if factor * steps < SAMPLED_STEP), "")
    p = prediction(look.base, _converted(TIME_UNITS[unit])(look.record), look.channels) if unit else None
    if p is None or not p.left() < min(MAX_ERROR_RATIO * before, MAX_GOOD_RESIDUAL):
        return ""
    undriven = dict.fromkeys(look.model.inputs, 0.0)
    return unit if p.left() < MAX_ERROR_RATIO * p.left(undriven) else ""


def _converted(factor: float) -> Callable[[ModelData], ModelData]:
    return lambda record: timed(record, lambda stamps: stamps * factor)
